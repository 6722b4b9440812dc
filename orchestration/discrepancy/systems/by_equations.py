"""Diagnosis of a member in its loop by its equations, with those of its partners.

The loop is one model, closed where it cannot be cut, and is diagnosed like any other: all
parameters are fitted, and what is left has its cause named among the effects of the member.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel
from fmus.kit.symbolic import trace
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import catalogue, without_random
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.diagnosis import diagnose, searched_parameters
from orchestration.discrepancy.selection import intersample
from orchestration.discrepancy.systems.clock_shift import estimate_shift, shifts_of
from orchestration.discrepancy.systems.closed_loop import close_loop, without_limits
from orchestration.discrepancy.systems.cut import IsolatedMember
from orchestration.fmu.model import catalogue as physics_of
from orchestration.fmu.model import declared_model
from orchestration.identify.noise import noise_std
from orchestration.system import Connection, Member

# Of a record is looked at, from the first sample on, as only there is it known what a controller
# remembers: so many seconds, for a loop takes a step for every millisecond, or so many samples.
_SECONDS = 10.0
_SAMPLES = 1000
# of a record, in which the loop forgets where its fast states and its controller started
_RUN_IN = 0.05
_FORGOTTEN = 1e-3  # of the largest effect of a start, that may be left of it after that
# more of them are left to simulations of the FMUs, since each is a sensitivity of every state: the
# bench with its actuator has 31, a foot with four 90
_PARAMETERS = 40
_UNREACHED = 0.5  # noise widths, by which a limit must not matter to be left out
_TIME = 15.0  # s of processor time for the search for a cause, beside the fits of the base


@dataclass(frozen=True)
class LoopDiagnosis:
    """The diagnosis of the model of all members of a loop, by one record.

    Attributes
    ----------
    member : str
        The one whose effects were searched.
    members : dict of str to IsolatedMember
        All of them, with what was looked at of them.
    diagnosis : Diagnosis
        Variables of the partners have their names before their own.
    shifts : dict of str to float
        Of clocks, seconds.
    time : ndarray, shape (n,)
        Of what was looked at, seconds.
    before, after : dict of str to ndarray, shape (n,)
        Outputs of the model as the system has it, but for the shift of clocks, and of the final
        one.
    """

    member: str
    members: Mapping[str, IsolatedMember]
    diagnosis: Diagnosis
    shifts: Mapping[str, float]
    time: Array
    before: Mapping[str, Array]
    after: Mapping[str, Array]

    def full_name(self, member: str, variable: str) -> str:
        """Return the name of a variable of a member in the loop."""
        return _prefix(self.member, member) + variable

    def own_name(self, member: str, variable: str) -> str | None:
        """Return the name that a variable of the loop has in a member; None if it has none."""
        for name in self.members:
            prefix = _prefix(self.member, name)
            if prefix and variable.startswith(prefix):
                return variable.removeprefix(prefix) if name == member else None
        return variable if member == self.member else None


def equations_of(member: Member) -> type[Component] | None:
    """Return the class of a member, or None where its equations are not known."""
    cls = member.cls or declared_model(str(member.fmu)).cls
    return cls if cls is not None and cls.engine is None else None


def has_shift(member: Member) -> bool:
    """Return whether a member is known to sample by a clock that may be shifted."""
    cls = equations_of(member)
    return cls is not None and bool(shifts_of(cls))


def diagnose_loop(
    isolated: IsolatedMember,
    partners: Sequence[IsolatedMember],
    connections: Sequence[Connection],
    time: Array,
    progress: Callable[[str], None] = lambda text: None,
) -> LoopDiagnosis | None:
    """Diagnose a member together with its partners.

    Parameters
    ----------
    isolated : IsolatedMember
        The member whose effects are searched.
    partners : sequence of IsolatedMember
        Those that hold it.
    connections : sequence of Connection
        Among them.
    time : ndarray, shape (n,)
        Seconds.
    progress : callable
        Told what is being done.

    Returns
    -------
    LoopDiagnosis or None
        None where the equations of one of them are not known, or have too many parameters.

    Raises
    ------
    UserError
        If the loop cannot be closed or simulated.
    """
    loop = _Loop.of(isolated.member, [partner.member for partner in partners], connections)
    if loop is None:
        return None
    name = isolated.member.name
    parts = [(_prefix(name, part.member.name), part) for part in (isolated, *partners)]
    values = _values(parts)
    limited = loop.model()
    data = _dataset(limited, parts, time)
    if len(searched_parameters(limited)) > _PARAMETERS:
        return None
    unlimited = loop.without_limits().model()
    cls = limited if _matters(limited, unlimited, data, values) else unlimited
    held = [*_without_trace(cls, data, values), *program_constants(cls, data.measured)]
    parameters = [p for p in searched_parameters(cls) if p not in held]
    shifts: dict[str, float] = {}
    for shift in shifts_of(cls):
        progress(f"estimating {shift} of {name}")
        shifts[shift] = estimate_shift(cls, data, values | shifts, parameters, shift)
    values |= shifts
    effects = without_random(catalogue(cls, physics_of(loop.own), isolated.outputs))
    diagnosis = diagnose(
        cls,
        replace(data, linear=None),  # the fits decide it anew
        effects,
        values,
        progress=lambda text: progress(f"judging {name} in its loop: {text}"),
        held=held,
        budget=Budget(_TIME),
        mixed_up=False,
    )
    return LoopDiagnosis(
        name,
        {part.member.name: _looked_at(part, data, prefix) for prefix, part in parts},
        diagnosis,
        shifts,
        data.time,
        _simulated(diagnosis, data, values),
        _simulated(diagnosis, data, values | diagnosis.final.fit.values),
    )


@dataclass(frozen=True)
class _Loop:
    """The equations of a member and of its partners, by name, and how they are connected."""

    member: str
    own: type[Component]
    partners: Mapping[str, type[Component]]
    connections: Sequence[Connection]

    @classmethod
    def of(
        cls, member: Member, partners: Sequence[Member], connections: Sequence[Connection]
    ) -> _Loop | None:
        """Return the loop; None where the equations of one of them are not known."""
        own = equations_of(member)
        others = {partner.name: equations_of(partner) for partner in partners}
        known = {name: equations for name, equations in others.items() if equations is not None}
        if own is None or len(known) < len(others):
            return None
        return cls(member.name, own, known, connections)

    def model(self) -> type[Component]:
        """Return the closed loop as one component."""
        return close_loop(self.member, self.own, self.partners, self.connections)

    def without_limits(self) -> _Loop:
        """Return the loop in which no partner has limits."""
        partners = {name: without_limits(equations) for name, equations in self.partners.items()}
        return replace(self, partners=partners)


def _prefix(subject: str, member: str) -> str:
    """Return what the names of the variables of a member begin with in the loop of another."""
    return "" if member == subject else f"{member}_"


def _values(parts: Sequence[tuple[str, IsolatedMember]]) -> dict[str, float]:
    """Return the parameters that the system sets."""
    return {
        prefix + name: float(value)
        for prefix, part in parts
        for name, value in part.member.parameters.items()
        if not isinstance(value, str) and name not in part.inputs
    }


def _dataset(
    cls: type[Component], parts: Sequence[tuple[str, IsolatedMember]], time: Array
) -> Dataset:
    """Return what was measured of a loop, after the time in which it forgets how it started."""
    within = int(np.searchsorted(time, time[0] + _SECONDS))
    count = min(time.size, max(within, _SAMPLES))
    inputs: dict[str, Array] = {}
    measured: dict[str, Array] = {}
    fed = {v.name for v in cls.layout.inputs}
    settled = np.arange(count) >= _RUN_IN * count
    for prefix, part in parts:
        for name, source in part.inputs.items():
            if prefix + name in fed:
                values = source.value if source.values is None else source.values[:count]
                inputs[prefix + name] = np.broadcast_to(np.asarray(values, dtype=float), count)
        for name, values in part.outputs.items():
            measured[prefix + name] = np.where(settled, values[:count], np.nan)
    data = Dataset(time[:count], inputs, measured)
    return replace(data, linear=intersample.linear(intersample.by_course(cls, data)))


def _looked_at(isolated: IsolatedMember, data: Dataset, prefix: str) -> IsolatedMember:
    """Return a member with the part of its signals that was looked at."""
    count = len(data.time)
    inputs = {
        name: source if source.values is None else replace(source, values=source.values[:count])
        for name, source in isolated.inputs.items()
    }
    outputs = {name: data.measured[prefix + name] for name in isolated.outputs}
    return replace(isolated, inputs=inputs, outputs=outputs)


def _matters(
    limited: type[Component],
    free: type[Component],
    data: Dataset,
    values: Mapping[str, float],
) -> bool:
    """Return whether limits of partners are reached in a record."""
    with_limits, without = (
        CompiledModel(cls).run(data.time, data.inputs, values, data.linear or ()).signals
        for cls in (limited, free)
    )
    return any(
        np.sqrt(np.nanmean(np.where(np.isfinite(y), with_limits[o] - without[o], np.nan) ** 2))
        > _UNREACHED * noise_std(y)
        for o, y in data.measured.items()
    )


def _without_trace(cls: type[Component], data: Dataset, values: Mapping[str, float]) -> list[str]:
    """Return parameters without effect on what was measured, and starts that were forgotten."""
    names = searched_parameters(cls)
    run = CompiledModel(cls, names).run(data.time, data.inputs, values, data.linear or ())
    slopes = np.array([np.abs(run.sensitivities[o]) for o in data.measured])
    seen = np.array([np.isfinite(y) for y in data.measured.values()])
    largest = slopes.max(1)
    left = (slopes * seen[:, :, None]).max(1)
    is_start = np.array([name in cls.layout.start_parameters for name in names])
    traced = left > np.where(is_start, _FORGOTTEN * largest, 0.0)
    return [name for name, kept in zip(names, traced.any(0), strict=True) if not kept]


def program_constants(cls: type[Component], measured: Collection[str]) -> list[str]:
    """Return parameters that sampled laws alone depend on, where no measured output shows them.

    Whoever programs a controller knows them exactly; fitted, they make up for what drives the
    plant wrongly. An output that depends on a discrete state without delay shows them.

    Parameters
    ----------
    cls : type[Component]
    measured : collection of str
        Outputs.

    Returns
    -------
    list of str
    """
    graph = trace(cls)
    layout = cls.layout
    shown = {d.name for d in layout.discretes}
    of_discretes = graph.depends(graph.outputs, graph.discretes)
    shown |= {o.name for o, found in zip(layout.outputs, of_discretes, strict=True) if found}
    if not shown.isdisjoint(measured):
        return []
    continuous, sampled = (
        {k for column in laws for row in graph.depends(column, graph.parameters) for k in row}
        for laws in ((graph.rates, graph.outputs), graph.updates)
    )
    constants = {layout.parameters[k].name for k in sampled - continuous}
    return [name for name in searched_parameters(cls) if name in constants]


def _simulated(
    diagnosis: Diagnosis, data: Dataset, values: Mapping[str, float]
) -> dict[str, Array]:
    """Return the measured outputs as the final model has them with some parameters, (n,) each."""
    problem = diagnosis.final.problem
    # not over the samples of the problem: the last third is missing where that fit failed
    signals = problem.model.run(data.time, data.inputs, problem.start | dict(values)).signals
    return {output: signals[output] for output in data.measured}
