"""Units through pint: one string in a declaration feeds the FMU, parameter files, docs and CSV headers."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Protocol

from fmus.kit.errors import UserError
from fmus.kit.spelling import from_modelica

if TYPE_CHECKING:
    import pint

# pint's name of each base unit -> attribute of FMI's BaseUnit
_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
_LONGEST = 100  # characters of a unit
_WRITTEN = re.compile(
    r"\s*(?:1\s*(?=/)|[^\W\d]\w*|[°%Ω]\w*|[()*/·.]|\s"
    r"|(?:\^|\*\*)\s*\(?[+-]?\d{1,2}(?:\.\d{1,2})?\)?(?!\s*(?:\^|\*\*|\.?\d)))*"
)  # factors, or their powers, of which none has a power itself


@cache
def registry() -> pint.UnitRegistry[Any]:
    """Return the project's only pint registry."""
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


@dataclass(frozen=True)
class BaseUnit:
    """A unit in SI base units: ``value_in_SI = factor * value + offset``.

    Attributes
    ----------
    exponents : dict of str to int
        FMI ``BaseUnit`` attribute to exponent, zero exponents left out.
    factor, offset : float
    """

    exponents: dict[str, int]
    factor: float
    offset: float


def parse(unit: str) -> pint.Unit:
    """Parse a unit.

    Parameters
    ----------
    unit : str
        Names that pint knows, as factors of products and quotients, with brackets and powers of up to two digits, or
        the same in Modelica's grammar (``m/s2``, ``Ohm``); ``"1"`` and ``"%"`` are dimensionless.

    Returns
    -------
    pint.Unit

    Raises
    ------
    UserError
        If it is none, or pint does not know a name.
    """
    if unit.strip() in ("", "1", "-", "–"):
        return registry().dimensionless
    for spelt in (unit, from_modelica(unit[:_LONGEST])):
        if (known := _known(spelt)) is not None:
            return known
    raise UserError(f"unknown unit {unit[:_LONGEST]!r}; write it like N, mm, N*s/m, ohm, degC")


def _known(unit: str) -> pint.Unit | None:
    """Read a unit as pint does; None if that cannot."""
    if len(unit) > _LONGEST or not _WRITTEN.fullmatch(unit):
        return None  # pint computes what it is given, and 9**9**9**9 takes for ever
    try:
        return registry().Unit(unit.replace("%", "percent").replace("Ω", "ohm").replace("·", "*"))
    except Exception:
        return None


@lru_cache
def familiar(unit: str) -> str:
    """Write a unit of an FMU as everywhere else: ``N*m`` for ``N.m``, ``ohm`` for ``Ohm``.

    Parameters
    ----------
    unit : str
        As an FMU names it, in Modelica's grammar or not.

    Returns
    -------
    str
        `unit` as it is if pint does not know it: an FMU may name its units as it likes.
    """
    spelt = from_modelica(unit[:_LONGEST])
    return spelt if _known(spelt) is not None else unit


@lru_cache
def base_unit(unit: str) -> BaseUnit:
    """Express a unit in SI base units, for FMI's ``UnitDefinitions``.

    Parameters
    ----------
    unit : str
        As pint reads it.

    Returns
    -------
    BaseUnit

    Raises
    ------
    UserError
        If FMI cannot express it: a fractional power, or a base unit outside SI.
    """
    one, zero = (
        registry().Quantity(1.0, parse(unit)).to_base_units(),
        registry().Quantity(0.0, parse(unit)).to_base_units(),
    )
    powers = {str(name): float(str(power)) for name, power in one.unit_items()}
    if not all(name in _BASE and power.is_integer() for name, power in powers.items()):
        raise UserError(
            f"unit {unit!r} is not made of integer powers of SI base units, as FMI requires"
        )
    exponents = {_BASE[name]: int(power) for name, power in powers.items()}
    return BaseUnit(exponents, float(one.magnitude - zero.magnitude), float(zero.magnitude))


def convert(value: Any, unit: str, to: str, what: str = "value") -> Any:
    """Convert a number or an array.

    Parameters
    ----------
    value : float or ndarray
    unit, to : str
        From which unit, to which.
    what : str
        What is converted, for the message.

    Returns
    -------
    float or ndarray

    Raises
    ------
    UserError
        If the two units measure different things.
    """
    if unit == to:
        return value
    source, target = parse(unit), parse(to)
    if not convertible(source, target):
        raise UserError(f"{what}: unit {unit!r} cannot be converted to {to!r}")
    return value if source == target else registry().Quantity(value, source).to(target).magnitude


def convertible(source: pint.Unit, target: pint.Unit) -> bool:
    """Whether two parsed units measure the same thing.

    pint counts an angle as a pure number, so that 1 Hz would be 1 rad/s and 60 rpm would be 2 pi Hz; here an angle
    must remain one.

    Parameters
    ----------
    source, target : pint.Unit

    Returns
    -------
    bool
    """
    return source.dimensionality == target.dimensionality and _angles(source) == _angles(target)


def _angles(unit: pint.Unit) -> float:
    """Power of the angle in a unit: 1 for rad/s and rpm, 0 for Hz."""
    powers = registry().Quantity(1.0, unit)._units
    turning = (
        power
        for name, power in powers.items()
        if "radian" in str(registry().get_root_units(name)[1])
    )
    return sum(float(str(power)) for power in turning)


class Described(Protocol):
    """What is needed to write a value: a declaration, or a variable of anybody's FMU.

    Attributes
    ----------
    type : {"real", "integer", "boolean"}
    unit : str
        SI unit.
    display : str or None
        Unit for people; None is the SI unit.
    min, max : float
        Inclusive range.
    """

    type: str
    unit: str
    display: (
        Any  # str | None would not match a class that always has one, for an attribute can be set
    )
    min: float
    max: float


def shown(value: float, variable: Described, digits: int = 6) -> str:
    """Write a value with its unit as people read it, e.g. ``0.068 mm/C``.

    Parameters
    ----------
    value : float
        SI.
    variable : Described
    digits : int
        Significant ones.

    Returns
    -------
    str
    """
    if variable.type == "boolean":
        return "true" if value else "false"
    return _with_unit(value, variable.unit, variable.display or variable.unit, digits)


def shown_difference(value: float, variable: Described, digits: int = 6) -> str:
    """Write a difference of two values, such as an error: 2 K stay 2 K, where the value 2 K would be -271 degC.

    Parameters
    ----------
    value : float
        SI.
    variable : Described
    digits : int
        Significant ones.

    Returns
    -------
    str
    """
    return _with_unit(value, variable.unit, unit_of_differences(variable), digits)


def unit_of_differences(variable: Described) -> str:
    """Choose the unit people prefer for differences: the displayed one unless it has an offset.

    Parameters
    ----------
    variable : Described

    Returns
    -------
    str
    """
    unit = variable.display or variable.unit
    return unit if convert(0.0, variable.unit, unit) == 0.0 else variable.unit


def _with_unit(value: float, unit: str, display: str, digits: int) -> str:
    return f"{convert(float(value), unit, display):.{digits}g}" + (
        "" if display == "1" else f" {display}"
    )


def allowed(variable: Described) -> str:
    """Write the range of a variable as people read it, e.g. ``0 … 1e+06 ohm``.

    Parameters
    ----------
    variable : Described

    Returns
    -------
    str
        Empty if the range is open.
    """
    low, high = math.isfinite(variable.min), math.isfinite(variable.max)
    if low and high:
        least = convert(variable.min, variable.unit, variable.display or variable.unit)
        return f"{least:g} … {shown(variable.max, variable)}"
    return (
        f"≥ {shown(variable.min, variable)}"
        if low
        else f"≤ {shown(variable.max, variable)}"
        if high
        else ""
    )
