"""Cross-correlation of a residual with signals, and the feedback that it may show.

Both the residual and the signals are filtered by what makes the residual white before they are correlated: two slow
signals that have nothing to do with each other look alike, two white ones do not.

A model is wrong where its residual depends on what was before or is at the same time. That an input comes after the
residual with which it correlates says that somebody has moved it by what was measured (Box and Jenkins; Ljung, section
13.4): the loop is closed. Then an input is a consequence of the noise even at its own sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.residuals.innovations import Innovations, normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.identify.noise.autoregression import segments
from orchestration.identify.noise.model import Noise, estimate

Array = NDArray[np.float64]
LAGS = 25  # samples, either way
FEWEST = 20  # samples that say something
SIGNIFICANCE = 0.01  # false alarms of all lags of all signals together
_STRONGER = (
    1.5  # times as strong as what comes before: an input that moves slowly correlates both ways
)
_ROUGH = 0.5  # of the change from sample to sample, above which an input is not smooth and does not rest either
_ANTICIPATING = (
    RegressorKind.RATE,
    RegressorKind.SPEED,
)  # by central differences: they know the next sample


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
        Where the correlation is strongest, and the correlation there, with its sign: of the lags at which the signal
        comes first, or together with the residual.
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
        """Whether it is more than chance among so many."""
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
    inputs: Sequence[str] = (),
    lags: int = LAGS,
    within: NDArray[np.bool_] | None = None,
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
    n, kept = signals[0].values.size, innovations.at.size
    max_lag = min(lags, n // 20)
    if kept < FEWEST or max_lag < 1:
        return [], []
    shifts = np.arange(-max_lag, max_lag + 1)
    normal, correlation = _correlated(
        innovations, [filtered(s.values, noise, within) for s in signals], shifts
    )
    own = [s for s in signals if s.kind is RegressorKind.VALUE and s.signal in inputs]
    feedback = _feedback(output, innovations, own, shifts, step, within)
    delays = np.asarray(shifts * step, dtype=np.float64)
    band, result = float(norm.ppf(0.995) / np.sqrt(kept)), []
    for signal, z, r in zip(signals, normal, correlation, strict=True):
        causal = np.flatnonzero(shifts >= first_causal(signal, bool(feedback)))
        at = int(causal[np.argmax(np.abs(z[causal]))])
        p = _probability(z[at], causal.size * len(signals))
        result.append(
            CrossCorrelation(
                output, signal.name, delays, r, band, float(shifts[at] * step), float(r[at]), p
            )
        )
    return sorted(result, key=lambda c: -abs(c.strength)), feedback


def first_causal(signal: Regressor, feedback: bool) -> int:
    """Samples that a signal must come before the residual at least, to be no consequence of it."""
    return (2 if signal.kind in _ANTICIPATING else 1) if feedback else 0


def _feedback(
    output: str,
    innovations: Innovations,
    inputs: Sequence[Regressor],
    shifts: NDArray[np.intp],
    step: float,
    within: NDArray[np.bool_] | None,
) -> list[Feedback]:
    """Inputs of which what their own past does not tell correlates with what was measured before, and not after."""
    result, tried = [], int((shifts <= 0).sum()) * len(inputs)
    for signal in inputs:
        surprises = filtered(signal.values, _own_colour(signal.values, within), within)
        (normal,), (correlation,) = _correlated(innovations, [normal_scores(surprises)], shifts)
        size, rough = np.abs(normal), _ROUGH * np.median(np.abs(np.diff(signal.values)))
        # with no delay all of it may be at once: then only an input that nothing but noise can have moved tells
        later = shifts <= 0 if np.median(np.abs(surprises)) > rough > 0.0 else shifts < 0
        at = int(np.argmax(np.where(later, size, 0.0)))
        p = _probability(float(normal[at]), tried)
        if p < SIGNIFICANCE and size[at] > _STRONGER * size[shifts > 0].max():
            result.append(
                Feedback(
                    output, signal.signal, float(-shifts[at] * step), float(correlation[at]), p
                )
            )
    return sorted(result, key=lambda f: -abs(f.strength))


def _probability(normal: float, tried: int) -> float:
    """Of so large a normal variable, either way, among so many."""
    return min(1.0, 2.0 * float(norm.sf(abs(normal))) * tried)


def _correlated(
    innovations: Innovations, signals: Sequence[Array], shifts: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Correlations of scores with white signals, (s, l): over their deviation where there is nothing, and plain."""
    n = signals[0].size
    scores, seen = np.zeros(n), np.zeros(n)
    scores[innovations.at], seen[innovations.at] = innovations.scores, 1.0
    power = float(scores @ scores) / innovations.at.size
    pairs = np.maximum([_overlap(seen, np.ones(n), int(k)) for k in shifts], 1.0)
    normal = np.zeros((len(signals), shifts.size))
    for row, white in enumerate(signals):
        # sums over the samples at which there are both, for every shift
        together = np.array([_overlap(scores, white, int(k)) for k in shifts])
        energy = np.array([_overlap(seen, white**2, int(k)) for k in shifts])
        size = np.sqrt(power * energy)
        np.divide(together, size, out=normal[row], where=size > 0.0)
    return normal, normal / np.sqrt(pairs)


def filtered(values: Array, noise: Noise, within: NDArray[np.bool_] | None = None) -> Array:
    """A signal (n,) through the filter that whitens the residual, without its mean; zero until that has begun."""
    whole = np.ones(values.size, dtype=bool) if within is None else within
    white = noise.whiten(values[whole] - values[whole].mean(), whole)
    begun = np.ones(white.size, dtype=bool)
    for a, _ in segments(whole):
        begun[a : a + noise.coefficients.size] = False
    result = np.zeros(values.size)
    result[whole] = np.where(begun, white - white[begun].mean(), 0.0) if begun.any() else 0.0
    return result


def _own_colour(values: Array, within: NDArray[np.bool_] | None) -> Noise:
    """Autoregression that tells a signal (n,) from its own past, with surprises in its own unit."""
    whole = np.ones(values.size, dtype=bool) if within is None else within
    return replace(estimate(values[whole] - values[whole].mean(), whole), deviation=1.0)


def _overlap(residual: Array, signal: Array, shift: int) -> float:
    """Sum of ``residual[k] * signal[k - shift]``."""
    n = residual.size
    return float(
        residual[max(shift, 0) : n + min(shift, 0)] @ signal[max(-shift, 0) : n - max(shift, 0)]
    )
