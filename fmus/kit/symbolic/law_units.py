"""Units as products of powers of declared units, without pint.

pint's registry takes half a second to load, and it converts units, which a model does not: the
numbers of a model in kW and mm are in kW and mm. An angle has a unit and no dimension.
"""

from __future__ import annotations

from collections.abc import Mapping

from fmus.kit import units


class Unit:
    """The unit of a number.

    Parameters
    ----------
    powers : Mapping of str to float
        Power of each unit by name, including ``rad``.
    """

    def __init__(self, powers: Mapping[str, float]):
        self.powers = {name: power for name, power in powers.items() if power}

    @property
    def exponents(self) -> dict[str, float]:
        """Powers of SI base units."""
        total: dict[str, float] = {}
        for name, power in self.powers.items():
            for base, exponent in units.base_unit(name).exponents.items():
                total[base] = total.get(base, 0.0) + power * exponent
        return {base: exponent for base, exponent in total.items() if exponent}

    @property
    def factor(self) -> float:
        """Value in SI of the number one in this unit."""
        product = 1.0
        for name, power in self.powers.items():
            product *= units.base_unit(name).factor ** power
        return product

    def __str__(self) -> str:
        above = "*".join(_factor(name, power) for name, power in self.powers.items() if power > 0.0)
        below = [f"/{_factor(name, -power)}" for name, power in self.powers.items() if power < 0.0]
        return "".join([above or "1", *below])


def dimension(unit: Unit) -> dict[str, float]:
    """Return the exponents of SI base units without those of angles."""
    return {base: power for base, power in unit.exponents.items() if base != "rad"}


def _factor(name: str, power: float) -> str:
    """Write a unit with its power."""
    return name if power == 1.0 else f"{name}^{power:g}"
