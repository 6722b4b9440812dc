"""Simulation of a member in its loop, together with the partners that hold it, as measured.

A slide that is pushed by a measured force integrates the noise of that force twice, and no
simulation of it by itself stays near a record: its partner keeps it in place. So the partner is
simulated along with it, and the member is fed the partner's output plus the partner's own residual
when it is simulated by itself. Where the member moves as it was measured to, it is then fed exactly
what was measured; only where it does not, the partner's model matters.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.systems.member import MemberSimulation, thinned
from orchestration.discrepancy.systems.verdict import MemberDiagnosis
from orchestration.identify.noise import noise_std
from orchestration.master import run
from orchestration.system import Connection, Member, Port, System


@dataclass
class Partner:
    """A member that another is connected with, both ways.

    Attributes
    ----------
    simulation : MemberSimulation
    values : dict of str to float
        Its parameters.
    """

    simulation: MemberSimulation
    values: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the member in its system."""
        return self.simulation.name


@dataclass(kw_only=True)
class LoopSimulation(MemberSimulation):
    """A member that is simulated together with its partners.

    Attributes
    ----------
    partners : sequence of Partner
    connections : sequence of Connection
        From the member to its partners and from these to it.
    parts : int
        Steps between samples, an even number.
    """

    partners: Sequence[Partner]
    connections: Sequence[Connection]
    parts: int

    def __post_init__(self) -> None:
        super().__post_init__()
        self._corrections: dict[Connection, Array] = {}
        for partner in self.partners:
            partner.simulation.budget += 1
            simulated = partner.simulation.simulate(partner.values)
            measured = partner.simulation.isolated.outputs
            for connection in self.connections:
                source = connection.source
                if source.member == partner.name and connection.target.member == self.name:
                    residual = measured[source.variable] - simulated[source.variable]
                    self._corrections[connection] = connection.factor * residual

    def input_uncertainty(
        self, simulated: Mapping[str, Array], values: Mapping[str, float]
    ) -> dict[str, float]:
        """Estimate how uncertain outputs are, here also because partners exchange values in steps.

        See `MemberSimulation`.
        """
        of_inputs = super().input_uncertainty(simulated, values)
        self.parts //= 2
        coarse = self.simulate(values)
        self.parts *= 2
        return {
            o: float(np.hypot(u, np.sqrt(np.mean((coarse[o] - simulated[o]) ** 2))))
            for o, u in of_inputs.items()
        }

    def _run(
        self, values: Mapping[str, float], thinning: int, noise: np.random.Generator | None
    ) -> dict[str, Array]:
        """Return real outputs at the samples, (n,) each.

        Thinned out and disturbed are the corrections.
        """
        connected = {c.target for c in self.connections}
        members = [self._unconnected(self, values, connected)]
        inputs = self._unconnected_inputs(self, connected)
        for partner in self.partners:
            members.append(self._unconnected(partner.simulation, partner.values, connected))
            inputs |= self._unconnected_inputs(partner.simulation, connected)
        names = [f"{self.name}.{output}" for output in self.outputs]
        result = run(
            System("loop", tuple(members), tuple(self.connections)),
            self._at_steps(self.time),
            inputs,
            self._disturbances(thinning, noise),
            record=names,
        )
        if not result.complete:
            raise KeyboardInterrupt  # nothing else leaves it incomplete
        return {
            output: result.signals[name][:: self.parts]
            for output, name in zip(self.outputs, names, strict=True)
        }

    @staticmethod
    def _unconnected(
        simulation: MemberSimulation, values: Mapping[str, float], connected: Collection[Port]
    ) -> Member:
        """Return a member with its start values but those of connected inputs."""
        start = {
            name: value
            for name, value in simulation.start_values(values).items()
            if Port(simulation.name, name) not in connected
        }
        return replace(simulation.isolated.member, parameters=start)

    def _unconnected_inputs(
        self, simulation: MemberSimulation, connected: Collection[Port]
    ) -> dict[str, Array]:
        """Return the measured inputs of a member at all steps, but those that are connected."""
        measured = simulation.inputs
        return {
            f"{simulation.name}.{name}": self._at_steps(column, name in measured.linear)
            for name, column in zip(measured.names, measured.columns.T, strict=True)
            if Port(simulation.name, name) not in connected
        }

    def _disturbances(self, thinning: int, noise: np.random.Generator | None) -> dict[str, Array]:
        """Return the residuals of partners by themselves, which are added to connected inputs."""
        added = {}
        for connection, correction in self._corrections.items():
            values = thinned(self.time, correction, thinning)
            if noise is not None:
                values = values + noise_std(correction) * noise.standard_normal(values.size)
            added[str(connection.target)] = self._at_steps(values)
        return added

    def _at_steps(self, values: Array, linear: bool = True) -> Array:
        """Return values at all steps, on straight lines from sample to sample, or held."""
        place = np.arange((values.size - 1) * self.parts + 1) / self.parts
        if linear:
            return np.interp(place, np.arange(values.size), values)
        return values[place.astype(int)]


def loop_members(system: System, name: str) -> list[str]:
    """Return the members that feed a member and are fed by it.

    Parameters
    ----------
    system : System
    name : str
        Of the member.
    """
    fed = {c.target.member for c in system.connections if c.source.member == name}
    feeding = {c.source.member for c in system.connections if c.target.member == name}
    return [m.name for m in system.members if m.name in fed & feeding]


def connections_between(system: System, name: str, others: Sequence[str]) -> list[Connection]:
    """Return the connections from a member to some others, and from these to it."""
    ends = {(name, other) for other in others} | {(other, name) for other in others}
    return [c for c in system.connections if (c.source.member, c.target.member) in ends]


def partners_of(
    system: System,
    name: str,
    simulations: Mapping[str, MemberSimulation],
    diagnoses: Mapping[str, MemberDiagnosis],
) -> list[Partner]:
    """Return the partners of a member if all of them can be relied on.

    They must follow what they are fed, and be measured without gaps where they feed the member.

    Parameters
    ----------
    system : System
    name : str
        Of the member.
    simulations : Mapping of str to MemberSimulation
        Of members that can be simulated.
    diagnoses : Mapping of str to MemberDiagnosis
        Of all members by themselves.

    Returns
    -------
    list of Partner
        Empty if any of them cannot be relied on.
    """
    others = loop_members(system, name)
    for other in others:
        if other not in simulations or not diagnoses[other].assessable:
            return []
        measured = simulations[other].isolated.outputs
        for connection in system.connections:
            if (connection.source.member, connection.target.member) != (other, name):
                continue
            output = connection.source.variable
            if output not in measured or not np.isfinite(measured[output]).all():
                return []
    partners = []
    for other in others:
        values = {p: adjusted.value for p, adjusted in diagnoses[other].parameters.items()}
        partners.append(Partner(simulations[other], values))
    return partners
