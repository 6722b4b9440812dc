"""The integrator of a component in Python: adaptive Runge-Kutta 4(3) with exact sample instants.

The method, its error estimate and the step control are those of ``fmi/integrate.c``, with the same
operations in the same order, so that both round alike; ``docs/decisions`` has the reasons for this
method. It works on floats and on NumPy arrays (a batch shares one internal step).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from .component import Component
from .errors import UserError
from .layout import Clock
from .sharing import has_shared_laws

_MIN_STEP = 1e-14
MAX_STEPS = 1_000_000
# Times closer than these are the same instant: hosts round times, and at late times the rounding is
# more than a small part of the period.
SAME_INSTANT = 1e-9  # relative to the period
ROUNDING = 1e-15  # relative to the time


def _step_source(names: list[str], batch: bool, shares: bool) -> str:
    """Write the source of a function that tries one step, unrolled over the states.

    A loop would make a Python FMU three times as slow. The function returns the error relative to
    the tolerance, or infinity if it is not finite; if it is above 1 the states are restored. Where
    C computes infinity, Python may raise (``1e200**2``, ``1 / 0``); the error then is infinity.

    In that source, a, b, c, d and q are the rates at the five stages, p = b + c, x the states at
    the beginning, r the functions of the rates, n the nominal values and e the errors.

    Parameters
    ----------
    names : list of str
        Names of the states.
    batch : bool
        Whether states are arrays, whose elements share one internal step.
    shares : bool
        Whether there are shared laws, whose values are kept within a stage.
    """
    new_stage = "m._kept = {}; " if shares else ""
    n = range(len(names))

    def each(pattern: str, separator: str = "; ") -> str:
        return separator.join(pattern.format(i=i, s=names[i]) for i in n)

    stages = [
        ("b", "t + 0.5 * h", "x{i} + g * a{i}"),
        ("c", "t + 0.5 * h", "x{i} + g * b{i}"),
        ("d", "t + h", "x{i} + h * c{i}"),
    ]
    lines = [
        "def step(m, t, h, tolerance, nominal, rates):",
        f"    {each('r{i}', ', ')}, = rates",
        f"    {each('n{i}', ', ')}, = nominal",
        "    " + each("x{i} = m.{s}"),
    ]
    body = [
        f"    {new_stage}m.time = t; " + each("a{i} = r{i}()"),
        "    g = 0.5 * h",
    ]
    for letter, time, state in stages:
        body += [
            f"    {new_stage}m.time = {time}; " + each("m.{s} = " + state),
            "    " + each(letter + "{i} = r{i}()"),
        ]
    worst = "max({})" if len(names) > 1 else "{}"
    body += [
        f"    {new_stage}g = h / 32.0; m.time = t + 0.75 * h",
        "    " + each("m.{s} = x{i} + g * (5.0 * a{i} + 7.0 * b{i} + 13.0 * c{i} - d{i})"),
        "    " + each("q{i} = r{i}()"),
        "    g = h / 6.0; w = h / sqrt(tolerance)",
        "    " + each("p{i} = b{i} + c{i}; m.{s} = x{i} + g * (a{i} + 2.0 * p{i} + d{i})"),
        # Zonneveld's estimate, with 2/3 of h, vanishes for a decay if the step is one time
        # constant; b - c does not. A fifth of it is compared with the tolerance (decision 3).
        "    g = h / 7.5 / tolerance",
        "    "
        + each(
            "e{i} = (abs(g * (a{i} - 3.0 * (p{i} + d{i}) + 8.0 * q{i})) + abs(w * (b{i} - c{i}))) /"
            " (n{i} + abs(x{i}))"
        ),
        *(["    " + each("e{i} = float(e{i}.max())")] if batch else []),
        # max() ignores a NaN that is not its first argument
        f"    error = {worst.format(each('e{i}', ', '))} if {each('e{i}', ' + ')} < inf else inf",
        "    if error > 1.0: " + each("m.{s} = x{i}"),
        "    return error",
    ]
    lines += ["    try:", *("    " + line for line in body)]
    lines += ["    except ArithmeticError: " + each("m.{s} = x{i}") + "; return inf"]
    lines += ["    finally: m._kept = None"] if shares else []
    return "\n".join(lines)


@lru_cache(maxsize=64)
def _trial_step(cls: type[Component], batch: bool) -> Callable[..., float] | None:
    """Compile the function that tries one step of a component; None if it has no states.

    See `_step_source`. Each class has its own function, because CPython specialises code for types.
    """
    names = [state.name for state in cls.layout.states]
    if not names:
        return None
    namespace: dict[str, Any] = {"inf": math.inf, "sqrt": math.sqrt}
    exec(_step_source(names, batch, has_shared_laws(cls)), namespace)
    step: Callable[..., float] = namespace["step"]
    if batch:  # a step that overflows is rejected, so that NumPy need not warn
        step = sys.modules["numpy"].errstate(all="ignore")(step)
    return step


class Integrator:
    """The integrator of one component instance, which advances it in time.

    Parameters
    ----------
    component : Component
        Its attributes are floats or arrays of one shape.
    batch : bool
        Whether the attributes are NumPy arrays.

    Attributes
    ----------
    hint : float
        Next internal step to try, s; infinity tries the whole communication step first.
    counters : list of float
        Number of samples taken in each group of discrete states.
    start_time : float
        Start time of the simulation, s, from which shifts of clocks count.
    tolerance : float
        Accuracy of an internal step; by default that of the component.
    """

    def __init__(self, component: Component, batch: bool = False):
        layout = component.layout
        self.component = component
        self.names = [state.name for state in layout.states]
        self.nominal = [state.nominal for state in layout.states]
        self.rates = component.laws([state.rate for state in layout.states])
        self.groups = [
            (clock, [d.name for d in members], component.laws([d.update for d in members]))
            for clock, members in layout.sampled
        ]
        self.hint = math.inf
        self.counters = [0.0] * len(self.groups)
        self.start_time = 0.0
        self.tolerance = component.tolerance
        self._budget = MAX_STEPS
        cls: Any = type(component)
        self._step = _trial_step(cls, batch)

    def advance(self, time: float, step: float) -> None:
        """Advance the component from ``time`` to ``time + step``.

        A sample instant at ``time`` is taken first; one at ``time + step`` belongs to the next
        call, unless the step is 0 s.

        Parameters
        ----------
        time, step : float
            Seconds; ``step`` is not negative.

        Raises
        ------
        UserError
            If a state becomes infinite or NaN, or the declared accuracy cannot be reached.
        """
        if not self.groups:
            self._integrate(time, time + step)
            return
        end = time + step
        self._budget = MAX_STEPS
        while True:
            target = end
            for index, group in enumerate(self.groups):
                period, shift = self._seconds(group[0])
                first = self.start_time + shift
                instant = first + self.counters[index] * period
                slack = SAME_INSTANT * period + ROUNDING * abs(end)
                if instant <= time + slack:
                    self._sample(time, index)
                    instant = first + self.counters[index] * period
                if instant < end - slack:
                    target = min(target, instant)
            target = max(target, time)
            steps = 1
            if target > time:
                steps += self._integrate(time, target)
            self._budget -= steps
            if self._budget <= 0 and target < end:
                raise self._too_many_steps(target)
            if target >= end:
                return
            time = target

    def _seconds(self, clock: Clock) -> tuple[float, float]:
        """Return the period and the shift of a clock in seconds; both may be parameters."""
        period = clock.period
        seconds = getattr(self.component, period) if isinstance(period, str) else period
        return seconds, sum(getattr(self.component, name) for name in clock.shift)

    def _sample(self, time: float, index: int) -> None:
        """Update the discrete states of one group."""
        _, names, updates = self.groups[index]
        self.component.time = time
        for name, value in zip(names, [update() for update in updates], strict=True):
            setattr(self.component, name, value)
        self.counters[index] += 1.0

    def _integrate(self, time: float, target: float) -> int:
        """Integrate from ``time`` to ``target``; return the number of steps before the last one."""
        trial = self._step
        if trial is None:
            return 0
        # local names are faster than attributes of self in this loop
        component = self.component
        tolerance = self.tolerance
        nominal = self.nominal
        rates = self.rates
        for used in range(self._budget):
            remaining = target - time
            # a step that almost reaches the target goes there, not to leave a tiny one
            h = self.hint if self.hint <= 0.999 * remaining else remaining
            error = trial(component, time, h, tolerance, nominal, rates)
            if error <= 1.0 and h == remaining and self.hint == math.inf:
                return used  # the hint stays: the next communication step too is tried as a whole
            # the error grows with the fourth power of the step; 0.9 is a margin
            if 0.0 < error < math.inf:
                next_step = h * min(max(0.9 / math.sqrt(math.sqrt(error)), 0.2), 5.0)
            else:
                next_step = h * (5.0 if error == 0.0 else 0.1)
            if error <= 1.0:
                time += h
                # a step that was shortened to end at the target must not shorten later ones
                self.hint = max(self.hint, next_step) if h == remaining else next_step
                if h == remaining:
                    return used
            elif h < _MIN_STEP * max(1.0, abs(time)):
                reason = (
                    f"accuracy {tolerance:g} cannot be reached"
                    if error < math.inf
                    else self._culprit()
                )
                raise UserError(f"{reason} at {time:.10g} s")
            else:
                self.hint = next_step
        raise self._too_many_steps(time)

    def _too_many_steps(self, time: float) -> UserError:
        """Return the error for too many internal steps in one communication step."""
        return UserError(
            f"more than {MAX_STEPS} internal steps in one communication step at {time:.10g} s: with"
            " these parameters a time constant is far too short for a step so long"
        )

    def _culprit(self) -> str:
        """Return a message with the state that stops the integration.

        It is the first state whose rate is not finite, or else the one that changes fastest.
        """
        culprit = self.names[0]
        fastest = -1.0
        for name, nominal, rate in zip(self.names, self.nominal, self.rates, strict=True):
            try:
                speed = abs(rate()) / (nominal + abs(getattr(self.component, name)))
            except ArithmeticError as error:
                return f"not finite: {name} ({error})"
            largest = float(speed.max()) if hasattr(speed, "max") else speed
            if not largest < math.inf:
                return f"not finite: {name}"
            if largest > fastest:
                culprit = name
                fastest = largest
        return f"not finite: {culprit}"
