"""Any FMU as a model to fit: its simulation over a record, and derivatives by differences.

The directional derivatives of FMI 2.0 are at one communication point, and by parameters in
initialization only, so that they do not hold the effect of a parameter on later steps. So every
parameter is moved a little to either side. The step is chosen for the FMU: the error of a
difference falls with the square of the step and the noise of the FMU's solver grows with its
reciprocal, so that of a ladder of steps the best are two neighbours that agree best.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import replace
from itertools import pairwise
from math import inf
from time import monotonic
from types import SimpleNamespace
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.record import Trajectory
from orchestration.fmu import Model, RepeatedRuns, Signal, Source, Value
from orchestration.fmu.isolation import Ended, Limits, Pool, keep, limits_of
from orchestration.fmu.simulation import source_of
from orchestration.identify.fitting.simulation_input import SimulationInput

_LADDER = 10.0 ** -np.arange(1.0, 6.5, 0.5)  # steps relative to the size of a parameter
_PATIENCE = 2.0  # s that a run may take in any case
_STIFFER = 30.0  # times as long as the first run that others may take
_SIZE_RATIO = 2.0  # of values of a parameter, beyond which its step is chosen anew
_repeated: RepeatedRuns | None = None  # that of a worker process


class FmuWithDifferences:
    """An FMU with derivatives by differences; a context manager that closes it.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Parameters by which derivatives are taken.
    outputs : sequence of str
        Outputs to simulate.
    settings : Mapping of str to float or str
        Other parameters, in the FMU's units.
    workers : int
        Processes that run it side by side; with one it runs in this process.

    Attributes
    ----------
    layout : SimpleNamespace
        Its ``parameters`` are the declarations, as of a component.
    delays : dict
        Empty; it is there as in `DelayedModel`.
    runs : int
        Number of simulations made.
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        outputs: Sequence[str],
        settings: Mapping[str, Value] | None = None,
        workers: int = 1,
    ):
        sizes = source_of(model).nominal
        numbers = [s for s in model.constants.values() if s.type != "string"]
        self.layout = SimpleNamespace(
            parameters=[_declared(s, sizes.get(s.name, 0.0)) for s in numbers]
        )
        self.delays: dict[str, str] = {}
        self.runs = 0
        self._declared = {p.name: p for p in self.layout.parameters}
        self._source = source_of(model)
        self._names = list(names)
        self._outputs = list(outputs)
        self._settings = dict(settings or {})
        self._workers = workers
        self._limits = limits_of(model.foreign)
        # by parameter: its size where the relative step was chosen, and the step
        self._steps: dict[str, tuple[float, float]] = {}
        self._open = ExitStack()
        self._is_open = False
        self._has_derivatives = True
        self._longest_run = np.inf  # s that a run may take

    @contextmanager
    def opened(self, derivatives: bool = True) -> Iterator[None]:
        """Open the FMU while the context lasts, unless it is already open.

        Without derivatives, all are zero, and a simulation is one run.
        """
        self._has_derivatives = derivatives
        try:
            with nullcontext() if self._is_open else self:
                yield
        finally:
            self._has_derivatives = True

    def __enter__(self) -> FmuWithDifferences:
        if self._limits is None:
            self._fmu = self._open.enter_context(self._source.open())
        if self._limits is not None or self._workers > 1:
            pool = Pool(
                self._limits or Limits(inf, inf), self._workers, _open_in_worker, self._source
            )
            self._pool = self._open.enter_context(pool)
        self._is_open = True
        return self

    def __exit__(self, *error: Any) -> None:
        self._is_open = False
        self._open.__exit__(*error)

    # an FMU may run away to numbers of which differences, or their squares, are none
    @np.errstate(over="ignore", invalid="ignore")
    def run(self, given: SimulationInput) -> Trajectory:
        """Simulate like `CompiledModel.run`, with inputs constant between samples.

        Parameters
        ----------
        given : SimulationInput
            Parameters that were not named at first are ignored, and so is the effort: the
            integrator is the FMU's own.

        Returns
        -------
        Trajectory
            Of the outputs.

        Raises
        ------
        UserError
            If the FMU fails there, or on both sides.
        """
        at = {name: float(given.parameters[name]) for name in self._names}
        point = replace(given, parameters=at)
        outputs_here = self._first_run(point)
        slopes = [np.zeros_like(outputs_here) for _ in self._names]
        if self._has_derivatives:
            slopes = self._differences(point, outputs_here)
        for name, slope in zip(self._names, slopes, strict=True):
            if not np.isfinite(slope).all():
                raise UserError(
                    f"{self._source.name}: fails on either side of {name} = {at[name]:g}"
                )
        signals = {output: outputs_here[:, k] for k, output in enumerate(self._outputs)}
        sensitivities = {}
        for k, output in enumerate(self._outputs):
            by_parameter = np.array([slope[:, k] for slope in slopes])
            sensitivities[output] = by_parameter.reshape(len(slopes), len(given.time)).T
        return Trajectory(signals, sensitivities)

    def _differences(self, point: SimulationInput, outputs_here: Array) -> list[Array]:
        """Return derivatives (n, m), one for each parameter, by steps that suit the FMU."""
        at = point.parameters
        for name in self._names:
            size = self._scale_of(name, at[name])
            before, _ = self._steps.get(name, (inf, 0.0))
            # a step holds where the parameter is of about the size at which it was chosen
            if not 1.0 / _SIZE_RATIO <= size / before <= _SIZE_RATIO:
                self._steps[name] = size, self._choose_step(point, outputs_here, name)
        steps = [(name, self._steps[name][1]) for name in self._names]
        return self._slopes(point, outputs_here, steps)

    def _first_run(self, point: SimulationInput) -> Array:
        """Simulate the outputs (n, m) at a point; the first such run limits the time of others.

        The model is not stiff where a fit begins, and elsewhere it shall not be much more so.
        """
        begin = monotonic()
        (outputs,) = self._run_all(point, [point.parameters])
        if self._longest_run == np.inf:
            self._longest_run = max(_PATIENCE, _STIFFER * (monotonic() - begin))
        if isinstance(outputs, UserError):
            raise outputs
        return outputs

    def _scale_of(self, name: str, value: float) -> float:
        """Return the size of a parameter, to which steps are relative."""
        return abs(value) or self._declared[name].nominal

    def _choose_step(self, point: SimulationInput, outputs_here: Array, name: str) -> float:
        """Return the relative step whose derivatives change least from the next longer one."""
        slopes = self._slopes(point, outputs_here, [(name, step) for step in _LADDER])
        scale = np.where(outputs_here.std(axis=0) > 0.0, outputs_here.std(axis=0), 1.0)
        changes = np.array([np.linalg.norm((a - b) / scale) for a, b in pairwise(slopes)])
        # a step too short for the FMU's numbers has no effect, and then no change either
        usable = np.isfinite(changes) & [bool(slope.any()) for slope in slopes[1:]]
        return float(_LADDER[1 + int(np.argmin(np.where(usable, changes, np.inf)))])

    def _slopes(
        self, point: SimulationInput, outputs_here: Array, steps: Sequence[tuple[str, float]]
    ) -> list[Array]:
        """Return derivatives (n, m), one for each parameter and relative step.

        They are from one side where the FMU fails on the other, and NaN where it fails on both.
        """
        at = point.parameters
        sides = [(name, *self._sides(name, at[name], step)) for name, step in steps]
        points = [{**at, name: x} for name, *ends in sides for x in ends]
        outputs = iter(self._run_all(point, points))
        slopes = []
        for name, low, high in sides:
            below = low, next(outputs)
            above = high, next(outputs)
            slopes.append(_difference_quotient(below, (at[name], outputs_here), above))
        return slopes

    def _sides(self, name: str, value: float, step: float) -> tuple[float, float]:
        """Return values on either side, inside the range of the parameter."""
        declared = self._declared[name]
        width = step * self._scale_of(name, value)
        return max(value - width, declared.min), min(value + width, declared.max)

    def _run_all(
        self, given: SimulationInput, points: Sequence[Mapping[str, float]]
    ) -> list[Array | UserError]:
        """Run the FMU at several points; return outputs (n, m), or the error, of each."""
        self.runs += len(points)
        time = given.time
        inputs = dict(given.inputs)
        jobs = [
            (time, inputs, self._settings | dict(values), self._outputs, self._longest_run)
            for values in points
        ]
        # limits can be kept on another process only, so then even one job goes there
        if self._limits is None and (self._workers == 1 or len(jobs) == 1):
            return [_run(self._fmu, *job) for job in jobs]
        futures = [self._pool.submit(_run_in_worker, job) for job in jobs]
        try:
            return [future.result() for future in futures]
        except Ended as end:
            where = end.state.describe(self._source.points(time), self._source.name)
            raise UserError(f"{where}: {end.reason}") from end


def _difference_quotient(*runs: tuple[float, Array | UserError]) -> Array:
    """Return the slope (n, m) between the outermost runs that did not fail; NaN if they are one.

    Parameters
    ----------
    runs : tuples of float and ndarray, shape (n, m), or UserError
        Rising values of a parameter, each with the outputs or the failure there.
    """
    valid = [(value, outputs) for value, outputs in runs if not isinstance(outputs, UserError)]
    low, below = valid[0]
    high, above = valid[-1]
    return (above - below) / (high - low) if high > low else np.full_like(below, np.nan)


def _open_in_worker(source: Source) -> None:
    """Open the FMU of a worker process."""
    global _repeated
    _repeated = keep(source.open())


def _run_in_worker(job: Any) -> Array | UserError:
    """Run the FMU of a worker process."""
    assert _repeated is not None
    return _run(_repeated, *job)


def _run(fmu: RepeatedRuns, *job: Any) -> Array | UserError:
    """Run an FMU once; return the outputs (n, m), or the error."""
    try:
        return fmu.run(*job)
    except UserError as error:
        return error


def _declared(signal: Signal, nominal: float) -> ParameterDeclaration:
    """Return a parameter of an FMU as a component declares one."""
    declared = ParameterDeclaration(
        unit=signal.unit,
        doc=signal.doc,
        min=signal.min,
        max=signal.max,
        display=signal.display,
        type=signal.type,
        nominal=nominal or abs(signal.start) or 1.0,
        start=signal.start,
    )
    declared.name = signal.name
    return declared
