"""Values that records of one fit do not share: of a parameter, or of a coefficient of a term.

In a fit of several records most values are common to all of them, and some are local to a group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Indices

Copy = tuple[int, int]  # position of a value, and the group in which it is another


@dataclass(frozen=True)
class LocalValues:
    """Values that are local to groups of records.

    Attributes
    ----------
    groups : tuple of str
        Names of the groups by their numbers, which records have; see `Record.group`.
    each : tuple of str
        Parameters with a value in each group.
    later : tuple of str
        Parameters with another value in the last group.
    later_values : tuple of tuple of int
        Positions of values of terms, with others in the last group; those of one term together.
    """

    groups: tuple[str, ...] = ("",)
    each: tuple[str, ...] = ()
    later: tuple[str, ...] = ()
    later_values: tuple[tuple[int, ...], ...] = ()

    @property
    def last(self) -> int:
        """Number of the last group."""
        return len(self.groups) - 1

    @property
    def changes(self) -> int:
        """Parameters and terms that differ in the last group, but for those local to each."""
        return len(self.later) + len(self.later_values)

    @property
    def released(self) -> int:
        """Values that differ there."""
        return len(self.later) + len(self.of_terms())

    def of_parameters(self, names: Sequence[str]) -> list[Copy]:
        """Return the further values of some parameters; those of others are left out."""
        further = [(name, group) for group in range(1, len(self.groups)) for name in self.each]
        further += [(name, self.last) for name in self.later]
        return [(names.index(name), group) for name, group in further if name in names]

    def of_terms(self) -> list[Copy]:
        """Return the further values of terms."""
        return [(position, self.last) for term in self.later_values for position in term]

    def name(self, name: str, group: int) -> str:
        """Return the name of a parameter's value in a group: ``R1``, or ``R1@GROUP`` if local."""
        is_local = len(self.groups) > 1 and name in (*self.each, *self.later)
        return f"{name}@{self.groups[group]}" if is_local else name


COMMON = LocalValues()  # none: all records share all values


def columns(count: int, copies: Sequence[Copy], group: int) -> Indices:
    """Return where the values of a group are among so many common ones and the copies behind."""
    places = np.arange(count)
    for k, (position, of) in enumerate(copies):
        if of == group:
            places[position] = count + k
    return places
