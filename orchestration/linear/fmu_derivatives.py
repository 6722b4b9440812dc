"""FMUs without equations, linearised by the derivatives that they give or by differences.

An FMU for model exchange shows its states, rates and outputs: the derivatives are its directional
derivatives where it provides them, else central differences. Where an FMU hides its states, which
all do for co-simulation, and those in which something is sampled, the differences are of
trajectories: a pulse on one input for one communication step, and its negative. The responses are
realised with python-control (eigensystem realisation: Juang, Pappa, Journal of Guidance 8, 1985).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.fmu import ExchangeFmu, Fmu, Model, Signal, Value
from orchestration.fmu.signal import numeric
from orchestration.fmu.simulation import grid
from orchestration.linear.blocks import LinearBlocks
from orchestration.linear.discretisation import Matrices, assemble
from orchestration.linear.model import LinearModel
from orchestration.linear.operating_point import OperatingPoint
from orchestration.reporting import option

_GIVEN = "directional derivatives of the FMU"
_DIFFERENCES = "central differences of the FMU's laws"
_PULSES = "central differences of responses to pulses"
_RELATIVE = np.finfo(float).eps ** (1.0 / 3.0)  # step of a central difference
_PULSE = 1e-3  # of an input, relative to its magnitude or to one
_RESPONSE = 400  # communication steps after a pulse
_NOISE = 1e-6  # singular values relative to the largest, above the FMU's integration error
_MOST_ORDER = 20
# error of a realisation, relative to its largest singular value, and of a response a step later
_FAITHFUL = 1e-4


@dataclass(frozen=True)
class FmuRequest:
    """The variables and the point of an FMU that are linearised.

    Attributes
    ----------
    model : Model
    time : float
        Of the operating point, s.
    settings : Mapping of str to float or str
        Parameters, and inputs that stay at a value.
    inputs, outputs : sequence of str
    step : float
        Communication step, s.
    """

    model: Model
    time: float
    settings: Mapping[str, Value]
    inputs: Sequence[str]
    outputs: Sequence[str]
    step: float

    @property
    def path(self) -> Path:
        """The file."""
        return self.model.path


def linearise_fmu(request: FmuRequest, sampled: bool = False) -> LinearModel:
    """Linearise an FMU from outside.

    Parameters
    ----------
    request : FmuRequest
    sampled : bool
        Whether a model with the FMU's communication step is wanted.

    Returns
    -------
    LinearModel
        Continuous, with the FMU's own states, where it shows them; else sampled at the
        communication step, with states of a realisation.

    Raises
    ------
    UserError
        If the FMU fails, or its responses give no model.
    """
    _check_names(request, "input", request.inputs, request.model.inputs)
    _check_names(request, "output", request.outputs, request.model.outputs)
    for role, names in (("input", request.inputs), ("output", request.outputs)):
        if not names:
            raise UserError(
                f"{request.model.name}: has no real {role}; a linear model goes from inputs to"
                " outputs"
            )
    with Fmu(request.path, request.settings) as probe:
        exchange = probe.description.modelExchange
        shown = exchange is not None and bool(probe.description.derivatives)
    if shown and not sampled:
        model = _by_laws(request, bool(exchange.providesDirectionalDerivative))
        if model is not None:
            return model
    return _by_pulses(request)


def _check_names(
    request: FmuRequest, role: str, names: Sequence[str], signals: Mapping[str, Signal]
) -> None:
    known = [name for name, signal in signals.items() if signal.type == "real"]
    for name in names:
        if name not in known:
            raise UserError(
                f"{request.model.name}: {option(f'{role}s', [name])}: an FMU without equations has"
                f" no real {role} of this name; there are {', '.join(known)}"
            )


def _by_laws(request: FmuRequest, given: bool) -> LinearModel | None:
    """Linearise by model exchange; None if something is sampled in the FMU, which it hides."""
    with ExchangeFmu(request.path, request.settings) as fmu:
        states = fmu.states
        reached = _states_at(request, states)
        fmu.start()
        fmu.hold(request.time, fmu.start_states() if reached is None else reached)
        if fmu.samples:
            return None
        reached = fmu.start_states()
        values = np.empty(len(request.inputs))
        fmu.reader(request.inputs)(values)
        if given:
            knowns = [*states, *request.inputs]
            whole = fmu.directional_derivatives([*fmu.rates, *request.outputs], knowns)
        else:
            whole = _differences(fmu, request, np.array(reached), values)
    n = len(states)
    inputs = tuple(request.inputs)
    identity = np.eye(n + len(inputs))
    signals = {name: identity[k] for k, name in enumerate((*states, *inputs))}
    signals |= dict(zip(request.outputs, whole[n:], strict=True))
    blocks = LinearBlocks(tuple(states), (), inputs, whole[:n], (), signals)
    kept = blocks.between(inputs, request.outputs)
    now = dict(zip(inputs, values.tolist(), strict=True))
    point = _point(request, now, dict(zip(states, reached, strict=True)))
    return _model(
        request, assemble(kept, request.outputs), point, _GIVEN if given else _DIFFERENCES
    )


def _states_at(request: FmuRequest, states: Sequence[str]) -> list[float] | None:
    """Return the states that a co-simulation up to the time of the operating point reaches."""
    if request.time == 0.0:
        return None
    reached = np.empty(len(states))
    with Fmu(request.path, request.settings) as fmu:
        fmu.start()
        _advance(fmu, request)
        fmu.reader(states)(reached)
    return reached.tolist()


def _advance(fmu: Fmu, request: FmuRequest) -> None:
    if request.time > 0.0:
        points = grid(0.0, request.time, min(request.step, request.time))
        for begin, end in pairwise(points):
            fmu.step(float(begin), float(end - begin))


def _differences(fmu: ExchangeFmu, request: FmuRequest, states: Array, inputs: Array) -> Array:
    """Return central differences of rates and outputs by states and inputs."""
    write = fmu.writer(request.inputs)
    read = fmu.reader(request.outputs)
    n = states.size

    def laws(point: Array) -> Array:
        fmu.set_states(point[:n].tolist())
        write(point[n:])
        outputs = np.empty(len(request.outputs))
        read(outputs)
        return np.concatenate([fmu.get_rates(), outputs])

    centre = np.concatenate([states, inputs])
    nominal = np.array([_nominal(fmu, name) for name in (*fmu.states, *request.inputs)])
    columns = []
    for k, size in enumerate(_RELATIVE * np.maximum(np.abs(centre), nominal)):
        aside = np.zeros(centre.size)
        aside[k] = size
        columns.append((laws(centre + aside) - laws(centre - aside)) / (2.0 * size))
    return np.array(columns).T


def _nominal(fmu: Fmu, name: str) -> float:
    given = fmu.variable(name).nominal
    return abs(float(given)) if given else 1.0


def _by_pulses(request: FmuRequest) -> LinearModel:
    """Linearise by responses to pulses, whose realisation is sampled at the communication step."""
    levels = {
        name: float(request.settings.get(name, request.model.inputs[name].start))
        for name in request.inputs
    }
    responses, later = (
        np.stack([_pulse(request, name, levels, at) for name in request.inputs], axis=1)
        for at in (0, 1)
    )
    scale = np.abs(responses).max(axis=(1, 2), keepdims=True)
    scale[scale == 0.0] = 1.0
    responses /= scale
    changed = np.abs(later[:, :, 1:] / scale - responses[:, :, :-1]).max(initial=0.0)
    order, error = _order(responses[:, :, 1:])
    if error > _FAITHFUL or changed > _FAITHFUL:
        raise UserError(
            f"{request.model.name}: its responses are not those of a linear model of up to"
            f" {_MOST_ORDER} states that is the same at every step of {request.step:g} s; if"
            f" something is sampled in it, take a multiple of that period as {option('step')}"
        )
    realised = _realised(responses, order)
    D = responses[:, :, 0] * scale[:, :, 0]
    states = tuple(f"x{k + 1}" for k in range(order))
    matrices = Matrices(*realised[:2], realised[2] * scale[:, :, 0], D, request.step, states)
    return _model(request, matrices, _point(request, levels, {}), _PULSES)


def _realised(responses: Array, order: int) -> tuple[Array, Array, Array]:
    """Return A, B and C of an order whose responses to pulses are (outputs, inputs, steps)."""
    with optional():
        import control

    outputs, inputs, steps = responses.shape
    if not order:
        return np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0))
    rows = (steps - 1) // 2
    realised, _ = control.eigensys_realization(responses, order, rows, rows, dt=True)
    return realised.A, realised.B, realised.C


def _order(responses: Array) -> tuple[int, float]:
    """Return the order of a realisation, and its error relative to the Hankel matrix.

    The order is the number of singular values of the matrix that are above its noise.
    """
    rows = responses.shape[2] // 2
    hankel = np.block([[responses[:, :, i + j] for j in range(rows)] for i in range(rows)])
    sizes = np.linalg.svd(hankel, compute_uv=False)
    largest = sizes.max(initial=0.0)
    if largest == 0.0:
        return 0, 0.0
    order = min(int((sizes > _NOISE * largest).sum()), _MOST_ORDER)
    return order, float(sizes[order:].max(initial=0.0) / largest)


def _pulse(request: FmuRequest, name: str, levels: Mapping[str, float], at: int) -> Array:
    """Return the responses (outputs, steps) to a pulse in one step, per its size."""
    size = _PULSE * max(1.0, abs(levels[name]))
    up, down = (
        _response(request, {**levels, name: levels[name] + s}, levels, at) for s in (size, -size)
    )
    return (up - down) / (2.0 * size)


def _response(
    request: FmuRequest, pulse: Mapping[str, float], levels: Mapping[str, float], at: int
) -> Array:
    names = list(levels)
    responses = np.empty((_RESPONSE, len(request.outputs)))
    with Fmu(request.path, request.settings) as fmu:
        write = fmu.writer(names)
        read = fmu.reader(request.outputs)
        fmu.start()
        _advance(fmu, request)
        for k, row in enumerate(responses):
            now = pulse if k == at else levels
            write(np.array([now[name] for name in names]))
            read(row)
            fmu.step(request.time + k * request.step, request.step)
    return responses.T


def _point(
    request: FmuRequest, inputs: dict[str, float], states: dict[str, float]
) -> OperatingPoint:
    numbers = {n: v for n, v in request.settings.items() if not isinstance(v, str)}
    parameters = {n: v for n, v in numeric(numbers).items() if n not in request.model.inputs}
    return OperatingPoint(request.time, parameters, inputs, states, {})


def _model(
    request: FmuRequest, matrices: Matrices, point: OperatingPoint, method: str
) -> LinearModel:
    signals = {**request.model.inputs, **request.model.outputs}
    units = {name: signal.unit for name, signal in signals.items()}
    return LinearModel(
        request.model.name,
        matrices,
        tuple(request.inputs),
        tuple(request.outputs),
        units,
        point,
        method,
    )
