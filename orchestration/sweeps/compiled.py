"""The compiled path: cases of a component whose equations are known, without the FMI around them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.archive import read_description
from orchestration.fmu.model import Model
from orchestration.fmu.repeated import RepeatedFmu
from orchestration.fmu.signal import Value

Array = NDArray[np.float64]
ENGINES = ("auto", "fmu", "compiled")
# Internal steps of a case, beyond which its FMU runs it: a few tenths of a second, in which no Ctrl-C is heard. Nothing
# is lost, for there it is the equations that take the time.
_MOST = 2e6


@dataclass(frozen=True)
class Equations:
    """A component compiled, in paths and numbers only, so that a worker can be told it.

    Attributes
    ----------
    library : Path
        Of :func:`fmus.kit.record.compiled.plain_library`.
    parameters : dict of str to tuple of float
        Start value, smallest and largest value of each, SI.
    inputs : dict of str to tuple of float and bool
        Start value, SI, and whether it is real.
    outputs, remembered : tuple of str
        What it computes, and its states and discrete states, which may be outputs of the FMU too.
    periods : tuple of str
        Parameters that are periods, s.
    tolerance : float
        Of the integration, relative.
    """

    library: Path
    parameters: dict[str, tuple[float, float, float]]
    inputs: dict[str, tuple[float, bool]]
    outputs: tuple[str, ...]
    remembered: tuple[str, ...]
    periods: tuple[str, ...]
    tolerance: float


def chosen(model: Model, engine: str) -> Equations | None:
    """Choose what runs the cases of a model.

    Parameters
    ----------
    model : Model
    engine : {"auto", "fmu", "compiled"}
        ``auto`` compiles a component of which the FMU is a native build, and runs the FMU of any other model.

    Returns
    -------
    Equations or None
        None for the FMU.

    Raises
    ------
    UserError
        If there is no such engine, or ``compiled`` is impossible.
    """
    if engine not in ENGINES:
        raise UserError(f"--engine {engine}: it is one of {', '.join(ENGINES)}")
    if engine == "fmu":
        return None
    try:
        return _equations(model)
    except UserError as error:
        if engine == "auto":
            return None
        raise UserError(f"--engine compiled: {error}") from error


def _equations(model: Model) -> Equations:
    from fmus.kit.build import plan
    from fmus.kit.record.compiled import plain_library

    cls = model.cls
    if cls is None or plan(cls, "native").guid != read_description(model.path).guid:
        raise UserError(f"{model.name} is run as an FMU; native builds of components here can be compiled")
    path, tolerance = plain_library(cls)
    layout = cls.layout
    return Equations(
        path,
        {p.name: (float(p.start), p.min, p.max) for p in layout.parameters},
        {v.name: (float(v.start), v.type == "real") for v in layout.inputs},
        tuple(v.name for v in layout.outputs),
        tuple(v.name for v in (*layout.states, *layout.discretes)),
        tuple(period for period, _ in layout.sampled if isinstance(period, str)),
        tolerance,
    )


class CompiledCases:
    """A component run again and again in compiled code; a context manager.

    What such code cannot judge, a value out of its range or a step that fails, is left to the FMU, which says what is
    wrong, or comes to the same numbers.

    Parameters
    ----------
    equations : Equations
    path : Path
        Of the FMU.

    Raises
    ------
    UserError
        If the library cannot be loaded.
    """

    def __init__(self, equations: Equations, path: Path):
        self._equations, self._path = equations, path
        self._starts, self._smallest, self._largest = np.array(list(equations.parameters.values())).reshape(-1, 3).T
        self._index = {name: k for k, name in enumerate(equations.parameters)}
        self._periods = [self._index[name] for name in equations.periods]
        self._column = {name: k for k, name in enumerate((*equations.outputs, *equations.remembered))}
        self._fmu: RepeatedFmu | None = None
        self._open = ExitStack()

    def __enter__(self) -> CompiledCases:
        from fmus.kit.record.library import RecordLibrary

        equations = self._equations
        try:
            self._library = RecordLibrary(equations.library, len(equations.outputs), len(equations.remembered))
        except OSError as error:
            raise UserError(f"{equations.library}: cannot be loaded ({error})") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return list(self._equations.inputs)

    def run(
        self, time: Array, inputs: Mapping[str, Array], settings: Mapping[str, Value], outputs: Sequence[str]
    ) -> Array:
        """Run once from the start; as :meth:`orchestration.fmu.repeated.RepeatedFmu.run`."""
        parameters, table = self._parameters(settings), self._table(len(time), inputs, settings)
        if parameters is not None and table is not None:
            held, effort = np.zeros(table.shape[1]), _MOST / len(time)
            try:
                found = self._library.simulate(time, table, held, parameters, self._equations.tolerance, effort, None)
                # in rows as those of an FMU: reductions round alike
                return np.ascontiguousarray(np.hstack(found)[:, [self._column[name] for name in outputs]])
            except UserError:
                pass  # the FMU says it in its words
        if self._fmu is None:
            self._fmu = self._open.enter_context(RepeatedFmu(self._path))
        return self._fmu.run(time, inputs, settings, outputs)

    def _parameters(self, settings: Mapping[str, Value]) -> Array | None:
        """Values (p,) with those that are set; None if the FMU would not take one."""
        values = self._starts.copy()
        for name, value in settings.items():
            if isinstance(value, str):
                return None
            if name in self._index:
                values[self._index[name]] = value
        taken = ((values >= self._smallest) & (values <= self._largest)).all() and (values[self._periods] > 0.0).all()
        return values if taken else None

    def _table(self, points: int, inputs: Mapping[str, Array], settings: Mapping[str, Value]) -> Array | None:
        """Inputs (n, u), held at what they are set to where they have no course; None if the FMU would not take one."""
        table = np.empty((points, len(self._equations.inputs)))
        for k, (name, (start, real)) in enumerate(self._equations.inputs.items()):
            table[:, k] = inputs.get(name, settings.get(name, start))
            if not real and not np.isin(table[:, k], (0.0, 1.0)).all():
                return None
        return table if np.isfinite(table).all() else None
