"""From measured records to the diagnosis of an FMU without equations, by corrections at its ports.

The FMU is linearised by its fitted parameters, and anew where a diagnosis moves these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError
from orchestration.diagnosis.engine import Diagnosis, diagnose
from orchestration.diagnosis.foreign.component import Fitted, Names, output_correction, reals
from orchestration.diagnosis.foreign.fmu_model import FmuModel, FmuRuns
from orchestration.diagnosis.foreign.response import FmuResponse, identify_responses
from orchestration.diagnosis.options import Options
from orchestration.diagnosis.runs import step_of
from orchestration.experiment.design import DiscriminatingExperiment
from orchestration.fmu import Model, Value
from orchestration.fmu.signal import numeric
from orchestration.identify import fit_model
from orchestration.identify.fitting import FitData, SimulationInput
from orchestration.records import Record
from orchestration.records.sampling import gaps

_T = TypeVar("_T")
_RESPONSES = 3  # times at most that responses to inputs are identified
_FAR = 0.01  # relative change of a parameter, from which on they are identified anew
_FITTED = 2.0 / 3.0  # of a single record: the rest is left out


@dataclass(frozen=True, eq=False)
class FmuDiagnosis:
    """The diagnosis of an FMU, with what its correction is made of.

    Attributes
    ----------
    diagnosis : Diagnosis
        Of the component that corrects the FMU.
    fmu : Model
    settings : Mapping of str to float or str
        Of its parameters and inputs, estimates among them.
    names : Names
    measured : list of str
        Outputs that are judged.
    moved : list of str
        Inputs that the FMU may get otherwise than they were recorded.
    experiment : tuple of float
        Stop time and step of the first record, s.
    """

    diagnosis: Diagnosis
    fmu: Model
    settings: Mapping[str, Value]
    names: Names
    measured: list[str]
    moved: list[str]
    experiment: tuple[float, float]


def diagnose_fmu(
    records: Sequence[Record],
    fmu: Model,
    holdouts: Sequence[Record] = (),
    settings: Mapping[str, Value] | None = None,
    options: Options | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> FmuDiagnosis:
    """Diagnose an FMU without equations over records.

    Parameters
    ----------
    records, holdouts : sequence of Record
        See `diagnose`; in the units of the FMU.
    fmu : Model
    settings : Mapping of str to float or str
        Values of parameters, and of inputs that stand still.
    options : Options, optional
        By names of the FMU. Of its parameters those of `fit` are fitted.
    progress : callable
        Called with a text about each step of the work.

    Raises
    ------
    UserError
        If the FMU cannot be simulated over a record, or a parameter cannot be fitted.
    """
    settings, options = settings or {}, options or Options()
    options.held(fmu.constants)
    measured = _measured_outputs(fmu, [*records, *holdouts])
    at = {}
    if options.fit:
        progress(f"fitting {', '.join(options.fit)} of {fmu.path.name}")
        is_alone = len(records) == 1 and not holdouts
        at = _first_fit(fmu, records[0], settings, [*options.fit], is_alone)
    for _ in range(_RESPONSES):
        subject = _Subject(fmu, measured, settings, at, records[0], progress)
        names = subject.names
        try:
            found = subject.diagnosed(records, holdouts, options)
        except UserError as error:
            raise UserError(names.in_words_of_fmu(str(error))) from error
        estimates = {name: found.parameters[names.variables[name]].value for name in at}
        is_fed = any(term.law in names.in_fmu.values() for term in found.final.fit.terms)
        far = max((abs(estimates[p] / v - 1.0) for p, v in at.items() if v), default=0.0)
        if not is_fed or far < _FAR:
            break
        at = estimates
    known = {**settings, **estimates}
    return FmuDiagnosis(
        found, fmu, known, subject.names, measured, subject.moved, subject.experiment
    )


class _Subject:
    """An FMU with corrections at its ports.

    Parameters
    ----------
    fmu : Model
    measured : list of str
    settings : Mapping of str to float or str
    at : Mapping of str to float
        Values of the fitted parameters, at which the FMU is linearised first.
    record : Record
        Over which its responses to inputs are identified.
    progress : callable
    """

    def __init__(
        self,
        fmu: Model,
        measured: list[str],
        settings: Mapping[str, Value],
        at: Mapping[str, float],
        record: Record,
        progress: Callable[[str], None],
    ):
        progress(f"simulating {fmu.path.name}")
        self._fmu = fmu
        self._progress = progress
        self.names = Names.of(fmu, [*at])
        self._at = at
        self._runs = FmuRuns(fmu, [*at], settings)
        self._given = {
            self.names.variables[name]: value
            for name, value in numeric(settings).items()
            if name in self.names.in_fmu
        }
        time = record.time
        self.experiment = float(time[-1] - time[0]), step_of(time)
        responses = self._responses(record, measured)
        self.moved = list(dict.fromkeys(name for _, name in responses))
        given = numeric(settings)
        fit = {}
        for name, value in at.items():
            nominal = float(given.get(name, fmu.constants[name].start))
            # one that starts at zero may be of any magnitude
            fit[name] = Fitted(nominal, abs(nominal) or abs(value) or 1.0)
        self._cls = output_correction(
            fmu,
            self.names,
            [*self.names.in_fmu],
            measured,
            self.experiment,
            fit=fit,
            responses=responses,
        )

    def _responses(
        self, record: Record, measured: Sequence[str]
    ) -> dict[tuple[str, str], FmuResponse]:
        """Identify the responses of measured outputs to the inputs that move in a record."""
        inputs: dict[str, Array] = {}
        for name in self.names.in_fmu:
            start = self._fmu.inputs[name].start
            recorded = record.signals.get(name, np.full(len(record.time), start))
            known = self._given.get(self.names.variables[name])
            inputs[name] = recorded if known is None else np.full(len(record.time), known)
        moving = [name for name in reals(self._fmu.inputs) if np.ptp(inputs[name]) > 0.0]
        with self._runs.without_derivatives(self._at) as fmu:
            given = SimulationInput(record.time, inputs, {})
            return identify_responses(fmu, given, measured, moving)

    def diagnosed(
        self, records: Sequence[Record], holdouts: Sequence[Record], options: Options
    ) -> Diagnosis:
        """Diagnose the component that corrects the FMU."""
        own = replace(
            options,
            hold=[self.names.variables[p] for p in options.hold if p in options.fit],
            fit=(),
            each=[self.names.variables.get(p, p) for p in options.each],
            given=self._given,
        )
        effects = own.effects_of(self._cls)
        model = FmuModel(self._cls, self.names, self._runs, self._at, effects)
        renamed, unseen = ([self._renamed(r) for r in part] for part in (records, holdouts))
        with self._runs.opened():
            found = diagnose(renamed, self._fmu, unseen, own, self._progress, model)
        experiment = found.experiment and self._by_fmu(found.experiment)
        return replace(
            found, records=tuple(records), holdouts=tuple(holdouts), experiment=experiment
        )

    def _by_fmu(self, experiment: DiscriminatingExperiment) -> DiscriminatingExperiment:
        """Return an experiment by names of the FMU, which is what it is rehearsed with."""
        names = {ours: name for name, ours in self.names.variables.items()}
        rehearsal = experiment.rehearsal
        return replace(
            experiment,
            stimuli=_renamed(experiment.stimuli, names),
            limits=_renamed(experiment.limits, names),
            rehearsal=replace(
                rehearsal,
                units=_renamed(rehearsal.units, names),
                outputs=[names[output] for output in rehearsal.outputs],
                parameters=_renamed(rehearsal.parameters, names),
                effects=(),
            ),
        )

    def _renamed(self, record: Record) -> Record:
        """Return a record by names of the component."""
        names = self.names.variables
        signals = {name: values for name, values in record.signals.items() if name in names}
        units = {name: record.units[name] for name in signals}
        return replace(record, signals=_renamed(signals, names), units=_renamed(units, names))


def _renamed(by_name: Mapping[str, _T], names: Mapping[str, str]) -> dict[str, _T]:
    """Return values by other names."""
    return {names[name]: value for name, value in by_name.items()}


def _measured_outputs(fmu: Model, records: Sequence[Record]) -> list[str]:
    """Return the real outputs that any record has.

    Raises
    ------
    UserError
        If there is none.
    """
    recorded = {name for record in records for name in record.signals}
    measured = [name for name in reals(fmu.outputs) if name in recorded]
    if not measured:
        raise UserError(
            f"{records[0].source}: it has no real output of {fmu.name} ({', '.join(fmu.outputs)})"
        )
    return measured


def _first_fit(
    fmu: Model, record: Record, settings: Mapping[str, Value], fit: Sequence[str], is_alone: bool
) -> dict[str, float]:
    """Fit parameters of an FMU to a record up to its first gap, without what is left out of it."""
    ends = [*(gaps(record.time) + 1).tolist(), len(record.time)]
    last = min(ends[0], int((_FITTED if is_alone else 1.0) * len(record.time)))
    signals = {name: values[:last] for name, values in record.signals.items()}
    inputs = {name: signals[name] for name in fmu.inputs if name in signals}
    outputs = {name: signals[name] for name in reals(fmu.outputs) if name in signals}
    data = FitData(record.time[:last], inputs, outputs)
    found = fit_model(fmu, [data], fit, settings)
    return {name: float(found.values[name]) for name in fit}
