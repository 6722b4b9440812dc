"""Simulation over a whole record without a C compiler: CasADi interprets the laws.

The integrators are in Python, with the operations of ``fmi/record.c`` in the same order, at a
hundredth of its speed.
"""

from __future__ import annotations

import math
from threading import Lock

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError
from fmus.kit.integrate import MAX_STEPS, MIN_STEP, ROUNDING, SAME_INSTANT
from fmus.kit.record.buffered_function import BufferedFunction
from fmus.kit.record.exponential import ExponentialIntegrator
from fmus.kit.record.linearisation import Ladder
from fmus.kit.symbolic import Graph


class _ExhaustedError(UserError):
    """More internal steps are needed than one communication step allows."""


class Interpreted:
    """An interpreter that simulates a graph over records.

    Parameters
    ----------
    graph : Graph
    """

    def __init__(self, graph: Graph):
        self._lock = Lock()  # all simulations use the same memory
        layout = graph.layout
        index = layout.parameter_index
        self._groups = layout.inputs, (*layout.states, *layout.discretes), layout.outputs
        self._x_starts = [index[layout.start_of[state.name]] for state in layout.states]
        self._z_starts = [index[layout.start_of[discrete.name]] for discrete in layout.discretes]
        self._nominal = np.array([state.nominal for state in layout.states])
        clocks = [clock for clock, _ in layout.sampled]
        # seconds, or the index of a parameter
        self._periods: list[int | float] = [
            index[c.period] if isinstance(c.period, str) else float(c.period) for c in clocks
        ]
        self._shifts = [[index[name] for name in clock.shift] for clock in clocks]
        # memory that the functions read: time, parameters, inputs, states, discrete states
        self._now = np.zeros(1)
        self._parameters = np.zeros(len(layout.parameters))
        self._inputs = np.zeros(len(layout.inputs))
        self._x = np.zeros(len(layout.states))
        self._z = np.zeros(len(layout.discretes))
        arguments = [self._now, self._parameters, self._inputs, self._x, self._z]
        rates, outputs, *updates = graph.functions(tangent=False)
        self._rates = BufferedFunction(rates, arguments)
        self._outputs = BufferedFunction(outputs, arguments)
        self._updates = [BufferedFunction(update, arguments) for update in updates]

    def simulate(
        self,
        time: Array,
        table: Array,
        linear: Array,
        parameters: Array,
        *,
        tolerance: float,
        effort: float,
        ladder: Ladder | None = None,
    ) -> tuple[Array, Array, float]:
        """Simulate the graph over a record of n samples.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds, increasing.
        table : ndarray, shape (n, inputs)
            Inputs, SI.
        linear : ndarray, shape (inputs,)
            1 for an input that is interpolated between samples, 0 for one that is constant.
        parameters : ndarray, shape (parameters,)
            SI.
        tolerance : float
            Accuracy of an internal step.
        effort : float
            Largest mean number of internal steps per sample.
        ladder : Ladder, optional
            Matrix functions of a component that is stiff over the record.

        Returns
        -------
        outputs : ndarray, shape (n, outputs)
        states : ndarray, shape (n, states)
            Continuous states, then discrete states.
        steps : float
            Number of internal steps.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        with self._lock:
            self._start(time, parameters, tolerance, ladder)
            return self._run(time, table, linear, effort)

    def _start(
        self, time: Array, parameters: Array, tolerance: float, ladder: Ladder | None
    ) -> None:
        """Set parameters, states, clocks and integrators to the start of a record."""
        self._parameters[:] = parameters
        self._x[:] = parameters[self._x_starts]
        self._z[:] = parameters[self._z_starts]
        self._sample_periods = [
            float(parameters[p]) if isinstance(p, int) else p for p in self._periods
        ]
        self._sample_counts = [0] * len(self._periods)
        self._start_time = float(time[0])
        self._first_samples = [
            self._start_time + float(parameters[shift].sum()) for shift in self._shifts
        ]
        self._tolerance = tolerance
        self._hint = math.inf
        self._exponential = None
        if ladder is not None:
            self._exponential = ExponentialIntegrator(
                ladder, self._rate, self._nominal, tolerance, self._start_time
            )

    def _run(
        self, time: Array, table: Array, linear: Array, effort: float
    ) -> tuple[Array, Array, float]:
        """Advance from sample to sample; return outputs, states, and number of internal steps."""
        allowed = effort * len(time)
        steps = 0
        outputs = np.empty((len(time), self._outputs.result.size))
        states = np.empty((len(time), self._x.size + self._z.size))
        for k, now in enumerate(time.tolist()):
            self._now[0] = now
            self._inputs[:] = table[k]
            outputs[k] = self._outputs()
            states[k] = np.concatenate([self._x, self._z])
            self._check(states[k], now)
            if k + 1 == len(time):
                break
            h = self._start_interval(time[k : k + 2], table[k : k + 2], linear)
            limit = int(min(MAX_STEPS, allowed - steps))
            try:
                steps += self._advance(now, now + h, limit)
            except _ExhaustedError:
                if limit == MAX_STEPS:
                    raise
                raise UserError(
                    f"more than {effort:g} internal steps per sample up to {time[k + 1]:.10g} s:"
                    " with these parameters a time constant is that much shorter than the time"
                    " between samples"
                ) from None
        return outputs, states, float(steps)

    def _start_interval(self, times: Array, table: Array, linear: Array) -> float:
        """Set the inputs between two samples, and return the length of the interval, s."""
        now, end = times.tolist()
        h: float = end - now
        if not 0.0 < h < math.inf:
            raise UserError(f"times must increase, but {end:.10g} s follows {now:.10g} s")
        self._last_inputs = table[0]
        self._last_time = now
        self._slope = None
        if linear.any():
            self._slope = np.where(linear, table[1] - table[0], 0.0) / h
        return h

    def _check(self, states: Array, now: float) -> None:
        """Raise an error unless inputs, states and outputs are finite."""
        for values, group in zip(
            (self._inputs, states, self._outputs.result), self._groups, strict=True
        ):
            if not np.isfinite(values).all():
                name = group[int(np.argmin(np.isfinite(values)))].name
                raise UserError(f"'{name}' is not a finite number at t = {now:.10g} s")

    def _advance(self, now: float, end: float, limit: int) -> int:
        """Advance to the next sample of the record; return the number of internal steps.

        Raises
        ------
        _ExhaustedError
            If there are more steps than `limit`.
        """
        self._budget = limit
        while now < end:
            target = end
            for i, period in enumerate(self._sample_periods):
                slack = SAME_INSTANT * period + ROUNDING * abs(end)
                if self._first_samples[i] + self._sample_counts[i] * period <= now + slack:
                    self._set_time(now)
                    self._z[:] = self._updates[i]()
                    self._sample_counts[i] += 1
                instant = self._first_samples[i] + self._sample_counts[i] * period
                if instant < end - slack:
                    target = min(target, instant)
            target = max(target, now)
            if target > now and self._x.size:
                self._integrate(now, target)
            else:
                self._count_step(now)
            now = target
        return limit - self._budget

    def _set_time(self, now: float) -> None:
        """Set the time, and interpolate inputs at this time."""
        self._now[0] = now
        if self._slope is not None:
            self._inputs[:] = self._last_inputs + (now - self._last_time) * self._slope

    def _rate(self, now: float, states: Array) -> Array:
        """Return the time derivatives of the states."""
        self._set_time(now)
        self._x[:] = states
        return self._rates().copy()

    def _integrate(self, now: float, target: float) -> None:
        """Integrate the states from one time to another.

        Exponential steps are used while they cost less than those of the Runge-Kutta method.
        """
        while self._exponential is not None and now < target:
            result = self._exponential.step(now, target, self._x.copy(), self._slope is not None)
            if result is None:
                break
            self._count_step(now)
            now, self._x[:] = result
        self._integrate_by_runge_kutta(now, target)

    def _integrate_by_runge_kutta(self, now: float, target: float) -> None:
        """Integrate by the Runge-Kutta method of ``fmi/integrate.c``."""
        while now < target:
            self._count_step(now)
            remaining = target - now
            h = self._hint if self._hint <= 0.999 * remaining else remaining
            x = self._x.copy()
            with np.errstate(all="ignore"):  # a trial step that overflows is rejected
                error = self._try_step(now, h, x)
            next_step = h * _step_factor(error)
            if error <= 1.0:
                now += h
                if self._hint < math.inf:
                    self._hint = max(self._hint, next_step) if h == remaining else next_step
                if h == remaining:
                    return
                continue
            self._x[:] = x
            if h < MIN_STEP * max(1.0, abs(now)):
                raise UserError(f"accuracy {self._tolerance:g} cannot be reached at {now:.10g} s")
            self._hint = next_step

    def _count_step(self, now: float) -> None:
        """Count an internal step; raise an error if there were too many since the last sample."""
        self._budget -= 1
        if self._budget < 0:
            raise _ExhaustedError(
                f"more than {MAX_STEPS} internal steps in one communication step at {now:.10g} s"
            )

    def _try_step(self, now: float, h: float, x: Array) -> float:
        """Set the states to the end of a step, and return its error relative to the tolerance.

        The method, its error estimate included, is that of `fmus.kit.integrate`.
        """
        k1 = self._rate(now, x)
        k2 = self._rate(now + 0.5 * h, x + 0.5 * h * k1)
        k3 = self._rate(now + 0.5 * h, x + 0.5 * h * k2)
        k4 = self._rate(now + h, x + h * k3)
        k5 = self._rate(now + 0.75 * h, x + h / 32.0 * (5.0 * k1 + 7.0 * k2 + 13.0 * k3 - k4))
        self._x[:] = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        estimate = k1 - 3.0 * (k2 + k3 + k4) + 8.0 * k5
        error = np.abs(h / 7.5 / self._tolerance * estimate) + np.abs(
            h / math.sqrt(self._tolerance) * (k2 - k3)
        )
        error /= self._nominal + np.abs(x)
        finite = np.isfinite(error).all() and np.isfinite(self._x).all()
        return float(error.max()) if finite else math.inf


def _step_factor(error: float) -> float:
    """Return the ratio of the next step to the last one for an error relative to the tolerance."""
    if error == 0.0:
        return 5.0
    return min(max(0.9 / error**0.25, 0.2), 5.0) if error < math.inf else 0.1
