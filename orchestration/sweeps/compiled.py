"""Compiled engine of sweeps, which runs cases of a component by compiled equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask
from orchestration.fmu import Model, Value, read_description
from orchestration.reporting import option

ENGINES = ("auto", "fmu", "compiled")
# Most internal steps of a case: a few tenths of a second, during which Ctrl-C has no effect. A case
# of more steps is run by the FMU, which is as fast then, as the equations take most of the time.
_MOST_STEPS = 2e6


@dataclass(frozen=True)
class Equations:
    """A compiled component as paths and numbers, which can be sent to a worker.

    Attributes
    ----------
    library : Path
        Library of :func:`fmus.kit.record.compiled.plain_library`.
    parameters : dict of str to tuple of float
        Start value, minimum and maximum by parameter, SI.
    inputs : dict of str to tuple of float and bool
        Start value, SI, and True for a real, by input.
    outputs, remembered : tuple of str
        Outputs; and states and discrete states, which may also be outputs of the FMU.
    periods : tuple of str
        Parameters that are periods, s.
    tolerance : float
        Relative tolerance of the integration.
    """

    library: Path
    parameters: dict[str, tuple[float, float, float]]
    inputs: dict[str, tuple[float, bool]]
    outputs: tuple[str, ...]
    remembered: tuple[str, ...]
    periods: tuple[str, ...]
    tolerance: float


def choose_equations(model: Model, engine: str) -> Equations | None:
    """Return the compiled equations for the cases of a model, if the engine uses them.

    Parameters
    ----------
    model : Model
    engine : {"auto", "fmu", "compiled"}
        ``auto`` compiles a component whose FMU is a native build, and runs the FMU of any other
        model.

    Returns
    -------
    Equations or None
        None if the FMU runs the cases.

    Raises
    ------
    UserError
        If there is no such engine, or the model cannot be compiled.
    """
    if engine not in ENGINES:
        raise UserError(f"{option('engine', engine)}: it is one of {', '.join(ENGINES)}")
    if engine == "fmu" or (engine == "auto" and model.tolerance is not None):
        return None
    try:
        return _compile(model)
    except UserError as error:
        if engine == "auto":
            return None
        raise UserError(f"{option('engine', 'compiled')}: {error}") from error


def _compile(model: Model) -> Equations:
    """Compile the equations of a model; raise if it is not a native build of a component here."""
    from fmus.kit.record import plain_library

    cls = model.cls
    needs_python = read_description(model.path).coSimulation.needsExecutionTool
    if cls is None or model.foreign or needs_python:
        raise UserError(
            f"{model.name} is run as an FMU; native builds of components here can be compiled"
        )
    layout = cls.layout
    computed = {v.name for v in (*layout.states, *layout.discretes, *layout.outputs)}
    for name in model.outputs:
        if name not in computed:
            raise UserError(f"{name} is none of what compiled equations compute")
    path, tolerance = plain_library(cls)
    return Equations(
        path,
        {p.name: (float(p.start), p.min, p.max) for p in layout.parameters},
        {v.name: (float(v.start), v.type == "real") for v in layout.inputs},
        tuple(v.name for v in layout.outputs),
        tuple(v.name for v in (*layout.states, *layout.discretes)),
        tuple(sorted(layout.clock_parameters)),
        tolerance,
    )


class CompiledCases:
    """Runner of cases by compiled code, which several threads may use.

    A case with a value out of its range, or with a step that fails, is left to the FMU, which
    reports the error or computes the same numbers.

    Parameters
    ----------
    equations : Equations

    Raises
    ------
    UserError
        If the library cannot be loaded.
    """

    def __init__(self, equations: Equations):
        from fmus.kit.record import RecordLibrary

        self._equations = equations
        ranges = np.array(list(equations.parameters.values())).reshape(-1, 3)
        self._starts, self._smallest, self._largest = ranges.T
        self._index = {name: k for k, name in enumerate(equations.parameters)}
        self._periods = [self._index[name] for name in equations.periods]
        columns = (*equations.outputs, *equations.remembered)
        self._column = {name: k for k, name in enumerate(columns)}
        try:
            library = equations.library
            self._library = RecordLibrary(
                library, library, len(equations.outputs), len(equations.remembered)
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
    ) -> tuple[Array, Mask]:
        """Run cases from the start.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points, s.
        inputs : Mapping of str to ndarray, shape (n,)
            In the FMU's units.
        settings : Mapping of str to float or str
            Parameters of all cases, in the FMU's units.
        over : Mapping of str to ndarray, shape (k,)
            Parameters of each case, or constant inputs.
        outputs : sequence of str
            Names of m outputs.

        Returns
        -------
        traces : ndarray, shape (k, n, m)
        decided : ndarray of bool, shape (k,)
            False for cases that are left to the FMU.
        """
        count = len(next(iter(over.values())))
        parameters, has_valid_parameters = self._parameter_table(count, settings, over)
        tables, has_valid_inputs = self._input_tables(len(time), count, inputs, settings, over)
        columns = [self._column[name] for name in outputs]
        decided = has_valid_parameters & has_valid_inputs
        parameters[~decided] = self._starts  # compiled code must not see invalid values
        tables[~has_valid_inputs] = 0.0
        tolerance = self._equations.tolerance
        steps_per_point = _MOST_STEPS / len(time)
        traces, done = self._library.cases(
            time, tables, parameters, tolerance, steps_per_point, columns
        )
        decided &= done
        traces[~decided] = np.nan
        return traces, decided

    def _parameter_table(
        self, count: int, settings: Mapping[str, Value], over: Mapping[str, Array]
    ) -> tuple[Array, Mask]:
        """Return parameters, shape (k, p), and a mask (k,) of the cases that the FMU accepts."""
        values = np.tile(self._starts, (count, 1))
        is_valid = np.ones(count, bool)
        for name, value in {**settings, **over}.items():
            if isinstance(value, str):  # compiled code has numbers only
                is_valid[:] = False
            elif name in self._index:
                values[:, self._index[name]] = value
        is_valid &= ((values >= self._smallest) & (values <= self._largest)).all(axis=1)
        return values, is_valid & (values[:, self._periods] > 0.0).all(axis=1)

    def _input_tables(
        self,
        points: int,
        count: int,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        over: Mapping[str, Array],
    ) -> tuple[Array, Mask]:
        """Return inputs, shape (k, n, u), and a mask (k,) of the cases that the FMU accepts.

        Inputs without a trace are constant. With the same inputs in all cases k is 1.
        """
        signals = self._equations.inputs
        cases = count if {*signals} & {*over} else 1
        tables = np.empty((cases, points, len(signals)))
        is_valid = np.ones(cases, bool)
        for k, (name, (start, is_real)) in enumerate(signals.items()):
            if name in over:
                tables[:, :, k] = over[name][:, np.newaxis]
            else:
                tables[:, :, k] = inputs.get(name, settings.get(name, start))
            if not is_real:
                is_valid &= np.isin(tables[:, :, k], (0.0, 1.0)).all(axis=1)
        return tables, is_valid & np.isfinite(tables).all(axis=(1, 2))
