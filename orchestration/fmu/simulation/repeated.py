"""Many runs of one FMU, which is unpacked and instantiated once and reset between runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.archive import read_description
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import PreparedRun, Pulse, library
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Value
from orchestration.fmu.simulation.simulation import begin_run, simulate_instance, unfinished
from orchestration.fmu.source import Source
from orchestration.fmu.stepping import (
    StepFailed,
    communication_points,
    is_continuous,
    own_step,
    plan_course,
)

# times, inputs, settings, outputs and largest duration of a run
_Job = tuple[Array, Mapping[str, Array], Mapping[str, Value], Sequence[str], float]


class RepeatedFmu:
    """An instance of an FMU for many runs; a context manager.

    Parameters
    ----------
    path : Path
        The FMU file.
    tolerance : float, optional
        Relative tolerance of its integration; default the declared one.

    Raises
    ------
    UserError
        If the FMU cannot be opened.

    Attributes
    ----------
    remarks : set of str
        What users have to know of runs that did not fail.
    """

    def __init__(self, path: Path, tolerance: float | None = None):
        self.remarks: set[str] = set()
        self._tolerance = tolerance
        self._fmu = Fmu(path, tolerance=tolerance)
        self._is_new = True
        self._first: tuple[_Job, Array] | None = None  # run of a new instance, and its outputs
        self._resets: bool | None = None  # whether a run after a reset is as that of a new instance
        self._pulse: Pulse | None = None
        self._prepared: PreparedRun | None = None  # for the current instance
        self._prepared_for: list[object] = []  # arrays and names

    def __enter__(self) -> RepeatedFmu:
        self._fmu.__enter__()
        if library.load_stepper() is not None:
            self._pulse = Pulse()
            self._pulse.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        try:
            if self._pulse is not None:
                self._pulse.__exit__()
        finally:
            self._prepared = None
            self._fmu.__exit__(*error)

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return self._fmu.inputs

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        outputs: Sequence[str],
        longest: float = np.inf,
    ) -> Array:
        """Simulate once from the start values and return the outputs.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points, s.
        inputs : Mapping of str to ndarray, shape (n,)
            In the FMU's units; the contents of an array must not change between runs.
        settings : Mapping of str to float or str
            Start values, in the FMU's units.
        outputs : sequence of str
            Outputs to return.
        longest : float
            Largest duration of the run in seconds; ignored without a C compiler.

        Returns
        -------
        ndarray, shape (n, outputs)

        Raises
        ------
        UserError
            If the FMU refuses, fails or takes too long. After a fatal error the next run uses a new
            instance.
        """
        job = (time, inputs, settings, outputs, longest)
        if self._first is None:
            self._renew()
            result = self._run(*job)
            self._first = (job, result)
            return result
        if self._resets is None:
            return self._run_beside_first(job)
        self._begin_anew()
        return self._run(*job)

    def _run_beside_first(self, job: _Job) -> Array:
        """Run once after a reset, which is judged by the first run: it must give the same again.

        Not every FMU that accepts a reset is as new after it. One that is not gets a new instance
        for each run.
        """
        assert self._first is not None
        first, expected = self._first
        outcomes: list[Array | UserError] = []
        for one in (job, first):
            self._begin_anew()
            try:
                outcomes.append(self._run(*one))
            except UserError as error:
                outcomes.append(error)
        mine, again = outcomes
        self._resets = isinstance(again, np.ndarray) and again.tobytes() == expected.tobytes()
        if not self._resets:
            self.remarks.add(
                f"{self._fmu.path.name}: after fmi2Reset its first run gives other results, so each"
                " run has an instance of its own"
            )
            self._renew()
            return self._run(*job)
        if isinstance(mine, UserError):
            raise mine
        return mine

    def _run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        outputs: Sequence[str],
        longest: float,
    ) -> Array:
        """Run an instance that is as new; see `run`."""
        self._is_new = False
        self._fmu.parameters = dict(settings)
        begin_run(self._fmu, time, inputs)
        if self._pulse is None:
            simulated = simulate_instance(self._fmu, time, inputs, outputs)
            result = np.column_stack([simulated[name] for name in outputs])
        else:
            try:
                self._prepare(time, inputs, outputs).run(longest=longest)
            except StepFailed as failure:
                points = self._course.time
                raise unfinished(failure, self._fmu, points, outputs, self._result) from failure
            result = self._course.at_wanted(self._result, self._continuous).copy()
        try:
            self._fmu.terminate()
        except UserError as error:
            self.remarks.add(str(error))  # the run was complete before
        return result

    def _prepare(
        self, time: Array, inputs: Mapping[str, Array], outputs: Sequence[str]
    ) -> PreparedRun:
        """Return the kernel's program, which is kept for runs with the same arrays and names.

        Preparing it takes as long as a thousand steps. Arrays are compared by identity.
        """
        # it is kept, so that no new object can have the identity of one of these
        key = [time, *inputs, *inputs.values(), *outputs]
        if self._prepared is None or [*map(id, key)] != [*map(id, self._prepared_for)]:
            self._course = plan_course(self._fmu, time, inputs)
            self._continuous = is_continuous(self._fmu, outputs)
            self._result = np.empty((len(self._course.time), len(outputs)))
            self._prepared = PreparedRun(
                self._fmu, self._course, outputs, self._result, self._pulse
            )
            self._prepared_for = key
        return self._prepared

    def _begin_anew(self) -> None:
        """Reset the instance, or replace it by a new one if that is not possible."""
        if self._resets is False or self._fmu.corrupted or not self._fmu.reset():
            self._renew()

    def _renew(self) -> None:
        """Replace the instance by a new one, unless it has not been run."""
        if self._is_new:
            return
        self._prepared = None  # the program calls the old instance
        self._fmu.close()
        self._fmu = Fmu(self._fmu.path, tolerance=self._tolerance)
        self._fmu.__enter__()
        self._is_new = True


@dataclass(frozen=True)
class FmuSource:
    """An FMU as the source of runs; see `orchestration.fmu.source.Source`.

    Attributes
    ----------
    path : Path
    tolerance : float, optional
        Relative tolerance of its integration; default the declared one.
    """

    path: Path
    tolerance: float | None = None

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.path.name

    @property
    def guid(self) -> str:
        """The GUID of the FMU."""
        return str(read_description(self.path).guid)

    @property
    def default_experiment(self) -> tuple[float, float | None, float | None]:
        """Declared start time, stop time and step in s; None for one that is not declared."""
        declared = read_description(self.path).defaultExperiment
        start, stop, step = (
            None if value is None else float(value)
            for value in (
                getattr(declared, name, None) for name in ("startTime", "stopTime", "stepSize")
            )
        )
        first = start or 0.0
        # some tools write a stop time or a step of 0 for an undefined one
        return first, stop if stop is not None and stop > first else None, step or None

    @property
    def nominal(self) -> dict[str, float]:
        """Declared nominal values by variable."""
        values = {}
        for variable in read_description(self.path).modelVariables:
            nominal = getattr(variable, "nominal", None)
            if nominal:
                values[variable.name] = abs(float(nominal))
        return values

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of the FMU."""
        return (self.path,)

    def with_files(self, files: Sequence[Path]) -> FmuSource:
        """Return the source with another path of its file."""
        (path,) = files
        return replace(self, path=path)

    def points(self, time: Array) -> Array:
        """Return the communication points (m,) of a run with outputs at `time` (n,), s."""
        return communication_points(read_description(self.path), time)

    def open(self) -> RepeatedFmu:
        """Return the FMU for many runs."""
        return RepeatedFmu(self.path, self.tolerance)


def source_of(model: Model) -> Source:
    """Return the source of a model: its system, or its FMU."""
    return model.system or FmuSource(model.path, model.tolerance)


def steps_of_its_own(model: Model) -> Iterator[str]:
    """Yield a remark on a model whose FMU has only steps of one size, which it declares."""
    if model.system is not None:
        return
    step = own_step(read_description(model.path))
    if step is not None:
        yield (
            f"{model.path.name} has only steps of {step:g} s: inputs are held from step to step,"
            " and outputs between two are interpolated"
        )
