"""Ports of a component: pairs of variables through which it exchanges power with others.

A pair is a potential, which connected ports share, and a flow, which adds up to zero over them
(Modelica 3.6, section 9.2); their product is a power. Connectors of Modelica and terminals of FMI
are made from ports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple


class Domain(NamedTuple):
    """A physical domain of ports.

    Attributes
    ----------
    potential, flow : str
        SI units of the two variables.
    """

    potential: str
    flow: str


DOMAINS: Mapping[str, Domain] = MappingProxyType(
    {
        "electrical": Domain("V", "A"),
        "translational": Domain("m", "N"),
        "rotational": Domain("rad", "N*m"),
        "thermal": Domain("K", "W"),
    }
)


@dataclass(frozen=True)
class PowerPort:
    """A pair of a component's variables whose product is a power.

    Attributes
    ----------
    name : str
    domain : {"electrical", "translational", "rotational", "thermal"}
    potential, flow : str
        Variables of the component, inputs or shown to the outside.
    connectors : tuple of str
        Names of one or two connectors. Of two, the potential is that of the first less that of the
        second, and the flow goes in at the first and out at the second.
    delivers : bool
        Whether the flow counts as positive where it leaves through the first connector.
    rate : str
        Input that is the time derivative of the potential; empty if there is none.
    """

    name: str
    domain: str
    potential: str
    flow: str
    connectors: tuple[str, ...]
    delivers: bool = False
    rate: str = ""

    @property
    def variables(self) -> tuple[str, ...]:
        """The component's variables that belong to it."""
        return tuple(filter(None, (self.potential, self.flow, self.rate)))
