"""An FMU with corrections as a model of laws: it simulates the inputs of its component."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from threading import Lock
from typing import Any

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array
from fmus.kit.declare import InputDeclaration
from fmus.kit.record import Trajectory
from orchestration.diagnosis.foreign.component import Names, reals
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.recording import jumps_of
from orchestration.diagnosis.runs import Course, Linearisation, Record, Setting
from orchestration.fmu import Model, Value
from orchestration.identify.fitting import FmuWithDifferences, SimulationInput

_FAR = 0.001  # relative change of a parameter, from which on an FMU is linearised anew

_KEPT = 60  # runs, of which the results are kept
_FINER = 4  # steps from a sample to the next, in which an input in a straight line is held


class FmuRuns:
    """Runs of an FMU with the derivatives of its outputs by some of its parameters.

    Parameters
    ----------
    model : Model
        Without equations.
    names : sequence of str
        Parameters by which there are derivatives.
    settings : Mapping of str to float or str
        Of its other parameters.
    """

    def __init__(self, model: Model, names: Sequence[str], settings: Mapping[str, Value]):
        self.model = model
        self._names = names
        self._settings = settings
        self._others = {p: v for p, v in settings.items() if p not in model.inputs}
        for name in names:
            self._others.pop(name, None)
        self._fmu = FmuWithDifferences(model, names, [*reals(model.outputs)], self._others)
        self._one_at_a_time = Lock()
        self._known: dict[bytes, Trajectory] = {}

    def __reduce__(self) -> Any:
        """Return what copies and pickles have, without runs."""
        return FmuRuns, (self.model, self._names, self._settings)

    def opened(self) -> AbstractContextManager[None]:
        """Keep the FMU open for the time of a context; without it each run opens it."""
        return self._fmu.opened()

    def without_derivatives(self, at: Mapping[str, float]) -> FmuWithDifferences:
        """Return the FMU, which is to be opened, with values of the parameters."""
        values = {**self._others, **at}
        return FmuWithDifferences(self.model, (), [*reals(self.model.outputs)], values)

    def run(self, time: Array, inputs: Mapping[str, Array], at: Mapping[str, float]) -> Trajectory:
        """Simulate all real outputs over inputs (n,) by name, which are held between instants.

        Raises
        ------
        UserError
            If the FMU fails.
        """
        values = np.array([*at.values()])
        key = sha256(np.concatenate([time, *inputs.values(), values]).tobytes()).digest()
        with self._one_at_a_time, self.opened():
            found = self._known.get(key) or self._fmu.run(SimulationInput(time, inputs, at))
            self._known[key] = found
            while len(self._known) > _KEPT:
                self._known.pop(next(iter(self._known)))
        return found


class FmuModel(LawModel):
    """A component that corrects an FMU, with the FMU that simulates its inputs.

    Parameters
    ----------
    cls : type[Component]
        Of `output_correction`.
    names : Names
    runs : FmuRuns
    at : Mapping of str to float
        Values of the fitted parameters at which the FMU is linearised first.
    effects : Mapping of str to type[Effect]
        That a named term may lay over it, by name.
    """

    begins_as_declared = True
    is_dynamic = True

    def __init__(
        self,
        cls: type[Component],
        names: Names,
        runs: FmuRuns,
        at: Mapping[str, float],
        effects: Mapping[str, type[Effect]] | None = None,
    ):
        super().__init__(cls, effects)
        self._at = at
        self._names = names
        self._runs = runs
        index = cls.layout.parameter_index
        self._fitted = [index[names.variables[name]] for name in at]
        self._points = [np.array([*at.values()])]
        nominal = np.array([float(p.start) for p in self.parameters])
        self.linearise_at(nominal)

    def __reduce__(self) -> Any:
        """Return what copies and pickles have, with the points of linearisations so far."""
        arguments = self.cls, self._names, self._runs, self._at, self.effects
        return type(self), arguments, {"_points": self._points}

    @cached_property
    def recorded(self) -> tuple[InputDeclaration, ...]:
        """Inputs of the FMU."""
        own = {self._names.variables[name] for name in self._names.in_fmu}
        return tuple(v for v in self.inputs if v.name in own)

    @cached_property
    def targets(self) -> list[str]:
        """Outputs and inputs of the FMU."""
        own = {o.name for o in self.outputs} | set(self._names.in_fmu.values())
        return [law for law in self.laws if law in own]

    @cached_property
    def plain_laws(self) -> frozenset[str]:
        """Names of the simulated outputs of the FMU."""
        return frozenset(self._names.simulated.values())

    def depends_on(self, law: str) -> set[str]:
        """Return the input that the FMU gets, or what it simulates of an output."""
        names = self._names
        for name, own in names.in_fmu.items():
            if own == law:
                return {names.variables[name]}
        for name, simulated in names.simulated.items():
            if names.variables[name] == law:
                return {simulated}
        return super().depends_on(law)

    def reads(self, law: str) -> set[str]:
        """Return the same: what calls what is a matter of the component that stands for the FMU."""
        return self.depends_on(law)

    @property
    def received(self) -> frozenset[str]:
        """Inputs as the FMU gets them."""
        return frozenset(self._names.in_fmu.values())

    @cached_property
    def arguments(self) -> frozenset[str]:
        """Real inputs of the FMU, what it simulates, and the time."""
        inputs = (self._names.variables[name] for name in reals(self._runs.model.inputs))
        return frozenset([*inputs, *self._names.simulated.values(), "time"])

    def simulated(self, record: Record) -> Record:
        """Return a record with what the FMU simulates over its inputs.

        Raises
        ------
        UserError
            If the FMU fails.
        """
        return self._simulated(record, self._points[0])

    def linearise_at(self, parameters: Array) -> bool:
        """Linearise the FMU at its parameters too, if they are far from where it is so far."""
        point = parameters[self._fitted]
        is_new = min(self._distances(point)) > _FAR
        if is_new:
            self._points.append(point)
        return is_new

    def run(
        self, record: Record, setting: Setting, start: Array, *, sensitive: bool = False
    ) -> Course | None:
        """Run freely, by the nearest linearisation of the FMU; see `LawModel.run`."""
        nearest = self._nearest(record, setting)
        return super().run(nearest, setting, start, sensitive=sensitive)

    def linearise(self, record: Record, setting: Setting, course: Course) -> Linearisation:
        """Linearise along a course; see `LawModel.linearise`."""
        return super().linearise(self._nearest(record, setting), setting, course)

    def _distances(self, point: Array) -> list[float]:
        """Return the largest relative differences of parameters from those of linearisations."""
        return [
            float(np.max(np.abs(point - own) / np.where(own, np.abs(own), 1.0), initial=0.0))
            for own in self._points
        ]

    def _nearest(self, record: Record, setting: Setting) -> Record:
        """Return a record as the FMU simulates it with the nearest parameters, unless it fails."""
        place = int(np.argmin(self._distances(setting.parameters[self._fitted])))
        if not place:
            return record
        try:
            return self._simulated(record, self._points[place])
        except UserError:
            return record

    def _simulated(self, record: Record, point: Array) -> Record:
        """Return a record with what the FMU simulates with values (p,) of its parameters."""
        names = self._names
        columns = dict(zip((v.name for v in self.inputs), record.inputs.T.copy(), strict=True))
        # of an output that was not measured there are no slopes
        columns |= {n: v for n, v in self._computed(record, columns, point) if n in columns}
        # between samples the FMU goes on, unless it jumps with its inputs
        of_fmu = {*names.run.values(), *names.simulated.values(), *names.slopes.values()}
        smooth = dict(zip(columns, record.smooth, strict=True))
        smooth |= {name: not jumps_of(columns[name]).any() for name in of_fmu & {*columns}}
        inputs = np.ascontiguousarray(np.column_stack([*columns.values()]))
        return replace(record, inputs=inputs, smooth=tuple(smooth.values()))

    def _computed(
        self, record: Record, columns: Mapping[str, Array], point: Array
    ) -> Iterator[tuple[str, Array]]:
        """Yield columns (n,) of what an FMU simulates, and of what it was simulated with."""
        names = self._names
        at = dict(zip(names.at, point.tolist(), strict=True))
        given = {name: columns[names.variables[name]] for name in names.in_fmu}
        ran = self._ran(record, given, at)
        for name, values in given.items():
            yield names.recorded[name], values
        for name, values in ran.signals.items():
            yield names.run[name] if names.run[name] in columns else names.simulated[name], values
        for (output, parameter), slope in names.slopes.items():
            yield slope, ran.sensitivities[output][:, list(at).index(parameter)]
        for name, value in at.items():
            yield names.at[name], np.full(len(record.time), value)

    def _ran(
        self, record: Record, given: Mapping[str, Array], at: Mapping[str, float]
    ) -> Trajectory:
        """Run the FMU over the inputs of a record, as these go between its samples."""
        time = record.time - record.begin
        pairs = zip(self.inputs, record.smooth, strict=True)
        if not any(smooth for v, smooth in pairs if v in self.recorded):
            return self._runs.run(time, given, at)
        finer, shown = _finer(time)
        smooth = {name: np.interp(shown, time, values) for name, values in given.items()}
        ran = self._runs.run(finer, smooth, at)
        every = slice(None, None, _FINER)
        slopes = {name: values[every] for name, values in ran.sensitivities.items()}
        return Trajectory({name: values[every] for name, values in ran.signals.items()}, slopes)


def _finer(time: Array) -> tuple[Array, Array]:
    """Return instants between samples (n,) too, and those of which an input is shown there.

    An input in straight lines is held in several steps; at a sample it is as recorded, and in the
    steps after it ahead by so much that its integral to the next sample is exact.
    """
    step = np.diff(time)[:, np.newaxis] / _FINER
    count = np.arange(_FINER)
    ahead = np.where(count > 0, 0.5 * _FINER / (_FINER - 1.0), 0.0)
    finer = time[:-1, np.newaxis] + count * step
    shown = finer + ahead * step
    return np.append(finer.ravel(), time[-1]), np.append(shown.ravel(), time[-1])
