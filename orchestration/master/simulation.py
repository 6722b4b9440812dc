"""Runs of a system: its members step and exchange values, and their outputs are recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from fractions import Fraction
from numbers import Real
from time import perf_counter
from typing import TypedDict, Unpack

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import error_context
from fmus.kit.interrupt import Interrupt, deferred
from orchestration.fmu.isolation import Limits, describe_rows
from orchestration.fmu.kernel import load_stepper
from orchestration.fmu.signal import read_signal
from orchestration.master.dependency_graph import describe_loop
from orchestration.master.executor import Executor
from orchestration.master.instances import CommunicationStep, SavedState
from orchestration.master.isolated import RowDescription, RowRecorder, run_isolated
from orchestration.master.kernel_run import KernelRun
from orchestration.master.pacing import Pacer, RealTime
from orchestration.master.realtime_priority import realtime_priority
from orchestration.master.result import MemberStatistics, Run, Statistics, Stopped
from orchestration.master.schedule import MasterSettings
from orchestration.master.setup import (
    check_capabilities,
    disturbance_values,
    enter_initialization,
    external_values,
    initialize,
    make_structure,
    open_members,
)
from orchestration.master.step_control import StepDoubling
from orchestration.system import Port, System, check

METHODS = ("gauss-seidel", "jacobi")


class CouplingOptions(TypedDict, total=False):
    """Options that say how the members of a system are coupled.

    Attributes
    ----------
    method : {"gauss-seidel", "jacobi"}
        Members step one after another with the newest outputs, or all with those from the beginning
        of the step.
    extrapolation : {0, 1}
        Connected inputs are held over a step, or change linearly.
    feedthrough : bool
        False: outputs are read at the end of every step, before any input is set. There are no
        algebraic loops then, but an output that depends on inputs is a step late. FMI 2.0 requires
        it of a master in the strict sense.
    tolerance : float, optional
        Between two points take as many steps as it takes to keep the coupling error of each below
        ``tolerance * (nominal + |value|)``; default one step.
    rates : Mapping of str to float
        Steps that a member makes for each step of the system: whole numbers, or 1/2, 1/3, ...
    """

    method: str
    extrapolation: int
    feedthrough: bool
    tolerance: float | None
    rates: Mapping[str, float] | None


_COUPLING: CouplingOptions = {
    "method": "gauss-seidel",
    "extrapolation": 0,
    "feedthrough": True,
    "tolerance": None,
    "rates": None,
}


def run(
    system: System,
    time: Array,
    inputs: Signals | None = None,
    disturbances: Signals | None = None,
    *,
    record: Sequence[str] | None = None,
    real_time: RealTime | None = None,
    progress: Callable[[int], None] = lambda done: None,
    isolation: Limits | None = None,
    **options: Unpack[CouplingOptions],
) -> Run:
    """Run a system over given communication points.

    Inputs are set at every point and held until the next. Outputs are recorded after all inputs of
    the point are set, in an order in which every value is the newest.

    Parameters
    ----------
    system : System
    time : ndarray, shape (n,)
        Communication points in s, increasing.
    inputs : Mapping of str to ndarray, shape (n,)
        By input of the system, or by ``member.variable``, in the FMU's units; an input that is
        missing keeps its start value.
    disturbances : Mapping of str to ndarray, shape (n,)
        Values that are added to connected inputs ``member.variable``, in their units, from every
        point until the next, for instance the part of a record that a model of the source does not
        explain. A disturbance is part of the run, not of the system; see
        :func:`orchestration.system.library.with_voltmeter`.
    record : sequence of str, optional
        Variables ``member.variable`` to record; default every output.
    real_time : RealTime, optional
        Wait for the time of each point, and count delays; default as fast as possible.
    progress : callable
        Called with the number of points done, now and then.
    isolation : Limits, optional
        Limits of a separate process in which it is run; default in this process. Not in real time.
    **options
        Those of :class:`CouplingOptions`.

    Returns
    -------
    Run
        After Ctrl-C the result until then, marked incomplete.

    Raises
    ------
    TypeError
        If an option is not known.
    Stopped
        If a member fails, discards a step, gives another a number that is not finite, or does not
        reach the end; if the run cannot keep pace with real time.
    UserError
        If the system cannot be run this way.
    """
    check(system)
    points = _check_points(time)
    coupling = _coupling(options)
    if disturbances and coupling["extrapolation"]:
        raise UserError(
            "disturbances are held from point to point, and do not go with extrapolation 1"
        )
    if isolation is not None:
        if real_time is not None:
            raise UserError("a run in real time is made in this process: it cannot be isolated")
        return run_isolated(
            isolation,
            run,
            system,
            time,
            inputs,
            disturbances,
            progress=progress,
            options={"record": record, **coupling},
        )
    settings = _settings(system, coupling)
    external = external_values(system, inputs or {}, len(points))
    disturbed = disturbance_values(system, disturbances or {}, len(points))
    with ExitStack() as opened:
        members = open_members(system, opened)
        check_capabilities(members, points, settings)
        structure, recorded = make_structure(system, members, list(external), record, settings)
        present_step = CommunicationStep()
        present_step.set(points[0], points[0])
        enter_initialization(members, points[0], points[-1])
        executor = Executor(
            members,
            structure,
            system.connections,
            external=external,
            disturbances=disturbed,
            settings=settings,
            present_step=present_step,
        )
        opened.callback(_release, executor.saved_states)
        notes = initialize(executor)
        runner = _Runner(
            executor,
            points,
            recorded,
            tolerance=coupling["tolerance"],
            real_time=real_time,
            progress=progress,
            notes=notes,
        )
        return runner.run()


def _check_points(time: Array) -> list[float]:
    """Return the communication points; UserError if they do not increase."""
    array = np.asarray(time, dtype=float)
    usable = array.ndim == 1 and array.size >= 2 and np.isfinite(array).all()
    if not usable or not (np.diff(array) > 0.0).all():
        raise UserError(
            "communication points must be at least two finite numbers, each greater than the one"
            " before"
        )
    points: list[float] = array.tolist()
    return points


def _coupling(options: CouplingOptions) -> CouplingOptions:
    """Return all options, with defaults for those not given; refuse values that are not allowed."""
    unknown = sorted(options.keys() - _COUPLING.keys())
    if unknown:
        raise TypeError(f"run() got an unexpected keyword argument {unknown[0]!r}")
    coupling: CouplingOptions = {**_COUPLING, **options}
    method = coupling["method"]
    extrapolation = coupling["extrapolation"]
    tolerance = coupling["tolerance"]
    if method not in METHODS:
        raise UserError(f"method {method!r}; there are: {', '.join(METHODS)}")
    if extrapolation not in (0, 1):
        raise UserError(
            f"extrapolation {extrapolation!r}: 0 (inputs are held) or 1 (they change linearly)"
        )
    if tolerance is not None and not (isinstance(tolerance, Real) and 0.0 < tolerance < 1.0):
        raise UserError(f"tolerance {tolerance!r}: must be a number between 0 and 1")
    return coupling


def _settings(system: System, coupling: CouplingOptions) -> MasterSettings:
    """Return the options in the form for the master.

    Raises
    ------
    UserError
        If a rate or its reciprocal is not a whole number, or there is no member of its name.
    """
    return MasterSettings(
        sequential=coupling["method"] == "gauss-seidel",
        extrapolation=coupling["extrapolation"],
        feedthrough=coupling["feedthrough"],
        adaptive=coupling["tolerance"] is not None,
        rates={
            name: _check_rate(system.member(name).name, value)
            for name, value in (coupling["rates"] or {}).items()
        },
    )


def _check_rate(name: str, value: float) -> Fraction:
    """Return the rate of a member; UserError unless it or its reciprocal is a whole number."""
    usable = isinstance(value, Real) and np.isfinite(value)
    rate = Fraction(value).limit_denominator(10**6) if usable else Fraction(0)
    if rate <= 0 or 1 not in (rate.numerator, rate.denominator):
        raise UserError(
            f"rate {value!r} of {name}: steps per step of the system must be 1, 2, 3, ... or 1/2,"
            " 1/3, ..."
        )
    return rate


def _release(saved_states: Sequence[SavedState]) -> None:
    """Free states that are still saved, after a run that did not come to its end."""
    for saved in saved_states:
        saved.release()


class _Runner:
    """One run of an executor that is initialized.

    Parameters
    ----------
    executor : Executor
    points : list of float
        Communication points in s.
    recorded : list of Port
        Variables to record.
    tolerance : float or None
        Relative tolerance of adaptive steps.
    real_time : RealTime or None
    progress : callable
        Called with the number of points done.
    notes : sequence of str
        Remarks on the initialization.
    """

    def __init__(
        self,
        executor: Executor,
        points: list[float],
        recorded: list[Port],
        *,
        tolerance: float | None,
        real_time: RealTime | None,
        progress: Callable[[int], None],
        notes: Sequence[str],
    ):
        self._executor = executor
        self._points = points
        self._recorded = recorded
        self._progress = progress
        self._progress_interval = max(1, len(points) // 200)
        self._notes_before = list(notes)
        self._real_time = real_time
        self._pacer: Pacer | None = None
        self._doubling = None if tolerance is None else StepDoubling(executor, tolerance)
        self._rows = RowRecorder()
        variables = {member.name: member.fmu.variables for member in executor.members}
        self._description = RowDescription(
            points=list(points),
            width=len(executor.outputs.at),
            places={str(port): executor.outputs.at[port] for port in recorded},
            units={
                str(port): read_signal(variables[port.member][port.variable]).unit
                for port in recorded
            },
            guids={member.name: member.fmu.description.guid for member in executor.members},
        )
        describe_rows(self._description)
        self._done = 0
        self._wall = 0.0

    def run(self) -> Run:
        """Go through all communication points; return the result, incomplete after Ctrl-C.

        Raises
        ------
        Stopped
            If a member fails or the run cannot keep pace with real time.
        """
        begin = perf_counter()
        message = ""
        finished = False
        try:
            with deferred() as interrupt, self._priority() as notes:
                self._notes_before += notes
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

    def _priority(self) -> AbstractContextManager[list[str]]:
        if self._real_time is None:
            return nullcontext([])
        return realtime_priority(self._real_time.processor, self._real_time.priority)

    def _advance(self, interrupt: Interrupt) -> None:
        """Make all steps and exchanges, until Ctrl-C is pressed."""
        executor = self._executor
        executor.exchange(executor.complete.stages, 0)
        self._rows.write(executor.outputs.cells)
        self._done = 1
        if self._kernel_can_run() and load_stepper() is not None:
            self._advance_in_kernel(interrupt)
        else:
            self._advance_in_python(interrupt)

    def _kernel_can_run(self) -> bool:
        """Return whether every step is the same, with nothing but an exchange after it."""
        executor = self._executor
        uniform = not executor.slow and not executor.settings.extrapolation
        return uniform and self._doubling is None and self._real_time is None

    def _advance_in_python(self, interrupt: Interrupt) -> None:
        """Make the steps with one call after the other, also in real time and adaptively."""
        points = self._points
        linear = self._executor.settings.extrapolation
        changes = self._executor.changes(len(points)) if linear else []
        write = self._rows.write
        cells = self._executor.outputs.cells
        if self._real_time is not None:
            self._pacer = Pacer(self._real_time, points, interrupt)
            self._pacer.begin(self._recorded_values())
        pacer = self._pacer
        for k in range(1, len(points)):
            if self._doubling is None:
                self._step(k, bool(linear), bool(linear) and changes[k])
            elif self._doubling.advance(points[k - 1], points[k], k - 1, interrupt):
                self._executor.exchange(self._executor.complete.stages, k)
            else:
                break
            write(cells)
            self._done = k + 1
            if k % self._progress_interval == 0:
                self._progress(k)
            if pacer is not None:
                pacer.keep(k, self._recorded_values())
            if interrupt.pressed:
                break

    def _step(self, k: int, linear: bool, changes: bool) -> None:
        """Make the step to point `k`, and exchange values there.

        Parameters
        ----------
        k : int
        linear : bool
            Whether connected inputs change linearly.
        changes : bool
            Whether a value from outside changes at the point.
        """
        executor = self._executor
        schedule = executor.complete
        if executor.slow:
            schedule = executor.schedule(executor.due(k, len(self._points) - 1))
        executor.step(schedule, self._points[k - 1], self._points[k])
        if linear:
            # Slopes of connected inputs are taken from this exchange. A jump of an external value
            # at the point must not be in them, so the exchange is made with the values before it.
            executor.exchange(schedule.stages, k - 1 if changes else k)
            executor.update_slopes(schedule)
        if not linear or changes:  # else the exchange above has set these values already
            executor.exchange(schedule.stages, k)

    def _advance_in_kernel(self, interrupt: Interrupt) -> None:
        """Make the steps in the compiled kernel, which returns for reports of progress."""
        last = len(self._points) - 1
        every = self._progress_interval
        with KernelRun(self._executor, self._points, every) as kernel:
            for k in (*range(every, last, every), last):
                while not self._advance_kernel(kernel, k + 1) and not interrupt.pressed:
                    pass
                if self._done > k and k % every == 0:
                    self._progress(k)
                if interrupt.pressed:
                    break

    def _advance_kernel(self, kernel: KernelRun, until: int) -> bool:
        """Let the kernel make steps, and take the rows that it has computed, even if it fails."""
        try:
            return kernel.advance(until)
        finally:
            self._rows.write(kernel.take_rows().data)
            self._done = kernel.done

    def _recorded_values(self) -> list[float]:
        """Return the present values of the recorded variables."""
        outputs = self._executor.outputs
        return [outputs.cells[outputs.at[port]] for port in self._recorded]

    def _finish(self) -> None:
        """Check that every member has reached the end, and terminate it.

        Raises
        ------
        UserError
            If one has not, or refuses.
        """
        last = self._points[-1]
        for member in self._executor.members:
            reached = member.fmu.last_time()
            if reached is not None and not abs(reached - last) <= 1e-9 * max(1.0, abs(last)):
                raise UserError(
                    f"{member.name}: says that it is at {reached:.10g} s at the end, {last:.10g} s"
                )
        for saved in self._executor.saved_states:
            saved.free()
        for member in self._executor.members:
            with error_context(member.name):
                member.fmu.terminate()
        self._progress(len(self._points))

    def _result(self, message: str) -> Run:
        """Return the result until now, complete if there is no message."""
        description = self._description
        table = self._rows.array(self._done, description.width)
        return Run(
            time=np.array(self._points[: self._done]),
            signals={name: table[:, place] for name, place in description.places.items()},
            units=description.units,
            complete=not message,
            message=message,
            statistics=self._statistics(),
            guids=description.guids,
            notes=tuple(self._notes()),
        )

    def _statistics(self) -> Statistics:
        executor = self._executor
        doubling = self._doubling
        components = {
            member.name: MemberStatistics(executor.steps_of(member), seconds, seconds / self._wall)
            for member, seconds in zip(executor.members, executor.seconds, strict=True)
        }
        return Statistics(
            components=components,
            steps=max(0, self._done - 1) if doubling is None else doubling.steps,
            rollbacks=0 if doubling is None else doubling.rollbacks,
            evaluations=sum(fixed_point.evaluations for _, fixed_point in executor.loops),
            wall=self._wall,
            pacing=None if self._pacer is None else self._pacer.statistics(),
        )

    def _notes(self) -> Iterator[str]:
        yield from self._notes_before
        evaluations: dict[str, int] = {}
        # the same loop occurs several times where members have rates of their own
        for loop, fixed_point in self._executor.loops:
            name = describe_loop(loop)
            evaluations[name] = evaluations.get(name, 0) + fixed_point.evaluations
        for name, count in evaluations.items():
            yield f"{name}: solved with {count} evaluations"
        for port in self._executor.complete.order.at_step_end:
            yield (
                f"{port}: taken as it stands at the end of a step, for it closes a loop, its FMU"
                " does not say on which inputs it depends, and cannot restore its state"
            )
        for member in self._executor.members:
            if member.fmu.complaints:
                yield f"{member.name}: {member.fmu.complaints}"
