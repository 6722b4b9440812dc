"""Units: parsed and converted by pint, and written for FMI, for Modelica and for people.

A unit is a string, declared once for the FMU, parameter files, documentation and CSV headers. It
has two spellings: that of pint (``N*m``, ``ohm``), and that of Modelica and FMI (``N.m``, ``Ohm``).
"""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass, replace
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
BASES = tuple(_BASE.values())
# units that are products of SI base units without a factor
_COHERENT = {
    **{base: base for base in BASES},
    "N": "kg*m/s^2",
    "J": "kg*m^2/s^2",
    "W": "kg*m^2/s^3",
    "Pa": "kg/(m*s^2)",
    "V": "kg*m^2/(A*s^3)",
    "ohm": "kg*m^2/(A^2*s^3)",
    "C": "A*s",
    "F": "A^2*s^4/(kg*m^2)",
    "Hz": "1/s",
    "H": "kg*m^2/(A^2*s^2)",
    "S": "A^2*s^3/(kg*m^2)",
    "T": "kg/(A*s^2)",
    "Wb": "kg*m^2/(A*s^2)",
}
_PREFIXES = {"n": -9, "u": -6, "m": -3, "c": -2, "k": 3, "M": 6}  # powers of ten
_LETTERS = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER = re.compile(r"(?:\^|\*\*)\(?(-?\d+)\)?")
_INVERSE = re.compile(r"1/([A-Za-z]+)(?:\^(\d+))?")
_MICRO = re.compile(r"(?<![A-Za-z])u(?=[A-Za-zΩ])")
_WITH_POWER_OF_TEN = 1e6  # smallest number that is written with a power of ten
_SINGLE_CHARACTERS = str.maketrans({"℃": "°C", "℉": "°F", "\u2126": "Ω", "\u212b": "Å"})
_SIGNS = {"ohm": "Ω", "degC": "°C", "degF": "°F", "deg": "°", "percent": "%"}
_LARGEST_POWER_OF_TEN = 300  # of a factor, which must be a float
# names that may have an SI prefix
_PREFIXED = ("m", "s", "A", "N", "J", "W", "Pa", "V", "ohm", "C", "F", "Hz", "H")
_LONGEST = 100  # largest number of characters of a unit
# factors and powers of them; a power has no power itself
_UNIT_SYNTAX = re.compile(
    r"\s*(?:1\s*(?=/)|[^\W\d]\w*|[°%Ω]\w*|[()*/·.]|\s"
    r"|(?:\^|\*\*)\s*\(?[+-]?\d{1,2}(?:\.\d{1,2})?\)?(?!\s*(?:\^|\*\*|\.?\d)))*"
)
# Modelica's grammar: a name directly followed by its power, and divisors in brackets
_FACTOR = re.compile(r"([^\W\d_]+)([+-]?\d{1,2}(?!\w))?")
_DIVISORS = re.compile(r"/\(([^()/]*)\)")
# what an FMU defines and nobody has a name for, such as 0.0254*m
_SCALED = re.compile(r"(\d[\d.]*(?:e[+-]?\d+)?)\*(.+)")
# names for what an FMU defines under another name
_USUAL = ("rpm", "rpm/s", "deg", "deg/s", "turn", "degC", "degF", "percent", "bar", "min", "h", "d")


@cache
def registry() -> pint.UnitRegistry[Any]:
    """Return the pint registry of this process."""
    import pint

    made: pint.UnitRegistry[Any] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    made.define("@alias turn = rev")  # rev/min is the speed of the Modelica Standard Library
    return made


@dataclass(frozen=True)
class BaseUnit:
    """A unit in SI base units: ``value_in_SI = factor * value + offset``.

    Attributes
    ----------
    exponents : dict of str to int
        Nonzero exponent by attribute of FMI's ``BaseUnit``.
    factor, offset : float
    """

    exponents: dict[str, int]
    factor: float
    offset: float


@lru_cache
def _common_base_unit(unit: str) -> BaseUnit | None:
    """Return a product of common SI units in base units without pint; None for any other unit.

    The result is that of pint, whose registry takes half a second to load.
    """
    if unit == "1":
        return BaseUnit({}, 1.0, 0.0)
    scaled = _SCALED.fullmatch(unit)
    if scaled:
        product = _common_base_unit(scaled[2])
        return product and replace(product, factor=float(scaled[1]) * product.factor)
    if not unit.isascii() or len(unit) > _LONGEST or not _UNIT_SYNTAX.fullmatch(unit):
        return None
    try:
        powers = _powers(ast.parse(unit.strip().replace("^", "**"), mode="eval").body)
    except (SyntaxError, ValueError):
        return None
    exponents: dict[str, int] = {}
    tens = 0
    for name, power in powers.items():
        prefix, coherent = _split_prefix(name)
        if coherent not in _COHERENT:
            return None
        tens += power * _PREFIXES.get(prefix, 0)
        for base, exponent in _powers(_parsed(_COHERENT[coherent])).items():
            exponents[base] = exponents.get(base, 0) + power * exponent
    if abs(tens) > _LARGEST_POWER_OF_TEN:
        return None
    return BaseUnit(
        {base: exponents[base] for base in BASES if exponents.get(base)},
        float(f"1e{tens}"),
        0.0,
    )


def _split_prefix(name: str) -> tuple[str, str]:
    """Return the SI prefix of a unit's name, empty if it has none, and the name without it."""
    if name not in _COHERENT and name[0] in _PREFIXES and name[1:] in _PREFIXED:
        return name[0], name[1:]
    return "", name


def powers_of_names(unit: str) -> dict[str, int]:
    """Return the names of units in a product, with their powers.

    Parameters
    ----------
    unit : str

    Returns
    -------
    dict of str to int
        Power of each name, in order of appearance; the unit with power 1 if it is no product of
        names. A unit with an offset, such as degC, is replaced by that of differences, delta_degC.

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
        return {difference_unit(name): power for name, power in powers.items()}
    return {unit: 1}


def parse(unit: str) -> pint.Unit:
    """Parse a unit.

    Parameters
    ----------
    unit : str
        Product or quotient of names that pint knows, with brackets and powers of up to two digits,
        or the same in Modelica's grammar (``m/s2``, ``Ohm``); ``"1"`` and ``"%"`` are
        dimensionless.

    Returns
    -------
    pint.Unit

    Raises
    ------
    UserError
        If it is no unit, or pint does not know a name.
    """
    if unit.strip() in ("", "1", "-", "–"):
        return registry().dimensionless
    plain = unit.translate(_SINGLE_CHARACTERS)
    for spelt in (plain, from_modelica(plain[:_LONGEST])):
        known = _parse_or_none(spelt)
        if known is not None:
            return known
    raise UserError(f"unknown unit {unit[:_LONGEST]!r}; write it like N, mm, N*s/m, ohm, degC")


def _parse_or_none(unit: str) -> pint.Unit | None:
    """Return the unit that pint reads; None if it cannot read it."""
    scaled = _SCALED.fullmatch(unit)
    if len(unit) > _LONGEST or not _UNIT_SYNTAX.fullmatch(scaled[2] if scaled else unit):
        return None  # pint would evaluate any power, such as 9**9**9**9
    try:
        if scaled:
            return registry().Unit(_scaled(unit))
        return registry().Unit(unit.replace("%", "percent").replace("Ω", "ohm").replace("·", "*"))
    except Exception:
        return None


@cache
def _scaled(unit: str) -> str:
    """Return the name that pint is given for a unit with a factor, which it has no units of."""
    name = f"scaled_{unit.encode().hex()}"
    registry().define(f"{name} = {unit}")
    return name


@lru_cache
def to_familiar(unit: str) -> str:
    """Return a unit of an FMU in pint's spelling: ``N*m`` for ``N.m``, ``ohm`` for ``Ohm``.

    Parameters
    ----------
    unit : str
        Unit as written in an FMU, in Modelica's grammar or not.

    Returns
    -------
    str
        `unit` unchanged if pint does not know it, as units of an FMU may have any name.
    """
    spelt = from_modelica(unit[:_LONGEST])
    is_known = _common_base_unit(spelt) is not None or _parse_or_none(spelt) is not None
    return spelt if is_known else unit


def defined_unit(name: str, meaning: BaseUnit | None) -> str:
    """Return a unit that an FMU names and defines, in a spelling that `parse` reads.

    Where pint reads the name with another meaning, or not at all, the definition decides (FMI
    2.0.4, 2.2.2). ``1/min`` of Modelica, which is 2 pi / 60 rad/s there, is ``rpm``.

    Parameters
    ----------
    name : str
        Name in the FMU.
    meaning : BaseUnit or None
        Its definition, if there is one.

    Returns
    -------
    str
        The name itself if it is neither known nor defined.
    """
    spelt = to_familiar(name)
    if meaning is None:
        return spelt
    if not meaning.exponents and meaning.factor == 1.0:  # nothing is defined
        return "1" if _parse_or_none(spelt) is None else spelt
    for known in (spelt, *_COHERENT, *_USUAL):
        if _means(known, meaning):
            return known
    if meaning.offset:
        return spelt
    factors = [b if n == 1 else f"{b}^{n}" for b, n in meaning.exponents.items()]
    product = "*".join(factors) or "1"
    return product if meaning.factor == 1.0 else f"{meaning.factor!r}*{product}"


def _means(unit: str, meaning: BaseUnit) -> bool:
    """Return whether a unit is defined as pint knows it; FMUs may leave out the angle."""
    try:
        known = base_unit(unit)
    except UserError:
        return False
    without_angle = {base: n for base, n in known.exponents.items() if base != "rad"}
    return (
        meaning.exponents in (known.exponents, without_angle)
        and math.isclose(known.factor, meaning.factor, rel_tol=1e-5)
        and math.isclose(known.offset, meaning.offset, rel_tol=1e-5)
    )


def difference_unit(unit: str) -> str:
    """Return the unit of differences of values in a unit: ``delta_degC`` for ``degC``.

    Raises
    ------
    UserError
        See `base_unit`.
    """
    return f"delta_{unit}" if base_unit(unit).offset else unit


def quotient(unit: str, by: str) -> str:
    """Return the unit of a change of a value per change of another: ``K/m`` for ``degC`` and ``m``.

    Parameters
    ----------
    unit, by : str
        SI units.
    """
    unit, by = (one.replace("degC", "K") for one in (unit, by))
    if by == "1":
        return unit
    if unit == by:
        return "1"
    return f"{unit}/{by}" if by.isalpha() else f"{unit}/({by})"


@lru_cache
def base_unit(unit: str) -> BaseUnit:
    """Return a unit in SI base units, for FMI's ``UnitDefinitions``.

    Parameters
    ----------
    unit : str
        Unit as pint reads it.

    Returns
    -------
    BaseUnit

    Raises
    ------
    UserError
        If FMI cannot express it, because of a fractional power or a base unit outside SI.
    """
    common = _common_base_unit(unit)
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
    """Convert a number or an array to another unit.

    Parameters
    ----------
    value : float or ndarray
        In `unit`.
    unit, to : str
        Units of argument and result.
    what : str
        Name of the value, for the message.

    Returns
    -------
    float or ndarray
        In the unit `to`.

    Raises
    ------
    UserError
        If the units have different dimensions.
    """
    if unit == to:
        return value
    if not measure_alike(unit, to):
        raise UserError(f"{what}: unit {unit!r} cannot be converted to {to!r}")
    source_base = _common_base_unit(unit)
    target_base = _common_base_unit(to)
    if source_base is not None and target_base is not None:
        # a conversion by one factor rounds like pint, which one by a ratio of two does not
        if target_base.factor == 1.0:
            return value * source_base.factor
        if source_base.factor == 1.0:
            return value * (1.0 / target_base.factor)
    source = parse(unit)
    target = parse(to)
    if source == target:
        return value
    try:
        return registry().Quantity(value, source).to(target).magnitude
    except TypeError as error:  # pint's, if one of two temperatures is a difference
        difference, other = (unit, to) if "delta_" in unit else (to, unit)
        raise UserError(
            f"{what}: {difference} measures a difference, {other} a temperature"
        ) from error


def check(unit: str) -> None:
    """Raise an error unless a text is a unit.

    Parameters
    ----------
    unit : str

    Raises
    ------
    UserError
        See `parse`.
    """
    if _common_base_unit(unit) is None:
        parse(unit)


def measure_alike(unit: str, other: str) -> bool:
    """Return whether two units measure the same quantity; see `convertible`.

    Parameters
    ----------
    unit, other : str

    Returns
    -------
    bool

    Raises
    ------
    UserError
        If one of them is no unit.
    """
    one = _common_base_unit(unit)
    another = _common_base_unit(other)
    if one is not None and another is not None:
        return one.exponents == another.exponents
    return convertible(parse(unit), parse(other))


def convertible(source: pint.Unit, target: pint.Unit) -> bool:
    """Return whether two parsed units measure the same quantity.

    In pint an angle is dimensionless, so that 1 Hz would be 1 rad/s and 60 rpm would be 2 pi Hz;
    here the power of the angle must also be the same.

    Parameters
    ----------
    source, target : pint.Unit

    Returns
    -------
    bool
    """
    if source.dimensionality != target.dimensionality:
        return False
    return _power_of_angle(source) == _power_of_angle(target)


def _power_of_angle(unit: pint.Unit) -> float:
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
        Unit for people; None for the SI unit.
    min, max : float
        Inclusive range.
    """

    type: str
    unit: str
    display: Any  # str | None would not match a class that always has one: it can be set
    min: float
    max: float


def format_value(value: float, variable: Described, digits: int = 6) -> str:
    """Write a value in its display unit, such as ``0.068 mm/C``.

    Parameters
    ----------
    value : float
        Value, SI.
    variable : Described
    digits : int
        Number of significant digits.

    Returns
    -------
    str
    """
    if variable.type == "boolean":
        return "true" if value else "false"
    return _with_unit(value, variable.unit, variable.display or variable.unit, digits)


def format_difference(value: float, variable: Described, digits: int = 6) -> str:
    """Write a difference of two values, such as an error, in its display unit.

    A difference of 2 K is written as 2 K, although the value 2 K is written as -271 degC.

    Parameters
    ----------
    value : float
        Difference, SI.
    variable : Described
    digits : int
        Number of significant digits.

    Returns
    -------
    str
    """
    return _with_unit(value, variable.unit, unit_of_differences(variable), digits)


def unit_of_differences(variable: Described) -> str:
    """Return the unit in which differences are displayed: the display unit if it has no offset.

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
    """Write a value with an SI prefix, such as ``13.0 mΩ``, ``18.0 s`` or ``1.70 MN·s/m``.

    Parameters
    ----------
    value : float
        Value, SI.
    variable : Described
        Its display unit is used if it is not the SI unit times a power of ten, such as degC.
    digits : int
        Number of significant digits, with trailing zeros.
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
        return f"{_write_digits(shown, digits)} {printed(display)}"
    return write_prefixed(float(value), variable.unit, digits, like)


def write_prefixed(value: float, unit: str, digits: int = 3, like: float | None = None) -> str:
    """Write a value in an SI unit with a prefix, such as ``9.80 mN·m``.

    Parameters
    ----------
    value : float
        Value in `unit`.
    unit : str
        SI unit.
    digits : int
        Number of significant digits, with trailing zeros.
    like : float, optional
        Value that determines the prefix, so that several values have the same unit; by default, or
        if it is 0 or not finite, the value itself.

    Returns
    -------
    str
    """
    # rounded first, so that 999.96 m becomes 1.00 km and not 1000 m
    number, shown = with_prefix(_to_digits(value, digits), unit, _to_digits(like or value, digits))
    return f"{_write_digits(number, digits)} {shown}".removesuffix(" 1")


def _is_prefixed(unit: str) -> bool:
    """Return whether a unit is an SI unit times a power of ten."""
    base = base_unit(unit)
    return not base.offset and math.log10(base.factor).is_integer()


def with_prefix(value: float, unit: str, like: float | None = None) -> tuple[float, str]:
    """Return a value converted to a unit with an SI prefix, and that unit.

    Parameters
    ----------
    value : float
        Value in `unit`.
    unit : str
        SI unit without prefix.
    like : float, optional
        See `write_prefixed`.

    Returns
    -------
    value : float
    unit : str
        As printed; see `printed`.
    """
    powers = powers_of_names(unit) if _common_base_unit(unit) is not None else {}
    first, power = next(iter(powers.items()), ("", 0))
    size = abs(like) if like and math.isfinite(like) else abs(value)
    if first not in _PREFIXED or power != 1 or not size or not math.isfinite(size):
        return value, printed(unit)
    largest = 0 if first == "s" else 9  # no kiloseconds
    # engineering notation: one to three digits before the point
    tens = min(max(3 * math.floor(math.log10(size) / 3.0), -9), largest)
    return value / 10.0**tens, _LETTERS[tens] + printed(unit)


def _to_digits(value: float, digits: int) -> float:
    """Round a value to a number of significant digits."""
    return float(f"{value:.{digits - 1}e}")


def _write_digits(number: float, digits: int) -> str:
    """Write a number with a number of significant digits, with trailing zeros."""
    if not math.isfinite(number) or not number:
        return f"{number:g}"
    if 10.0 ** (digits - 1) <= abs(number) < _WITH_POWER_OF_TEN:
        return f"{_to_digits(number, digits):.0f}".replace("-", "−")
    return f"{number:#.{digits}g}".removesuffix(".").replace("-", "−")


def printed(unit: str) -> str:
    """Write a unit in typographic form, such as ``N·s/m``, ``mΩ`` or ``C⁻²``."""
    inverse = _INVERSE.fullmatch(unit)
    product = f"{inverse[1]}^-{inverse[2] or 1}" if inverse else unit.translate(_SINGLE_CHARACTERS)
    text = _POWER.sub(lambda power: power[1].translate(_SUPERSCRIPTS), product)
    for name, sign in _SIGNS.items():
        text = re.sub(rf"(?<![A-Za-z])([numkMG]?){name}(?![A-Za-z])", rf"\g<1>{sign}", text)
    return _MICRO.sub("µ", text).replace("*", "·")


def _with_unit(value: float, unit: str, display: str, digits: int) -> str:
    """Write a value converted to its display unit."""
    number = f"{convert(float(value), unit, display):.{digits}g}"
    return number if display == "1" else f"{number} {display}"


def format_range(variable: Described) -> str:
    """Write the range of a variable in its display unit, such as ``0 … 1e+06 ohm``.

    Parameters
    ----------
    variable : Described

    Returns
    -------
    str
        Empty if the range has no limits.
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
    """Return a unit in Modelica's grammar, which tools that import FMUs read.

    Parameters
    ----------
    unit : str
        Unit as pint reads it.

    Returns
    -------
    str
        Factors with points between them, powers after names, at most one slash; `unit` unchanged if
        that is impossible.

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
    """Parse a unit as a Python expression; raise SyntaxError if that is impossible."""
    text = unit.strip().translate(_SINGLE_CHARACTERS).replace("^", "**").replace("·", "*")
    text = text.replace(".", "*").replace("°C", "degC")
    product = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    return ast.parse(product, mode="eval").body


def _powers(node: ast.expr) -> dict[str, int]:
    """Return the power of each name in a product; raise ValueError for any other expression."""
    match node:
        case ast.Name(id=name) if not any(map(str.isdigit, name)):  # m2 is Modelica's m^2
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
    """Return a unit, which may be in Modelica's grammar, in pint's spelling.

    Parameters
    ----------
    unit : str

    Returns
    -------
    str
        Its names may be unknown to pint.

    Examples
    --------
    >>> [from_modelica(unit) for unit in ("N.m", "mOhm", "m/s2", "A/(V.s)", "s-1", "N*s/m")]
    ['N*m', 'mohm', 'm/s^2', 'A/V/s', 's^-1', 'N*s/m']
    """
    factors = _FACTOR.sub(_factor_for_pint, unit)
    product = re.sub(r"\.(?!\d)", "*", factors)
    return _DIVISORS.sub(lambda match: "/" + match[1].replace("*", "/"), product)


def _factor_for_pint(match: re.Match[str]) -> str:
    """Return a name and its power in pint's spelling."""
    name = re.sub("Ohm$", "ohm", match[1])
    return f"{name}^{match[2]}" if match[2] else name
