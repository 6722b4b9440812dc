"""Subjects of experiments: components and systems, their signals, and their execution."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from fmus.kit import registry
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from fmus.kit.storage import scratch
from orchestration import master
from orchestration.experiment.model import Experiment, Master
from orchestration.fmu import Signal, Value, find_model, read_description
from orchestration.fmu.isolation import Limits
from orchestration.fmu.model import declared_model, refuse_runtime
from orchestration.fmu.signal import read_signal
from orchestration.fmu.simulation import FmuSource, LimitOutputs
from orchestration.master.reference import Mechanical, fuse, mechanical
from orchestration.system import NAMES, Member, Port, System, library, ssp
from orchestration.system import checking as check
from orchestration.system.ssp import ENDINGS

Progress = Callable[[int], None]


_NOT_RECORDABLE = ("parameter", "input", "independent")


@dataclass(frozen=True)
class Subject:
    """A component or a system.

    Attributes
    ----------
    name : str
    inputs, parameters, outputs : Mapping of str to Signal
        Variables that can be driven, set and recorded; in a system the latter two are
        ``member.variable``. Parameters include the inputs of members without a connection.
    tunable : Mapping of str to Signal
        Parameters that can be driven, too.
    open_inputs : Mapping of str to Signal
        Inputs of members without a connection and without a value.
    why_not_settable : Mapping of str to str
        For each input that cannot be set like a parameter, the reason.
    recorded_by_default : list of str
        Outputs that are recorded unless the experiment names others.
    settings : Mapping of str to float or str
        Parameters with values of the preset, or of the members of the system.
    start, duration, step : float
        Of the default experiment, s.
    guids : Mapping of str to str
        GUID of every FMU.
    couplings : list of Mechanical
        Couplings whose energy imbalance can be computed.
    system : System
        What is run.
    prefix : str
        Removed from the names of signals of the system.
    options : Master
        Options of running it.
    foreign : bool
        Whether one of the FMUs is not ours.
    notes : sequence of str
        Remarks for the user, such as why the equations of a component are not known.
    """

    name: str
    inputs: Mapping[str, Signal]
    why_not_settable: Mapping[str, str]
    parameters: Mapping[str, Signal]
    tunable: Mapping[str, Signal]
    open_inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    recorded_by_default: Sequence[str]
    settings: Mapping[str, Value]
    start: float
    duration: float
    step: float
    guids: Mapping[str, str]
    couplings: Sequence[Mechanical]
    system: System
    prefix: str
    options: Master
    foreign: bool
    notes: Sequence[str] = ()

    @property
    def driven(self) -> Mapping[str, Signal]:
        """Everything that a stimulus can drive: inputs and tunable parameters."""
        return {**self.inputs, **self.tunable}

    def run(
        self,
        time: Array,
        inputs: Signals,
        settings: Mapping[str, Value],
        record: Sequence[str],
        progress: Progress,
        *,
        pace: master.RealTime | None = None,
        isolation: Limits | None = None,
    ) -> master.Run:
        """Run it over communication points, and return the recorded outputs.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Communication points, s.
        inputs : Mapping of str to ndarray, shape (n,)
        settings : Mapping of str to float or str
            Parameters.
        record : sequence of str
            Names of outputs.
        progress : callable
            Called with the number of computed points.
        pace : RealTime, optional
            Options of real time.
        isolation : Limits, optional
            Limits of another process, in which the FMUs run.
        """
        system = self.system.given(
            {f"{self.prefix}{name}": value for name, value in settings.items()}
        )
        names = [f"{self.prefix}{name}" for name in record]
        driven = {
            name if name in system.inputs else f"{self.prefix}{name}": values
            for name, values in inputs.items()
        }
        if self.options.method == "fused":
            return _run_fused(system, time, driven, names, progress)
        return master.run(
            system,
            time,
            driven,
            record=names,
            progress=progress,
            real_time=pace,
            isolation=isolation,
            **self.options.model_dump(exclude_none=True),
        )


@contextmanager
def open_subject(experiment: Experiment, where: str) -> Iterator[Subject]:
    """Yield the subject of an experiment, which can be run inside the context.

    Raises
    ------
    UserError
        If there is no such component, system, preset or effect, or an FMU cannot be read or built.
    """
    with scratch.folder("system") as folder:
        try:
            if experiment.component is not None:
                subject = _component_subject(experiment, experiment.component)
            else:
                system = find_system(str(experiment.system), experiment.chosen_runtime, folder)
                subject = replace(subject_of(system, experiment.master), notes=unknown_laws(system))
        except UserError as error:
            file = experiment.system
            # `where` is the system's own file if it is run without an experiment
            is_same_file = file is not None and Path(where).absolute() == Path(file)
            message = str(error).removeprefix(f"{file}: ") if is_same_file else error
            raise UserError(f"{where}: {message}") from error
        yield subject


def _component_subject(experiment: Experiment, name: str) -> Subject:
    """Return a component as a system of one member, with signals without the prefix ``member.``."""
    model = find_model(name, experiment.chosen_runtime, experiment.effects)
    start, stop, step = FmuSource(model.path).default_experiment
    duration = 10.0 if stop is None else stop - start
    member = model.path.stem.replace(".", "_")
    cls = None if model.foreign else model.cls  # the binary of a user's FMU is not ours
    system = System(
        model.name,
        members=(Member(member, model.path, model.settings([], experiment.preset), cls),),
        connections=(),
        inputs={driven: (Port(member, driven),) for driven in model.inputs},
        step=step or duration / 1000,
        start=start,
        stop=start + duration,
    )
    return replace(subject_of(system, experiment.master, f"{member}."), notes=model.notes)


def is_system(name: str) -> bool:
    """Return whether a name is that of a system or of its file, and not that of a component."""
    is_name = name in NAMES and name not in registry.models()
    return is_name or Path(name).suffix.lower() in ENDINGS


def find_system(name: str, runtime: str | None = None, folder: Path | None = None) -> System:
    """Return the system of a name or a file.

    Parameters
    ----------
    name : str
        Name of a system that ships, or an ``.ssp`` or ``.ssd`` file.
    runtime : {"native", "python"}, optional
        Kind of build of a system that ships; native by default.
    folder : Path, optional
        Where FMUs of a file are unpacked; by default in one that is kept until the process ends.

    Raises
    ------
    UserError
        If there is no such system, it cannot be read, or a kind of build is given for a file.
    """
    if Path(name).suffix.lower() in ENDINGS:
        refuse_runtime(runtime, name)
        return ssp.read(Path(name), folder or scratch.make("system"))
    return library.system(name, runtime or "native")


def subject_of(system: System, master_options: Master | None = None, prefix: str = "") -> Subject:
    """Return a system as a subject; from names of its signals a prefix is removed.

    Parameters
    ----------
    system : System
    master_options : Master, optional
        Options of running it.
    prefix : str
        Name and dot of the only member, or empty.

    Raises
    ------
    UserError
        If the system does not pass its check.
    """
    check.check(system)
    options = master_options or Master()
    why_not_settable = _why_not_settable(system)
    guids = {}
    variables = {}
    settings = {}
    for member in system.members:
        description = read_description(member.fmu)
        guids[member.name] = description.guid
        for variable in description.modelVariables:
            variables[f"{member.name}.{variable.name}".removeprefix(prefix)] = variable
        for parameter, value in member.parameters.items():
            settings[f"{member.name}.{parameter}".removeprefix(prefix)] = value
    signals = {name: read_signal(variable) for name, variable in variables.items()}
    outputs = {}
    parameters = {}
    for name, variable in variables.items():
        if _is_recordable(variable):
            outputs[name] = signals[name]
        if _is_settable(variable) and f"{prefix}{name}" not in why_not_settable:
            parameters[name] = signals[name]
    inputs = {}
    for name, targets in system.inputs.items():
        target = str(targets[0]).removeprefix(prefix)
        inputs[name] = with_start(signals[target], settings.get(target, signals[target].default))
    recorded_by_default = [str(port) for port in system.outputs.values()]
    if not recorded_by_default:
        margins = LimitOutputs.among(outputs, signals).margins
        recorded_by_default = [
            name
            for name in outputs
            if variables[name].causality == "output" and name not in margins
        ]
    return Subject(
        name=system.name,
        inputs=inputs,
        why_not_settable=why_not_settable,
        parameters=parameters,
        tunable={name: signal for name, signal in parameters.items() if signal.is_tunable},
        open_inputs={
            str(port).removeprefix(prefix): signal
            for port, signal in check.open_inputs(system).items()
        },
        outputs=outputs,
        recorded_by_default=recorded_by_default,
        settings=settings,
        start=system.start,
        duration=system.duration,
        step=system.step,
        guids=guids,
        couplings=mechanical(system) if options.couples_evenly else [],
        system=system,
        prefix=prefix,
        options=options,
        foreign=any(member.cls is None for member in system.members),
    )


def with_start(signal: Signal, start: Value) -> Signal:
    """Return a signal with the value that it has in the system."""
    if isinstance(start, str):
        return replace(signal, text=start)
    return replace(signal, start=start)


def _why_not_settable(system: System) -> dict[str, str]:
    """Return, for each input that cannot be set as a parameter, the reason."""
    reasons = {str(c.target): f"it receives {c.source}" for c in system.connections}
    for name, targets in system.inputs.items():
        reasons |= dict.fromkeys([name, *map(str, targets)], f"give it as inputs.{name}")
    return reasons


def _is_settable(variable: Any) -> bool:
    return variable.causality == "parameter" or (
        variable.causality == "input" and variable.type != "String"
    )


def _is_recordable(variable: Any) -> bool:
    return variable.causality not in _NOT_RECORDABLE and variable.type != "String"


def _run_fused(
    system: System,
    time: Array,
    inputs: Signals,
    record: Sequence[str],
    progress: Progress,
) -> master.Run:
    """Run a system as one compiled model, in which members are connected in continuous time.

    Inputs are constant between communication points, as with a master.
    """
    for name in inputs:
        if name not in system.inputs:
            raise UserError(f"{name}: parameters of a fused system cannot be driven, only inputs")
    model = CompiledModel(fuse(with_classes(system)))
    begin = perf_counter()
    signals = model.run(time, inputs).signals
    for name in record:
        if name not in signals:
            raise UserError(
                f"{name}: a fused system has states and outputs only{suggestion(name, signals)}"
            )
    progress(time.size)
    spent = master.Statistics({}, time.size - 1, 0, 0, perf_counter() - begin)
    return master.Run(time, {name: signals[name] for name in record}, {}, True, "", spent, {})


def unknown_laws(system: System) -> tuple[str, ...]:
    """Return the reasons for which the declared equations of members cannot be used."""
    unknown = [declared_model(str(m.fmu)).notes for m in system.members if m.cls is None]
    return tuple(dict.fromkeys(note for notes in unknown for note in notes))


def with_classes(system: System) -> System:
    """Return a system whose members have the classes from which their FMUs were built."""
    members = (
        m if m.cls is not None else replace(m, cls=declared_model(str(m.fmu)).cls)
        for m in system.members
    )
    return replace(system, members=tuple(members))
