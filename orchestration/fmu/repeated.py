"""One FMU run again and again: unpacked once, one instance, reset between the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
from fmpy.fmi2 import fmi2Warning
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.course import course
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import library
from orchestration.fmu.kernel.one_fmu import Prepared
from orchestration.fmu.kernel.pulse import Pulse
from orchestration.fmu.signal import Value
from orchestration.fmu.simulate import check_inputs, simulate_instance
from orchestration.fmu.stepping import Failed

Array = NDArray[np.float64]


class RepeatedFmu:
    """An instance of an FMU; a context manager.

    Parameters
    ----------
    path : Path
        Of the FMU.

    Raises
    ------
    UserError
        If the FMU cannot be opened.
    """

    def __init__(self, path: Path):
        self._fmu = Fmu(path)
        self._fresh = self._can_reset = True
        self._pulse: Pulse | None = None
        self._prepared: Prepared | None = None  # of the instance that there is
        self._of: list[object] = []  # what it was prepared for

    def __enter__(self) -> RepeatedFmu:
        self._fmu.__enter__()
        if library.stepper() is not None:
            self._pulse = Pulse()
            self._pulse.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._pulse is not None:
            self._pulse.__exit__()
        self._prepared = None
        self._fmu.__exit__(kind, error, trace)

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
            In the FMU's units; nothing in an array may change between two runs with it.
        settings : Mapping of str to float or str
            Start values, in the FMU's units.
        outputs : sequence of str
            Of which the course is wanted, m of them.
        longest : float
            Seconds that it may take; not heeded without a compiler.

        Returns
        -------
        ndarray, shape (n, m)

        Raises
        ------
        UserError
            If the FMU refuses, fails or takes too long; the next run has a new instance if this one must not be called
            again.
        """
        self._begin_again()
        self._fresh = False
        self._fmu.parameters = dict(settings)
        self._fmu.start(float(time[0]))
        if self._pulse is not None:
            try:
                self._steps(time, inputs, outputs).run(longest=longest)
            except Failed as failure:
                raise UserError(str(failure)) from failure
            return self._result.copy()
        found = simulate_instance(self._fmu, time, inputs, outputs)
        return np.column_stack([found[name] for name in outputs])

    def _steps(self, time: Array, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Prepared:
        """What the kernel does; to list it takes as long as a thousand steps, so that it is kept while it is the same.

        The arrays themselves are compared, not their numbers.
        """
        of = [time, *inputs, *inputs.values(), *outputs]
        if (
            self._prepared is None
            or len(of) != len(self._of)
            or any(a is not b for a, b in zip(of, self._of, strict=True))
        ):
            check_inputs(self._fmu, inputs)
            way = course(self._fmu, time, inputs, (), 1)
            self._result = np.empty((len(time), len(outputs)))
            self._prepared, self._of = (
                Prepared(self._fmu, way, outputs, self._result, self._pulse),
                of,
            )
        return self._prepared

    def _begin_again(self) -> None:
        """Bring the instance to where it was before it started; one that cannot go there is made anew."""
        if self._fresh:
            return
        if not self._fmu.corrupted and self._can_reset:
            status = self._fmu.bound("fmi2Reset")()
            if status <= fmi2Warning:
                return
            self._fmu.failed("reset", status)  # which remembers whether it may be called again
            self._can_reset = False
        self._prepared = None  # it has the instance in it
        self._fmu.close()
        self._fmu = Fmu(self._fmu.path)
        self._fmu.__enter__()
