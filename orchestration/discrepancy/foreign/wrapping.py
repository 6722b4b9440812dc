"""Wrapping of an FMU for a diagnosis: simulation over records, and corrections of its signals.

What is diagnosed is the component that corrects the outputs of the FMU, over records that have what
the FMU simulates as inputs. The result is a system: the original FMU, connected to its corrections.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Component, Effect, stack
from fmus.kit.arrays import Array
from fmus.kit.effects import unstack
from fmus.kit.errors import UserError, suggestion
from orchestration.discrepancy.data import Dataset, ValidationData, joined_dataset
from orchestration.discrepancy.foreign.correction import (
    IN_FMU,
    RECORDED,
    OutputCorrection,
    input_correction,
    output_correction,
    real_signals,
)
from orchestration.discrepancy.foreign.response import FmuResponse, identify_responses
from orchestration.discrepancy.note import Note
from orchestration.fmu import Model, Value
from orchestration.fmu.model import model_of
from orchestration.fmu.signal import numeric
from orchestration.identify import Fit, fit_model
from orchestration.identify.fitting import FmuWithDifferences, SimulationInput
from orchestration.identify.uncertainty import Estimate
from orchestration.records import Record
from orchestration.system import Connection, Member, Port, System

_FAR = 0.01  # relative change of a parameter, from which on an FMU is linearised anew
# members of the corrected system
_FMU = "fmu"
_FEED = "feed"
_CORRECTION = "correction"


@dataclass(frozen=True)
class WrappedFmu:
    """A wrapped FMU: the component and the records that are diagnosed in its place.

    Attributes
    ----------
    original : Model
        The FMU.
    settings : dict of str to float or str
        With which it was simulated, fitted values among them.
    fit : Fit or None
    correction : OutputCorrection
    responses : dict of tuple of str to FmuResponse
        Of outputs to inputs, where a linear one follows the FMU.
    model : Model
        Of the component that corrects its outputs.
    records, holdouts : list of Record
        With what the FMU simulates over them.
    """

    original: Model
    settings: dict[str, Value]
    fit: Fit | None
    correction: OutputCorrection
    responses: dict[tuple[str, str], FmuResponse]
    model: Model
    records: list[Record]
    holdouts: list[Record]

    @property
    def moved(self) -> list[str]:
        """Inputs that may be others in the FMU than recorded, by the names of the component."""
        inputs = dict.fromkeys(name for _, name in self.responses)
        return [self.correction.names[name] for name in inputs]

    def moved_to(self, estimates: Mapping[str, Estimate]) -> dict[str, float]:
        """Return parameters of the FMU as they were estimated beside corrections.

        Empty if none is far from where it was.
        """
        estimated = {
            p: estimates[name].value
            for p, name in self.correction.fitted.items()
            if name in estimates
        }
        for p, value in estimated.items():
            before = float(self.settings.get(p, self.original.parameters[p].start))
            if abs(value - before) > _FAR * (abs(before) or 1.0):
                return estimated
        return {}

    def of_recorded(self, notes: Sequence[Note]) -> list[Note]:
        """Return notes without those on what was simulated, not recorded."""
        inputs = {v.name for v in self.correction.cls.layout.inputs}
        simulated = inputs - {*self.correction.names.values()}
        return [note for note in notes if note.subject not in simulated]

    @property
    def at_rest(self) -> list[str]:
        """Start values of states, which are known: all begins as it was recorded."""
        layout = self.correction.cls.layout
        return [layout.start_of[s.name] for s in layout.states]


def wrap(
    model: Model,
    records: Sequence[Record],
    holdouts: Sequence[Record],
    given: Mapping[str, Value],
    fit: Sequence[str] = (),
    *,
    progress: Callable[[str], None] = lambda text: None,
    at: Mapping[str, float] | None = None,
) -> WrappedFmu:
    """Simulate an FMU over records, and make the component that corrects its outputs.

    Parameters
    ----------
    model : Model
        Without equations.
    records, holdouts : sequence of Record
        In the FMU's units.
    given : Mapping of str to float or str
        Values of parameters, and of inputs that stand still.
    fit : sequence of str
        Parameters to fit first, to the first record without the part that is held out; they may
        still change, to first order, beside every correction.
    progress : callable
        Told what is being done.
    at : Mapping of str to float, optional
        Values of these parameters to linearise at, in place of a first fit.

    Raises
    ------
    UserError
        If the FMU cannot be simulated over a record, or a parameter cannot be fitted.
    """
    every = (*records, *holdouts)
    measured = _measured_outputs(model, every)
    _check_parameters(model, fit)
    settings = dict(given) | dict(at or {})
    fitted = None
    if fit and at is None:
        progress(f"fitting {', '.join(fit)} of {model.path.name}")
        whole = bool(holdouts) or len(records) > 1
        fitted = _first_fit(model, records[0], given, fit, whole=whole)
        settings |= fitted.values
    progress(f"simulating {model.path.name}")
    run = _Simulation(model, settings, measured, fit)
    responses = run.responses(records[0])
    time = records[0].time
    correction = output_correction(
        model,
        measured,
        run.fitted,
        float(time[-1] - time[0]),
        float(np.median(np.diff(time))),
        responses,
    )
    wrapped = run.wrapped(every, correction)
    return WrappedFmu(
        model,
        settings,
        fitted,
        correction,
        responses,
        replace(model_of(correction.cls), name=model.name),
        wrapped[: len(records)],
        wrapped[len(records) :],
    )


def _measured_outputs(model: Model, records: Sequence[Record]) -> list[str]:
    """Return the real outputs that any record has.

    Raises
    ------
    UserError
        If there is none.
    """
    measured = [
        name
        for name, signal in model.outputs.items()
        if any(name in record.signals for record in records) and signal.type == "real"
    ]
    if not measured:
        raise UserError(
            f"{records[0].source}: it has no real output of {model.name}"
            f" ({', '.join(model.outputs)})"
        )
    return measured


def _check_parameters(model: Model, names: Sequence[str]) -> None:
    for name in names:
        if name not in model.parameters:
            raise UserError(
                f"fit: {model.name} has no parameter named"
                f" {name!r}{suggestion(name, model.parameters)}"
            )


def _first_fit(
    model: Model,
    record: Record,
    given: Mapping[str, Value],
    fit: Sequence[str],
    *,
    whole: bool,
) -> Fit:
    """Fit parameters of an FMU to a record, without the part of it by which is judged.

    Of a record with gaps only what is before the first one is fitted to.
    """
    data = joined_dataset({"": record}, model, numeric(given))
    estimation = data if whole else ValidationData.split(data)[0]
    first: Dataset = next(iter(estimation.by_run().values()))
    return fit_model(model, first.time, first.inputs, first.measured, fit, given)


class _Simulation:
    """Simulation of an FMU over records, with derivatives.

    Parameters
    ----------
    model : Model
    settings : Mapping of str to float or str
        Of parameters and inputs.
    measured : sequence of str
        Outputs that are judged.
    fit : sequence of str
        Parameters that may change.

    Attributes
    ----------
    fitted : dict of str to float
        Values of the parameters that may change.
    """

    def __init__(
        self,
        model: Model,
        settings: Mapping[str, Value],
        measured: Sequence[str],
        fit: Sequence[str],
    ):
        self._model = model
        self._settings = settings
        self._measured = measured
        self._fit = fit
        self._outputs = [*real_signals(model.outputs)]
        self._others = {n: v for n, v in settings.items() if n not in fit and n in model.parameters}
        self.fitted = {p: float(settings.get(p, model.parameters[p].start)) for p in fit}

    def responses(self, record: Record) -> dict[tuple[str, str], FmuResponse]:
        """Identify the responses of measured outputs to the inputs that move in a record."""
        inputs = self._inputs(record)
        moving = [
            name
            for name in real_signals(self._model.inputs)
            if name in record.signals and np.ptp(inputs[name]) > 0.0
        ]
        values = {**self._others, **self.fitted}
        with FmuWithDifferences(self._model, (), self._outputs, values) as fmu:
            return identify_responses(
                fmu, SimulationInput(record.time, inputs, {}), self._measured, moving
            )

    def wrapped(self, records: Sequence[Record], correction: OutputCorrection) -> list[Record]:
        """Return records with what the FMU makes of their inputs, by names of its correction."""
        with FmuWithDifferences(self._model, self._fit, self._outputs, self._others) as fmu:
            return [self._wrapped(record, correction, fmu) for record in records]

    def _wrapped(
        self, record: Record, correction: OutputCorrection, fmu: FmuWithDifferences
    ) -> Record:
        inputs = self._inputs(record)
        ran = fmu.run(SimulationInput(record.time, inputs, self.fitted))
        names = correction.names
        units = {v.name: v.unit for v in correction.cls.layout.variables}
        declared = {v.name for v in correction.cls.layout.inputs}
        signals = {
            names[name]: values
            for name, values in (record.signals | inputs).items()
            if name in names
        }
        signals |= {correction.simulated(o): values for o, values in ran.signals.items()}
        for name, values in inputs.items():
            recorded = RECORDED.format(names.get(name, ""))
            if recorded in declared:
                signals[recorded] = values
        for k, parameter in enumerate(self.fitted):
            for output in self._measured:
                signals[correction.slope(output, parameter)] = ran.sensitivities[output][:, k]
        return replace(record, signals=signals, units={name: units[name] for name in signals})

    def _inputs(self, record: Record) -> dict[str, Array]:
        """Return what the FMU gets over a record: inputs that were set, and those recorded."""
        constant = {
            name: np.full(len(record.time), float(value))
            for name, value in self._settings.items()
            if name in self._model.inputs
        }
        recorded = {
            name: record.signals[name] for name in self._model.inputs if name in record.signals
        }
        return constant | recorded


def corrected_system(around: WrappedFmu, component: type[Component]) -> System:
    """Connect an FMU, with the parameters that were estimated, to its corrections.

    Parameters
    ----------
    around : WrappedFmu
    component : type[Component]
        The component that corrects its outputs, as a diagnosis has extended it.

    Returns
    -------
    System
        With a member ahead of the FMU where a correction is of an input.

    Raises
    ------
    UserError
        If a correction of an input depends on what the FMU gives.
    """
    original = around.original
    names = around.correction.names
    fitted = {p.name: p.start for p in component.layout.parameters}
    stop, step = around.correction.cls.experiment
    of_inputs, of_outputs = _effects_by_place(component, around.moved)
    measured = _judged_outputs(around)
    plain = output_correction(original, measured, {}, stop, step)
    members = [
        Member(_FMU, original.path, _parameters(around, fitted)),
        Member.of(_CORRECTION, _with_effects(plain.cls, of_outputs, fitted)),
    ]
    connections = [
        Connection(Port(_FMU, o), Port(_CORRECTION, plain.simulated(o)))
        for o in original.outputs
        if o in names
    ]
    free = [i for i in original.inputs if i not in around.settings]
    moved = [i for i in free if of_inputs and names.get(i) in around.moved]
    if of_inputs:
        members.append(
            Member.of(_FEED, _extended_input_correction(around, moved, of_inputs, fitted))
        )
        for i in moved:
            source = Port(_FEED, IN_FMU.format(names[i]))
            connections.append(Connection(source, Port(_FMU, i)))
    return System(
        plain.cls.name,
        tuple(members),
        tuple(connections),
        {i: _fed_ports(i, names, moved, ahead=bool(of_inputs)) for i in free},
        {o: Port(_CORRECTION, names[o]) for o in measured},
        f"{original.path.name}, corrected",
        step,
        stop,
    )


def _fed_ports(
    name: str, names: Mapping[str, str], moved: Collection[str], *, ahead: bool
) -> tuple[Port, ...]:
    """Return the ports of all members that an input of the corrected system feeds.

    Parameters
    ----------
    name : str
        As the FMU has it.
    names : Mapping of str to str
        Of inputs of corrections.
    moved : collection of str
        Inputs that the FMU gets from the member ahead of it.
    ahead : bool
        Whether there is such a member.
    """
    ports = []
    if name not in moved:
        ports.append(Port(_FMU, name))
    if name in names:
        ports.append(Port(_CORRECTION, names[name]))
        if ahead:
            ports.append(Port(_FEED, names[name]))
    return tuple(ports)


def _judged_outputs(around: WrappedFmu) -> list[str]:
    declared = {v.name for v in around.correction.cls.layout.outputs}
    names = around.correction.names
    return [output for output in around.original.outputs if names.get(output) in declared]


def _effects_by_place(
    component: type[Component], moved: Sequence[str]
) -> tuple[list[type[Effect]], list[type[Effect]]]:
    """Divide the effects of a component into those of what the FMU gets, and of what it gives."""
    _, effects = unstack(component)
    of_inputs = [effect for effect in effects if _is_of_input(effect, moved)]
    return of_inputs, [effect for effect in effects if effect not in of_inputs]


def _is_of_input(effect: type[Effect], moved: Sequence[str]) -> bool:
    """Return True if an effect is of what the FMU gets, instead of what it gives."""
    if effect.term.law:
        return effect.term.law in {IN_FMU.format(name) for name in moved}
    return effect.term.qualifier in moved


def _extended_input_correction(
    around: WrappedFmu,
    moved: Sequence[str],
    effects: Sequence[type[Effect]],
    fitted: Mapping[str, float],
) -> type[Component]:
    """Return the component that corrects inputs, with its effects."""
    stop, step = around.correction.cls.experiment
    try:
        plain = input_correction(around.original, moved, stop, step)
        return _with_effects(plain, effects, fitted)
    except UserError as error:
        raise UserError(
            f"{around.original.path.name}: what it gets was found to hang on what it gives"
            f" ({error}); as a system that is a loop, which is not made"
        ) from error


def _with_effects(
    base: type[Component], effects: Sequence[type[Effect]], fitted: Mapping[str, float]
) -> type[Component]:
    """Lay effects over a component, with fitted values of its parameters."""
    extended = stack(base, *effects)
    own = {p.name for p in extended.layout.parameters}
    defaults = {name: value for name, value in fitted.items() if name in own}
    return stack(extended, name=base.name, defaults=defaults)


def _parameters(around: WrappedFmu, fitted: Mapping[str, float]) -> dict[str, Value]:
    """Return parameters of the FMU, those that were fitted as estimated beside the correction."""
    estimated = {p: fitted[name] for p, name in around.correction.fitted.items()}
    return dict(around.settings) | estimated
