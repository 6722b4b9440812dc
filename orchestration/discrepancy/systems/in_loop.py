"""A member that runs away by itself, judged in its loop: its partners hold it, corrected by what was measured of them.

A slide that is pushed by a measured force integrates the noise of that force twice, and no simulation of it stays near
a record. What keeps it in place is its partner. So the partner is simulated along with it, and what reaches the member
is the partner's output plus what the partner by itself leaves unexplained of the record: where the member moves as it
was measured to, it is fed exactly what was measured, and only where it does not does the partner's model matter.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.systems.member import BudgetExceeded, MemberSimulation, floor
from orchestration.fmu.instance import Fmu
from orchestration.system.model import Connection

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]


@dataclass
class Partner:
    """A member that another is connected with, either way.

    Attributes
    ----------
    alone : MemberSimulation
    values : dict of str to float
        Its parameters.
    """

    alone: MemberSimulation
    values: dict[str, float] = field(default_factory=dict)


@dataclass
class InLoop(MemberSimulation):
    """A member that is simulated together with its partners.

    Attributes
    ----------
    partners : list of Partner
    connections : list of Connection
        From the member to its partners and from these to it.
    parts : int
        Steps between samples, an even number.
    """

    partners: list[Partner] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    parts: int = 2

    def doubt(self, simulated: Mapping[str, Array], values: Mapping[str, float]) -> dict[str, float]:
        """How uncertain outputs are, see `MemberSimulation.doubt`; here also because partners meet in steps."""
        found = super().doubt(simulated, values)
        self.parts //= 2
        coarse = self.simulate(values)
        self.parts *= 2
        return {o: float(np.hypot(d, np.sqrt(np.mean((coarse[o] - simulated[o]) ** 2)))) for o, d in found.items()}

    def __post_init__(self) -> None:
        own = self.cut.member.name
        self._correction: dict[Connection, Array] = {}
        for partner in self.partners:
            name = partner.alone.cut.member.name
            partner.alone.most += 1
            simulated = partner.alone.simulate(partner.values)
            for c in self.connections:
                if c.source.member == name and c.target.member == own:
                    left = partner.alone.cut.outputs[c.source.variable] - simulated[c.source.variable]
                    self._correction[c] = c.factor * left

    def simulate(
        self, values: Mapping[str, float], every: int = 1, disturbed: np.random.Generator | None = None
    ) -> dict[str, Array]:
        """Simulate, see `MemberSimulation.simulate`; ``every`` thins out what is measured of the partners."""
        if self.made >= self.most:
            raise BudgetExceeded
        self.made += 1
        self.tell(self.made)
        outputs = self.shown
        result = np.full((self.time.size, len(outputs)), np.nan)
        with ExitStack() as stack:
            members = {self.cut.member.name: _Running(self, values, stack)}
            for p in self.partners:
                members[p.alone.cut.member.name] = _Running(p.alone, p.values, stack)
            wires = []
            for c in self.connections:
                added = np.full(self.time.size, c.offset) + self._thinned(self._correction.get(c), every)
                if disturbed is not None and c in self._correction:
                    added = added + floor(self._correction[c]) * disturbed.standard_normal(added.size)
                wires.append((c, added))
            own = members[self.cut.member.name]
            chosen = [own.outputs.index(o) for o in outputs]
            points = self.time.tolist()
            for k, now in enumerate(points):
                size = (points[k + 1] - now) / self.parts if k + 1 < len(points) else 0.0
                for part in range(self.parts if size else 1):
                    share = part / self.parts
                    for member in members.values():  # each sees what those before it have made of the step
                        member.prepare(k, share)
                        for c, added in wires:
                            if c.target.member == member.name:
                                shift = added[k] + share * (added[k + 1] - added[k]) if size else added[k]
                                source = members[c.source.member].value(c.source.variable)
                                member.row[member.inputs.index(c.target.variable)] = c.factor * source + shift
                        member.apply()
                        if member is own and part == 0:
                            result[k] = own.seen[chosen]
                        if size:
                            member.fmu.step(now + part * size, size)
                            member.look()
        if not np.isfinite(result).all():
            raise UserError(f"{self.cut.member.name}: an output is not a finite number")
        return {name: result[:, i] for i, name in enumerate(outputs)}

    def _thinned(self, values: Array | None, every: int) -> Array:
        if values is None:
            return np.zeros(self.time.size)
        kept = np.unique([*range(0, self.time.size, every), self.time.size - 1])
        return np.interp(self.time, self.time[kept], values[kept])


class _Running:
    """An instance in the loop: a row of all its driven inputs, a row of its outputs."""

    def __init__(self, alone: MemberSimulation, values: Mapping[str, float], stack: ExitStack):
        cut = alone.cut
        self.name, self.inputs = cut.member.name, [n for n, f in cut.inputs.items() if f.values is not None]
        self.columns = [f.values for f in cut.inputs.values() if f.values is not None]
        self.moving = [n in alone.moving for n in self.inputs]
        constant = {n: f.value for n, f in cut.inputs.items() if f.value is not None}
        first = {n: float(c[0]) for n, c in zip(self.inputs, self.columns, strict=True)}
        given = {**cut.member.parameters, **constant, **values, **first}
        self.fmu = stack.enter_context(Fmu(cut.member.fmu, given, folder=alone.folder))
        self.fmu.start(float(alone.time[0]), float(alone.time[-1]))
        self.outputs = [n for n in self.fmu.outputs if self.fmu.variables[n].type == "Real"]
        self._feed, self._read = self.fmu.writer(self.inputs), self.fmu.reader(self.outputs)
        self.row, self.seen = np.array(list(first.values())), np.zeros(len(self.outputs))
        self.look()

    def prepare(self, k: int, share: float) -> None:
        """Take inputs from the record, at a share of the way from one sample to the next."""
        for i, column in enumerate(self.columns):
            last = k + 1 == column.size or not self.moving[i]
            self.row[i] = column[k] if last else column[k] + share * (column[k + 1] - column[k])

    def value(self, output: str) -> float:
        """Newest value of an output."""
        return float(self.seen[self.outputs.index(output)])

    def apply(self) -> None:
        """Set the inputs; outputs that depend on them change at once."""
        self._feed(self.row)
        self.look()

    def look(self) -> None:
        """Read the outputs."""
        self._read(self.seen)
