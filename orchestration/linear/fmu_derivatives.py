"""Linearisation of FMUs without equations, by directional derivatives or by differences.

An FMU for model exchange shows its states, rates and outputs: its derivatives are directional
derivatives if it provides them, else central differences. For co-simulation, and for an FMU that
samples, the states are hidden, and the differences are of trajectories: responses to a pulse on one
input for one communication step, and to its negative. python-control realises the responses
(eigensystem realisation: Juang, Pappa, Journal of Guidance 8, 1985).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

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
from orchestration.linear.operating_point import OperatingPoint, rest_notes
from orchestration.reporting import option

_DIRECTIONAL = "directional derivatives of the FMU"
_DIFFERENCES = "central differences of the FMU's laws"
_PULSES = "central differences of responses to pulses"
_RELATIVE = np.finfo(float).eps ** (1.0 / 3.0)  # relative step of a central difference
_PULSE = 1e-3  # height of a pulse, relative to the magnitude of the input or to one
_RESPONSE = 400  # communication steps of a response
_NOISE = 1e-6  # singular values due to the integration error, relative to the largest one
_MOST_ORDER = 20
# largest error of a realisation, relative to the largest singular value, and largest change of a
# response that begins a step later
_FAITHFUL = 1e-4


_Kind = TypeVar("_Kind", bound=Fmu)


@dataclass(frozen=True)
class FmuRequest:
    """Variables and operating point for the linearisation of an FMU.

    Attributes
    ----------
    model : Model
    time : float
        Time of the operating point, s.
    settings : Mapping of str to float or str
        Parameters and constant inputs.
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
        """Path of the FMU."""
        return self.model.path

    def opened(self, kind: type[_Kind]) -> _Kind:
        """Return an instance with the settings, to be entered."""
        return kind(self.path, self.settings, tolerance=self.model.tolerance)

    def start(self, fmu: Fmu) -> None:
        """Initialize an instance; it knows of the end of the longest response."""
        fmu.start(0.0, self.time + _RESPONSE * self.step)


def linearise_fmu(request: FmuRequest, sampled: bool = False) -> LinearModel:
    """Linearise an FMU by its interface.

    Parameters
    ----------
    request : FmuRequest
    sampled : bool
        Return a model sampled at the communication step, even if the FMU shows its states.

    Returns
    -------
    LinearModel
        Continuous with the FMU's states if it shows them; else sampled at the communication step,
        with the states of a realisation.

    Raises
    ------
    UserError
        If there is no signal of a name, the FMU fails, or its responses are not those of a linear
        model.
    """
    _check_names(request, "input", request.inputs, request.model.inputs)
    _check_names(request, "output", request.outputs, request.model.outputs)
    for role, names in (("input", request.inputs), ("output", request.outputs)):
        if not names:
            raise UserError(
                f"{request.model.name}: has no real {role}; a linear model goes from inputs to"
                " outputs"
            )
    with request.opened(Fmu) as probe:
        exchange = probe.description.modelExchange
        has_states = exchange is not None and bool(probe.description.derivatives)
    if has_states and not sampled:
        model = _by_laws(request, bool(exchange.providesDirectionalDerivative))
        if model is not None:
            return model
    return _by_pulses(request)


def _check_names(
    request: FmuRequest, role: str, names: Sequence[str], signals: Mapping[str, Signal]
) -> None:
    """Raise if a name is not one of the real signals."""
    known = [name for name, signal in signals.items() if signal.type == "real"]
    for name in names:
        if name not in known:
            raise UserError(
                f"{request.model.name}: {option(f'{role}s', [name])}: an FMU without equations has"
                f" no real {role} of this name; there are {', '.join(known)}"
            )


def _by_laws(request: FmuRequest, directional: bool) -> LinearModel | None:
    """Linearise the rates and outputs of model exchange; return None if the FMU samples within."""
    with request.opened(ExchangeFmu) as fmu:
        simulated = _states_at(request, fmu.states)
        request.start(fmu)
        fmu.enter_continuous_time(
            request.time, fmu.get_states() if simulated is None else simulated
        )
        if fmu.samples:
            return None
        point = _point_of(fmu, request)
        rates = np.array(fmu.get_rates())
        nominal = np.array([_nominal(fmu, name) for name in fmu.states])
        if directional:
            knowns = [*point.states, *request.inputs]
            jacobian = fmu.directional_derivatives([*fmu.rates, *request.outputs], knowns)
        else:
            states, inputs = (np.array([*one.values()]) for one in (point.states, point.inputs))
            jacobian = _central_differences(fmu, request, states, inputs)
    blocks = _blocks(request, tuple(point.states), jacobian)
    matrices = assemble(blocks.between(request.inputs, request.outputs), request.outputs)
    model = _linear_model(request, matrices, point, _DIRECTIONAL if directional else _DIFFERENCES)
    by_states = blocks.rates[:, : len(point.states)]
    return replace(model, notes=rest_notes(point.states, rates, nominal, by_states, model.units))


def _point_of(fmu: ExchangeFmu, request: FmuRequest) -> OperatingPoint:
    """Return the operating point where an FMU is."""
    inputs, outputs = (np.empty(len(names)) for names in (request.inputs, request.outputs))
    fmu.reader(request.inputs)(inputs)
    fmu.reader(request.outputs)(outputs)
    states = dict(zip(fmu.states, fmu.get_states(), strict=True))
    point = _operating_point(
        request, dict(zip(request.inputs, inputs.tolist(), strict=True)), states
    )
    return replace(point, outputs=dict(zip(request.outputs, outputs.tolist(), strict=True)))


def _blocks(request: FmuRequest, states: tuple[str, ...], jacobian: Array) -> LinearBlocks:
    """Return the blocks of derivatives of rates and outputs by states and inputs."""
    rates, outputs = np.split(jacobian, [len(states)])
    columns = (*states, *request.inputs)
    signals = dict(zip(columns, np.eye(len(columns)), strict=True))
    signals |= zip(request.outputs, outputs, strict=True)
    return LinearBlocks(states, (), tuple(request.inputs), rates, (), signals)


def _states_at(request: FmuRequest, states: Sequence[str]) -> list[float] | None:
    """Return the states at the operating point by co-simulation; None at the start."""
    if request.time == 0.0:
        return None
    values = np.empty(len(states))
    with request.opened(Fmu) as fmu:
        request.start(fmu)
        _advance(fmu, request)
        fmu.reader(states)(values)
    return values.tolist()


def _advance(fmu: Fmu, request: FmuRequest) -> None:
    """Step an FMU to the time of the operating point."""
    if request.time > 0.0:
        points = grid(0.0, request.time, min(request.step, request.time))
        for begin, end in pairwise(points):
            fmu.step(float(begin), float(end - begin))


def _central_differences(
    fmu: ExchangeFmu, request: FmuRequest, states: Array, inputs: Array
) -> Array:
    """Return central differences of rates and outputs with respect to states and inputs."""
    write = fmu.writer(request.inputs)
    read = fmu.reader(request.outputs)
    n = states.size

    def laws(point: Array) -> Array:
        """Return rates and outputs at states and inputs."""
        fmu.set_states(point[:n].tolist())
        write(point[n:])
        outputs = np.empty(len(request.outputs))
        read(outputs)
        return np.concatenate([fmu.get_rates(), outputs])

    centre = np.concatenate([states, inputs])
    nominal = np.array([_nominal(fmu, name) for name in (*fmu.states, *request.inputs)])
    columns = []
    for k, size in enumerate(_RELATIVE * np.maximum(np.abs(centre), nominal)):
        step = np.zeros(centre.size)
        step[k] = size
        columns.append((laws(centre + step) - laws(centre - step)) / (2.0 * size))
    return np.array(columns).T


def _nominal(fmu: Fmu, name: str) -> float:
    """Return the absolute nominal value of a variable; 1 if the FMU states none."""
    value = fmu.variable(name).nominal
    return abs(float(value)) if value else 1.0


def _by_pulses(request: FmuRequest) -> LinearModel:
    """Linearise by a realisation of responses to pulses, sampled at the communication step."""
    levels = {
        name: float(request.settings.get(name, request.model.inputs[name].start))
        for name in request.inputs
    }
    responses = _pulse_responses(request, levels, 0)
    delayed = _pulse_responses(request, levels, 1)
    largest = np.abs(responses).max(axis=(1, 2), keepdims=True)  # of each output
    scale = np.where(largest == 0.0, 1.0, largest)
    scaled = responses / scale
    # the response to a later pulse is the same one, later, if the model does not change with time
    change = np.abs(delayed[:, :, 1:] / scale - scaled[:, :, :-1]).max(initial=0.0)
    order, error = _realisation_order(scaled[:, :, 1:])
    if error > _FAITHFUL or change > _FAITHFUL:
        raise UserError(
            f"{request.model.name}: its responses are not those of a linear model of up to"
            f" {_MOST_ORDER} states that is the same at every step of {request.step:g} s; if"
            f" it samples, take a multiple of its sample period as {option('step')}"
        )
    A, B, C = _realisation(scaled, order)
    D = scaled[:, :, 0] * scale[:, :, 0]
    states = tuple(f"x{k + 1}" for k in range(order))
    matrices = Matrices(A, B, C * scale[:, :, 0], D, request.step, states)
    return _linear_model(request, matrices, _operating_point(request, levels, {}), _PULSES)


def _realisation(responses: Array, order: int) -> tuple[Array, Array, Array]:
    """Return A, B and C of the given order by the eigensystem realisation algorithm.

    Responses are those to unit pulses, shape (outputs, inputs, steps).
    """
    with optional():
        import control

    outputs, inputs, steps = responses.shape
    if not order:
        return np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0))
    rows = (steps - 1) // 2
    system, _ = control.eigensys_realization(responses, order, rows, rows, dt=True)
    return system.A, system.B, system.C


def _realisation_order(responses: Array) -> tuple[int, float]:
    """Return the order of a realisation of pulse responses, and its error.

    The order is the number of singular values of the Hankel matrix of the responses above its
    noise; the error is the first singular value after it, relative to the largest.
    """
    rows = responses.shape[2] // 2
    hankel = np.block([[responses[:, :, i + j] for j in range(rows)] for i in range(rows)])
    sizes = np.linalg.svd(hankel, compute_uv=False)
    largest = sizes.max(initial=0.0)
    if largest == 0.0:
        return 0, 0.0
    order = min(int((sizes > _NOISE * largest).sum()), _MOST_ORDER)
    return order, float(sizes[order:].max(initial=0.0) / largest)


def _pulse_responses(request: FmuRequest, levels: Mapping[str, float], at: int) -> Array:
    """Return the responses to unit pulses in step `at`, shape (outputs, inputs, steps).

    They are central differences about constant inputs at `levels`.
    """
    responses = []
    for name in request.inputs:
        size = _PULSE * max(1.0, abs(levels[name]))
        up = _response(request, {**levels, name: levels[name] + size}, levels, at)
        down = _response(request, {**levels, name: levels[name] - size}, levels, at)
        responses.append((up - down) / (2.0 * size))
    return np.stack(responses, axis=1)


def _response(
    request: FmuRequest, pulse: Mapping[str, float], levels: Mapping[str, float], at: int
) -> Array:
    """Simulate with the inputs of a pulse in step `at`, else constant ones; return the outputs.

    Their shape is (outputs, steps).
    """
    names = list(levels)
    responses = np.empty((_RESPONSE, len(request.outputs)))
    with request.opened(Fmu) as fmu:
        write = fmu.writer(names)
        read = fmu.reader(request.outputs)
        request.start(fmu)
        _advance(fmu, request)
        for k, row in enumerate(responses):
            now = pulse if k == at else levels
            write(np.array([now[name] for name in names]))
            read(row)
            fmu.step(request.time + k * request.step, request.step)
    return responses.T


def _operating_point(
    request: FmuRequest, inputs: dict[str, float], states: dict[str, float]
) -> OperatingPoint:
    """Return the operating point, with the numeric parameters of the settings."""
    numbers = {n: v for n, v in request.settings.items() if not isinstance(v, str)}
    parameters = {n: v for n, v in numeric(numbers).items() if n not in request.model.inputs}
    return OperatingPoint(request.time, parameters, inputs, states, {})


def _linear_model(
    request: FmuRequest, matrices: Matrices, point: OperatingPoint, method: str
) -> LinearModel:
    """Return the linear model of matrices, with the units of its signals."""
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
