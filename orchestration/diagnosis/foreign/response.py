"""Identification of the linear response of the outputs of an FMU to small changes of its inputs.

The FMU runs over a record with an input moved a little to either side, at random; half the
difference of its outputs is their response, without what is even in the change. Where a linear
model of low order does not follow it, as where the FMU is far from linear, there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm, logm

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.fitting import FmuWithDifferences, SimulationInput
from orchestration.records.sampling import evenly_sampled

_CHANGE = 0.02  # of how much an input moves
_DWELL = 20  # samples that the change stays at most
_HIGHEST = 4  # order
_GOOD = 99.0  # fit in percent, at which no higher order is tried
_ENOUGH = 90.0  # fit in percent, to be used
_MOVES = 1e-9  # of an output's spread, below which a change does nothing to it
_SEED = 20


@dataclass(frozen=True)
class FmuResponse:
    """A linear model of one output by one input: ``dz/dt = A z + B du``, ``dy = C z + D du``.

    Attributes
    ----------
    a, b, c : ndarray, shapes (n, n), (n,), (n,)
        In coordinates of about unit size under changes of the size of the input.
    d : float
    fit : float
        Of the free run over runs of the FMU that it was not identified from, in percent.
    """

    a: Array
    b: Array
    c: Array
    d: float
    fit: float


def identify_responses(
    fmu: FmuWithDifferences, given: SimulationInput, outputs: Sequence[str], moved: Sequence[str]
) -> dict[tuple[str, str], FmuResponse]:
    """Identify the responses of outputs to inputs.

    Parameters
    ----------
    fmu : FmuWithDifferences
        Open.
    given : SimulationInput
        About which the FMU is moved, at instants that are equally spaced; otherwise there are no
        responses.
    outputs, moved : sequence of str
        Outputs, and inputs that are moved.

    Returns
    -------
    dict of tuple of str to FmuResponse
        By output and input; without those that are not there, or not linear enough.
    """
    time = given.time
    if not evenly_sampled(time):
        return {}
    step = float(time[-1] - time[0]) / (len(time) - 1)
    responses = {}
    for name in moved:
        change = _random_signs(len(time))
        course = given.inputs[name]
        size = float(np.std(course)) or 1.0
        shift = _CHANGE * size * change
        try:
            above = fmu.run(given.with_input(name, course + shift)).signals
            below = fmu.run(given.with_input(name, course - shift)).signals
        except UserError:  # it cannot be moved there
            continue
        for output in outputs:
            answer = (above[output] - below[output]) / (2.0 * _CHANGE * size)
            least = _MOVES * (float(np.std(above[output])) or 1.0) / size
            if not np.ptp(answer) > least:
                continue
            models = _models(change, answer, step, size)
            best = max(models, key=lambda model: model.fit, default=None)
            if best is not None and best.fit >= _ENOUGH:
                responses[output, name] = best
    return responses


def _random_signs(count: int) -> Array:
    """Return minus one and one, each for up to some samples."""
    rng = np.random.default_rng(_SEED)
    levels = np.repeat(rng.choice([-1.0, 1.0], count), rng.integers(1, _DWELL + 1, count))
    return np.asarray(levels[:count], dtype=np.float64)


def _models(change: Array, answer: Array, step: float, size: float) -> Iterator[FmuResponse]:
    """Yield models of one order after the other, until one is good.

    Parameters
    ----------
    change, answer : ndarray, shape (n,)
        Of the input, of size one, and of the output.
    step : float
        Seconds between samples.
    size : float
        By which the input is divided.
    """
    # half a second to load, which few diagnoses need
    from scipy.signal import dlsim

    from orchestration.identify.black_box import input_output_data, output_error
    from orchestration.identify.black_box.models import PolynomialModel

    half = len(change) // 2
    data = input_output_data(change[:half], answer[:half], step)
    for order in range(1, _HIGHEST + 1):
        try:
            model = output_error(data, order + 1, order, 0).model
        except (UserError, np.linalg.LinAlgError):
            return
        assert isinstance(model, PolynomialModel)
        discrete = _companion(model.b[0], model.f[0])
        continuous = _continuous(discrete, step)
        if continuous is None:
            continue
        simulated = dlsim((*discrete, step), change)[1][:, 0]
        response = _scaled(continuous, _fit_percent(answer, simulated, half), step, change * size)
        yield response
        if response.fit >= _GOOD:
            return


def _fit_percent(answer: Array, simulated: Array, first: int) -> float:
    """Return the fit of a simulation from a sample on, in percent."""
    error = (answer - simulated)[first:]
    spread = np.linalg.norm(answer[first:] - answer[first:].mean())
    return 100.0 * (1.0 - float(np.linalg.norm(error) / spread))


class _StateSpace(NamedTuple):
    """A linear system with one input and one output."""

    a: Array  # (n, n)
    b: Array  # (n, 1)
    c: Array  # (1, n)
    d: Array  # (1, 1)


def _companion(numerator: Array, denominator: Array) -> _StateSpace:
    """Return the state-space form of a ratio of polynomials of q^-1, the second monic.

    Of coefficients that are zero but for rounding, too.
    """
    n = len(denominator) - 1
    a = np.vstack([-denominator[1:], np.eye(n - 1, n)])
    c = numerator[1:] - numerator[0] * denominator[1:]
    return _StateSpace(a, np.eye(n, 1), c[np.newaxis], numerator[:1, np.newaxis])


def _continuous(discrete: _StateSpace, step: float) -> _StateSpace | None:
    """Return the continuous system that is this one with a held input; None if there is none."""
    a = discrete.a
    n = len(a)
    whole = np.block([[a, discrete.b], [np.zeros((1, n)), np.ones((1, 1))]])
    if np.linalg.matrix_rank(a) < n:  # delays
        return None
    root = logm(whole)
    if np.abs(np.imag(root)).max() > 1e-9 * np.abs(root).max() or not np.allclose(
        expm(np.real(root)), whole
    ):
        return None  # a pole on the negative real axis
    rates = np.real(root) / step
    return _StateSpace(rates[:n, :n], rates[:n, n:], discrete.c, discrete.d)


def _scaled(model: _StateSpace, fit: float, step: float, moved: Array) -> FmuResponse:
    """Return a model in coordinates of about unit size under an input (n,)."""
    from scipy.signal import cont2discrete, dlsim

    n = len(model.a)
    held = cont2discrete((model.a, model.b, np.eye(n), np.zeros((n, 1))), step)
    states = dlsim((held[0], held[1], held[2], held[3], step), moved)[1]
    largest = np.abs(states).max(axis=0)
    size = np.where(largest > 0.0, largest, 1.0)
    return FmuResponse(
        model.a * size / size[:, np.newaxis],
        model.b[:, 0] / size,
        model.c[0] * size,
        float(model.d[0, 0]),
        fit,
    )
