"""Delays of inputs and of measured outputs, exact: earlier inputs, and outputs of earlier instants.

A component has a delay as a shift register, because an FMU keeps no other past; over a whole record
the past is known. The register differs from the exact delay in the curvature within one of its
periods, and its dozens of discrete states, each with derivatives, cost many times the model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fmus.kit import Component, Effect, stack
from fmus.kit.arrays import Array, Mask
from fmus.kit.effects import made_by, unstack
from fmus.kit.inputs import input_delay
from fmus.kit.record import CompiledModel, Trajectory
from fmus.kit.sensors import transport_delay
from orchestration.identify.fitting.block_simulation import BlockwiseModel
from orchestration.identify.fitting.simulation_input import SimulationInput

_NEARBY = 1e-3  # of a sample: step of the derivative by time
_ROUNDING = 1e-6  # of a sample: between instants that are the same
_KEPT = 64  # compiled models


class DelayedModel:
    """A compiled component whose inputs and measurements may be delayed.

    A delay counts as the outermost of the effects: no other one depends on the time.

    Parameters
    ----------
    cls : type[Component]
    sensitivities : sequence of str
        Parameters by which derivatives are taken.
    measured : collection of str, optional
        Outputs and states of which a long simulation has derivatives; all unless given.

    Attributes
    ----------
    layout : Layout
        Of the component, the registers included.
    delays : dict of str to str
        Names of the delays of outputs, by output.
    """

    def __init__(
        self,
        cls: type[Component],
        sensitivities: Sequence[str],
        measured: Collection[str] | None = None,
    ):
        base, effects = unstack(cls)
        delays = [e for e in effects if made_by(e) is transport_delay]
        dead_times = [e for e in effects if made_by(e) is input_delay]
        others = tuple(e for e in effects if e not in (*delays, *dead_times))
        of_delays = {p.name for e in (*delays, *dead_times) for p in e.layout.parameters}
        self.layout = cls.layout
        self.delays = {delay.output: delay.neutral for delay in delays}
        self._histories = {delay.output: _history_of(delay) for delay in delays}
        self._dead_times = {effect.term.signal: effect.neutral for effect in dead_times}
        self._names = list(sensitivities)
        names = tuple(name for name in sensitivities if name not in of_delays)
        model = _compiled(base, others, names)
        self._undelayed = BlockwiseModel(model, measured)
        self._known = {p.name for p in model.layout.parameters}

    def run(self, given: SimulationInput) -> Trajectory:
        """Simulate like `CompiledModel.run`.

        Parameters
        ----------
        given : SimulationInput

        Returns
        -------
        Trajectory

        Raises
        ------
        UserError
            If the simulation fails.
        """
        trajectory = self._run(given)
        nearby = _NEARBY * float(np.median(np.diff(given.time)))
        for name in set(self._dead_times.values()).intersection(self._names):
            moved = {**given.parameters, name: given.parameters[name] + nearby}
            other = self._run(replace(given, parameters=moved))
            column = self._names.index(name)
            for output, slopes in trajectory.sensitivities.items():
                change = other.signals[output] - trajectory.signals[output]
                slopes[:, column] = change / nearby
        return trajectory

    def _run(self, given: SimulationInput) -> Trajectory:
        """Simulate without derivatives by delays of inputs, which are zero."""
        if not (self.delays or self._dead_times):
            return self._undelayed.run(given)
        time = given.time
        parameters = given.parameters
        pasts = {
            output: _earlier_instants(time, parameters[name])
            for output, name in self.delays.items()
            if parameters[name] > 0.0
        }
        late = {name: parameters[delay] for name, delay in self._dead_times.items()}
        # all instants that are shown, or read for a derivative, or at which an input arrives
        earlier = [instants for past in pasts.values() for instants in (past.then, past.near)]
        arrivals = [_between(time, time + delay) for delay in late.values()]
        instants = np.unique(np.concatenate([time, *earlier, *arrivals]))
        trajectory = self._undelayed.run(
            replace(
                given,
                time=instants,
                inputs=_inputs_at(given, instants, late),
                parameters={n: value for n, value in parameters.items() if n in self._known},
            )
        )
        at = {output: np.searchsorted(instants, past.then) for output, past in pasts.items()}
        now = np.searchsorted(instants, time)
        signals = {o: y[at.get(o, now)] for o, y in trajectory.signals.items()}
        slopes = {o: by[at.get(o, now)] for o, by in trajectory.sensitivities.items()}
        by_delay: dict[str, dict[str, Array]] = {}
        for output, past in pasts.items():
            near = trajectory.signals[output][np.searchsorted(instants, past.near)]
            # before the record such an output ran on a line
            line = self._line_before(output, past.before, time)
            by_delay[output] = {self.delays[output]: past.slope(signals[output], near), **line}
            for name, derivative in line.items():
                signals[output] = signals[output] + parameters.get(name, 0.0) * derivative
        return replace(
            trajectory,
            signals=signals | self._delay_states(time, parameters),
            sensitivities={
                o: self._order_slopes(by, by_delay.get(o, {})) for o, by in slopes.items()
            },
        )

    def _line_before(self, output: str, before: Mask, time: Array) -> dict[str, Array]:
        """Return the derivatives of a delayed output by level and slope of its line beforehand.

        Parameters
        ----------
        output : str
        before : ndarray of bool, shape (n,)
            Where the output is from before the record.
        time : ndarray, shape (n,)
            Seconds.
        """
        history = self._histories[output]
        return {
            history.level: before.astype(np.float64),
            history.slope: before * (time - time[0]),
        }

    def _delay_states(self, time: Array, parameters: Mapping[str, float]) -> dict[str, Array]:
        """Return the states of the delays: rate and level of the lines before the record."""
        states = {}
        for history in self._histories.values():
            rate = np.full(len(time), parameters.get(history.slope, 0.0))
            states[history.rate] = rate
            states[history.state] = parameters.get(history.level, 0.0) + rate * (time - time[0])
        return states

    def _order_slopes(self, slopes: Array, by_delay: Mapping[str, Array]) -> Array:
        """Return the derivatives by the parameters of the model and of the delays, in their order.

        Parameters
        ----------
        slopes : ndarray, shape (n, k)
            By the parameters of the model without delays.
        by_delay : Mapping of str to ndarray, shape (n,)
            By parameters of the delays; zero for a parameter that is in neither.
        """
        of_model = iter(slopes.T)
        columns = []
        for name in self._names:
            if name in self._known:
                columns.append(next(of_model))
            else:
                columns.append(by_delay.get(name, np.zeros(len(slopes))))
        return np.column_stack(columns) if columns else slopes


def _between(time: Array, instants: Array) -> Array:
    """Return the instants inside a record that are not, but for rounding, its samples."""
    inside = instants[instants < time[-1]]
    after = np.searchsorted(time, inside)
    gap = np.minimum(time[after] - inside, inside - time[np.maximum(after - 1, 0)])
    return inside[gap > _ROUNDING * float(np.median(np.diff(time)))]


def _inputs_at(
    given: SimulationInput, instants: Array, late: Mapping[str, float]
) -> dict[str, Array]:
    """Return inputs at other instants, as they go between samples and arrive late, s, by name."""
    rounding = _ROUNDING * float(np.median(np.diff(given.time)))
    at = {}
    for name, values in given.inputs.items():
        course = np.broadcast_to(np.asarray(values, dtype=float), len(given.time))
        then = instants - late.get(name, 0.0)
        latest = np.maximum(np.searchsorted(given.time, then + rounding, "right") - 1, 0)
        at[name] = np.interp(then, given.time, course) if given.linear else course[latest]
    return at


class _History(NamedTuple):
    """The line on which a delayed output ran before the record.

    Attributes
    ----------
    level, slope : str
        Parameters: its value and slope at the beginning of the record.
    state, rate : str
        States of the delay that hold both.
    """

    level: str
    slope: str
    state: str
    rate: str


def _history_of(delay: type[Effect]) -> _History:
    """Return the names by which a delay declares the line before the record."""
    state, rate = (s.name for s in delay.layout.states)
    start = delay.layout.start_of
    return _History(start[state], start[rate], state, rate)


class _EarlierInstants(NamedTuple):
    """The earlier instants that the samples of a delayed output show.

    Attributes
    ----------
    then : ndarray, shape (n,)
        Of the undelayed output; where they lie before the record, its beginning.
    near : ndarray, shape (n,)
        Others close by for the derivative by time, in the same stretch of held inputs; the same
        where the output is from before the record.
    before : ndarray of bool, shape (n,)
        True where the output is from before the record.
    """

    then: Array
    near: Array
    before: Mask

    def slope(self, at_then: Array, at_near: Array) -> Array:
        """Return the derivative (n,) of the delayed output by its delay."""
        return -(at_near - at_then) / np.where(self.near == self.then, 1.0, self.near - self.then)


def _earlier_instants(time: Array, delay: float) -> _EarlierInstants:
    """Return the earlier instants that the samples (n,) of an output show, delayed by seconds."""
    then = np.maximum(time - delay, time[0])
    step = _NEARBY * float(np.median(np.diff(time)))
    following = time[np.minimum(np.searchsorted(time, then, "right"), len(time) - 1)]
    # forward, unless an input may step before the instant close by
    near = np.where(following - then > step, then + step, then - step)
    before = time - delay < time[0]
    return _EarlierInstants(then, np.where(before, then, near), before)


@lru_cache(_KEPT)
def _compiled(
    base: type[Component], effects: tuple[type[Effect], ...], names: tuple[str, ...]
) -> CompiledModel:
    """Return a compiled model with derivatives by `names`; it is compiled once for all fits."""
    return CompiledModel(stack(base, *effects) if effects else base, names)
