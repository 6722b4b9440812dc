"""Bad readings of an output: samples that neither inputs nor the samples around them explain.

With the innovations e of a long ARX model ``A y = B u + e``, the samples of a block that deviate by
w have ``e = X w``, where the columns of X are A, each a sample later. The sum of squares that a
block explains, over the variance of the innovations, is a chi square of as many degrees of freedom
as the block has samples (Chang, Tiao and Chen: Technometrics 30, 1988). A bad reading is missing
data: it is replaced by what the model expects there of all other samples, and the model is
estimated again until no block is left (Ljung, sections 14.2 and 14.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import toeplitz
from scipy.ndimage import maximum_filter1d, median_filter
from scipy.special import chdtri, ndtri

from fmus.kit.arrays import Array, Indices, Mask, single_threaded
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.polynomials import filtered, solve_least_squares, stabilised
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.variable_projection import ReducedPredictionError
from orchestration.records.quality import resolution_of

_SHORTEST = 60  # samples of a record
_ORDER = 8  # of A
_MEMORY = 100  # coefficients of every B, at most: it has to hold the delay
_SAMPLES = 10  # for each coefficient of B, at least
_LONGEST = 5  # samples of a block; what lasts longer is a disturbance of the process
_ALARM = 1e-6  # probability, for a whole record, of a block in Gaussian noise
_LEAST = 1e-3  # of the range of the output: no smaller noise is believed
_ONE_SHOCK = 0.95  # of what one innovation explains, which a disturbance of the process has
_RETURNS = 0.7  # of its deviation, by which a block leaves the samples at its sides
_AGREE = 0.5  # of it, by which the disturbance differs between its sides, at most
_TOGETHER = 0.1  # of the largest gain, above which blocks are replaced in the same round
_HUBER = 2.0  # standard deviations, to which an innovation counts in full
_DEVIATES = 3.0  # standard deviations, below which a sample of a block is none
_ROUNDS = 30
_MODELS = 30  # that are estimated, at most
# samples whose median is what the model lacks there: what it drifts by, and the inputs before the
# first sample
_NEIGHBOURS = 31
_LEVEL = 61  # samples whose median size is the level of the noise there
_QUARTILE = float(ndtri(0.75))
_ONE = np.ones(1)


class _Innovations(NamedTuple):
    """Innovations of a long ARX model.

    Attributes
    ----------
    a : ndarray
        Its polynomial A.
    values : ndarray, shape (n,)
    freedom : float
        Samples over those samples less parameters of the model.
    unknown : ndarray, shape (n,)
        What inputs before the first sample may add, a standard deviation.
    """

    a: Array
    values: Array
    freedom: float
    unknown: Array


@single_threaded
def find_outliers(data: InputOutputData) -> tuple[Indices, Array]:
    """Find bad readings of the output, up to five in a row.

    Parameters
    ----------
    data : InputOutputData

    Returns
    -------
    indices : ndarray of int
        Samples with bad readings.
    expected : ndarray, shape (n,)
        The output, with what is expected in their place.
    """
    output = data.output
    bad: Mask = np.zeros(len(output), dtype=bool)
    if len(data) < _SHORTEST or not np.ptp(output) > 0.0:
        return np.flatnonzero(bad), output
    fitted = _within_range(output)
    for _ in range(_MODELS):
        before = fitted
        bad, expected, fitted = _deviating(_innovations(data, before), output)
        if not bad.any() or np.abs(fitted - before).max() <= _LEAST * _spread(output):
            break
    return np.flatnonzero(bad), expected


def _within_range(output: Array) -> Array:
    """Return the output (n,), clipped where it is far beyond the others, for a first model."""
    low, high = np.percentile(output, (5, 95))
    beyond = 0.5 * _spread(output)
    return np.clip(output, low - beyond, high + beyond)


def _spread(output: Array) -> float:
    """Return the range of an output without its ends."""
    low, high = np.percentile(output, (5, 95))
    return float(high - low)


def _innovations(data: InputOutputData, fitted: Array) -> _Innovations:
    """Return the innovations of the output with a model of another output (n,).

    The inputs rest before the first sample, as far as is known.
    """
    n, m = data.inputs.shape
    inputs = data.inputs - data.inputs.mean(axis=0)
    memory = max(1, min(_MEMORY, n // (_SAMPLES * m)))
    orders = Orders(_ORDER, (memory,) * m, 0, 0, (0,) * m, (0,) * m)
    level = fitted.mean()
    problem = PredictionError(inputs, fitted - level, orders)
    parts = problem.coefficients(ReducedPredictionError(problem).theta(np.empty(0)))
    values = _filtered_from_rest(parts.a, data.output - level) - parts.offset
    unknown = np.zeros(n)
    for b, u in zip(parts.b, inputs.T, strict=True):
        values -= _filtered_from_rest(b, u)
        unknown[: len(b) - 1] += u.var() * np.cumsum(b[:0:-1] ** 2)[::-1]
    values -= median_filter(values, _NEIGHBOURS, mode="mirror")
    freedom = problem.samples / max(problem.samples - problem.size, 1)
    return _Innovations(parts.a, values, freedom, np.sqrt(unknown))


def _deviating(innovations: _Innovations, output: Array) -> tuple[Mask, Array, Array]:
    """Return a mask (n,) of samples that deviate, and the output with what is expected there.

    The third is the output of which the next model is estimated, Huber's pseudo-values: whatever
    else is far from the model counts no more than what is at the edge of its noise. Innovations
    right after what was replaced show how good the model is.
    """
    bad: Mask = np.zeros(len(output), dtype=bool)
    expected = output
    left = innovations
    deviation = _deviation(left, output)
    for _ in range(_ROUNDS):
        blocks = _blocks(left, expected, deviation)
        if not blocks:
            break
        for block in blocks:
            bad[block] = True
        expected, left = _replaced(innovations, output, bad)
        deviation = _deviation(left, output)
    bad &= np.abs(output - expected) > _DEVIATES * deviation
    expected, left = _replaced(innovations, output, bad)
    after_bad = filtered(np.ones(_ORDER + 1), _ONE, bad.astype(float)) > 0.5
    most = np.where(after_bad, np.inf, _HUBER * deviation)
    return bad, expected, expected - left.values + np.clip(left.values, -most, most)


def _deviation(innovations: _Innovations, output: Array) -> Array:
    """Return the standard deviation (n,) of innovations, which is local where it is large."""
    size = np.sqrt(innovations.freedom) * np.abs(innovations.values) / _QUARTILE
    usual = max(float(np.median(size)), _LEAST * _spread(output), resolution_of(output))
    local = np.maximum(usual, median_filter(size, _LEVEL, mode="mirror"))
    return np.hypot(local, innovations.unknown)


def _filtered_from_rest(polynomial: Array, values: Array) -> Array:
    """Filter values (n,) that are constant before the first."""
    return filtered(polynomial, _ONE, values - values[0]) + polynomial.sum() * values[0]


def _blocks(innovations: _Innovations, output: Array, deviation: Array) -> list[slice]:
    """Return the blocks of samples that deviate the most, none near another."""
    n = len(output)
    gains = np.array([_gains(innovations, output, deviation, 1 + k) for k in range(_LONGEST)])
    gain = gains.max(axis=0)
    apart = maximum_filter1d(gain, 2 * (_ORDER + _LONGEST) + 1)
    chosen = (gain == apart) & (gain > max(0.0, _TOGETHER * gain.max()))
    return [slice(k, min(k + 1 + gains[:, k].argmax(), n)) for k in np.flatnonzero(chosen)]


def _gains(innovations: _Innovations, output: Array, deviation: Array, length: int) -> Array:
    """Return how far beyond its limit the chi square of a block is that begins at a sample, (n,).

    Minus infinity where it is not, and where the output does not return after it. One innovation,
    from which the process recovers by its own dynamics, is no bad reading either.
    """
    n = len(output)
    a, e = innovations.a, innovations.values
    later = np.concatenate([e, np.zeros(_ORDER + length)])
    score = sliding_window_view(later, len(a)) @ a  # X'e, of a block of one sample
    scores = sliding_window_view(score, length)[:n]
    memory = np.correlate(np.pad(a, (0, length)), a)[:length]
    deviations = scores @ np.linalg.inv(toeplitz(memory))
    explained = np.sum(deviations * scores, axis=1) / deviation**2
    shock = sliding_window_view(later**2, length)[:n].max(axis=1) / deviation**2

    gain = explained - chdtri(length, _ALARM / n)
    gain[explained - length < _ONE_SHOCK * shock] = -np.inf
    gain[~_returns(output, filtered(_ONE, stabilised(a), e), deviations)] = -np.inf
    return gain


def _returns(output: Array, disturbance: Array, deviations: Array) -> Mask:
    """Return where a block leaves the samples at its sides as far as it deviates, and comes back.

    The output alone may have gone on to another level by its inputs.

    Parameters
    ----------
    output, disturbance : ndarray, shape (n,)
        The latter is the part of the output that inputs do not explain.
    deviations : ndarray, shape (n, length)
        Of the block that begins at a sample, from what is expected.
    """
    n, length = deviations.shape
    places = np.arange(1, n - length)
    result: Mask = np.zeros(n, dtype=bool)
    largest = np.abs(deviations[places]).argmax(axis=1)
    before, after = output[places - 1], output[places + length]
    line = before + (after - before) * (largest + 1) / (length + 1)
    deviation = deviations[places, largest]
    left = (output[places + largest] - line) * np.sign(deviation)
    between = np.abs(disturbance[places + length] - disturbance[places - 1])
    size = np.abs(deviation)
    result[places] = (left >= _RETURNS * size) & (between <= _AGREE * size)
    return result


def _replaced(innovations: _Innovations, output: Array, bad: Mask) -> tuple[Array, _Innovations]:
    """Return the output with bad samples as all others let expect them, and its innovations."""
    samples = np.flatnonzero(bad)
    columns = np.zeros((len(output) + _ORDER, len(samples)))
    for k, sample in enumerate(samples):
        columns[sample : sample + _ORDER + 1, k] = innovations.a
    columns = columns[: len(output)]
    deviations = solve_least_squares(columns, innovations.values)
    result = output.copy()
    result[samples] -= deviations
    return result, innovations._replace(values=innovations.values - columns @ deviations)
