"""Subjects of an experiment, a component or a system: their signals, and a way to run them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol

from fmus.kit.arrays import Array
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
from orchestration.system import Member, Port, System, library, ssp
from orchestration.system import checking as check
from orchestration.system.ssp import ENDINGS

Progress = Callable[[int], None]


class Runner(Protocol):
    """Runs a subject over communication points."""

    def __call__(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        record: Sequence[str],
        progress: Progress,
        *,
        pace: master.RealTime | None = None,
        isolation: Limits | None = None,
    ) -> master.Run:
        """Return the recorded outputs.

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
            Called with the number of points done.
        pace : RealTime, optional
            Keeps pace with real time.
        isolation : Limits, optional
            Of a process beside this one, in which the run goes on.
        """


_NO_READING = ("parameter", "input", "independent")


@dataclass(frozen=True)
class Subject:
    """A component or a system.

    Attributes
    ----------
    name : str
    inputs, parameters, outputs : Mapping of str to Signal
        What can be driven, set and recorded; in a system the latter two are ``member.variable``.
        Inputs of members that nothing feeds can be set.
    open_inputs : Mapping of str to Signal
        Those of them that have no value yet.
    why_not_settable : Mapping of str to str
        Inputs that cannot be set, and why.
    recorded_by_default : list of str
        Outputs that are recorded unless the experiment names others.
    settings : Mapping of str to float or str
        Parameters that are set already: those of the preset, or of the members of the system.
    duration, step : float
        Seconds, of its default experiment.
    guids : Mapping of str to str
        GUID of every FMU.
    couplings : list of Mechanical
        Those whose imbalance can be computed.
    run : callable
        A `Runner`.
    foreign : bool
        Whether an FMU among it is not one of ours.
    notes : sequence of str
        Remarks for the user, such as why the equations of a component are not known.
    """

    name: str
    inputs: Mapping[str, Signal]
    why_not_settable: Mapping[str, str]
    parameters: Mapping[str, Signal]
    open_inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    recorded_by_default: Sequence[str]
    settings: Mapping[str, Value]
    duration: float
    step: float
    guids: Mapping[str, str]
    couplings: Sequence[Mechanical]
    run: Runner
    foreign: bool
    notes: Sequence[str] = ()


@contextmanager
def subject(experiment: Experiment, where: str) -> Iterator[Subject]:
    """Find what an experiment is made on; while the context lasts, it can be run.

    Raises
    ------
    UserError
        If there is no such component, system, preset or effect, or an FMU cannot be read or built.
    """
    with scratch.folder("system") as folder:
        try:
            if experiment.component is not None:
                made_on = _component(experiment, experiment.component)
            else:
                made_on = _system(experiment, str(experiment.system), folder)
        except UserError as error:
            system = experiment.system
            itself = system is not None and Path(where).absolute() == Path(system)
            told = str(error).removeprefix(f"{system}: ") if itself else error
            raise UserError(f"{where}: {told}") from error
        yield made_on


def _component(experiment: Experiment, name: str) -> Subject:
    """Wrap a component as a system of one member, whose signals need no ``member.`` before them."""
    model = find_model(name, experiment.chosen_runtime, experiment.effects)
    start, stop, step = FmuSource(model.path).default_experiment
    duration = 10.0 if stop is None else stop - start
    member = model.path.stem.replace(".", "_")
    cls = None if model.foreign else model.cls  # whatever its laws, its binary is the user's
    system = System(
        model.name,
        members=(Member(member, model.path, model.settings([], experiment.preset), cls),),
        connections=(),
        inputs={name: (Port(member, name),) for name in model.inputs},
        step=step or duration / 1000,
        stop=duration,
    )
    return replace(subject_of(system, experiment.master, f"{member}."), notes=model.notes)


def _system(experiment: Experiment, name: str, folder: Path) -> Subject:
    """Read a system from its file, or build one that ships."""
    if Path(name).suffix.lower() in ENDINGS:
        refuse_runtime(experiment.chosen_runtime, name)
        system = ssp.read(Path(name), folder)
        return replace(subject_of(system, experiment.master), notes=unknown_laws(system))
    return subject_of(library.system(name, experiment.runtime), experiment.master)


def subject_of(system: System, master_options: Master | None = None, prefix: str = "") -> Subject:
    """Return a system as a subject, whose signals are named without a prefix.

    Parameters
    ----------
    system : System
    master_options : Master, optional
        How it is run.
    prefix : str

    Raises
    ------
    UserError
        If it does not pass its check.
    """
    check.check(system)
    described = {member.name: read_description(member.fmu) for member in system.members}
    variables = {
        f"{member}.{v.name}".removeprefix(prefix): v
        for member, description in described.items()
        for v in description.modelVariables
    }
    outputs = {name: read_signal(v) for name, v in variables.items() if _is_recordable(v)}
    first_port = {
        name: str(targets[0]).removeprefix(prefix) for name, targets in system.inputs.items()
    }
    why_not_settable = _why_not_settable(system)
    options = master_options or Master()
    parameters = {name: read_signal(v) for name, v in variables.items()}
    margins = LimitOutputs.among(outputs, parameters).margins
    named_outputs = [str(port) for port in system.outputs.values()]
    return Subject(
        name=system.name,
        inputs={name: read_signal(variables[port]) for name, port in first_port.items()},
        why_not_settable=why_not_settable,
        parameters={
            name: read_signal(v)
            for name, v in variables.items()
            if v.causality == "parameter"
            or (
                v.causality == "input"
                and v.type != "String"
                and f"{prefix}{name}" not in why_not_settable
            )
        },
        open_inputs={
            str(port).removeprefix(prefix): signal
            for port, signal in check.open_inputs(system).items()
        },
        outputs=outputs,
        recorded_by_default=named_outputs
        or [
            name
            for name in outputs
            if variables[name].causality == "output" and name not in margins
        ],
        settings={
            f"{m.name}.{n}".removeprefix(prefix): v
            for m in system.members
            for n, v in m.parameters.items()
        },
        duration=system.stop,
        step=system.step,
        guids={name: description.guid for name, description in described.items()},
        couplings=mechanical(system) if options.couples_evenly else [],
        run=_runner(system, prefix, options),
        foreign=any(member.cls is None for member in system.members),
    )


def _why_not_settable(system: System) -> dict[str, str]:
    """Return why inputs are not set like parameters, by their names and those of the system."""
    reasons = {str(c.target): f"it receives {c.source}" for c in system.connections}
    for name, targets in system.inputs.items():
        reasons |= dict.fromkeys([name, *map(str, targets)], f"give it as inputs.{name}")
    return reasons


def _runner(system: System, prefix: str, master_options: Master) -> Runner:
    """Return a runner of a system, whose signals are named without a prefix."""

    def run(
        time: Array,
        inputs: Mapping[str, Array],
        settings: Mapping[str, Value],
        record: Sequence[str],
        progress: Progress,
        *,
        pace: master.RealTime | None = None,
        isolation: Limits | None = None,
    ) -> master.Run:
        ready = system.given({f"{prefix}{name}": value for name, value in settings.items()})
        names = [f"{prefix}{name}" for name in record]
        if master_options.method == "fused":
            return _fused(ready, time, inputs, names, progress)
        return master.run(
            ready,
            time,
            inputs,
            record=names,
            progress=progress,
            real_time=pace,
            isolation=isolation,
            **master_options.model_dump(exclude_none=True),
        )

    return run


def _is_recordable(variable: Any) -> bool:
    return variable.causality not in _NO_READING and variable.type != "String"


def _fused(
    system: System,
    time: Array,
    inputs: Mapping[str, Array],
    record: Sequence[str],
    progress: Progress,
) -> master.Run:
    """Run a system as one compiled model.

    Inputs are held as a master holds them; members exchange all the time.
    """
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
    """Return why equations of members are not known, of those that tell what they are made from."""
    unknown = [declared_model(str(m.fmu)).notes for m in system.members if m.cls is None]
    return tuple(dict.fromkeys(note for notes in unknown for note in notes))


def with_classes(system: System) -> System:
    """Return a system whose members have the classes that their FMUs were built from."""
    members = (
        m if m.cls is not None else replace(m, cls=declared_model(str(m.fmu)).cls)
        for m in system.members
    )
    return replace(system, members=tuple(members))


def known(name: str, among: Mapping[str, Signal], what: str, where: str) -> Signal:
    """Return a signal by its name; UserError with the nearest one if there is none."""
    if name not in among:
        raise UserError(f"{where}: {what} named {name!r}{suggestion(name, among)}")
    return among[name]
