"""The compiled path: cases of a component whose equations are known, without the FMI around them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.archive import read_description
from orchestration.fmu.model import Model
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
        raise UserError(
            f"{model.name} is run as an FMU; native builds of components here can be compiled"
        )
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
    """A component that compiled code runs again and again; it may do so in several threads at once.

    What such code cannot judge, a value out of its range or a step that fails, is left to the FMU, which says what is
    wrong, or comes to the same numbers.

    Parameters
    ----------
    equations : Equations

    Raises
    ------
    UserError
        If the library cannot be loaded.
    """

    def __init__(self, equations: Equations):
        from fmus.kit.record.library import RecordLibrary

        self._equations = equations
        self._starts, self._smallest, self._largest = (
            np.array(list(equations.parameters.values())).reshape(-1, 3).T
        )
        self._index = {name: k for k, name in enumerate(equations.parameters)}
        self._periods = [self._index[name] for name in equations.periods]
        self._column = {
            name: k for k, name in enumerate((*equations.outputs, *equations.remembered))
        }
        try:
            self._library = RecordLibrary(
                equations.library, len(equations.outputs), len(equations.remembered)
            )
        except OSError as error:
            raise UserError(f"{equations.library}: cannot be loaded ({error})") from error

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        over: Mapping[str, Array],
        outputs: Sequence[str],
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Run cases from the start.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points, s.
        inputs : Mapping of str to ndarray, shape (n,)
            In the FMU's units.
        settings : Mapping of str to float or str
            Parameters that all cases have, in the FMU's units.
        over : Mapping of str to ndarray, shape (k,)
            Parameters of each case, or inputs that it holds.
        outputs : sequence of str
            Of which the course is wanted, m of them.

        Returns
        -------
        courses : ndarray, shape (k, n, m)
        judged : ndarray of bool, shape (k,)
            Whether each was run; the others are the FMU's.
        """
        count = len(next(iter(over.values())))
        parameters, taken = self._parameters(count, settings, over)
        tables, fed = self._tables(len(time), count, inputs, settings, over)
        columns = [self._column[name] for name in outputs]
        judged = taken & fed
        parameters[~judged], tables[~fed] = self._starts, 0.0  # what compiled code may see instead
        tolerance, effort = self._equations.tolerance, _MOST / len(time)
        courses, done = self._library.cases(time, tables, parameters, tolerance, effort, columns)
        judged &= done
        courses[~judged] = np.nan
        return courses, judged

    def _parameters(
        self, count: int, settings: Mapping[str, Value], over: Mapping[str, Array]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Values (k, p), and whether the FMU would take them (k,)."""
        values, taken = np.tile(self._starts, (count, 1)), np.ones(count, bool)
        for name, value in {**settings, **over}.items():
            if isinstance(value, str):
                taken[:] = False
            elif name in self._index:
                values[:, self._index[name]] = value
        taken &= ((values >= self._smallest) & (values <= self._largest)).all(axis=1)
        return values, taken & (values[:, self._periods] > 0.0).all(axis=1)

    def _tables(
        self,
        points: int,
        count: int,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        over: Mapping[str, Array],
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Inputs (k or 1, n, u), held where they have no course, and whether the FMU would take them (k or 1,)."""
        kept = self._equations.inputs
        tables = np.empty((count if {*kept} & {*over} else 1, points, len(kept)))
        taken = np.ones(len(tables), bool)
        for k, (name, (start, real)) in enumerate(kept.items()):
            given = (
                over[name][:, np.newaxis]
                if name in over
                else inputs.get(name, settings.get(name, start))
            )
            tables[:, :, k] = given
            if not real:
                taken &= np.isin(tables[:, :, k], (0.0, 1.0)).all(axis=1)
        return tables, taken & np.isfinite(tables).all(axis=(1, 2))
