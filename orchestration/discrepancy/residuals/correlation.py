"""Cross-correlation of a residual with signals, and the feedback that it may show.

Before they are correlated, both the residual and the signals are filtered by what makes the
residual white: two slow signals that have nothing to do with each other correlate, two white ones
do not.

A model is wrong where its residual depends on what was before or is at the same time. That an input
comes after the residual with which it correlates says that somebody has moved it by what was
measured (Box and Jenkins; Ljung, section 13.4): the loop is closed. Then an input is a consequence
of the noise even at its own sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.special import ndtr, ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.residuals.innovations import Innovations, normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.discrepancy.residuals.residual_test import ALPHA, ResidualTest
from orchestration.identify.noise import Noise, estimate_noise, segments

if TYPE_CHECKING:
    from orchestration.discrepancy.residuals.output_residual import OutputResidual

LAGS = 25  # samples, either way
FEWEST = 20  # samples that say something
SIGNIFICANCE = 0.01  # false alarms of all lags of all signals together
# times as strong as what comes before: an input that moves slowly correlates both ways
_STRONGER = 1.5
# of the change from sample to sample, above which an input is not smooth and does not rest either
_ROUGH = 0.5
# by central differences: they know the next sample
_ANTICIPATING = (RegressorKind.RATE, RegressorKind.SPEED)


@dataclass(frozen=True)
class CrossCorrelation(ResidualTest):
    """Cross-correlation of the innovations of an output with a signal.

    Attributes
    ----------
    output, signal : str
    lags : ndarray, shape (l,)
        Seconds by which the signal comes before the residual.
    correlation : ndarray, shape (l,)
    band : float
        99 % of the correlations of one lag lie within it, either way, where there is nothing.
    lag, strength : float
        Where the correlation is strongest, and the correlation there, with its sign: of the lags at
        which the signal comes first, or together with the residual.
    p_value : float
        Of so strong a correlation at any such lag of any of the signals.
    rms : float
        Of the innovations that go with the signal; infinite where their size is not known.
    """

    rank: ClassVar[int] = 4

    output: str
    signal: str
    lags: Array
    correlation: Array
    band: float
    lag: float
    strength: float
    p_value: float
    rms: float = np.inf

    @classmethod
    def of(cls, residual: OutputResidual) -> list[CrossCorrelation]:
        """Return the correlations that are more than rounding leaves."""
        cleaned = residual.cleaned
        sized = [
            replace(c, rms=abs(c.strength) * cleaned.noise.deviation) for c in residual.correlations
        ]
        return [c for c in sized if c.rms >= cleaned.rounding]

    @property
    def significant(self) -> bool:
        """True if it is more than chance among so many."""
        return self.p_value < SIGNIFICANCE

    def is_structure(self, rounding: float) -> bool:
        """Return True if it is structure; more than rounding leaves it is already."""
        return self.p_value < ALPHA

    def describe(self, output: str) -> str:
        """Return with which signal a residual correlates, how strongly and at which lag."""
        when = "at once"
        if self.lag:
            when = f"{abs(self.lag):.3g} s {'later' if self.lag > 0 else 'earlier'}"
        return (
            f"{output} correlates with {self.signal}: {self.strength:+.2f} {when}"
            f" (99 % band ±{self.band:.2f})"
        )


@dataclass(frozen=True)
class Feedback:
    """An input that follows the residual of an output.

    Attributes
    ----------
    output, input : str
    lag : float
        Seconds by which the input comes later.
    strength : float
        Their correlation there, with its sign.
    p_value : float
        Of so strong a correlation with any later input.
    """

    output: str
    input: str
    lag: float
    strength: float
    p_value: float


def cross_correlations(
    output: str,
    innovations: Innovations,
    noise: Noise,
    signals: Sequence[Regressor],
    step: float,
    *,
    inputs: Sequence[str] = (),
    lags: int = LAGS,
    within: Mask | None = None,
) -> tuple[list[CrossCorrelation], list[Feedback]]:
    """Correlate the innovations of an output with signals.

    Parameters
    ----------
    output : str
    innovations : Innovations
    noise : Noise
        Of the residual.
    signals : sequence of Regressor
    step : float
        Seconds between samples.
    inputs : sequence of str
        Names of those signals that somebody may have moved by what was measured.
    lags : int
        Samples that are looked at, either way.
    within : ndarray of bool, shape (n,), optional
        Samples of the runs that the record is made of; all of them unless given.

    Returns
    -------
    list of CrossCorrelation
        The strongest first.
    list of Feedback
        The strongest first.
    """
    if not signals:
        return [], []
    largest = min(lags, signals[0].values.size // 20)
    if innovations.at.size < FEWEST or largest < 1:
        return [], []
    correlator = _Correlator(output, innovations, step, np.arange(-largest, largest + 1), within)
    own = [s for s in signals if s.kind is RegressorKind.VALUE and s.signal in inputs]
    feedback = correlator.feedback(own)
    normal, correlation = correlator([prewhiten(s.values, noise, within) for s in signals])
    result = []
    for signal, z, r in zip(signals, normal, correlation, strict=True):
        lead = least_lead(signal, bool(feedback))
        result.append(correlator.strongest(signal.name, z, r, lead, len(signals)))
    return sorted(result, key=lambda c: -abs(c.strength)), feedback


def least_lead(signal: Regressor, feedback: bool) -> int:
    """Return how many samples before the residual a signal can be no consequence of it."""
    if not feedback:
        return 0
    return 2 if signal.kind in _ANTICIPATING else 1


def prewhiten(values: Array, noise: Noise, within: Mask | None = None) -> Array:
    """Filter a signal (n,) as whitens the residual, without its mean; zero until that has begun."""
    whole = _all_unless(within, values)
    white = noise.whiten(values[whole] - values[whole].mean(), whole)
    begun = np.ones(white.size, dtype=bool)
    for first, _ in segments(whole):
        begun[first : first + noise.coefficients.size] = False
    result = np.zeros(values.size)
    result[whole] = np.where(begun, white - white[begun].mean(), 0.0) if begun.any() else 0.0
    return result


def _all_unless(within: Mask | None, values: Array) -> Mask:
    return np.ones(values.size, dtype=bool) if within is None else within


def _own_colour(values: Array, within: Mask | None) -> Noise:
    """Fit an autoregression to a signal (n,), whose innovations are in the unit of the signal."""
    whole = _all_unless(within, values)
    return replace(estimate_noise(values[whole] - values[whole].mean(), whole), deviation=1.0)


def _probability(normal: float, tried: int) -> float:
    """Return the probability of so large a normal variable, either way, among so many."""
    return min(1.0, 2.0 * float(ndtr(-abs(normal))) * tried)


@dataclass(frozen=True)
class _Correlator:
    """Correlation of the normal scores of an output with white signals, at some shifts.

    Attributes
    ----------
    output : str
    innovations : Innovations
    step : float
        Seconds between samples.
    shifts : ndarray of int, shape (l,)
        Samples by which a signal comes before the residual, as many to either side.
    within : ndarray of bool, shape (n,), optional
        Samples of the runs that the record is made of; all of them unless given.
    """

    output: str
    innovations: Innovations
    step: float
    shifts: Indices
    within: Mask | None

    def __call__(self, signals: Sequence[Array]) -> tuple[Array, Array]:
        """Correlate with s white signals, (n,) each.

        Returns
        -------
        normal, correlation : ndarray, shape (s, l)
            The correlations over their standard deviation where there is nothing, and as they are.
        """
        at = self.innovations.at
        scores = np.zeros(signals[0].size)
        scores[at] = self.innovations.scores
        power = float(scores @ scores) / at.size
        padded = np.pad(scores, self.shifts[-1])
        starts, ends = _overlaps(at, self.shifts, scores.size)
        normal = np.zeros((len(signals), self.shifts.size))
        for row, white in enumerate(signals):
            # sums over the samples at which there are both, for every shift
            together = np.correlate(padded, white, "valid")
            summed = np.concatenate([[0.0], np.cumsum(white**2)])
            energy = (summed[ends] - summed[starts]).sum(axis=1)
            size = np.sqrt(power * energy)
            np.divide(together, size, out=normal[row], where=size > 0.0)
        pairs = np.maximum((ends - starts).sum(axis=1), 1.0)
        return normal, normal / np.sqrt(pairs)

    def strongest(
        self, signal: str, normal: Array, correlation: Array, lead: int, number: int
    ) -> CrossCorrelation:
        """Return the correlation with a signal, one of a number of them, where it is strongest.

        Parameters
        ----------
        signal : str
        normal, correlation : ndarray, shape (l,)
        lead : int
            Samples by which the signal comes first, at the least.
        number : int
        """
        causal = np.flatnonzero(self.shifts >= lead)
        at = int(causal[np.argmax(np.abs(normal[causal]))])
        return CrossCorrelation(
            self.output,
            signal,
            lags=np.asarray(self.shifts * self.step, dtype=np.float64),
            correlation=correlation,
            band=float(ndtri(0.995) / np.sqrt(self.innovations.at.size)),
            lag=float(self.shifts[at] * self.step),
            strength=float(correlation[at]),
            p_value=_probability(normal[at], causal.size * number),
        )

    def feedback(self, inputs: Sequence[Regressor]) -> list[Feedback]:
        """Find inputs whose innovations correlate with what was measured before, and not after."""
        tried = int((self.shifts <= 0).sum()) * len(inputs)
        result = []
        for signal in inputs:
            colour = _own_colour(signal.values, self.within)
            surprises = prewhiten(signal.values, colour, self.within)
            (normal,), (correlation,) = self([normal_scores(surprises)])
            size = np.abs(normal)
            rough = _ROUGH * np.median(np.abs(np.diff(signal.values)))
            # with no delay all of it may be at once: then only an input counts that nothing but
            # noise can have moved
            is_rough = np.median(np.abs(surprises)) > rough > 0.0
            later = self.shifts <= 0 if is_rough else self.shifts < 0
            at = int(np.argmax(np.where(later, size, 0.0)))
            p_value = _probability(float(normal[at]), tried)
            if p_value < SIGNIFICANCE and size[at] > _STRONGER * size[self.shifts > 0].max():
                lag = float(-self.shifts[at] * self.step)
                strength = float(correlation[at])
                result.append(Feedback(self.output, signal.signal, lag, strength, p_value))
        return sorted(result, key=lambda f: -abs(f.strength))


def _overlaps(at: Indices, shifts: Indices, n: int) -> tuple[Indices, Indices]:
    """Return where a signal meets every stretch of some samples, by shift: (l, stretches) each.

    It is from the first on, and to one before the second.
    """
    first, last = _stretches(at)
    return np.clip(first - shifts[:, None], 0, n), np.clip(last - shifts[:, None], 0, n)


def _stretches(at: Indices) -> tuple[Indices, Indices]:
    """Return the first of every stretch of neighbouring samples, and one past the last."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    first = np.concatenate([at[:1], at[breaks + 1]])
    last = np.concatenate([at[breaks], at[-1:]]) + 1
    return first, last
