"""What a small change of an input does to an output of an FMU: a linear model, identified from runs of the FMU itself.

The FMU runs over a record with an input moved a little to either side, at random; half the difference of its outputs is
their response, without what is even in the change. Where a linear model of low order does not follow it, as where the
FMU is far from linear, there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm
from scipy.signal import cont2discrete, dlsim

from fmus.kit.errors import UserError
from orchestration.identify.any_fmu import FmuWithDifferences
from orchestration.identify.black_box import PolynomialModel, input_output_data, output_error
from orchestration.records.clock import evenly_sampled

Array = NDArray[np.float64]
_CHANGE = 0.02  # of how much an input moves
_DWELL = 20  # samples that the change stays at most
_HIGHEST, _GOOD, _ENOUGH = (
    4,
    99.0,
    90.0,
)  # order; fits in percent, at which no higher order is tried, and to be used
_MOVES = 1e-9  # of an output's spread, below which a change does nothing to it
_SEED = 20


@dataclass(frozen=True)
class Response:
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


def responses(
    fmu: FmuWithDifferences,
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, float],
    outputs: Sequence[str],
    of: Sequence[str],
) -> dict[tuple[str, str], Response]:
    """Identify the responses of outputs to inputs.

    Parameters
    ----------
    fmu : FmuWithDifferences
        Open.
    time : ndarray, shape (n,)
        Equally spaced; otherwise there are no responses.
    inputs : Mapping of str to ndarray, shape (n,)
        About which the FMU is moved.
    parameters : Mapping of str to float
    outputs, of : sequence of str
        Outputs, and inputs that are moved.

    Returns
    -------
    dict of tuple of str to Response
        By output and input; without those that are not there, or not linear enough.
    """
    if not evenly_sampled(time):
        return {}
    step = float(time[-1] - time[0]) / (len(time) - 1)
    found = {}
    for name in of:
        change = _random(len(time))
        size = float(np.std(inputs[name])) or 1.0
        moved = [
            {**inputs, name: inputs[name] + sign * _CHANGE * size * change} for sign in (1.0, -1.0)
        ]
        try:
            above, below = (fmu.run(time, fed, parameters).signals for fed in moved)
        except UserError:  # it cannot be moved there
            continue
        for output in outputs:
            answer = (above[output] - below[output]) / (2.0 * _CHANGE * size)
            if np.ptp(answer) > _MOVES * (float(np.std(above[output])) or 1.0) / size:
                best = max(
                    _models(change, answer, step, size), key=lambda one: one.fit, default=None
                )
                if best is not None and best.fit >= _ENOUGH:
                    found[output, name] = best
    return found


def _random(count: int) -> Array:
    """Minus one and one, each for up to some samples."""
    rng = np.random.default_rng(_SEED)
    levels = np.repeat(rng.choice([-1.0, 1.0], count), rng.integers(1, _DWELL + 1, count))
    return np.asarray(levels[:count], dtype=np.float64)


def _models(change: Array, answer: Array, step: float, size: float) -> Iterator[Response]:
    """Models of one order after the other, until one is good."""
    half = len(change) // 2
    data = input_output_data(change[:half], answer[:half], step)
    for order in range(1, _HIGHEST + 1):
        try:
            model = output_error(data, order + 1, order, 0).model
        except (UserError, np.linalg.LinAlgError):
            return
        assert isinstance(model, PolynomialModel)
        a, b, c, d = _companion(model.b[0], model.f[0])
        continuous = _continuous(a, b, c, d, step)
        if continuous is None:
            continue
        simulated = dlsim((a, b, c, d, step), change)[1][:, 0]
        error = (answer - simulated)[half:]
        fit = 100.0 * (
            1.0
            - float(np.linalg.norm(error) / np.linalg.norm(answer[half:] - answer[half:].mean()))
        )
        yield _scaled(*continuous, fit, step, change * size)
        if fit >= _GOOD:
            return


def _companion(numerator: Array, denominator: Array) -> tuple[Array, Array, Array, Array]:
    """State-space form of a ratio of polynomials of q^-1, the second monic; of what is nothing but for rounding too."""
    n = len(denominator) - 1
    a = np.vstack([-denominator[1:], np.eye(n - 1, n)])
    c = numerator[1:] - numerator[0] * denominator[1:]
    return a, np.eye(n, 1), c[np.newaxis], numerator[:1, np.newaxis]


def _continuous(
    a: Array, b: Array, c: Array, d: Array, step: float
) -> tuple[Array, Array, Array, float] | None:
    """The system of which this is one with a held input; None if there is none."""
    n = len(a)
    whole = np.block([[a, b], [np.zeros((1, n)), np.ones((1, 1))]])
    if np.linalg.matrix_rank(a) < n:  # delays
        return None
    root = logm(whole)
    if np.abs(np.imag(root)).max() > 1e-9 * np.abs(root).max() or not np.allclose(
        expm(np.real(root)), whole
    ):
        return None  # a pole on the negative real axis
    rates = np.real(root) / step
    return rates[:n, :n], rates[:n, n], c[0], float(d[0, 0])


def _scaled(
    a: Array, b: Array, c: Array, d: float, fit: float, step: float, moved: Array
) -> Response:
    """The same in coordinates of about unit size."""
    n = len(a)
    held = cont2discrete((a, b[:, np.newaxis], np.eye(n), np.zeros((n, 1))), step)
    states = dlsim((held[0], held[1], held[2], held[3], step), moved)[1]
    size = np.where(np.abs(states).max(axis=0) > 0.0, np.abs(states).max(axis=0), 1.0)
    return Response(a * size / size[:, np.newaxis], b / size, c * size, d, fit)
