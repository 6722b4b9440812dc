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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.extras import optional
from orchestration.fmu import ExchangeFmu, Fmu, Model, Value
from orchestration.fmu.signal import numeric
from orchestration.fmu.simulation import grid
from orchestration.linear.blocks import LinearBlocks, SampledUpdate, check_finite
from orchestration.linear.operating_point import (
    MOST_LISTED,
    OperatingPoint,
    motion,
    not_at_rest,
)
from orchestration.reporting import option

_DIRECTIONAL = "directional derivatives of the FMU"
_DIFFERENCES = "central differences of the FMU's laws"
_PULSES = "central differences of responses to pulses"
# sizes of differences and pulses that are tried, relative to a value or its nominal value
_SIZES = 10.0 ** -np.arange(2.0, 11.0)
_PULSE_SIZES = 10.0 ** -np.arange(1.0, 6.0)
_EXACT = 1e-9  # relative change of slopes, below which no other size is better
_RESPONSE = 400  # communication steps of a response
_NOISE = 1e-6  # singular values due to the integration error, relative to the largest one
_MOST_ORDER = 20
# largest error of a realisation, relative to the largest singular value, and largest change of a
# response that begins a step later
_FAITHFUL = 1e-4
_SOON = 1e-3  # of a communication step, after which a sampler has answered
_AT_REST = 1e-3  # largest change of an output at constant inputs, of its magnitude


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
    prefix : str
        What stands before the names of its variables, such as ``member.``.
    points : ndarray, shape (n,)
        Communication points until the operating point, s; by default at every step.
    driven : Mapping of str to ndarray, shape (n,)
        Inputs at `points` that vary until then.
    """

    model: Model
    time: float
    settings: Mapping[str, Value]
    inputs: Sequence[str]
    outputs: Sequence[str]
    step: float
    prefix: str = ""
    points: Array | None = None
    driven: Signals = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """Path of the FMU."""
        return self.model.path

    @property
    def levels(self) -> dict[str, float]:
        """Inputs at the operating point."""
        model = self.model
        constant = {n: self.settings.get(n, model.inputs[n].start) for n in self.inputs}
        driven = {name: values[-1] for name, values in self.driven.items()}
        return {name: float(value) for name, value in {**constant, **driven}.items()}

    def opened(self, kind: type[_Kind]) -> _Kind:
        """Return an instance with the settings, to be entered."""
        return kind(self.path, self.settings, tolerance=self.model.tolerance)

    def start(self, fmu: Fmu) -> None:
        """Initialize an instance; it knows of the end of the longest response."""
        first = {name: float(values[0]) for name, values in self.driven.items()}
        fmu.start(0.0, self.time + _RESPONSE * self.step, first)

    def advance(self, fmu: Fmu) -> None:
        """Step an instance to the operating point, whose inputs it has then."""
        names = list(self.driven)
        write = fmu.writer(names)
        rows = np.array([self.driven[name] for name in names]).T
        points = self.points
        if points is None:
            step = min(self.step, self.time)
            points = grid(0.0, self.time, step) if self.time else np.zeros(1)
        for k, (begin, end) in enumerate(pairwise(points.tolist())):
            if names:
                write(rows[k])
            fmu.step(begin, end - begin)
        if names:
            write(rows[-1])

    def named(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return values by the names that variables have outside."""
        return {f"{self.prefix}{name}": value for name, value in values.items()}

    def point(
        self, states: Mapping[str, float], rates: Mapping[str, float], outputs: Array
    ) -> OperatingPoint:
        """Return the operating point, with the numeric parameters of the settings."""
        numbers = {n: v for n, v in self.settings.items() if not isinstance(v, str)}
        parameters = {n: v for n, v in numeric(numbers).items() if n not in self.model.inputs}
        return OperatingPoint(
            self.time,
            self.named(parameters),
            self.named(self.levels),
            self.named(states),
            {},
            self.named(dict(zip(self.outputs, outputs.tolist(), strict=True))),
            self.named(rates),
        )


class LinearPart(NamedTuple):
    """A model that is linearised about an operating point, alone or as a member of a system.

    Attributes
    ----------
    blocks : LinearBlocks
    point : OperatingPoint
    method : str
        Origin of the derivatives, with the sizes of differences.
    nominal : dict of str to float
        Magnitudes of continuous states.
    notes : tuple of str
        Remarks for the user.
    is_held : bool
        Whether it is known only for inputs that are held over the communication step.
    """

    blocks: LinearBlocks
    point: OperatingPoint
    method: str
    nominal: dict[str, float]
    notes: tuple[str, ...] = ()
    is_held: bool = False


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
    with request.opened(Fmu) as probe:
        exchange = probe.description.modelExchange
        has_states = exchange is not None and bool(probe.description.derivatives)
    part = None
    if has_states:
        part = _by_laws(request, bool(exchange.providesDirectionalDerivative))
    found = part or _by_pulses(request)
    check_finite(found.blocks, request.model.name, found.point)
    return found


def _by_laws(request: FmuRequest, directional: bool) -> LinearPart | None:
    """Linearise the rates and outputs of model exchange; return None if the FMU samples within."""
    with request.opened(ExchangeFmu) as fmu:
        simulated = _states_at(request, fmu.states)
        request.start(fmu)
        fmu.enter_continuous_time(
            request.time, fmu.get_states() if simulated is None else simulated
        )
        if fmu.samples:
            return None
        laws = _laws(fmu, list(request.levels), request.outputs)
        centre = np.array([*fmu.get_states(), *request.levels.values()])
        point = _point(request, fmu, centre, laws(centre))
        nominal = request.named({name: _nominal(fmu, name) for name in fmu.states})
        knowns = [*fmu.states, *request.inputs]
        if directional:
            jacobian = fmu.directional_derivatives([*fmu.rates, *request.outputs], knowns)
            return LinearPart(_blocks(request, fmu.states, jacobian), point, _DIRECTIONAL, nominal)
        found = {
            name: _slope_along(laws, centre, k, max(abs(centre[k]), _nominal(fmu, name)))
            for k, name in enumerate(knowns)
        }
        jacobian = np.column_stack([one.slope for one in found.values()])
        method = f"{_DIFFERENCES} ({_words_of_sizes(request, found)})"
        return LinearPart(_blocks(request, fmu.states, jacobian), point, method, nominal)


def _point(request: FmuRequest, fmu: ExchangeFmu, centre: Array, values: Array) -> OperatingPoint:
    """Return the operating point of states and inputs, with the values of rates and outputs."""
    count = len(fmu.states)
    states = dict(zip(fmu.states, centre[:count].tolist(), strict=True))
    rates = dict(zip(fmu.states, values[:count].tolist(), strict=True))
    return request.point(states, rates, values[count:])


def _laws(
    fmu: ExchangeFmu, inputs: Sequence[str], outputs: Sequence[str]
) -> Callable[[Array], Array]:
    """Return the function of states and inputs that evaluates rates and outputs."""
    write = fmu.writer(inputs)
    read = fmu.reader(outputs)
    count = len(fmu.states)

    def laws(point: Array) -> Array:
        fmu.set_states(point[:count].tolist())
        write(point[count:])
        values = np.empty(len(outputs))
        read(values)
        return np.concatenate([fmu.get_rates(), values])

    return laws


def _blocks(request: FmuRequest, states: Sequence[str], jacobian: Array) -> LinearBlocks:
    """Return the blocks of derivatives of rates and outputs by states and inputs."""
    prefix = request.prefix
    rates, outputs = np.split(jacobian, [len(states)])
    own = tuple(f"{prefix}{name}" for name in states)
    inputs = tuple(f"{prefix}{name}" for name in request.inputs)
    columns = (*own, *inputs)
    signals = {f"der({name})": row for name, row in zip(own, rates, strict=True)}
    signals |= zip((f"{prefix}{name}" for name in request.outputs), outputs, strict=True)
    # after outputs: of one that is a state FMUs may know no derivative
    signals |= zip(columns, np.eye(len(columns)), strict=True)
    return LinearBlocks(own, (), inputs, rates, (), signals)


def _states_at(request: FmuRequest, states: Sequence[str]) -> list[float] | None:
    """Return the states at the operating point by co-simulation; None at the start."""
    if request.time == 0.0:
        return None
    values = np.empty(len(states))
    with request.opened(Fmu) as fmu:
        request.start(fmu)
        request.advance(fmu)
        fmu.reader(states)(values)
    return values.tolist()


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


def _slope_along(laws: Callable[[Array], Array], centre: Array, k: int, scale: float) -> _Slope:
    """Return the slope of laws by element k of their argument."""
    direction = np.zeros(centre.size)
    direction[k] = 1.0
    return _slope(lambda size: laws(centre + size * direction)[:, None], scale * _SIZES)


def _slope(values: Callable[[float], Array], sizes: Array) -> _Slope:
    """Return the slope at zero by differences of the size at which it depends least on the size.

    Parameters
    ----------
    values : callable
        Takes a deviation and returns an array, shape (rows, n).
    sizes : ndarray, shape (m,)
        Falling.
    """

    def difference(size: float) -> Array:
        try:
            return (values(size) - values(-size)) / (2.0 * size)
        except UserError:  # too far, where it refuses a value
            return np.full_like(values(0.0), np.nan)

    slopes = [difference(sizes[0])]
    for size in sizes[1:].tolist():
        slopes.append(difference(size))
        errors = _errors(np.array(slopes))
        if errors.min() <= _EXACT:
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
    with np.errstate(invalid="ignore"):
        changes = np.abs(np.diff(slopes, axis=0)).max(axis=2)
    extents = np.abs(slopes).max(axis=2)
    extents[~np.isfinite(extents)] = 0.0
    # where most differences show a change, one of exactly zero is too small for the digits
    is_lost = (extents == 0.0) & (np.median(extents, axis=0) > 0.0)
    largest = extents.max(axis=0)
    errors = changes / np.where(largest > 0.0, largest, 1.0)
    errors[is_lost[:-1] | is_lost[1:] | ~np.isfinite(changes)] = np.inf
    return np.asarray(errors.max(axis=1))


def _words_of_sizes(request: FmuRequest, found: Mapping[str, _Slope]) -> str:
    """Return the sizes of differences, and their error, in words."""
    signals = {**request.model.inputs, **request.model.outputs}
    words = []
    for name, one in list(found.items())[:MOST_LISTED]:
        unit = f" {signals[name].unit}" if name in signals and signals[name].unit != "1" else ""
        words.append(f"{request.prefix}{name} ±{one.size:.1g}{unit}")
    rest = len(found) - len(words)
    error = max(one.error for one in found.values())
    sizes = ", ".join(words) + (f" and {rest} more" if rest else "")
    return f"{sizes}; a tenth changes slopes by {100.0 * error:.1g} %"


def _nominal(fmu: Fmu, name: str) -> float:
    """Return the absolute nominal value of a variable; 1 if the FMU states none."""
    value = fmu.variable(name).nominal
    return abs(float(value)) if value else 1.0


def _by_pulses(request: FmuRequest) -> LinearPart:
    """Linearise by a realisation of responses to pulses, sampled at the communication step."""
    if not request.inputs:
        raise UserError(f"{request.model.name}: has no real input whose pulses show its states")
    with request.opened(Fmu) as probe:
        nominal = {name: _nominal(probe, name) for name in request.inputs}
    at_rest = _response(request, {}, 0)
    found = {name: _pulsed(request, name, scale) for name, scale in nominal.items()}
    A, B, C, D = _realised(request, found)
    blocks = _sampled_blocks(request, A, B, C, D)
    is_sampler = len(A) > 0 and _answers_at_once(request, found)
    moving = _moving(request, at_rest)
    notes = (not_at_rest(moving),) if moving else ()
    point = request.point({}, {}, at_rest[:, 0])
    method = f"{_PULSES} ({_words_of_sizes(request, found)})"
    return LinearPart(blocks, point, method, {}, notes, not is_sampler)


def _pulsed(request: FmuRequest, name: str, nominal: float) -> _Slope:
    """Return the response to a unit pulse on an input in the first step."""
    level = request.levels[name]

    def response(size: float) -> Array:
        return _response(request, {name: level + size}, 0)

    return _slope(response, max(nominal, abs(level)) * _PULSE_SIZES)


def _realised(
    request: FmuRequest, found: Mapping[str, _Slope]
) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C and D of a realisation of responses to unit pulses on each input."""
    responses = np.stack([one.slope for one in found.values()], axis=1)
    delayed = np.stack([_delayed(request, name, one) for name, one in found.items()], axis=1)
    largest = np.abs(responses).max(axis=(1, 2), keepdims=True)  # of each output
    scale = np.where(largest == 0.0, 1.0, largest)
    scaled = responses / scale
    # the response to a later pulse is the same one, later, if the model does not change with time
    change = np.abs(delayed[:, :, 1:] / scale - scaled[:, :, :-1]).max(initial=0.0)
    noise = max(_NOISE, *(one.error for one in found.values()))
    order, error = _realisation_order(scaled[:, :, 1:], noise)
    if error > _FAITHFUL or change > _FAITHFUL:
        raise UserError(
            f"{request.model.name}: its responses are not those of a linear model of up to"
            f" {_MOST_ORDER} states that is the same at every step of {request.step:g} s; if"
            f" it samples, take a multiple of its sample period as {option('step')}"
        )
    A, B, C = _realisation(scaled, order)
    return A, B, C * scale[:, :, 0], scaled[:, :, 0] * scale[:, :, 0]


def _answers_at_once(request: FmuRequest, found: Mapping[str, _Slope]) -> bool:
    """Return whether outputs step after an input at a communication point, and then stay.

    So does a sampler, such as a controller. An FMU of which steps of one size are required cannot
    be asked.
    """
    for name, one in found.items():
        level = request.levels[name]
        try:
            high = _soon_after(request, {name: level + one.size})
            low = _soon_after(request, {name: level - one.size})
        except UserError:
            return False
        difference = np.abs((high - low) / (2.0 * one.size) - one.slope[:, 1])
        largest = np.abs(one.slope).max(axis=1)
        feedthrough = np.abs(one.slope[:, 0])
        if (np.maximum(difference, feedthrough) > _FAITHFUL * largest).any():
            return False
    return True


def _soon_after(request: FmuRequest, pulse: Mapping[str, float]) -> Array:
    """Return the outputs, shape (outputs,), soon after inputs are set at the operating point."""
    now = {**request.levels, **pulse}
    outputs = np.empty(len(request.outputs))
    with request.opened(Fmu) as fmu:
        request.start(fmu)
        request.advance(fmu)
        fmu.writer(list(now))(np.array(list(now.values())))
        fmu.step(request.time, _SOON * request.step)
        fmu.reader(request.outputs)(outputs)
    return outputs


def _delayed(request: FmuRequest, name: str, found: _Slope) -> Array:
    """Return the response to a unit pulse a step later, of the same size."""
    level = request.levels[name]
    high = _response(request, {name: level + found.size}, 1)
    low = _response(request, {name: level - found.size}, 1)
    return (high - low) / (2.0 * found.size)


def _moving(request: FmuRequest, at_rest: Array) -> list[str]:
    """Return in words which outputs, shape (outputs, steps), move at constant inputs."""
    units = {name: signal.unit for name, signal in request.model.outputs.items()}
    moving = []
    for name, values in zip(request.outputs, at_rest, strict=True):
        if np.ptp(values) > _AT_REST * np.abs(values).max():
            rate = float(values[1] - values[0]) / request.step
            outside = f"{request.prefix}{name}"
            moving.append(motion(outside, rate, {outside: units[name]}))
    return moving


def _sampled_blocks(request: FmuRequest, A: Array, B: Array, C: Array, D: Array) -> LinearBlocks:
    """Return the blocks of a sampled model, whose inputs are held over the communication step."""
    prefix = request.prefix
    count = len(A)
    stem = "x"
    while f"{stem}1" in request.inputs or f"{stem}1" in request.outputs:
        stem += "x"
    states = tuple(f"{prefix}{stem}{k + 1}" for k in range(count))
    inputs = tuple(f"{prefix}{name}" for name in request.inputs)
    columns = (*states, *inputs)
    update = SampledUpdate(
        "the communication step", request.step, 0.0, tuple(range(count)), np.hstack([A, B])
    )
    signals = dict(zip(columns, np.eye(len(columns)), strict=True))
    outputs = (f"{prefix}{name}" for name in request.outputs)
    signals |= zip(outputs, np.hstack([C, D]), strict=True)
    return LinearBlocks((), states, inputs, np.zeros((0, len(columns))), (update,), signals)


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


def _realisation_order(responses: Array, noise: float) -> tuple[int, float]:
    """Return the order of a realisation of pulse responses, and its error.

    The order is the number of singular values of the Hankel matrix of the responses above its
    noise; the error is the first singular value after it. Both are relative to the largest one.
    """
    outputs, inputs, steps = responses.shape
    rows = np.arange(steps // 2)
    blocks = responses[:, :, np.add.outer(rows, rows)]
    hankel = blocks.transpose(2, 0, 3, 1).reshape(rows.size * outputs, rows.size * inputs)
    sizes = np.linalg.svd(hankel, compute_uv=False)
    largest = sizes.max(initial=0.0)
    if largest == 0.0:
        return 0, 0.0
    order = min(int((sizes > noise * largest).sum()), _MOST_ORDER)
    return order, float(sizes[order:].max(initial=0.0) / largest)


def _response(request: FmuRequest, pulse: Mapping[str, float], at: int) -> Array:
    """Simulate with the inputs of a pulse in step `at`, else constant ones; return the outputs.

    Their shape is (outputs, steps).
    """
    levels = request.levels
    names = list(levels)
    responses = np.empty((_RESPONSE, len(request.outputs)))
    with request.opened(Fmu) as fmu:
        write = fmu.writer(names)
        read = fmu.reader(request.outputs)
        request.start(fmu)
        request.advance(fmu)
        for k, row in enumerate(responses):
            now = {**levels, **pulse} if k == at else levels
            write(np.array([now[name] for name in names]))
            read(row)
            fmu.step(request.time + k * request.step, request.step)
    return responses.T
