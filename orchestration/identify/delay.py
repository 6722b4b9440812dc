"""Transport delays of measured outputs, exactly: the model without them, looked at as much earlier.

A component bears a delay in a shift register, because an FMU knows the past in no other way; over a whole record the
past is there. What differs is that the register rounds the curvature within one of its periods, and that its dozens of
discrete states, each with derivatives, cost many times the model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect, stack
from fmus.kit.record.compiled import CompiledModel, Trajectory
from fmus.kit.record.smooth_inputs import with_knots
from fmus.kit.sensors import transport_delay

Array = NDArray[np.float64]
_NEAR = 1e-3  # of a sample, for the slope of what is looked back at


class DelayedModel:
    """A compiled component whose measurements may be delayed; a delay counts as the outermost of the effects.

    Parameters
    ----------
    cls : type[Component]
    sensitivities : sequence of str
        Parameters with respect to which derivatives are wanted.
    linear : bool or collection of str
        Inputs that are smooth, all or those named (`smooth_inputs`); others are held until the next sample.

    Attributes
    ----------
    layout : Layout
        Of the component, the registers included.
    delays : dict of str to str
        Names of the delays by output.
    """

    def __init__(
        self,
        cls: type[Component],
        sensitivities: Sequence[str],
        linear: bool | Collection[str] = False,
    ):
        base, effects = vars(cls).get("stacked", (cls, ()))
        delays = [e for e in effects if getattr(e, "made_by", None) is transport_delay]
        others = [e for e in effects if e not in delays]
        self.layout, self._linear = cls.layout, linear
        self.delays = {effect.output: effect.neutral for effect in delays}
        self._histories = {
            e.output: {e.layout.start_of[s.name]: s.name for s in e.layout.states} for e in delays
        }
        own = {p.name for effect in delays for p in effect.layout.parameters}
        self._model = _compiled(
            base, tuple(others), tuple(n for n in sensitivities if n not in own)
        )
        self._known = {p.name for p in self._model.layout.parameters}
        self._names = list(sensitivities)

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float = 1e6,
    ) -> Trajectory:
        """Simulate, as `CompiledModel.run`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        inputs : Mapping of str to ndarray, shape (n,)
            SI.
        parameters : Mapping of str to float
            SI.
        effort : float
            Internal steps per sample, beyond which the model has become too stiff.

        Returns
        -------
        Trajectory

        Raises
        ------
        UserError
            If the simulation fails.
        """
        given = {name: value for name, value in parameters.items() if name in self._known}
        clock, fed, samples = with_knots(time, inputs, self._linear)
        if not self.delays:
            ran = self._model.run(clock, fed, given, self._linear, effort)
            return ran if samples == slice(None) else _picked(ran, samples)
        delays = {output: parameters[name] for output, name in self.delays.items()}
        late = {output: delay for output, delay in delays.items() if delay > 0.0}
        instants_of = {output: _delayed_instants(time, delay) for output, delay in late.items()}
        instants, back = np.unique(
            np.concatenate([time, *(x for pair in instants_of.values() for x in pair), clock]),
            return_inverse=True,
        )
        held = np.searchsorted(clock, instants, "right") - 1
        full = {n: np.broadcast_to(np.asarray(v, dtype=float), len(clock)) for n, v in fed.items()}
        moving = full if self._linear is True else self._linear or ()
        fed = {
            n: np.interp(instants, clock, v) if n in moving else v[held] for n, v in full.items()
        }
        ran = self._model.run(instants, fed, given, self._linear, effort)
        places = iter(np.split(back[: -len(clock)], 1 + 2 * len(instants_of)))
        now = next(places)
        signals = {name: values[now] for name, values in ran.signals.items()}
        slopes = {name: values[now] for name, values in ran.sensitivities.items()}
        of_delays: dict[str, dict[str, Array]] = {output: {} for output in delays}
        for output, (then, near) in instants_of.items():
            at, beside = next(places), next(places)
            signals[output], slopes[output] = ran.signals[output][at], ran.sensitivities[output][at]
            apart = np.where(near == then, 1.0, near - then)
            of_delays[output][self.delays[output]] = (
                -(ran.signals[output][beside] - signals[output]) / apart
            )
            before = time - late[output] < time[0]
            for name, line in zip(
                self._histories[output], (before * 1.0, before * (time - time[0])), strict=True
            ):
                signals[output] = signals[output] + parameters.get(name, 0.0) * line
                of_delays[output][name] = line
        for (level, state), (slope, rate) in (
            history.items() for history in self._histories.values()
        ):
            signals[rate] = np.full(len(time), parameters.get(slope, 0.0))
            signals[state] = parameters.get(level, 0.0) + signals[rate] * (time - time[0])
        return Trajectory(
            signals,
            {n: self._complete(values, of_delays.get(n, {})) for n, values in slopes.items()},
        )

    def _complete(self, slopes: Array, of_delay: Mapping[str, Array]) -> Array:
        """Put the derivatives by what a delay of the signal brings among the others."""
        columns, others = [], iter(slopes.T)
        for name in self._names:
            if name in self._known:
                columns.append(next(others))
            else:
                columns.append(of_delay.get(name, np.zeros(len(slopes))))
        return np.column_stack(columns) if columns else slopes


def _picked(ran: Trajectory, at: slice) -> Trajectory:
    """Some of the instants of a simulation."""
    parts = (
        {name: values[at] for name, values in group.items()}
        for group in (ran.signals, ran.sensitivities)
    )
    return Trajectory(*parts)


@lru_cache(maxsize=64)
def _compiled(
    base: type[Component], effects: tuple[type[Effect], ...], names: tuple[str, ...]
) -> CompiledModel:
    """A model once for all fits of it: to trace one with many parameters takes seconds."""
    return CompiledModel(stack(base, *effects) if effects else base, names)


def _delayed_instants(time: Array, delay: float) -> tuple[Array, Array]:
    """Return the instants that a delayed output is of, and others close by in the same stretch of held inputs."""
    then = np.maximum(time - delay, time[0])
    near = _NEAR * float(np.median(np.diff(time)))
    following = time[np.minimum(np.searchsorted(time, then, "right"), len(time) - 1)]
    beside = np.where(following - then > near, then + near, then - near)
    return then, np.where(time - delay < time[0], then, beside)
