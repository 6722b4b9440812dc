"""Linearisation of FMUs without equations, by directional derivatives or by differences.

An FMU for model exchange shows its states, rates and outputs: its derivatives are directional
derivatives if it provides them, else central differences. For co-simulation, and for an FMU that
samples, the states are hidden, and the differences are of trajectories: responses to a pulse on one
input for one communication step, and to its negative. python-control realises the responses
(eigensystem realisation: Juang, Pappa, Journal of Guidance 8, 1985).

Differences are made by several sizes, of which that is taken at which a tenth of it changes the
slopes least: larger ones leave the tangent, smaller ones drown in rounding and integration errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.extras import optional
from orchestration.fmu import ExchangeFmu, Model, Value, read_description
from orchestration.fmu.simulation import source_of
from orchestration.linear.blocks import LinearBlocks, SampledUpdate, check_finite
from orchestration.linear.operating_point import (
    OperatingPoint,
    listed,
    motion,
    not_at_rest,
    with_unit,
)
from orchestration.reporting import option

_DIRECTIONAL = "directional derivatives of the FMU"
_DIFFERENCES = "central differences of the FMU's laws"
_PULSES = "central differences of responses to pulses"
# sizes of differences that are tried, relative to a value or its nominal value
_SIZES = 10.0 ** -np.arange(2.0, 11.0)
_EXACT = 1e-9  # relative change of slopes, below which no other size is better
_RESPONSE = 400  # communication steps of a response
_NOISE = 1e-6  # singular values due to the integration error, relative to the largest one
_MOST_ORDER = 20
# largest error of a realisation, relative to the largest singular value, and largest change of a
# response that begins a step later
_FAITHFUL = 1e-4
_SOON = 1e-3  # of a communication step, after which a sampler has answered
_AT_REST = 1e-3  # largest change of an output at constant inputs, of its magnitude


@dataclass(frozen=True)
class FmuRequest:
    """An FMU at an operating point, and variables for its linearisation.

    Attributes
    ----------
    model : Model
    settings : Mapping of str to float or str
        Parameters and constant inputs.
    points : ndarray, shape (n,)
        Communication points until the operating point, s.
    driven : Mapping of str to ndarray, shape (n,)
        Inputs at `points`.
    inputs, outputs : sequence of str
        Those that are to be linearised; the inputs are among `driven`.
    step : float
        Communication step of responses, s.
    prefix : str
        What stands before the names of its variables in a system: ``member.``.
    """

    model: Model
    settings: Mapping[str, Value]
    points: Array
    driven: Signals
    inputs: Sequence[str]
    outputs: Sequence[str]
    step: float
    prefix: str = ""

    def run(
        self,
        outputs: Sequence[str],
        steps: Sequence[float] | Array = (),
        pulse: Mapping[str, float] | None = None,
        at: int = 0,
    ) -> Array:
        """Simulate to the operating point and beyond, with inputs that are constant from there.

        Parameters
        ----------
        outputs : sequence of str
            Any variables.
        steps : array_like, shape (m,)
            Communication points after the operating point, s from there.
        pulse : Mapping of str to float, optional
            What is added to inputs at one communication point.
        at : int
            That point, 0 for the operating point.

        Returns
        -------
        ndarray, shape (m + 1, outputs)
            From the operating point on.
        """
        now = self.points.size - 1
        time = np.append(self.points, self.points[-1] + np.array(steps))
        inputs = {}
        for name, values in self.driven.items():
            inputs[name] = np.append(values, np.full(len(steps), values[-1]))
        for name, size in (pulse or {}).items():
            inputs[name][now + at] += size
        with source_of(self.model).open() as runs:
            return runs.run(time, inputs, self.settings, outputs)[now:]

    def names(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the names that variables have in the system."""
        return tuple(f"{self.prefix}{name}" for name in names)

    def named(self, names: Iterable[str], values: Array) -> dict[str, float]:
        """Return values by the names that variables have in the system."""
        return dict(zip(self.names(names), values.tolist(), strict=True))

    def point(self, outputs: Array, **groups: dict[str, float]) -> OperatingPoint:
        """Return the operating point of values of outputs, and of states and rates if known."""
        inputs = self.named(self.driven, np.array([v[-1] for v in self.driven.values()]))
        known = {"states": {}, "rates": {}, **groups}
        return OperatingPoint(
            float(self.points[-1]),
            parameters={},
            inputs=inputs,
            discretes={},
            outputs=self.named(self.outputs, outputs),
            **known,
        )

    def words(self, found: Mapping[str, _Slope]) -> str:
        """Return the sizes of differences, and their error, in words."""
        units = units_of(self.model)
        sizes = [
            f"{self.prefix}{name} ±{with_unit(f'{one.size:.1g}', units.get(name))}"
            for name, one in found.items()
        ]
        error = max(one.error for one in found.values())
        return f"{listed(sizes)}; a tenth changes slopes by {100.0 * error:.1g} %"


class LinearPart(NamedTuple):
    """A model that is linearised about an operating point, alone or as a member of a system.

    Attributes
    ----------
    blocks : LinearBlocks
    point : OperatingPoint
    method : str
        Origin of the derivatives, with the sizes of differences.
    nominal : Mapping of str to float
        Magnitudes of continuous states.
    notes : tuple of str
        Remarks for the user.
    is_held : bool
        Whether it is known only for inputs that are held over the communication step.
    """

    blocks: LinearBlocks
    point: OperatingPoint
    method: str
    nominal: Mapping[str, float]
    notes: tuple[str, ...] = ()
    is_held: bool = False


def units_of(model: Model) -> dict[str, str]:
    """Return the units of all variables of a model, by name."""
    signals = {**model.settable, **model.outputs, **model.others}
    return {name: signal.unit for name, signal in signals.items()}


def linearise_fmu(request: FmuRequest) -> LinearPart:
    """Linearise an FMU by its interface.

    Parameters
    ----------
    request : FmuRequest

    Returns
    -------
    LinearPart
        Continuous with the FMU's states if it shows them; else sampled at the communication step,
        with the states of a realisation.

    Raises
    ------
    UserError
        If the FMU fails, a derivative is not finite, or responses are not those of a linear model.
    """
    description = read_description(request.model.path)
    exchange = description.modelExchange
    part = None
    if exchange is not None and description.derivatives:
        part = _by_laws(request, bool(exchange.providesDirectionalDerivative))
    found = part or _by_pulses(request)
    check_finite(found.blocks, request.model.name, found.point)
    return found


def _by_laws(request: FmuRequest, directional: bool) -> LinearPart | None:
    """Linearise the rates and outputs of model exchange; return None if the FMU samples within."""
    model = request.model
    starts, ends = (
        {name: float(values[k]) for name, values in request.driven.items()} for k in (0, -1)
    )
    with ExchangeFmu(model.path, request.settings, tolerance=model.tolerance) as fmu:
        fmu.start(0.0, inputs=starts)
        is_start = request.points.size == 1
        states = fmu.get_states() if is_start else request.run(fmu.states)[0].tolist()
        fmu.enter_continuous_time(float(request.points[-1]), states)
        if fmu.samples:
            return None
        fmu.writer([*ends])(np.array([*ends.values()]))
        write = fmu.writer(request.inputs)
        read = fmu.reader(request.outputs)
        count = len(states)
        outputs = np.empty(len(request.outputs))

        def laws(point: Array) -> Array:
            fmu.set_states(point[:count].tolist())
            write(point[count:])
            read(outputs)
            return np.concatenate([fmu.get_rates(), outputs])

        def along(direction: Array) -> Callable[[float], Array]:
            return lambda size: laws(centre + size * direction)[:, None]

        centre = np.array([*states, *(ends[name] for name in request.inputs)])
        rates, values = np.split(laws(centre), [count])
        point = request.point(
            values,
            states=request.named(fmu.states, centre[:count]),
            rates=request.named(fmu.states, rates),
        )
        columns = [*fmu.states, *request.inputs]
        known = source_of(model).nominal
        nominal = np.array([known.get(name, 1.0) for name in columns])
        if directional:
            method = _DIRECTIONAL
            jacobian = fmu.directional_derivatives([*fmu.rates, *request.outputs], columns)
        else:
            scales = np.fmax(np.abs(centre), nominal)
            found = {
                name: _slope(along(direction), scale * _SIZES)
                for name, direction, scale in zip(
                    columns, np.eye(len(columns)), scales, strict=True
                )
            }
            method = f"{_DIFFERENCES} ({request.words(found)})"
            jacobian = np.column_stack([one.slope for one in found.values()])
        blocks = _blocks(request, fmu.states, jacobian)
        return LinearPart(blocks, point, method, request.named(columns, nominal))


def _blocks(
    request: FmuRequest, states: Sequence[str], matrix: Array, period: float = 0.0
) -> LinearBlocks:
    """Return the blocks of a matrix with rows of laws of states and of outputs.

    Parameters
    ----------
    request : FmuRequest
    states : sequence of str
    matrix : ndarray, shape (states + outputs, states + inputs)
    period : float
        That of sampled states, s; 0 if rows of states are rates.
    """
    own = request.names(states)
    inputs = request.names(request.inputs)
    columns = (*own, *inputs)
    laws, outputs = np.split(matrix, [len(own)])
    signals = dict(zip(request.names(request.outputs), outputs, strict=True))
    # after outputs: of one that is a state FMUs may know no derivative
    signals |= zip(columns, np.eye(len(columns)), strict=True)
    if not period:
        signals |= zip((f"der({name})" for name in own), laws, strict=True)
        return LinearBlocks(own, (), inputs, laws, (), signals)
    rows = tuple(range(len(own)))
    update = SampledUpdate("the communication step", period, 0.0, rows, laws)
    return LinearBlocks((), own, inputs, np.empty((0, len(columns))), (update,), signals)


class _Slope(NamedTuple):
    """A slope by central differences.

    Attributes
    ----------
    slope : ndarray, shape (rows, n)
    size : float
        Half of the difference.
    error : float
        Change of the slope if the size is a tenth, of the largest slope of the same row.
    """

    slope: Array
    size: float
    error: float


def _difference(values: Callable[[float], Array], size: float) -> Array:
    """Return the slope at zero by a central difference."""
    return (values(size) - values(-size)) / (2.0 * size)


def _slope(values: Callable[[float], Array], sizes: Array) -> _Slope:
    """Return the slope at zero by differences of the size at which it depends least on the size.

    Parameters
    ----------
    values : callable
        Takes a deviation and returns an array, shape (rows, n).
    sizes : ndarray, shape (m,)
        Falling.
    """
    slopes: list[Array] = []
    errors = np.zeros(0)
    for size in sizes.tolist():
        try:
            slopes.append(_difference(values, size))
        except UserError:  # too far, where it refuses a value
            slopes.append(np.full_like(values(0.0), np.nan))
        errors = _errors(np.array(slopes))
        if errors.min(initial=np.inf) <= _EXACT:
            break
    best = int(np.argmin(errors))
    return _Slope(slopes[best], float(sizes[best]), float(errors[best]))


def _errors(slopes: Array) -> Array:
    """Return the largest change from each of some slopes to the next, of the largest in its row.

    Parameters
    ----------
    slopes : ndarray, shape (m, rows, n)

    Returns
    -------
    ndarray, shape (m - 1,)
    """
    extents = np.nan_to_num(np.abs(slopes).max(axis=2), posinf=0.0)
    # where most differences show a change, one of exactly zero is too small for the digits
    is_lost = (extents == 0.0) & (np.median(extents, axis=0) > 0.0)
    with np.errstate(invalid="ignore"):
        changes = np.abs(np.diff(slopes, axis=0)).max(axis=2)
    changes[is_lost[:-1] | is_lost[1:] | np.isnan(changes)] = np.inf
    largest = extents.max(axis=0)
    return np.asarray((changes / np.where(largest > 0.0, largest, 1.0)).max(axis=1))


def _by_pulses(request: FmuRequest) -> LinearPart:
    """Linearise by a realisation of responses to pulses, sampled at the communication step."""
    if not request.inputs:
        raise UserError(f"{request.model.name}: has no real input whose pulses show its states")
    known = source_of(request.model).nominal
    found = {}
    for name in request.inputs:
        scale = max(abs(request.driven[name][-1]), known.get(name, 1.0))
        found[name] = _slope(_response(request, name), scale * _SIZES)
    states, matrix, is_sampler = _realised(request, found)
    at_rest = request.run(request.outputs, _steps(request))
    moving = _moving(request, at_rest)
    return LinearPart(
        _blocks(request, states, matrix, request.step),
        request.point(at_rest[0]),
        f"{_PULSES} ({request.words(found)})",
        {},
        (not_at_rest(moving),) if moving else (),
        not is_sampler,
    )


def _steps(request: FmuRequest) -> Array:
    """Return the communication points of a response after the first one, s."""
    return request.step * np.arange(1, _RESPONSE)


def _response(
    request: FmuRequest, name: str, at: int = 0, steps: Array | None = None
) -> Callable[[float], Array]:
    """Return the function from the size of a pulse on an input to outputs, (outputs, steps)."""
    points = _steps(request) if steps is None else steps
    return lambda size: request.run(request.outputs, points, {name: size}, at).T


def _unit_responses(
    request: FmuRequest, found: Mapping[str, _Slope], at: int, steps: Array | None = None
) -> Array:
    """Return responses to unit pulses, shape (outputs, inputs, steps), of sizes that are found."""
    return np.stack(
        [_difference(_response(request, name, at, steps), one.size) for name, one in found.items()],
        axis=1,
    )


def _realised(request: FmuRequest, found: Mapping[str, _Slope]) -> tuple[list[str], Array, bool]:
    """Realise responses to unit pulses on each input.

    Returns
    -------
    states : list of str
        Names of the states of the realisation.
    matrix : ndarray, shape (states + outputs, states + inputs)
        A, B, C and D.
    is_sampler : bool
        Whether outputs step after an input at a communication point, and then stay, as those of a
        controller do.
    """
    responses = np.stack([one.slope for one in found.values()], axis=1)
    largest = np.abs(responses).max(axis=(1, 2), keepdims=True)  # of each output
    scale = np.where(largest == 0.0, 1.0, largest)
    scaled = responses / scale
    # the response to a later pulse is the same one, later, if the model does not change with time
    delayed = _unit_responses(request, found, 1) / scale
    change = np.abs(delayed[:, :, 1:] - scaled[:, :, :-1]).max(initial=0.0)
    noise = max(_NOISE, *(one.error for one in found.values()))
    A, B, C, D, error = _realisation(scaled, noise)
    if error > _FAITHFUL or change > _FAITHFUL:
        raise UserError(
            f"{request.model.name}: its responses are not those of a linear model of up to"
            f" {_MOST_ORDER} states that is the same at every step of {request.step:g} s; if"
            f" it samples, take a multiple of its sample period as {option('step')}"
        )
    stem = "x"
    while f"{stem}1" in (*request.inputs, *request.outputs):
        stem += "x"
    states = [f"{stem}{k + 1}" for k in range(len(A))]
    matrix = np.block([[A, B], [C * scale[:, :, 0], D * scale[:, :, 0]]])
    return states, matrix, len(A) > 0 and _answers_at_once(request, found, responses)


def _answers_at_once(request: FmuRequest, found: Mapping[str, _Slope], responses: Array) -> bool:
    """Return whether outputs step after an input at a communication point, and then stay.

    So does a sampler, such as a controller. An FMU that refuses a short step cannot be asked.
    """
    try:
        soon = _unit_responses(request, found, 0, np.array([_SOON * request.step]))
    except UserError:
        return False
    at_once = np.abs(soon[:, :, 1] - responses[:, :, 1]) + np.abs(responses[:, :, 0])
    return bool((at_once <= _FAITHFUL * np.abs(responses).max(axis=2)).all())


def _realisation(responses: Array, noise: float) -> tuple[Array, Array, Array, Array, float]:
    """Realise responses by the eigensystem realisation algorithm.

    The order is the number of singular values of their Hankel matrix above the noise; the error is
    the first one after it. Both are relative to the largest one.

    Parameters
    ----------
    responses : ndarray, shape (outputs, inputs, steps)
        To unit pulses.
    noise : float

    Returns
    -------
    A, B, C, D : ndarray
    error : float
    """
    with optional():
        import control

    outputs, inputs, steps = responses.shape
    rows = (steps - 1) // 2
    if not responses[:, :, 1:].any():
        A, B, C = np.empty((0, 0)), np.empty((0, inputs)), np.empty((outputs, 0))
        return A, B, C, responses[:, :, 0], 0.0
    _, sizes = control.eigensys_realization(responses, 1, rows, rows, dt=True)
    relative = sizes / sizes[0]
    order = min(int((relative > noise).sum()), _MOST_ORDER)
    system, _ = control.eigensys_realization(responses, order, rows, rows, dt=True)
    error = float(relative[order:].max(initial=0.0))
    return system.A, system.B, system.C, system.D, error


def _moving(request: FmuRequest, at_rest: Array) -> list[str]:
    """Return in words which outputs, shape (steps, outputs), move at constant inputs."""
    units = units_of(request.model)
    moving = []
    for name, values in zip(request.outputs, at_rest.T, strict=True):
        if np.ptp(values) > _AT_REST * np.abs(values).max():
            rate = float(values[1] - values[0]) / request.step
            moving.append(motion(f"{request.prefix}{name}", rate, units[name]))
    return moving
