"""Expected evidence of a record yet to be made: the fall of BIC in favour of the true model.

Of two models the true one is simulated. The other is refitted to that, and so is the colour of its
noise, which takes slow errors for noise as it does in a real fit. Everything is an expectation over
the noise, so nothing is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.identify import autoregression
from orchestration.identify.fitting import PRIOR_STD, minimise
from orchestration.identify.noise import ORDER, Noise, yule_walker
from orchestration.identify.uncertainty import parameter_covariance

_PASSES = 2  # of refitting and estimating the colour of the residual
_MEMORY = 4000  # samples after which noise has forgotten
_TRIALS = 12  # of a refit: it is an expectation to a factor, not an estimate
_EFFORT = 200.0  # internal steps per sample, beyond which a model has become too stiff


@dataclass(frozen=True)
class ExpectedResponse:
    """Response of a fitted model to a stimulus.

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
    """Return the searched coordinates (p,) of a fitted model, states at their declared starts."""
    problem = model.problem
    starts = {name: problem.start[name] for name in problem.names if problem.declared[name].starts}
    return problem.position(problem.start | model.fit.values | starts)


def respond(
    model: FittedCandidate, time: Array, inputs: Mapping[str, Array], q: Array
) -> ExpectedResponse:
    """Simulate a fitted model under a stimulus.

    Parameters
    ----------
    model : FittedCandidate
    time, inputs
        The stimulus, (n,) each, SI.
    q : ndarray, shape (p,)
        Searched coordinates.

    Returns
    -------
    ExpectedResponse

    Raises
    ------
    UserError
        If the simulation fails.
    """
    problem = model.problem
    run = problem.model.run(time, inputs, problem.start | problem.values(q), effort=_EFFORT)
    scale = np.array([s.slope(x) for s, x in zip(problem.scales, q, strict=True)])
    measured = list(model.fit.residual)
    signals = {o: run.signals[o] for o in measured}
    slopes = {o: run.sensitivities[o] * scale for o in measured}
    return ExpectedResponse(signals, slopes)


def expected_delta_bic_linear(
    true_model: FittedCandidate,
    candidate: FittedCandidate,
    truth: ExpectedResponse,
    other: ExpectedResponse,
) -> float:
    """Return the expected fall of BIC in favour of the true model, to first order.

    The candidate is refitted as far as it is linear.

    Parameters
    ----------
    true_model, candidate : FittedCandidate
        Both fitted to a record that does not discriminate between them.
    truth, other : ExpectedResponse
        Of the two, over the stimulus.
    """
    errors = {o: truth.signals[o] - other.signals[o] for o in other.signals}
    samples = len(next(iter(errors.values())))
    prior = _prior(candidate)
    colours = true_model.fit.noise
    for _ in range(_PASSES):
        rows = np.concatenate([_whiten(colours[o], error) for o, error in errors.items()])
        columns = np.vstack([_whiten(colours[o], slopes) for o, slopes in other.slopes.items()])
        normal = columns.T @ columns + prior.T @ prior
        step = parameter_covariance(normal).matrix @ (columns.T @ rows)
        residual = {o: error - other.slopes[o] @ step for o, error in errors.items()}
        colours = _expected_colours(true_model, residual)
    return _delta_bic(true_model, candidate, colours, samples)


def expected_delta_bic(
    true_model: FittedCandidate,
    candidate: FittedCandidate,
    truth: ExpectedResponse,
    time: Array,
    inputs: Mapping[str, Array],
    q: Array,
) -> float:
    """Return the expected fall of BIC in favour of the true model, the candidate refitted.

    Parameters
    ----------
    true_model, candidate, truth
        As in :func:`expected_delta_bic_linear`.
    time, inputs
        The stimulus.
    q : ndarray, shape (p,)
        Searched coordinates at which the candidate starts.
    """
    low, high = candidate.problem.bounds()
    start = np.clip(q, low, high)
    problem = _Refit(candidate, truth, time, inputs, start)
    true_noise = true_model.fit.noise
    white = {o: Noise(np.empty(0), _standard_deviation(noise)) for o, noise in true_noise.items()}
    falls = []
    # a colour that swallows what is wrong and white noise that does not lead to different ends: a
    # fit takes the better
    for noise in (true_noise, white):
        at = start
        problem.colours = noise
        for _ in range(_PASSES):
            at = minimise(problem.rows, problem.slopes, at, low, high, 1e-3, trials=_TRIALS).q
            problem.colours = _expected_colours(true_model, problem.residual(at))
        falls.append(_delta_bic(true_model, candidate, problem.colours, len(time)))
    return min(falls)


class _Refit:
    """Least-squares problem of a candidate that is refitted to the response of a true model.

    Parameters
    ----------
    candidate : FittedCandidate
    truth : ExpectedResponse
    time, inputs
        The stimulus.
    start : ndarray, shape (p,)
        Searched coordinates, from which physical parameters must not run away.

    Attributes
    ----------
    colours : Mapping of str to Noise
        By which errors are whitened.
    """

    def __init__(
        self,
        candidate: FittedCandidate,
        truth: ExpectedResponse,
        time: Array,
        inputs: Mapping[str, Array],
        start: Array,
    ):
        self.colours: Mapping[str, Noise] = {}
        self._candidate = candidate
        self._truth = truth
        self._time = time
        self._inputs = inputs
        self._start = start
        self._prior = _prior(candidate)
        self._newest: tuple[bytes, ExpectedResponse] | None = None

    def residual(self, q: Array) -> dict[str, Array]:
        """Return the error (n,) of every output."""
        simulated = self._response(q).signals
        return {o: self._truth.signals[o] - y for o, y in simulated.items()}

    def rows(self, q: Array) -> Array:
        """Return whitened errors, and deviations from the start."""
        errors = [_whiten(self.colours[o], error) for o, error in self.residual(q).items()]
        return np.concatenate([*errors, self._prior @ (q - self._start)])

    def slopes(self, q: Array) -> Array:
        """Return the derivatives of the rows."""
        by_output = self._response(q).slopes
        whitened = [_whiten(self.colours[o], -slopes) for o, slopes in by_output.items()]
        return np.vstack([*whitened, self._prior])

    def _response(self, q: Array) -> ExpectedResponse:
        """Return the response at a point; the last one is remembered."""
        if self._newest is None or self._newest[0] != q.tobytes():
            response = respond(self._candidate, self._time, self._inputs, q)
            self._newest = (q.tobytes(), response)
        return self._newest[1]


def _standard_deviation(noise: Noise) -> float:
    return float(np.sqrt(_covariance(noise)[0]))


def _whiten(noise: Noise, values: Array) -> Array:
    return noise.whiten(values, np.ones(len(values), dtype=bool))


def _prior(model: FittedCandidate) -> Array:
    """Return rows (k, p) that keep physical parameters from running away, as in a fit.

    Start values, and parameters of effects, are free.
    """
    own = set(model.candidate.parameters)
    problem = model.problem
    held = [
        k
        for k, name in enumerate(problem.names)
        if name not in own and not problem.declared[name].starts
    ]
    return np.eye(len(problem.names))[held] / PRIOR_STD


def _expected_colours(
    true_model: FittedCandidate, residual: Mapping[str, Array]
) -> dict[str, Noise]:
    """Return the noise that a fit would estimate, on average, where systematic errors remain."""
    colours = {}
    for output, error in residual.items():
        n = len(error)
        systematic = np.array([error[: n - k] @ error[k:] for k in range(ORDER + 1)]) / n
        covariance = systematic + _covariance(true_model.fit.noise[output])
        coefficients, variance = yule_walker(covariance, n)
        colours[output] = Noise(coefficients, float(np.sqrt(variance)))
    return colours


def _covariance(noise: Noise) -> Array:
    """Return the covariance of an autoregression at the first lags."""
    impulse = np.zeros(_MEMORY)
    impulse[0] = noise.deviation
    answer = autoregression([1.0, *-noise.coefficients], impulse)
    return np.array([answer[: _MEMORY - k] @ answer[k:] for k in range(ORDER + 1)])


def _delta_bic(
    true_model: FittedCandidate, candidate: FittedCandidate, colours: Mapping[str, Noise], n: int
) -> float:
    """Return the BIC of a refitted candidate with some noise, less that of the true model."""
    true = true_model.fit.noise
    deviance = sum(2.0 * n * np.log(colours[o].deviation / true[o].deviation) for o in colours)
    more = len(candidate.fit.q) - len(true_model.fit.q)
    more += sum(len(colours[o].coefficients) - len(true[o].coefficients) for o in colours)
    return float(deviance + more * np.log(n * len(colours)))
