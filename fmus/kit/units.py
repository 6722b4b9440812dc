"""Units parsed and converted by pint, and written for FMI, for Modelica and for people.

One string in a declaration feeds the FMU, parameter files, documentation and CSV headers. There are
two ways to write a unit: as pint reads it (``N*m``, ``ohm``), and as Modelica and FMI do (``N.m``,
``Ohm``).
"""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Protocol

from fmus.kit.errors import UserError

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
# names that are products of SI base units without a factor -> exponents of these
_COHERENT: dict[str, dict[str, int]] = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "V": {"A": -1, "kg": 1, "m": 2, "s": -3},
    "ohm": {"A": -2, "kg": 1, "m": 2, "s": -3},
    "C": {"A": 1, "s": 1},
    "F": {"A": 2, "kg": -1, "m": -2, "s": 4},
    "Hz": {"s": -1},
    "H": {"A": -2, "kg": 1, "m": 2, "s": -2},
    "S": {"A": 2, "kg": -1, "m": -2, "s": 3},
    "T": {"A": -1, "kg": 1, "s": -2},
    "Wb": {"A": -1, "kg": 1, "m": 2, "s": -2},
}
_PREFIXES = {"n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6}  # powers of ten
_LETTERS = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER = re.compile(r"(?:\^|\*\*)\(?(-?\d+)\)?")
_INVERSE = re.compile(r"1/([A-Za-z]+)(?:\^(\d+))?")
_MICRO = re.compile(r"(?<![A-Za-z])u(?=[A-Za-zΩ])")
_WRITTEN_OUT = 1e6  # below which a number has no power of ten
_SIGNS = {"ohm": "Ω", "degC": "°C", "deg": "°", "percent": "%"}
_TENS = 300  # power of ten that a number may have
_PREFIXED = ("m", "s", "A", "N", "J", "W", "Pa", "V", "ohm", "C", "F", "Hz", "H")
_LONGEST = 100  # characters of a unit
# factors, or their powers, of which none has a power itself
_UNIT_SYNTAX = re.compile(
    r"\s*(?:1\s*(?=/)|[^\W\d]\w*|[°%Ω]\w*|[()*/·.]|\s"
    r"|(?:\^|\*\*)\s*\(?[+-]?\d{1,2}(?:\.\d{1,2})?\)?(?!\s*(?:\^|\*\*|\.?\d)))*"
)
# of Modelica: a name with its power directly after it, and divisors in brackets
_FACTOR = re.compile(r"([^\W\d_]+)([+-]?\d{1,2}(?!\w))?")
_DIVISORS = re.compile(r"/\(([^()/]*)\)")


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


@lru_cache
def _without_pint(unit: str) -> BaseUnit | None:
    """Express a unit of common SI units in base units; None for any other.

    It is what pint says, of which the registry takes half a second to make.
    """
    if unit == "1":
        return BaseUnit({}, 1.0, 0.0)
    if not unit.isascii() or len(unit) > _LONGEST or not _UNIT_SYNTAX.fullmatch(unit):
        return None
    try:
        powers = _powers(ast.parse(unit.strip().replace("^", "**"), mode="eval").body)
    except (SyntaxError, ValueError):
        return None
    exponents: dict[str, int] = {}
    tens = 0
    for name, power in powers.items():
        prefix, coherent = _split(name)
        if coherent not in _COHERENT:
            return None
        tens += power * _PREFIXES.get(prefix, 0)
        for base, exponent in _COHERENT[coherent].items():
            exponents[base] = exponents.get(base, 0) + power * exponent
    if abs(tens) > _TENS:
        return None
    return BaseUnit(
        {base: exponents[base] for base in _BASE.values() if exponents.get(base)},
        float(f"1e{tens}"),
        0.0,
    )


def _split(name: str) -> tuple[str, str]:
    """Split the prefix from a name, if it has one."""
    if name not in _COHERENT and name[0] in _PREFIXES and name[1:] in _PREFIXED:
        return name[0], name[1:]
    return "", name


def powers_of_names(unit: str) -> dict[str, int]:
    """Split a unit into the names that it is a product of.

    Parameters
    ----------
    unit : str

    Returns
    -------
    dict of str to int
        Power of each name, in order of appearance; of the unit itself if it is no such product. A
        scale with a zero of its own, such as degC, is there as that of differences, delta_degC.

    Examples
    --------
    >>> powers_of_names("N*s/mm")
    {'N': 1, 's': 1, 'mm': -1}
    """
    for spelt in (unit, from_modelica(unit)):
        try:
            powers = _powers(_parsed(spelt))
        except (SyntaxError, ValueError):
            continue
        return {
            f"delta_{name}" if base_unit(name).offset else name: power
            for name, power in powers.items()
        }
    return {unit: 1}


def parse(unit: str) -> pint.Unit:
    """Parse a unit.

    Parameters
    ----------
    unit : str
        Names that pint knows, as factors of products and quotients, with brackets and powers of up
        to two digits, or the same in Modelica's grammar (``m/s2``, ``Ohm``); ``"1"`` and ``"%"``
        are dimensionless.

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
        known = _parse_or_none(spelt)
        if known is not None:
            return known
    raise UserError(f"unknown unit {unit[:_LONGEST]!r}; write it like N, mm, N*s/m, ohm, degC")


def _parse_or_none(unit: str) -> pint.Unit | None:
    """Read a unit as pint does; None if that cannot."""
    if len(unit) > _LONGEST or not _UNIT_SYNTAX.fullmatch(unit):
        return None  # pint computes any power, and 9**9**9**9 takes for ever
    try:
        return registry().Unit(unit.replace("%", "percent").replace("Ω", "ohm").replace("·", "*"))
    except Exception:
        return None


@lru_cache
def to_familiar(unit: str) -> str:
    """Write a unit of an FMU as everywhere else: ``N*m`` for ``N.m``, ``ohm`` for ``Ohm``.

    Parameters
    ----------
    unit : str
        As an FMU names it, in Modelica's grammar or not.

    Returns
    -------
    str
        `unit` unchanged if pint does not know it: an FMU may name its units as it likes.
    """
    spelt = from_modelica(unit[:_LONGEST])
    if _without_pint(spelt) is not None:
        return spelt
    return spelt if _parse_or_none(spelt) is not None else unit


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
    common = _without_pint(unit)
    if common is not None:
        return common
    one = registry().Quantity(1.0, parse(unit)).to_base_units()
    zero = registry().Quantity(0.0, parse(unit)).to_base_units()
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
        Name of the value, for the message.

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
    if not measure_alike(unit, to):
        raise UserError(f"{what}: unit {unit!r} cannot be converted to {to!r}")
    known = _without_pint(unit)
    wanted = _without_pint(to)
    if known is not None and wanted is not None and 1.0 in (known.factor, wanted.factor):
        return value * (known.factor if wanted.factor == 1.0 else 1.0 / wanted.factor)
    source = parse(unit)
    target = parse(to)
    if source == target:
        return value
    return registry().Quantity(value, source).to(target).magnitude


def check(unit: str) -> None:
    """Refuse what is no unit.

    Parameters
    ----------
    unit : str

    Raises
    ------
    UserError
        As `parse` does.
    """
    if _without_pint(unit) is None:
        parse(unit)


def measure_alike(unit: str, other: str) -> bool:
    """Return whether two units measure the same thing; see `convertible`.

    Parameters
    ----------
    unit, other : str

    Returns
    -------
    bool

    Raises
    ------
    UserError
        If one of them is none.
    """
    one = _without_pint(unit)
    another = _without_pint(other)
    if one is not None and another is not None:
        return one.exponents == another.exponents
    return convertible(parse(unit), parse(other))


def convertible(source: pint.Unit, target: pint.Unit) -> bool:
    """Return whether two parsed units measure the same thing.

    pint counts an angle as a pure number, so that 1 Hz would be 1 rad/s and 60 rpm would be 2 pi
    Hz; here an angle must remain one.

    Parameters
    ----------
    source, target : pint.Unit

    Returns
    -------
    bool
    """
    return source.dimensionality == target.dimensionality and _angles(source) == _angles(target)


def _angles(unit: pint.Unit) -> float:
    """Return the power of the angle in a unit: 1 for rad/s and rpm, 0 for Hz."""
    total = 0.0
    for name, power in registry().Quantity(1.0, unit)._units.items():
        if "radian" in str(registry().get_root_units(name)[1]):
            total += float(str(power))
    return total


class Described(Protocol):
    """A declaration, or a variable of any FMU, whose values can be written with a unit.

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
    display: Any  # str | None would not match a class that always has one: it can be set
    min: float
    max: float


def format_value(value: float, variable: Described, digits: int = 6) -> str:
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


def format_difference(value: float, variable: Described, digits: int = 6) -> str:
    """Write a difference of two values, such as an error, with its unit as people read it.

    A difference of 2 K is 2 K, where the value 2 K is written as -271 degC.

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


def format_prefixed(
    value: float, variable: Described, digits: int = 3, like: float | None = None
) -> str:
    """Write a value with an SI prefix, as people say it: ``13.0 mΩ``, ``18.0 s``, ``1.70 MN·s/m``.

    Parameters
    ----------
    value : float
        SI.
    variable : Described
        Its display unit is taken where that is no power of ten of the SI unit, such as degC.
    digits : int
        Significant ones, zeros at the end included.
    like : float, optional
        See `write_prefixed`.

    Returns
    -------
    str
    """
    if variable.type == "boolean":
        return format_value(value, variable)
    display = variable.display or variable.unit
    if display != variable.unit and not _is_prefixed(display):
        shown = convert(float(value), variable.unit, display)
        return f"{_rounded(shown, digits)} {printed(display)}"
    return write_prefixed(float(value), variable.unit, digits, like)


def write_prefixed(value: float, unit: str, digits: int = 3, like: float | None = None) -> str:
    """Write a value in an SI unit with a prefix: ``9.80 mN·m``.

    Parameters
    ----------
    value : float
    unit : str
    digits : int
        Significant ones, zeros at the end included.
    like : float, optional
        Value whose prefix is taken, so that values beside each other are in one unit; its own
        unless given, or where that is 0 or not finite.

    Returns
    -------
    str
    """
    number, shown = with_prefix(_round(value, digits), unit, _round(like or value, digits))
    return f"{_rounded(number, digits)} {shown}".removesuffix(" 1")


def _is_prefixed(unit: str) -> bool:
    """Return whether a unit is one of SI times a power of ten."""
    shown = base_unit(unit)
    return not shown.offset and math.log10(shown.factor).is_integer()


def with_prefix(value: float, unit: str, like: float | None = None) -> tuple[float, str]:
    """Return a value for a unit with an SI prefix, and that unit as it is printed.

    Parameters
    ----------
    value : float
    unit : str
        Of SI, without prefix.
    like : float, optional
        See `write_prefixed`.

    Returns
    -------
    value : float
    unit : str
    """
    powers = powers_of_names(unit) if _without_pint(unit) is not None else {}
    first, power = next(iter(powers.items()), ("", 0))
    size = abs(like) if like and math.isfinite(like) else abs(value)
    if first not in _PREFIXED or power != 1 or not size or not math.isfinite(size):
        return value, printed(unit)
    largest = 0 if first == "s" else 9  # nobody says kiloseconds
    tens = min(max(3 * math.floor(math.log10(size) / 3.0), -9), largest)
    return value / 10.0**tens, _LETTERS[tens] + printed(unit)


def _round(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")


def _rounded(number: float, digits: int) -> str:
    """Write a number with so many digits, zeros at the end included."""
    if not math.isfinite(number) or not number:
        return f"{number:g}"
    if 10.0 ** (digits - 1) <= abs(number) < _WRITTEN_OUT:
        return f"{_round(number, digits):.0f}".replace("-", "−")
    return f"{number:#.{digits}g}".removesuffix(".").replace("-", "−")


def printed(unit: str) -> str:
    """Write a unit as it is printed: ``N·s/m``, ``mΩ``, ``C⁻²``."""
    inverse = _INVERSE.fullmatch(unit)
    if inverse:
        unit = f"{inverse[1]}^-{inverse[2] or 1}"
    text = _POWER.sub(lambda power: power[1].translate(_SUPERSCRIPTS), unit)
    for name, sign in _SIGNS.items():
        text = re.sub(rf"(?<![A-Za-z])([numkMG]?){name}(?![A-Za-z])", rf"\g<1>{sign}", text)
    return _MICRO.sub("µ", text).replace("*", "·")


def _with_unit(value: float, unit: str, display: str, digits: int) -> str:
    """Write a value converted to the unit that is displayed."""
    number = f"{convert(float(value), unit, display):.{digits}g}"
    return number if display == "1" else f"{number} {display}"


def format_range(variable: Described) -> str:
    """Write the range of a variable as people read it, e.g. ``0 … 1e+06 ohm``.

    Parameters
    ----------
    variable : Described

    Returns
    -------
    str
        Empty if the range is open.
    """
    has_lower = math.isfinite(variable.min)
    has_upper = math.isfinite(variable.max)
    if has_lower and has_upper:
        least = convert(variable.min, variable.unit, variable.display or variable.unit)
        return f"{least:g} … {format_value(variable.max, variable)}"
    if has_lower:
        return f"≥ {format_value(variable.min, variable)}"
    if has_upper:
        return f"≤ {format_value(variable.max, variable)}"
    return ""


def to_modelica(unit: str) -> str:
    """Write a unit in the grammar of the Modelica language, which tools that import FMUs read.

    Parameters
    ----------
    unit : str
        As pint reads it.

    Returns
    -------
    str
        Factors with points between them, powers after names, one slash; `unit` unchanged if that
        is impossible.

    Examples
    --------
    >>> [to_modelica(u) for u in ("N*m", "ohm", "m/s/s", "A/V/s", "kg*m^2", "1/s", "1", "degC")]
    ['N.m', 'Ohm', 'm/s2', 'A/(V.s)', 'kg.m2', '1/s', '1', 'degC']
    """
    try:
        powers = _powers(_parsed(unit))
    except (SyntaxError, ValueError):
        return unit
    above: list[str] = []
    below: list[str] = []
    for name, power in powers.items():
        spelt = re.sub("(ohm|Ω)$", "Ohm", name).replace("μ", "u")
        if power:
            factors = above if power > 0 else below
            factors.append(spelt + (str(abs(power)) if abs(power) != 1 else ""))
    numerator = ".".join(above) or "1"
    if not below:
        return numerator
    denominator = ".".join(below)
    return f"{numerator}/({denominator})" if len(below) > 1 else f"{numerator}/{denominator}"


def _parsed(unit: str) -> ast.expr:
    """Parse a unit as an expression of Python; SyntaxError if it is none."""
    text = unit.strip().replace("^", "**").replace("·", "*").replace(".", "*").replace("°C", "degC")
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    return ast.parse(text, mode="eval").body


def _powers(node: ast.expr) -> dict[str, int]:
    """Return the power of each name, in order of appearance; ValueError for anything else."""
    match node:
        case ast.Name(id=name) if not any(map(str.isdigit, name)):
            return {name: 1}
        case ast.Constant(value=1):
            return {}
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
            powers = _powers(left)
            sign = 1 if isinstance(node.op, ast.Mult) else -1
            for name, power in _powers(right).items():
                powers[name] = powers.get(name, 0) + sign * power
            return powers
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            times = ast.literal_eval(exponent)
            if isinstance(times, int):
                return {name: times * power for name, power in _powers(base).items()}
    raise ValueError(node)


def from_modelica(unit: str) -> str:
    """Write a unit that may be in Modelica's grammar as pint reads it.

    The names may still be unknown to pint.

    Parameters
    ----------
    unit : str

    Returns
    -------
    str

    Examples
    --------
    >>> [from_modelica(unit) for unit in ("N.m", "mOhm", "m/s2", "A/(V.s)", "s-1", "N*s/m")]
    ['N*m', 'mohm', 'm/s^2', 'A/V/s', 's^-1', 'N*s/m']
    """
    text = _FACTOR.sub(_factor_for_pint, unit)
    text = re.sub(r"\.(?!\d)", "*", text)
    return _DIVISORS.sub(lambda match: "/" + match[1].replace("*", "/"), text)


def _factor_for_pint(match: re.Match[str]) -> str:
    """Write a name and its power as pint reads them."""
    name = match[1]
    if name.endswith("Ohm"):
        name = name.removesuffix("Ohm") + "ohm"
    return f"{name}^{match[2]}" if match[2] else name
