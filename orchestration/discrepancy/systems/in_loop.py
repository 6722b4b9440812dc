"""A member that runs away by itself, judged in its loop: its partners hold it, corrected by what was measured of them.

A slide that is pushed by a measured force integrates the noise of that force twice, and no simulation of it stays near
a record. What keeps it in place is its partner. So the partner is simulated along with it, and what reaches the member
is the partner's output plus the partner's own residual when it is simulated by itself: where the member moves as it was
measured to, it is fed exactly what was measured, and only where it does not does the partner's model matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.systems.inputs import thinned
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.identify.noise.model import noise_std
from orchestration.master.run import run
from orchestration.system.model import Connection, Port, System

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
                    residual = (
                        partner.simulation.isolated.outputs[c.source.variable]
                        - simulated[c.source.variable]
                    )
                    self._corrections[c] = c.factor * residual

    def input_uncertainty(
        self, simulated: Mapping[str, Array], values: Mapping[str, float]
    ) -> dict[str, float]:
        """How uncertain outputs are, see `MemberSimulation`; here also because partners exchange values in steps."""
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
        """Real outputs at the samples, (n,) each; the corrections are what is thinned out and disturbed."""
        each = [(self, values), *((p.simulation, p.values) for p in self.partners)]
        connected = {c.target for c in self.connections}
        members, inputs = [], dict[str, Array]()
        for one, own in each:
            start = {
                n: v for n, v in one.start_values(own).items() if Port(one.name, n) not in connected
            }
            members.append(replace(one.isolated.member, parameters=start))
            for name, column in zip(one.inputs.names, one.inputs.columns.T, strict=True):
                if Port(one.name, name) not in connected:
                    inputs[f"{one.name}.{name}"] = self._between(column, name in one.inputs.linear)
        loop = System("loop", tuple(members), tuple(self.connections))
        read = [f"{self.name}.{output}" for output in self.outputs]
        found = run(
            loop, self._between(self.time), inputs, self._disturbances(thinning, noise), record=read
        )
        if not found.complete:
            raise KeyboardInterrupt  # nothing else leaves it incomplete
        return {
            output: found.signals[name][:: self.parts]
            for output, name in zip(self.outputs, read, strict=True)
        }

    def _disturbances(self, thinning: int, noise: np.random.Generator | None) -> dict[str, Array]:
        """What is added to connected inputs: what the partner by itself leaves of its record."""
        added = {}
        for c, correction in self._corrections.items():
            values = thinned(self.time, correction, thinning)
            if noise is not None:
                values = values + noise_std(correction) * noise.standard_normal(values.size)
            added[str(c.target)] = self._between(values)
        return added

    def _between(self, values: Array, linear: bool = True) -> Array:
        """Values at all steps, on straight lines from sample to sample, or held."""
        place = np.arange((values.size - 1) * self.parts + 1) / self.parts
        return (
            np.interp(place, np.arange(values.size), values)
            if linear
            else values[place.astype(int)]
        )
