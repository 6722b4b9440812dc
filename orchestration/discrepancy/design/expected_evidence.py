"""What a record yet to be made would say: how far BIC would fall in favour of the true one of two models.

The true model is simulated; the other is refitted to that, and so is the colour of its noise, which takes slow
errors for noise as it does in a real fit. Everything is an expectation over the noise, so nothing is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.covariance import covariance
from orchestration.identify.least_squares import minimise
from orchestration.identify.noise.autoregression import ORDER, yule_walker
from orchestration.identify.noise.model import Noise
from orchestration.identify.prediction_error import PRIOR_STD

Array = NDArray[np.float64]
_PASSES = 2  # of refitting and estimating the colour of the residual
_MEMORY = 4000  # samples after which noise has forgotten
_TRIALS = 12  # of a refit: it is an expectation to a factor, not an estimate
_EFFORT = 200.0  # internal steps per sample, beyond which a model has become too stiff


@dataclass(frozen=True)
class Response:
    """A fitted model over a stimulus.

    Attributes
    ----------
    signals : dict of str to ndarray, shape (n,)
        Measured outputs.
    slopes : dict of str to ndarray, shape (n, p)
        Their derivatives by the searched coordinates.
    """

    signals: dict[str, Array]
    slopes: dict[str, Array]


def at_rest(model: FittedCandidate) -> Array:
    """Searched coordinates of a fitted model, states where they start by declaration."""
    problem = model.problem
    starts = {name: problem.start[name] for name in problem.names if problem.declared[name].starts}
    return problem.position(problem.start | model.fit.values | starts)


def respond(model: FittedCandidate, time: Array, inputs: Mapping[str, Array], q: Array) -> Response:
    """Simulate a fitted model.

    Parameters
    ----------
    model : FittedCandidate
    time, inputs
        The stimulus, (n,) each, SI.
    q : ndarray, shape (p,)
        Searched coordinates.

    Returns
    -------
    Response

    Raises
    ------
    UserError
        If the simulation fails.
    """
    problem = model.problem
    run = problem.model.run(time, inputs, problem.start | problem.values(q), effort=_EFFORT)
    scale = np.array([s.slope(x) for s, x in zip(problem.scales, q, strict=True)])
    measured = model.fit.residual
    return Response(
        {o: run.signals[o] for o in measured}, {o: run.sensitivities[o] * scale for o in measured}
    )


def expected_delta_bic_linear(
    true_model: FittedCandidate, candidate: FittedCandidate, truth: Response, other: Response
) -> float:
    """Expected fall of BIC in favour of the true model, the candidate refitted as far as it is linear.

    Parameters
    ----------
    true_model, candidate : FittedCandidate
        Both fitted to a record that cannot tell them apart.
    truth, other : Response
        Of the two, over the stimulus.
    """
    residual, colours = other.signals, true_model.fit.noise
    for _ in range(_PASSES):
        rows = np.concatenate(
            [_white(colours[o], truth.signals[o] - other.signals[o]) for o in other.signals]
        )
        columns = np.vstack([_white(colours[o], slopes) for o, slopes in other.slopes.items()])
        prior = _prior(candidate)
        step = covariance(columns.T @ columns + prior.T @ prior).matrix @ (columns.T @ rows)
        residual = {
            o: truth.signals[o] - other.signals[o] - other.slopes[o] @ step for o in other.signals
        }
        colours = _colours(true_model, residual)
    return _fall(true_model, candidate, colours, len(next(iter(residual.values()))))


def expected_delta_bic(
    true_model: FittedCandidate,
    candidate: FittedCandidate,
    truth: Response,
    time: Array,
    inputs: Mapping[str, Array],
    q: Array,
) -> float:
    """Expected fall of BIC in favour of the true model, the candidate refitted as it is.

    Parameters
    ----------
    true_model, candidate, truth
        As in :func:`expected_delta_bic_linear`.
    time, inputs
        The stimulus.
    q : ndarray, shape (p,)
        Where the candidate starts.
    """
    low, high = candidate.problem.bounds()
    prior, begin = _prior(candidate), np.clip(q, low, high)
    colours: Mapping[str, Noise] = true_model.fit.noise
    kept: dict[bytes, Response] = {}

    def response(q: Array) -> Response:
        if q.tobytes() not in kept:
            kept.clear()
            kept[q.tobytes()] = respond(candidate, time, inputs, q)
        return kept[q.tobytes()]

    def rows(q: Array) -> Array:
        simulated = response(q).signals
        return np.concatenate(
            [
                *(_white(colours[o], truth.signals[o] - y) for o, y in simulated.items()),
                prior @ (q - begin),
            ]
        )

    def slopes(q: Array) -> Array:
        return np.vstack([*(_white(colours[o], -j) for o, j in response(q).slopes.items()), prior])

    falls = []
    # a colour that swallows what is wrong and white noise that does not lead to different ends: a fit takes the better
    for first in (
        true_model.fit.noise,
        {o: Noise(np.empty(0), _size(true_model, o)) for o in true_model.fit.noise},
    ):
        at, colours = begin, first
        for _ in range(_PASSES):
            at = minimise(rows, slopes, at, low, high, 1e-3, _TRIALS).q
            simulated = response(at).signals
            colours = _colours(true_model, {o: truth.signals[o] - y for o, y in simulated.items()})
        falls.append(_fall(true_model, candidate, colours, len(time)))
    return min(falls)


def _size(true_model: FittedCandidate, output: str) -> float:
    return float(np.sqrt(_covariance(true_model.fit.noise[output])[0]))


def _white(noise: Noise, values: Array) -> Array:
    return noise.whiten(values, np.ones(len(values), dtype=bool))


def _prior(model: FittedCandidate) -> Array:
    """Rows that keep physical parameters, not start values nor those of effects, from running away, as in a fit."""
    own = set(model.candidate.parameters)
    held = [
        k
        for k, n in enumerate(model.problem.names)
        if n not in own and not model.problem.declared[n].starts
    ]
    return np.eye(len(model.problem.names))[held] / PRIOR_STD


def _colours(true_model: FittedCandidate, residual: Mapping[str, Array]) -> dict[str, Noise]:
    """Noise that a fit would estimate, on average, where a systematic error remains under the true noise."""
    colours = {}
    for output, error in residual.items():
        n = len(error)
        systematic = np.array([error[: n - k] @ error[k:] for k in range(ORDER + 1)]) / n
        coefficients, variance = yule_walker(
            systematic + _covariance(true_model.fit.noise[output]), n
        )
        colours[output] = Noise(coefficients, float(np.sqrt(variance)))
    return colours


def _covariance(noise: Noise) -> Array:
    """Covariance of an autoregression at the first lags."""
    impulse = np.zeros(_MEMORY)
    impulse[0] = noise.deviation
    answer = np.asarray(lfilter([1.0], np.concatenate([[1.0], -noise.coefficients]), impulse))
    return np.array([answer[: _MEMORY - k] @ answer[k:] for k in range(ORDER + 1)])


def _fall(
    true_model: FittedCandidate, candidate: FittedCandidate, colours: Mapping[str, Noise], n: int
) -> float:
    true = true_model.fit.noise
    deviance = sum(2.0 * n * np.log(colours[o].deviation / true[o].deviation) for o in colours)
    more = len(candidate.fit.q) - len(true_model.fit.q)
    more += sum(len(colours[o].coefficients) - len(true[o].coefficients) for o in colours)
    return float(deviance + more * np.log(n * len(colours)))
