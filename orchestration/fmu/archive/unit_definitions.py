"""Units of an FMU's variables, by the definitions of the FMU."""

from __future__ import annotations

from functools import cache
from typing import Any
from xml.etree.ElementTree import Element

from fmus.kit import UserError
from fmus.kit.units import BASES, BaseUnit, defined_unit, difference_unit, measure_alike


def spell_units(description: Any, root: Element) -> None:
    """Give the variables of an FMU units that the kit reads, by the FMU's ``UnitDefinitions``.

    A variable gets those of its declared type as its own. Units of a relative quantity have no
    offset.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
        Its variables are changed.
    root : Element
        ``fmiModelDescription`` of FMI 2.0, of which fmpy loses what is a relative quantity.
    """
    stated = {node.get("name"): node[0] for node in root.iterfind("ModelVariables/*") if len(node)}
    meanings = _meanings(description)

    @cache
    def spelt(unit: str, display: str | None, is_relative: bool) -> str:
        known = defined_unit(display or unit, meanings.get((unit, display)))
        try:
            if display and not measure_alike(known, spelt(unit, None, is_relative)):
                return spelt(unit, None, is_relative)
            return difference_unit(known) if is_relative else known
        except UserError:  # nobody knows it
            return spelt(unit, None, is_relative) if display else known

    for variable in description.modelVariables:
        unit = _attribute(variable, "unit")
        if not unit:
            continue
        display = _attribute(variable, "displayUnit")
        own = stated[variable.name].get("relativeQuantity")
        if own is not None:
            variable.relativeQuantity = own in ("true", "1")
        is_relative = bool(_attribute(variable, "relativeQuantity"))
        variable.unit = spelt(unit, None, is_relative)
        variable.displayUnit = spelt(unit, display, is_relative) if display else None


def _attribute(variable: Any, name: str) -> Any:
    """Return an attribute of a variable, or that of its declared type."""
    own = getattr(variable, name, None)
    return getattr(variable.declaredType, name, None) if own is None else own


def _meanings(description: Any) -> dict[tuple[str, str | None], BaseUnit]:
    """Return the definitions of units, and of their display units beside them."""
    found: dict[tuple[str, str | None], BaseUnit] = {}
    for unit in description.unitDefinitions:
        base = unit.baseUnit
        if base is None:
            continue
        exponents = {name: int(getattr(base, name) or 0) for name in BASES}
        powers = {name: power for name, power in exponents.items() if power}
        factor, offset = float(base.factor or 1.0), float(base.offset or 0.0)
        found[unit.name, None] = BaseUnit(powers, factor, offset)
        for shown in unit.displayUnits:
            # value = (shown - its offset) / its factor (FMI 2.0.4, 2.2.2)
            scale = factor / float(shown.factor or 1.0)
            zero = offset - scale * float(shown.offset or 0.0)
            found[unit.name, shown.name] = BaseUnit(powers, scale, zero)
    return found
