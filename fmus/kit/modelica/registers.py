"""Shift registers of a component, which are arrays in Modelica."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from fmus.kit.layout import ArrayPlace
from fmus.kit.modelica.names import identifier
from fmus.kit.symbolic import Graph


class Register(NamedTuple):
    """An array of discrete states of which each takes, at a sample, the value of the one before.

    Attributes
    ----------
    name : str
    size : int
    """

    name: str
    size: int

    @property
    def states(self) -> list[str]:
        """Names of its states, the newest first."""
        return [f"{self.name}[{age}]" for age in range(1, self.size + 1)]

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
            texts[f"{self.name}_start[{place}]"] = f"{self.name}_start[{place}]"
        return texts

    def shifted(self, line: str) -> str:
        """Write the equation of the newest state as that of the array; leave others as they are."""
        left, _, newest = line.removesuffix(";").partition(" = ")
        if left != f"{self.array}[1]":
            return line
        return f"{self.array} = cat(1, {{{newest}}}, pre({self.array}[1:{self.size - 1}]));"


def registers(graph: Graph) -> list[Register]:
    """Return the shift registers of a component: no outputs, and all of one unit."""
    layout = graph.layout
    first = len(layout.parameters) + len(layout.inputs) + len(layout.states)
    found = []
    for array in layout.arrays:
        place = array.first - first
        if 0 <= place < len(layout.discretes) and _shifts(graph, array, place):
            found.append(Register(array.name, array.size))
    return found


def _shifts(graph: Graph, array: ArrayPlace, place: int) -> bool:
    """Return whether all but the first state of an array take the value of the one before."""
    state = graph.layout.discretes[place]
    clock = next(k for k, (_, group) in enumerate(graph.layout.sampled) if state in group)
    after = graph.updates[clock][place + 1 : place + array.size]
    before = graph.discretes[place : place + array.size - 1]
    return (
        array.shape == (array.size,)
        and state.type == "real"
        and not state.output
        and ca.is_equal(after, before)
    )
