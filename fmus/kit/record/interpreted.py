"""Running a whole record without a C compiler: the laws in CasADi's virtual machine, the integrators in Python.

The same operations in the same order as ``fmi2/record.c``, at a hundredth of its speed.
"""

from __future__ import annotations

import math
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.integrate import MAX_STEPS, MIN_STEP, ROUNDING, SAME_INSTANT
from fmus.kit.record.exponential import ExponentialIntegrator
from fmus.kit.record.linearisation import Ladder
from fmus.kit.symbolic.trace import Graph

Array = NDArray[np.float64]


class _Law:
    """A CasADi function whose arguments and result are the same arrays in every call."""

    def __init__(self, function: ca.Function, arguments: list[Array], size: int):
        self.result = np.zeros(size)
        buffer: Any  # CasADi's stubs want a size beside the memoryview, which has one
        buffer, self._call = function.buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, self.result.data)
        self._kept = function, buffer, arguments  # the call borrows their memory

    def __call__(self) -> Array:
        self._call()
        return self.result


class Interpreted:
    """A graph, ready to be run over records.

    Parameters
    ----------
    graph : Graph
    """

    def __init__(self, graph: Graph):
        self._lock = Lock()  # all simulations have the same memory
        layout = graph.layout
        index = {p.name: i for i, p in enumerate(layout.parameters)}
        self._groups = layout.inputs, (*layout.states, *layout.discretes), layout.outputs
        self._starts = [
            [index[layout.start_of[v.name]] for v in group]
            for group in (layout.states, layout.discretes)
        ]
        self._nominal = np.array([state.nominal for state in layout.states])
        self._periods = [index[p] if isinstance(p, str) else float(p) for p, _ in layout.sampled]
        sizes = (
            len(layout.parameters),
            len(layout.inputs),
            len(layout.states),
            len(layout.discretes),
        )
        self._parameters, self._fed, self._x, self._z = (np.zeros(size) for size in sizes)
        self._now = np.zeros(1)
        arguments = [self._now, self._parameters, self._fed, self._x, self._z]
        rates, outputs, *updates = graph.functions(tangent=False)[:-1]
        self._rates = _Law(rates, arguments, sizes[2])
        self._outputs = _Law(outputs, arguments, len(layout.outputs))
        self._updates = [_Law(update, arguments, sizes[3]) for update in updates]

    def simulate(
        self,
        time: Array,
        table: Array,
        linear: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        ladder: Ladder | None = None,
    ) -> tuple[Array, Array]:
        """Run over a record.

        Parameters
        ----------
        time : ndarray, shape (n,)
        table : ndarray, shape (n, inputs)
        linear : ndarray, shape (inputs,)
            1 for an input that is interpolated between samples, 0 for one that is held.
        parameters : ndarray
        tolerance, effort : float
            Accuracy of an internal step, and how many there may be for each sample.
        ladder : Ladder, optional
            Of a component that is stiff over the record.

        Returns
        -------
        outputs, states : ndarray
            Row by row; the states are followed by the discrete ones.

        Raises
        ------
        UserError
            If the simulation fails.
        """
        with self._lock:
            return self._simulated(time, table, linear, parameters, tolerance, effort, ladder)

    def _simulated(
        self,
        time: Array,
        table: Array,
        linear: Array,
        parameters: Array,
        tolerance: float,
        effort: float,
        ladder: Ladder | None,
    ) -> tuple[Array, Array]:
        self._parameters[:], self._tolerance, self._hint, budget = (
            parameters,
            tolerance,
            math.inf,
            effort * len(time),
        )
        self._x[:], self._z[:] = (parameters[where] for where in self._starts)
        self._exponential = (
            None
            if ladder is None
            else ExponentialIntegrator(ladder, self._rate, self._nominal, tolerance, float(time[0]))
        )
        periods = [float(parameters[p]) if isinstance(p, int) else p for p in self._periods]
        counters = [0] * len(periods)
        outputs = np.empty((len(time), self._outputs.result.size))
        states = np.empty((len(time), self._x.size + self._z.size))
        for k, now in enumerate(time.tolist()):
            self._now[0], self._fed[:] = now, table[k]
            outputs[k], states[k] = self._outputs(), np.concatenate([self._x, self._z])
            self._check(states[k], now)
            if k + 1 == len(time):
                break
            h = float(time[k + 1]) - now
            if not 0.0 < h < math.inf:
                raise UserError(
                    f"times must increase, but {time[k + 1]:.10g} s follows {now:.10g} s"
                )
            slope = np.where(linear, table[k + 1] - table[k], 0.0) / h if linear.any() else None
            self._held, self._slope, self._since = table[k], slope, now
            budget -= self._advance(now, now + h, float(time[0]), periods, counters)
            if budget < 0.0:
                raise UserError(
                    f"more than {effort:g} internal steps per sample up to {time[k + 1]:.10g} s: with these parameters "
                    "a time constant is that much shorter than the time between samples"
                )
        return outputs, states

    def _check(self, states: Array, now: float) -> None:
        for values, group in zip(
            (self._fed, states, self._outputs.result), self._groups, strict=True
        ):
            if not np.isfinite(values).all():
                name = group[int(np.argmin(np.isfinite(values)))].name
                raise UserError(f"'{name}' is not a finite number at t = {now:.10g} s")

    def _advance(
        self, now: float, end: float, start: float, periods: list[float], counters: list[int]
    ) -> int:
        """Advance to the next sample of the record; the number of internal steps is returned."""
        spent = 0
        while now < end:
            target = end
            for i, period in enumerate(periods):
                slack = SAME_INSTANT * period + ROUNDING * abs(end)
                if start + counters[i] * period <= now + slack:
                    self._feed(now)
                    self._z[:] = self._updates[i]()
                    counters[i] += 1
                instant = start + counters[i] * period
                if instant < end - slack:
                    target = min(target, instant)
            target = max(target, now)
            spent += 1 + (self._integrate(now, target) if target > now and self._x.size else 0)
            now = target
        return spent

    def _feed(self, now: float) -> None:
        self._now[0] = now
        if self._slope is not None:
            self._fed[:] = self._held + (now - self._since) * self._slope

    def _rate(self, now: float, states: Array) -> Array:
        self._feed(now)
        self._x[:] = states
        return self._rates().copy()

    def _integrate(self, now: float, target: float) -> int:
        """Integrate from one time to another; the number of internal steps is returned, less the last one."""
        if self._exponential is None:
            return self._by_runge_kutta(now, target)
        for spent in range(MAX_STEPS):
            done = self._exponential.step(now, target, self._x.copy(), self._slope is not None)
            if done is None:
                return spent + self._by_runge_kutta(now, target)
            now, self._x[:] = done
            if now == target:
                return spent
        raise self._exhausted(now)

    def _by_runge_kutta(self, now: float, target: float) -> int:
        for spent in range(MAX_STEPS):
            remaining = target - now
            h = self._hint if self._hint <= 0.999 * remaining else remaining
            x = self._x.copy()
            with np.errstate(all="ignore"):  # a trial step that overflows is rejected
                error = self._try(now, h, x)
            following = h * (
                5.0
                if error == 0.0
                else min(max(0.9 / error**0.25, 0.2), 5.0)
                if error < math.inf
                else 0.1
            )
            if error <= 1.0:
                now += h
                if self._hint < math.inf:
                    self._hint = max(self._hint, following) if h == remaining else following
                if h == remaining:
                    return spent
                continue
            self._x[:] = x
            if h < MIN_STEP * max(1.0, abs(now)):
                raise UserError(f"accuracy {self._tolerance:g} cannot be reached at {now:.10g} s")
            self._hint = following
        raise self._exhausted(now)

    def _exhausted(self, now: float) -> UserError:
        return UserError(
            f"more than {MAX_STEPS} internal steps in one communication step at {now:.10g} s"
        )

    def _try(self, now: float, h: float, x: Array) -> float:
        """Try one step and leave the states at its end; the error returned is relative to the tolerance."""
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
        return (
            float(error.max())
            if np.isfinite(error).all() and np.isfinite(self._x).all()
            else math.inf
        )
