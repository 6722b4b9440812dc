"""Running a system: its members step, exchange values, and what they deliver is recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from fractions import Fraction
from numbers import Real
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.isolation.box import keep
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.kernel.library import stepper
from orchestration.fmu.signal import read_signal
from orchestration.master.dependency_graph import describe
from orchestration.master.executor import Executor
from orchestration.master.initialization import enter, initialize
from orchestration.master.instances import Clock, SavedState
from orchestration.master.interrupt import Interrupt, deferred
from orchestration.master.isolated.rows import Rows
from orchestration.master.isolated.run import Recorded, run_beside
from orchestration.master.kernel.run import KernelRun
from orchestration.master.pacing import Pacer, RealTime
from orchestration.master.result import MemberStatistics, Run, Statistics, Stopped
from orchestration.master.schedule import Settings
from orchestration.master.setup import (
    check_abilities,
    disturbance_values,
    external_values,
    open_members,
    structure,
)
from orchestration.master.step_control import StepDoubling
from orchestration.master.undisturbed import undisturbed
from orchestration.system.check import check
from orchestration.system.model import Port, System

Array = NDArray[np.float64]
METHODS = ("gauss-seidel", "jacobi")


def run(
    system: System,
    time: Array,
    inputs: Mapping[str, Array] | None = None,
    disturbances: Mapping[str, Array] | None = None,
    *,
    method: str = "gauss-seidel",
    record: Sequence[str] | None = None,
    extrapolation: int = 0,
    feedthrough: bool = True,
    tolerance: float | None = None,
    rates: Mapping[str, float] | None = None,
    real_time: RealTime | None = None,
    progress: Callable[[int], None] = lambda done: None,
    isolation: Limits | None = None,
) -> Run:
    """Run a system over given communication points.

    Inputs are set at every point and held until the next. Outputs are recorded after all inputs of the point are set,
    in an order in which every value is the newest.

    Parameters
    ----------
    system : System
    time : ndarray, shape (n,)
        Communication points in s, increasing.
    inputs : Mapping of str to ndarray, shape (n,)
        By input of the system, or by ``member.variable``, in the FMU's units; what is missing keeps its start value.
    disturbances : Mapping of str to ndarray, shape (n,)
        What is added to connected inputs ``member.variable``, in their units, at every point and until the next: what
        a model of the source leaves unexplained of a record, for instance. A disturbance is of the run, not of the
        system; see :func:`orchestration.system.library.with_voltmeter`.
    method : {"gauss-seidel", "jacobi"}
        Members step one after another with the newest outputs there are, or all with those from the beginning.
    record : sequence of str, optional
        Variables ``member.variable`` to record; default every output.
    extrapolation : {0, 1}
        Connected inputs are held over a step, or change linearly.
    feedthrough : bool
        False: outputs are read at the end of every step, before any input is set. There are no algebraic loops then,
        but an output that depends on inputs is a step late. This is what FMI 2.0 asks of a master in the strict sense.
    tolerance : float, optional
        Between two points take as many steps as it takes to keep the coupling error of each below
        ``tolerance * (nominal + |value|)``; default one step.
    rates : Mapping of str to float
        Steps that a member makes for each step of the system: whole numbers, or 1/2, 1/3, ...
    real_time : RealTime, optional
        Reach no point before its time, and tell how late each one was; default as fast as possible.
    progress : callable
        Called with the number of points done, now and then.
    isolation : Limits, optional
        Of a process beside this one, in which it is run; default in this one. Not in real time.

    Returns
    -------
    Run
        After Ctrl-C what was computed, marked incomplete.

    Raises
    ------
    Stopped
        If a member fails, discards a step, delivers what is no number, or does not reach the end; if the run cannot
        keep pace with real time.
    UserError
        If the system cannot be run this way.
    """
    check(system)
    points = _points(time)
    if method not in METHODS:
        raise UserError(f"method {method!r}; there are: {', '.join(METHODS)}")
    if extrapolation not in (0, 1):
        raise UserError(
            f"extrapolation {extrapolation!r}: 0 (inputs are held) or 1 (they change linearly)"
        )
    if tolerance is not None and not (isinstance(tolerance, Real) and 0.0 < tolerance < 1.0):
        raise UserError(f"tolerance {tolerance!r}: must be a number between 0 and 1")
    if disturbances and extrapolation:
        raise UserError(
            "disturbances are held from point to point, and do not go with extrapolation 1"
        )
    if isolation is not None:
        if real_time is not None:
            raise UserError("a run in real time is made in this process: it cannot be isolated")
        options = {
            "method": method,
            "record": record,
            "extrapolation": extrapolation,
            "feedthrough": feedthrough,
            "tolerance": tolerance,
            "rates": rates,
        }
        return run_beside(
            isolation, run, system, time, inputs, disturbances, progress=progress, options=options
        )
    fractions = {
        name: _rate(system.member(name).name, value) for name, value in (rates or {}).items()
    }
    settings = Settings(
        method == "gauss-seidel", extrapolation, feedthrough, tolerance is not None, fractions
    )
    external = external_values(system, inputs or {}, len(points))
    disturbed = disturbance_values(system, disturbances or {}, len(points))
    with ExitStack() as opened:
        members = open_members(system, opened)
        check_abilities(members, points, settings)
        who_feeds_whom, recorded = structure(system, members, list(external), record, settings)
        clock = Clock()
        clock.set(points[0], points[0])
        enter(members, points[0], points[-1])
        executor = Executor(
            members, who_feeds_whom, system.connections, external, disturbed, settings, clock
        )
        opened.callback(_release, executor.saved_states)
        notes = initialize(executor)
        return _Runner(executor, points, recorded, tolerance, real_time, progress, notes).run()


class _Runner:
    """One run of an executor that is initialized."""

    def __init__(
        self,
        executor: Executor,
        points: list[float],
        recorded: list[Port],
        tolerance: float | None,
        real_time: RealTime | None,
        progress: Callable[[int], None],
        notes: Sequence[str],
    ):
        self._executor, self._points, self._recorded, self._progress = (
            executor,
            points,
            recorded,
            progress,
        )
        self._notes_before = list(notes)
        self._real_time = real_time
        self._pacer: Pacer | None = None
        self._doubling = None if tolerance is None else StepDoubling(executor, tolerance)
        self._rows = Rows()
        variables = {member.name: member.fmu.variables for member in executor.members}
        self._about = Recorded(
            list(points),
            len(executor.outputs.at),
            {str(port): executor.outputs.at[port] for port in recorded},
            {
                str(port): read_signal(variables[port.member][port.variable]).unit
                for port in recorded
            },
            {member.name: member.fmu.description.guid for member in executor.members},
        )
        keep(self._about)
        self._done = 0
        self._wall = 0.0

    def run(self) -> Run:
        """Go through all communication points."""
        begin, message, finished = perf_counter(), "", False
        try:
            with deferred() as interrupt, self._undisturbed() as disturbances:
                self._notes_before += disturbances
                self._advance(interrupt)
            if self._done == len(self._points):
                self._finish()
                finished = True
        except KeyboardInterrupt:
            pass
        except UserError as error:
            self._wall = perf_counter() - begin
            raise Stopped(str(error), self._result(str(error))) from error
        self._wall = perf_counter() - begin
        if not finished:
            reached = self._points[max(0, self._done - 1)]
            message = f"interrupted at {reached:.10g} s of {self._points[-1]:.10g} s"
        return self._result(message)

    def _undisturbed(self) -> AbstractContextManager[list[str]]:
        asked = self._real_time
        return nullcontext([]) if asked is None else undisturbed(asked.processor, asked.priority)

    def _advance(self, interrupt: Interrupt) -> None:
        executor, points, linear = (
            self._executor,
            self._points,
            self._executor.settings.extrapolation,
        )
        last, every = len(points) - 1, max(1, len(points) // 200)
        write, cells = self._rows.write, executor.outputs.cells
        step, exchange, schedule = executor.step, executor.exchange, executor.complete
        changed = executor.changes(len(points)) if linear else []
        exchange(schedule.stages, 0)
        write(cells)
        self._done = 1
        if self._all_steps_alike() and stepper() is not None:
            self._advance_in_kernel(interrupt)
            return
        if self._real_time is not None:
            self._pacer = Pacer(self._real_time, points, interrupt)
            self._pacer.begin(self._values())
        pacer = self._pacer
        for k in range(1, len(points)):
            if executor.slow:
                schedule = executor.schedule(executor.due(k, last))
            if self._doubling is not None:
                if not self._doubling.advance(points[k - 1], points[k], k - 1, interrupt):
                    break
            else:
                step(schedule, points[k - 1], points[k])
                if linear:  # slopes are of what came before a jump of the values from outside
                    exchange(schedule.stages, k - 1 if changed[k] else k)
                    executor.update_slopes(schedule)
            if not linear or changed[k] or self._doubling is not None:
                exchange(schedule.stages, k)
            write(cells)
            self._done = k + 1
            if k % every == 0:
                self._progress(k)
            if pacer is not None:
                pacer.keep(k, self._values())
            if interrupt.pressed:
                break

    def _all_steps_alike(self) -> bool:
        """Whether nothing but steps and exchanges lies between the first point and the last."""
        executor = self._executor
        plain = not executor.slow and not executor.settings.extrapolation
        return plain and self._doubling is None and self._real_time is None

    def _advance_in_kernel(self, interrupt: Interrupt) -> None:
        last, every = len(self._points) - 1, max(1, len(self._points) // 200)
        with KernelRun(self._executor, self._points, every) as kernel:
            for k in (*range(every, last, every), last):
                while not self._carried_on(kernel, k + 1) and not interrupt.pressed:
                    pass
                if self._done > k and k % every == 0:
                    self._progress(k)
                if interrupt.pressed:
                    break

    def _carried_on(self, kernel: KernelRun, until: int) -> bool:
        """Go on in the kernel, and take from it what was computed, however it ends."""
        try:
            return kernel.carry_on(until)
        finally:
            self._rows.write(kernel.taken().data)
            self._done = kernel.done

    def _values(self) -> list[float]:
        """What is recorded, as it is now."""
        outputs = self._executor.outputs
        return [outputs.cells[outputs.at[port]] for port in self._recorded]

    def _finish(self) -> None:
        """Every member must have reached the end, and end properly.

        Raises
        ------
        UserError
            If one has not, or does not.
        """
        last = self._points[-1]
        for member in self._executor.members:
            reached = member.last_time()
            if reached is not None and not abs(reached - last) <= 1e-9 * max(1.0, abs(last)):
                raise UserError(
                    f"{member.name}: says that it is at {reached:.10g} s at the end, {last:.10g} s"
                )
        for saved in self._executor.saved_states:
            saved.free()
        for member in self._executor.members:
            member.terminate(self._executor.clock)
        self._progress(len(self._points))

    def _result(self, message: str) -> Run:
        about = self._about
        table = self._rows.array(self._done, about.width)
        return Run(
            np.array(self._points[: self._done]),
            {name: table[:, place] for name, place in about.places.items()},
            about.units,
            not message,
            message,
            self._statistics(),
            about.guids,
            tuple(self._notes()),
        )

    def _statistics(self) -> Statistics:
        executor, doubling = self._executor, self._doubling
        components = {
            member.name: MemberStatistics(executor.steps_of(member), seconds, seconds / self._wall)
            for member, seconds in zip(executor.members, executor.seconds, strict=True)
        }
        steps = max(0, self._done - 1) if doubling is None else doubling.steps
        rollbacks = 0 if doubling is None else doubling.rollbacks
        evaluations = sum(fixed_point.evaluations for _, fixed_point in executor.loops)
        pacing = None if self._pacer is None else self._pacer.statistics()
        return Statistics(components, steps, rollbacks, evaluations, self._wall, pacing)

    def _notes(self) -> Iterator[str]:
        yield from self._notes_before
        evaluations: dict[str, int] = {}
        for (
            loop,
            fixed_point,
        ) in self._executor.loops:  # the same one again where members have rates of their own
            evaluations[describe(loop)] = (
                evaluations.get(describe(loop), 0) + fixed_point.evaluations
            )
        for name, count in evaluations.items():
            yield f"{name}: solved with {count} evaluations"
        for port in self._executor.complete.plan.at_step_end:
            yield (
                f"{port}: taken as it stands at the end of a step, for it closes a loop, its FMU does not say on which "
                "inputs it depends, and cannot restore its state"
            )
        for member in self._executor.members:
            if member.fmu.complaints:
                yield f"{member.name}: {member.fmu.complaints}"


def _release(saved_states: Sequence[SavedState]) -> None:
    """Release states that are still saved, after a run that did not come to its end."""
    for saved in saved_states:
        saved.release()


def _points(time: Array) -> list[float]:
    array = np.asarray(time, dtype=float)
    if (
        array.ndim != 1
        or array.size < 2
        or not np.isfinite(array).all()
        or not (np.diff(array) > 0.0).all()
    ):
        raise UserError(
            "communication points must be at least two finite numbers, each greater than the one before"
        )
    points: list[float] = array.tolist()
    return points


def _rate(name: str, value: float) -> Fraction:
    usable = isinstance(value, Real) and np.isfinite(value)
    rate = Fraction(value).limit_denominator(10**6) if usable else Fraction(0)
    if rate <= 0 or 1 not in (rate.numerator, rate.denominator):
        raise UserError(
            f"rate {value!r} of {name}: steps per step of the system must be 1, 2, 3, ... or 1/2, 1/3, ..."
        )
    return rate
