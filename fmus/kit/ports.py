"""Ports of a component: pairs of variables through which it exchanges power with others.

A pair is a potential, which is equal at connected ports, and a flow, whose sum over them is zero
(Modelica 3.6, section 9.2); the product is a power. Modelica connectors and FMI terminals are
written from ports.
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
        Variables of the component: inputs, or outputs of the FMU.
    connectors : tuple of str
        Names of one or two connectors. With two, the potential is the difference first less second,
        and the flow enters at the first and leaves at the second.
    delivers : bool
        Whether a positive flow leaves through the first connector.
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
        """Variables of the component that belong to the port."""
        return tuple(filter(None, (self.potential, self.flow, self.rate)))
