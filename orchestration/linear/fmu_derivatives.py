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
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import Any, NamedTuple

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

    def run(self, at: int, steps: Sequence[float] | Array, name: str, size: float) -> Array:
        """Simulate to the operating point and beyond, with inputs that are constant from there.

        Parameters
        ----------
        at : int
            Communication point of a pulse on an input, 0 for the operating point.
        steps : array_like, shape (m,)
            Communication points after the operating point, s from there.
        name : str
            Input with the pulse.
        size : float
            What is added to it for a step.

        Returns
        -------
        ndarray, shape (outputs, m + 1)
            From the operating point on.
        """
        now = self.points.size - 1
        time = np.append(self.points, self.points[-1] + np.array(steps))
        inputs = {}
        for driven, values in self.driven.items():
            inputs[driven] = np.append(values, np.full(len(steps), values[-1]))
        if size:
            inputs[name][now + at] += size
        # a pulse at the start time comes after the initialization, which may look at inputs
        settings = {**self.settings, **self.levels} if now == 0 else self.settings
        with source_of(self.model).open() as runs:
            return runs.run(time, inputs, settings, self.outputs)[now:].T

    @property
    def levels(self) -> dict[str, float]:
        """Inputs at the operating point."""
        return {name: float(values[-1]) for name, values in self.driven.items()}

    def named(self, names: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
        """Return values by the names that variables have in the system."""
        return {f"{self.prefix}{n}": value for n, value in zip(names, values, strict=True)}

    def point(
        self, outputs: Array, states: dict[str, float], rates: dict[str, float]
    ) -> OperatingPoint:
        """Return the operating point."""
        inputs = self.named(self.levels, self.levels.values())
        shown = self.named(self.outputs, outputs.tolist())
        return OperatingPoint(float(self.points[-1]), {}, inputs, states, {}, shown, rates)

    def slopes(
        self, levels: Mapping[str, float], values: Callable[[str, float], Array]
    ) -> dict[str, _Slope]:
        """Return slopes by variables at their levels.

        Parameters
        ----------
        levels : Mapping of str to float
        values : callable
            Takes a variable and its deviation, and returns an array, shape (rows, n).
        """
        nominal = source_of(self.model).nominal
        return {
            name: _slope(partial(values, name), max(abs(level), nominal.get(name, 1.0)) * _SIZES)
            for name, level in levels.items()
        }

    def method(self, way: str, found: Mapping[str, _Slope]) -> str:
        """Return in words how slopes were found, with sizes of differences and their error."""
        units = units_of(self.model)
        sizes = [
            f"{self.prefix}{name} ±{with_unit(f'{one.size:.1g}', units.get(name))}"
            for name, one in found.items()
        ]
        error = max(one.error for one in found.values())
        return f"{way} ({listed(sizes)}; a tenth changes slopes by {100.0 * error:.1g} %)"


class LinearPart(NamedTuple):
    """A model that is linearised about an operating point, alone or as a member of a system.

    Attributes
    ----------
    blocks : LinearBlocks
    point : OperatingPoint
    method : str
        Origin of the derivatives, with the sizes of differences.
    notes : tuple of str
        Remarks for the user.
    is_held : bool
        Whether it is known only for inputs that are held over the communication step.
    """

    blocks: LinearBlocks
    point: OperatingPoint
    method: str
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
    with ExchangeFmu(model.path, request.settings, tolerance=model.tolerance) as fmu:
        fmu.start(0.0, inputs={name: float(v[0]) for name, v in request.driven.items()})
        states = fmu.get_states()
        if request.points.size > 1:
            states = replace(request, outputs=fmu.states).run(0, (), "", 0.0).ravel().tolist()
        fmu.enter_continuous_time(float(request.points[-1]), states)
        if fmu.samples:
            return None
        laws = _laws(fmu, request)
        centre = dict(zip(fmu.states, states, strict=True))
        rates, outputs = np.split(laws(centre), [len(states)])
        point = request.point(
            outputs, request.named(centre, states), request.named(centre, rates.tolist())
        )
        centre |= {name: request.levels[name] for name in request.inputs}
        if directional:
            jacobian = fmu.directional_derivatives([*fmu.rates, *request.outputs], [*centre])
            method = _DIRECTIONAL
        else:
            found = request.slopes(
                centre, lambda name, size: laws({**centre, name: centre[name] + size})[:, None]
            )
            method = request.method(_DIFFERENCES, found)
            jacobian = np.column_stack([one.slope for one in found.values()])
        return LinearPart(_blocks(request, fmu.states, jacobian), point, method)


def _laws(fmu: ExchangeFmu, request: FmuRequest) -> Callable[[Mapping[str, float]], Array]:
    """Return the function of states, and perhaps inputs, that evaluates rates and outputs."""
    levels = request.levels
    write = fmu.writer([*levels])
    read = fmu.reader(request.outputs)

    def laws(point: Mapping[str, float]) -> Array:
        fmu.set_states([point[name] for name in fmu.states])
        write(np.array([point.get(name, level) for name, level in levels.items()]))
        outputs = np.empty(len(request.outputs))
        read(outputs)
        return np.concatenate([fmu.get_rates(), outputs])

    return laws


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
    own, inputs, shown = (
        tuple(f"{request.prefix}{name}" for name in names)
        for names in (states, request.inputs, request.outputs)
    )
    columns = (*own, *inputs)
    laws, outputs = np.split(matrix, [len(own)])
    signals = dict(zip(shown, outputs, strict=True))
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
    steps = np.multiply(request.step, np.arange(1, _RESPONSE), dtype=float)
    levels = {name: request.levels[name] for name in request.inputs}
    found = request.slopes(levels, partial(request.run, 0, steps))
    responses = np.stack([one.slope for one in found.values()], axis=1)
    # the response to a later pulse is the same one, later, if the model does not change with time
    delayed = _responses(request, found, 1, steps)
    largest = np.abs(responses).max(axis=(1, 2))  # of each output
    scale = np.where(largest == 0.0, 1.0, largest)[:, None]
    change = np.abs(delayed[:, :, 1:] - responses[:, :, :-1]) / scale[:, :, None]
    noise = max(_NOISE, *(one.error for one in found.values()))
    order, matrix, error = _realisation(responses / scale[:, :, None], noise)
    matrix[order:] *= scale
    if max(error, change.max(initial=0.0)) > _FAITHFUL:
        raise UserError(
            f"{request.model.name}: its responses are not those of a linear model of up to"
            f" {_MOST_ORDER} states that is the same at every step of {request.step:g} s; if"
            f" it samples, take a multiple of its sample period as {option('step')}"
        )
    stem = "x"
    while f"{stem}1" in (*request.inputs, *request.outputs):
        stem += "x"
    states = [f"{stem}{k + 1}" for k in range(order)]
    at_rest = request.run(0, steps, "", 0.0)
    return LinearPart(
        _blocks(request, states, matrix, request.step),
        request.point(at_rest[:, 0], {}, {}),
        request.method(_PULSES, found),
        _notes(request, at_rest),
        not (order and _answers_at_once(request, found, responses)),
    )


def _responses(request: FmuRequest, found: Mapping[str, _Slope], at: int, steps: Array) -> Array:
    """Return responses to unit pulses, shape (outputs, inputs, steps), of sizes that are found."""
    ways = {name: partial(request.run, at, steps, name) for name in found}
    return np.stack([_difference(ways[n], one.size) for n, one in found.items()], axis=1)


def _answers_at_once(request: FmuRequest, found: Mapping[str, _Slope], responses: Array) -> bool:
    """Return whether outputs step after an input at a communication point, and then stay.

    So does a sampler, such as a controller. An FMU that refuses a short step cannot be asked.
    """
    try:
        soon = _responses(request, found, 0, np.array([_SOON * request.step]))
    except UserError:
        return False
    change = np.abs(soon[:, :, 1] - responses[:, :, 1]) + np.abs(responses[:, :, 0])
    return bool((change <= _FAITHFUL * np.abs(responses).max(axis=2)).all())


def _realisation(responses: Array, noise: float) -> tuple[int, Array, float]:
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
    order : int
    matrix : ndarray, shape (order + outputs, order + inputs)
        A, B, C and D.
    error : float
    """
    with optional():
        import control

    rows = (responses.shape[2] - 1) // 2
    _, sizes = control.eigensys_realization(responses, 0, rows, rows, dt=True)
    relative = sizes / (sizes[0] or 1.0)
    order = min(int((relative > noise).sum()), _MOST_ORDER)
    found, _ = control.eigensys_realization(responses, order, rows, rows, dt=True)
    matrix = np.block([[found.A, found.B], [found.C, found.D]])
    return order, matrix, float(relative[order:].max(initial=0.0))


def _notes(request: FmuRequest, at_rest: Array) -> tuple[str, ...]:
    """Return a note on outputs, shape (outputs, steps), that move at constant inputs."""
    rates = request.named(request.outputs, (at_rest[:, 1] - at_rest[:, 0]).tolist())
    is_moving = np.ptp(at_rest, axis=1) > _AT_REST * np.abs(at_rest).max(axis=1)
    moving = {n: rate / request.step for n, rate in compress(rates.items(), is_moving)}
    units = units_of(request.model)
    return not_at_rest(moving, request.named(units, units.values()))
