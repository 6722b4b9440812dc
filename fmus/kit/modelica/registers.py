"""Shift registers of a component, which are arrays in Modelica."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from fmus.kit.modelica.names import identifier
from fmus.kit.symbolic import Graph

_SHORTEST = 3  # states


class Register(NamedTuple):
    """Discrete states of which each takes, at a sample, the value that the one before had.

    Attributes
    ----------
    name : str
        Stem of the names of its states: ``name_1`` is the newest.
    size : int
    """

    name: str
    size: int

    @property
    def states(self) -> list[str]:
        """Names of its states."""
        return [f"{self.name}_{age}" for age in range(1, self.size + 1)]

    @property
    def array(self) -> str:
        """Identifier of the array."""
        return identifier(self.name)

    @property
    def elements(self) -> dict[str, str]:
        """Elements of the arrays by the names of states and of their start parameters."""
        texts = {}
        for place, state in enumerate(self.states, 1):
            texts[state] = f"{self.array}[{place}]"
            texts[f"{state}_start"] = f"{self.name}_start[{place}]"
        return texts

    def shifted(self, newest: str) -> str:
        """Write the equation at a sample by the value that enters."""
        return f"{self.array} = cat(1, {{{newest}}}, pre({self.array}[1:{self.size - 1}]));"


def registers(graph: Graph) -> list[Register]:
    """Return the shift registers of a component: no outputs, and all of one unit."""
    layout = graph.layout
    places = {d.name: place for place, d in enumerate(layout.discretes)}
    found = []
    for update, (_, members) in zip(graph.updates, layout.sampled, strict=True):
        for first in members:
            name = first.name.removesuffix("_1")
            size = 1
            while (following := places.get(f"{name}_{size + 1}")) is not None:
                state = layout.discretes[following]
                before = graph.discretes[places[f"{name}_{size}"]]
                if state.output or not ca.is_equal(update[following], before):
                    break
                size += 1
            has_place = first.name.endswith("_1") and name not in layout.names
            if has_place and not first.output and first.type == "real" and size >= _SHORTEST:
                found.append(Register(name, size))
    return found
