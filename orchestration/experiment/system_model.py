"""Systems as models, which are swept, compared with records and fitted like single FMUs.

Parameters and outputs are ``member.variable``, as in experiments; inputs are those of the system,
and those of members without a connection. Sweeps run a system as `ppy run` does. For a comparison
with a record it is fused where that is possible, as the parts of a rig are coupled continuously.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices, Signals
from fmus.kit.record import CompiledModel
from orchestration.experiment.model import Master
from orchestration.experiment.subjects import (
    Subject,
    subject_of,
    unknown_laws,
    with_classes,
    with_start,
)
from orchestration.fmu import Model, Signal, Value
from orchestration.fmu.signal import numeric
from orchestration.fmu.simulation import FmuSource
from orchestration.master.reference import fuse
from orchestration.system import System, interface

_ROUNDING = 1e-9  # relative, by which a distance may exceed whole steps


def system_model(system: System, master: Master | None = None, name: str = "") -> Model:
    """Return a system as a model.

    Parameters
    ----------
    system : System
        Its members exchange values at least once in its `step`.
    master : Master, optional
        Options of running it.
    name : str
        Name of the model, for results and messages; that of the system by default.

    Raises
    ------
    UserError
        If the system does not pass its check.
    """
    subject = subject_of(system, master)
    parameters = {}
    for key, signal in _with_names(subject.parameters).items():
        if key not in subject.open_inputs:
            parameters[key] = with_start(signal, subject.settings.get(key, signal.default))
    return Model(
        name or system.name,
        Path(),
        None,
        inputs=_with_names({**subject.inputs, **subject.open_inputs}),
        outputs=_with_names({port: subject.outputs[port] for port in _all_outputs(system)}),
        parameters=parameters,
        system=SystemSource(_without_classes(system), master or Master()),
        kept=tuple(subject.recorded_by_default),
        of_others=subject.foreign,
        notes=unknown_laws(system),
    )


def _all_outputs(system: System) -> list[str]:
    """Return the outputs of all members, by ``member.variable``."""
    return [
        f"{member.name}.{name}" for member in system.members for name in interface(member).outputs
    ]


def fused_model(system: System, name: str = "") -> Model:
    """Return a system as a model whose members are connected in continuous time, if possible.

    Parameters
    ----------
    system : System
    name : str
        See `system_model`.

    Returns
    -------
    Model
        That of `system_model`, with a note, if laws of a member are unknown or there is an
        algebraic loop.

    Raises
    ------
    UserError
        If the system does not pass its check.
    """
    model = system_model(system, Master(method="fused"), name)
    try:
        # its classes are found anew, as in another process
        fuse(with_classes(_without_classes(system)))
    except UserError as error:
        note = (
            f"members exchange values once in {system.step:g} s, which a record may show: {error}"
        )
        return replace(
            model,
            system=SystemSource(_without_classes(system), Master()),
            notes=(*model.notes, note),
        )
    return model


def _without_classes(system: System) -> System:
    """Return a system without classes of members, as not all can be pickled for other processes."""
    return replace(system, members=tuple(replace(m, cls=None) for m in system.members))


def _with_names(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return signals with the names that they have in the system."""
    return {name: replace(signal, name=name) for name, signal in signals.items()}


@dataclass(frozen=True)
class SystemSource:
    """A system as a source of runs; see `orchestration.fmu.Source`.

    Attributes
    ----------
    system : System
    master : Master
        Options of running it.
    """

    system: System
    master: Master

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    @property
    def guid(self) -> str:
        """Digest of members, connections and options of running."""
        members = [
            (m.name, FmuSource(m.fmu).guid, sorted(m.parameters.items()))
            for m in self.system.members
        ]
        known = (members, self.system.connections, self.system.inputs, self.system.step)
        return sha256(repr((*known, self.master)).encode()).hexdigest()

    @property
    def default_experiment(self) -> tuple[float, float | None, float | None]:
        """Start time, stop time and step of the system, s."""
        return self.system.start, self.system.stop, self.system.step

    @property
    def nominal(self) -> dict[str, float]:
        """Nominal values that its members declare, by ``member.variable``."""
        return {
            f"{member.name}.{name}": size
            for member in self.system.members
            for name, size in FmuSource(member.fmu).nominal.items()
        }

    @property
    def files(self) -> tuple[Path, ...]:
        """The FMUs of its members."""
        return tuple(member.fmu for member in self.system.members)

    def with_files(self, files: Sequence[Path]) -> SystemSource:
        """Return the source with FMUs in other files, in the order of `files`."""
        pairs = zip(self.system.members, files, strict=True)
        members = tuple(replace(member, fmu=path) for member, path in pairs)
        return replace(self, system=replace(self.system, members=members))

    def points(self, time: Array) -> Array:
        """Return communication points (n,), no further apart than the step of the system."""
        return _divide_steps(time, self.step)[0]

    @property
    def step(self) -> float:
        """Longest time in s between two exchanges; infinite where the members are fused."""
        return np.inf if self.master.method == "fused" else self.system.step

    def open(self) -> RepeatedSystem:
        """Return the context in which the system is run."""
        return RepeatedSystem(self)


class RepeatedSystem:
    """Context manager that runs a system many times, each time from the start.

    Parameters
    ----------
    source : SystemSource
    """

    def __init__(self, source: SystemSource):
        self.remarks: set[str] = set()
        self._source = source

    def __enter__(self) -> RepeatedSystem:
        return self

    def __exit__(self, *error: Any) -> None:
        """Do nothing, as no FMU stays open from run to run."""

    @cached_property
    def _fused(self) -> CompiledModel:
        """The fused system, compiled once for all runs."""
        return CompiledModel(fuse(with_classes(self._source.system)))

    @cached_property
    def _subject(self) -> Subject:
        return subject_of(self._source.system, self._source.master)

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return [*self._subject.inputs, *self._subject.open_inputs]

    def run(
        self,
        time: Array,
        inputs: Signals,
        settings: Mapping[str, Value],
        outputs: Sequence[str],
        longest: float = np.inf,
    ) -> Array:
        """Run once from the start; see `orchestration.fmu.RepeatedFmu.run`.

        Outputs are ``member.variable``; settings are parameters and constant inputs.
        """
        points, parts = _divide_steps(time, self._source.step)
        parameters = {}
        driven = {name: np.repeat(values, parts) for name, values in inputs.items()}
        for name, value in settings.items():
            if name not in self.inputs:
                parameters[name] = value
            elif name not in inputs:
                driven[name] = np.full(points.size, value)
        if self._source.master.method == "fused":
            signals = self._fused.run(time, driven, numeric(parameters)).signals
            return np.column_stack([signals[name] for name in outputs])
        ran = self._subject.run(points, driven, parameters, outputs, self._time_limit(longest))
        if not ran.complete:  # the master returns a part after Ctrl-C
            raise KeyboardInterrupt
        first = np.cumsum(parts) - parts
        return np.column_stack([ran.signals[name][first] for name in outputs])

    def _time_limit(self, longest: float) -> Callable[[int], None]:
        """Return a progress function that raises UserError `longest` seconds after this call."""
        end = monotonic() + longest

        def check(done: int) -> None:
            if monotonic() > end:
                raise UserError(f"{self._source.name}: takes longer than {longest:.3g} s")

        return check


def _divide_steps(time: Array, step: float) -> tuple[Array, Indices]:
    """Divide the intervals between points evenly into parts no longer than a step.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    step : float

    Returns
    -------
    points : ndarray, shape (m,)
        Those of `time` are among them.
    parts : ndarray of int, shape (n,)
        Number of points from each of `time` until the next.
    """
    distances = np.diff(time, append=time[-1])
    parts = np.maximum(np.ceil(distances / step * (1.0 - _ROUNDING)), 1.0).astype(np.intp)
    first = np.cumsum(parts) - parts  # index of each of `time` among the points
    share = (np.arange(parts.sum()) - np.repeat(first, parts)) / np.repeat(parts, parts)
    return np.repeat(time, parts) + share * np.repeat(distances, parts), parts
