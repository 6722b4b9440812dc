"""One FMU run many times: unpacked and instantiated once, and reset between the runs."""

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
        self._prepared: PreparedRun | None = None  # for the present instance
        self._prepared_for: list[object] = []

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
        """Run once from the start.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points, s.
        inputs : Mapping of str to ndarray, shape (n,)
            In the FMU's units; an array must not be changed between two runs with it.
        settings : Mapping of str to float or str
            Start values, in the FMU's units.
        outputs : sequence of str
            The m outputs to return.
        longest : float
            Seconds that it may take; ignored without a compiler.

        Returns
        -------
        ndarray, shape (n, m)

        Raises
        ------
        UserError
            If the FMU refuses, fails or takes too long; the next run has a new instance if this one
            must not be called again.
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
        """Return the kernel's program, kept as long as it is for the same arrays and names.

        Preparing it takes as long as a thousand steps. The arrays themselves are compared, not
        their numbers.
        """
        key = [time, *inputs, *inputs.values(), *outputs]
        same = len(key) == len(self._prepared_for) and all(
            a is b for a, b in zip(key, self._prepared_for, strict=True)
        )
        if self._prepared is None or not same:
            check_inputs(self._fmu, inputs)
            course = plan_course(self._fmu, time, inputs, (), 1)
            self._result = np.empty((len(time), len(outputs)))
            self._prepared = PreparedRun(self._fmu, course, outputs, self._result, self._pulse)
            self._prepared_for = key
        return self._prepared

    def _reset(self) -> None:
        """Reset the instance; one that cannot be reset is replaced by a new one."""
        if self._is_new:
            return
        if not self._fmu.corrupted and self._can_reset:
            status = self._fmu.bound("fmi2Reset")()
            if status <= fmi2Warning:
                return
            self._fmu.failed("reset", status)  # which notes whether it may be called again
            self._can_reset = False
        self._prepared = None  # it refers to the instance
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
        """Name of its file."""
        return self.path.name

    @property
    def guid(self) -> str:
        """Its own."""
        return str(read_description(self.path).guid)

    @property
    def default_experiment(self) -> tuple[float, float | None, float | None]:
        """Start time, stop time and step that it declares, s; None where it does not."""
        own = read_description(self.path).defaultExperiment
        start, stop, step = (
            float(getattr(own, name, None) or 0.0) for name in ("startTime", "stopTime", "stepSize")
        )
        return start, stop or None, step or None

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal values that it declares, by variable."""
        sizes = {}
        for variable in read_description(self.path).modelVariables:
            size = getattr(variable, "nominal", None)
            if size:
                sizes[variable.name] = abs(float(size))
        return sizes

    @property
    def files(self) -> tuple[Path, ...]:
        """Its file."""
        return (self.path,)

    def with_files(self, files: Sequence[Path]) -> FmuSource:
        """Return it with a copy of its file."""
        (path,) = files
        return FmuSource(path)

    def points(self, time: Array) -> Array:
        """Return the points (n,) as they are."""
        return time

    def open(self) -> RepeatedFmu:
        """Return what makes the runs."""
        return RepeatedFmu(self.path)


def source_of(model: Model) -> Source:
    """Return where the runs of a model come from."""
    return model.system or FmuSource(model.path)
