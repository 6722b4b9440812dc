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

import numpy as np
from scipy.special import ndtr, ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.residuals.innovations import Innovations, normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.identify.noise import Noise, estimate_noise, segments

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
class CrossCorrelation:
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
    """

    output: str
    signal: str
    lags: Array
    correlation: Array
    band: float
    lag: float
    strength: float
    p_value: float

    @property
    def significant(self) -> bool:
        """True if it is more than chance among so many."""
        return self.p_value < SIGNIFICANCE


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
    count = innovations.at.size
    largest = min(lags, signals[0].values.size // 20)
    if count < FEWEST or largest < 1:
        return [], []
    shifts = np.arange(-largest, largest + 1)
    own = [s for s in signals if s.kind is RegressorKind.VALUE and s.signal in inputs]
    feedback = _feedback(output, innovations, own, shifts, step, within=within)
    whitened = [prewhiten(s.values, noise, within) for s in signals]
    normal, correlation = _correlate(innovations, whitened, shifts)
    result = []
    for signal, z, r in zip(signals, normal, correlation, strict=True):
        causal = np.flatnonzero(shifts >= least_lead(signal, bool(feedback)))
        at = int(causal[np.argmax(np.abs(z[causal]))])
        result.append(
            CrossCorrelation(
                output,
                signal.name,
                lags=np.asarray(shifts * step, dtype=np.float64),
                correlation=r,
                band=float(ndtri(0.995) / np.sqrt(count)),
                lag=float(shifts[at] * step),
                strength=float(r[at]),
                p_value=_probability(z[at], causal.size * len(signals)),
            )
        )
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


def _feedback(
    output: str,
    innovations: Innovations,
    inputs: Sequence[Regressor],
    shifts: Indices,
    step: float,
    *,
    within: Mask | None,
) -> list[Feedback]:
    """Find inputs whose innovations correlate with what was measured before, and not after."""
    tried = int((shifts <= 0).sum()) * len(inputs)
    result = []
    for signal in inputs:
        surprises = prewhiten(signal.values, _own_colour(signal.values, within), within)
        (normal,), (correlation,) = _correlate(innovations, [normal_scores(surprises)], shifts)
        size = np.abs(normal)
        rough = _ROUGH * np.median(np.abs(np.diff(signal.values)))
        # with no delay all of it may be at once: then only an input counts that nothing but noise
        # can have moved
        later = shifts <= 0 if np.median(np.abs(surprises)) > rough > 0.0 else shifts < 0
        at = int(np.argmax(np.where(later, size, 0.0)))
        p_value = _probability(float(normal[at]), tried)
        if p_value < SIGNIFICANCE and size[at] > _STRONGER * size[shifts > 0].max():
            lag = float(-shifts[at] * step)
            result.append(Feedback(output, signal.signal, lag, float(correlation[at]), p_value))
    return sorted(result, key=lambda f: -abs(f.strength))


def _own_colour(values: Array, within: Mask | None) -> Noise:
    """Fit an autoregression to a signal (n,), whose innovations are in the unit of the signal."""
    whole = _all_unless(within, values)
    return replace(estimate_noise(values[whole] - values[whole].mean(), whole), deviation=1.0)


def _probability(normal: float, tried: int) -> float:
    """Return the probability of so large a normal variable, either way, among so many."""
    return min(1.0, 2.0 * float(ndtr(-abs(normal))) * tried)


def _correlate(
    innovations: Innovations, signals: Sequence[Array], shifts: Indices
) -> tuple[Array, Array]:
    """Correlate scores with white signals at some shifts.

    Returns
    -------
    normal, correlation : ndarray, shape (s, l)
        The correlations over their standard deviation where there is nothing, and as they are.
    """
    n = signals[0].size
    scores = np.zeros(n)
    scores[innovations.at] = innovations.scores
    padded = np.pad(scores, shifts[-1])
    first, last = _stretches(innovations.at)
    power = float(scores @ scores) / innovations.at.size
    starts = np.clip(first - shifts[:, np.newaxis], 0, n)
    ends = np.clip(last - shifts[:, np.newaxis], 0, n)
    pairs = np.maximum((ends - starts).sum(axis=1), 1.0)
    normal = np.zeros((len(signals), shifts.size))
    for row, white in enumerate(signals):
        # sums over the samples at which there are both, for every shift
        together = np.correlate(padded, white, "valid")
        summed = np.concatenate([[0.0], np.cumsum(white**2)])
        energy = (summed[ends] - summed[starts]).sum(axis=1)
        size = np.sqrt(power * energy)
        np.divide(together, size, out=normal[row], where=size > 0.0)
    return normal, normal / np.sqrt(pairs)


def _stretches(at: Indices) -> tuple[Indices, Indices]:
    """Return the first of every stretch of neighbouring samples, and one past the last."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    first = np.concatenate([at[:1], at[breaks + 1]])
    last = np.concatenate([at[breaks], at[-1:]]) + 1
    return first, last
