"""A member that runs away by itself, judged in its loop: its partners hold it, corrected by what was measured of them.

A slide that is pushed by a measured force integrates the noise of that force twice, and no simulation of it stays near
a record. What keeps it in place is its partner. So the partner is simulated along with it, and what reaches the member
is the partner's output plus the partner's own residual when it is simulated by itself: where the member moves as it was
measured to, it is fed exactly what was measured, and only where it does not does the partner's model matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.systems.inputs import thinned
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.fmu.instance import Fmu
from orchestration.identify.noise.model import noise_std
from orchestration.system.model import Connection

Array = NDArray[np.float64]


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
            for c in self.connections:
                if c.source.member == partner.simulation.name and c.target.member == self.name:
                    residual = partner.simulation.isolated.outputs[c.source.variable] - simulated[c.source.variable]
                    self._corrections[c] = c.factor * residual

    def input_uncertainty(self, simulated: Mapping[str, Array], values: Mapping[str, float]) -> dict[str, float]:
        """How uncertain outputs are, see `MemberSimulation`; here also because partners exchange values in steps."""
        of_inputs = super().input_uncertainty(simulated, values)
        self.parts //= 2
        coarse = self.simulate(values)
        self.parts *= 2
        return {o: float(np.hypot(u, np.sqrt(np.mean((coarse[o] - simulated[o]) ** 2)))) for o, u in of_inputs.items()}

    def _run(self, values: Mapping[str, float], thinning: int, noise: np.random.Generator | None) -> dict[str, Array]:
        """Real outputs at the samples, (n,) each; the corrections are what is thinned out and disturbed."""
        result = np.full((self.time.size, len(self.outputs)), np.nan)
        with ExitStack() as stack:
            members = {self.name: _Instance(self, values, stack)}
            members |= {p.simulation.name: _Instance(p.simulation, p.values, stack) for p in self.partners}
            for c, offset in self._offsets(thinning, noise).items():
                members[c.target.member].connect(c, members[c.source.member], offset)
            own = members[self.name]
            read = [own.outputs.index(output) for output in self.outputs]
            points = self.time.tolist()
            for k, now in enumerate(points):
                size = (points[k + 1] - now) / self.parts if k + 1 < len(points) else 0.0
                for part in range(self.parts if size else 1):
                    for member in members.values():  # each sees what those before it have made of the step
                        member.exchange(k, part / self.parts)
                        if member is own and part == 0:
                            result[k] = own.output_values[read]
                        if size:
                            member.step(now + part * size, size)
        return dict(zip(self.outputs, result.T, strict=True))

    def _offsets(self, thinning: int, noise: np.random.Generator | None) -> dict[Connection, Array]:
        """What is added to the scaled output of every connection, (n,): its own offset, and the correction."""
        offsets = {}
        for c in self.connections:
            offset = np.full(self.time.size, c.offset)
            if (correction := self._corrections.get(c)) is not None:
                offset = offset + thinned(self.time, correction, thinning)
                if noise is not None:
                    offset = offset + noise_std(correction) * noise.standard_normal(offset.size)
            offsets[c] = offset
        return offsets


class _Instance:
    """An FMU in the loop, with one array of its measured inputs and one of its real outputs."""

    def __init__(self, simulation: MemberSimulation, values: Mapping[str, float], stack: ExitStack):
        inputs, time = simulation.inputs, simulation.time
        self._names = inputs.names
        self._columns, self._changes = inputs.columns, _closed(inputs.changes(inputs.columns))
        self._wires: list[tuple[Connection, _Instance, Array, Array]] = []
        start = simulation.start_values(values)
        self._fmu = stack.enter_context(Fmu(simulation.isolated.member.fmu, start, folder=simulation.folder))
        self._fmu.start(float(time[0]), float(time[-1]))
        self.outputs = [n for n in self._fmu.outputs if self._fmu.variables[n].type == "Real"]
        self._write, self._read = self._fmu.writer(inputs.names), self._fmu.reader(self.outputs)
        self.output_values = np.zeros(len(self.outputs))
        self._read(self.output_values)

    def connect(self, connection: Connection, source: _Instance, offset: Array) -> None:
        """Take an input from another instance, with an offset (n,) that changes linearly between samples."""
        self._wires.append((connection, source, offset, _closed(np.diff(offset))))

    def exchange(self, k: int, share: float) -> None:
        """Set all inputs as they are at a share of the way from sample k to the next, and read the outputs."""
        row = self._columns[k] + share * self._changes[k]
        for c, source, offset, change in self._wires:
            value = float(source.output_values[source.outputs.index(c.source.variable)])
            row[self._names.index(c.target.variable)] = c.factor * value + (offset[k] + share * change[k])
        self._write(row)
        self._read(self.output_values)  # those that depend on the inputs at once

    def step(self, time: float, size: float) -> None:
        """Make a step, in seconds, and read the outputs."""
        self._fmu.step(time, size)
        self._read(self.output_values)


def _closed(changes: Array) -> Array:
    """Changes from every sample to the next, and none after the last."""
    return np.concatenate([changes, np.zeros_like(changes[:1])])
