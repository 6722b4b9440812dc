"""Many runs of one FMU, which is unpacked and instantiated once and reset between runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2Warning

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.fmu.archive import read_description
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import PreparedRun, Pulse, library
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Value
from orchestration.fmu.simulation.simulation import check_inputs, simulate_instance
from orchestration.fmu.source import Source
from orchestration.fmu.stepping import StepFailed, plan_course


class RepeatedFmu:
    """An instance of an FMU for many runs; a context manager.

    Parameters
    ----------
    path : Path
        The FMU file.

    Raises
    ------
    UserError
        If the FMU cannot be opened.
    """

    def __init__(self, path: Path):
        self._fmu = Fmu(path)
        self._is_new = True
        self._can_reset = True
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
        self._reset()
        self._is_new = False
        self._fmu.parameters = dict(settings)
        self._fmu.start(float(time[0]))
        if self._pulse is not None:
            try:
                self._prepare(time, inputs, outputs).run(longest=longest)
            except StepFailed as failure:
                raise UserError(str(failure)) from failure
            return self._result.copy()
        simulated = simulate_instance(self._fmu, time, inputs, outputs)
        return np.column_stack([simulated[name] for name in outputs])

    def _prepare(
        self, time: Array, inputs: Mapping[str, Array], outputs: Sequence[str]
    ) -> PreparedRun:
        """Return the kernel's program, which is kept for runs with the same arrays and names.

        Preparing it takes as long as a thousand steps. Arrays are compared by identity.
        """
        # it is kept, so that no new object can have the identity of one of these
        key = [time, *inputs, *inputs.values(), *outputs]
        if self._prepared is None or [*map(id, key)] != [*map(id, self._prepared_for)]:
            check_inputs(self._fmu, inputs)
            course = plan_course(self._fmu, time, inputs, (), 1)
            self._result = np.empty((len(time), len(outputs)))
            self._prepared = PreparedRun(self._fmu, course, outputs, self._result, self._pulse)
            self._prepared_for = key
        return self._prepared

    def _reset(self) -> None:
        """Reset the instance, or replace it by a new one if that is not possible."""
        if self._is_new:
            return
        if not self._fmu.corrupted and self._can_reset:
            status = self._fmu.bound("fmi2Reset")()
            if status <= fmi2Warning:
                return
            self._fmu.failed("reset", status)  # marks the instance as corrupted after a fatal error
            self._can_reset = False
        self._prepared = None  # the program calls the old instance
        self._fmu.close()
        self._fmu = Fmu(self._fmu.path)
        self._fmu.__enter__()


@dataclass(frozen=True)
class FmuSource:
    """An FMU as the source of runs; see `orchestration.fmu.source.Source`.

    Attributes
    ----------
    path : Path
    """

    path: Path

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
            float(getattr(declared, name, None) or 0.0)
            for name in ("startTime", "stopTime", "stepSize")
        )
        return start, stop or None, step or None

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
        return FmuSource(path)

    def points(self, time: Array) -> Array:
        """Return `time`, which has the communication points (n,) of a single FMU."""
        return time

    def open(self) -> RepeatedFmu:
        """Return the FMU for many runs."""
        return RepeatedFmu(self.path)


def source_of(model: Model) -> Source:
    """Return the source of a model: its system, or its FMU."""
    return model.system or FmuSource(model.path)
