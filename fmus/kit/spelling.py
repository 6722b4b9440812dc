"""Two ways to write a unit: as pint reads it (``N*m``, ``ohm``), and as Modelica and FMI do (``N.m``, ``Ohm``)."""

from __future__ import annotations

import ast
import re

_FACTOR = re.compile(
    r"([^\W\d_]+)([+-]?\d{1,2}(?!\w))?"
)  # a name and, at once behind it, its power
_DIVISORS = re.compile(r"/\(([^()/]*)\)")


def to_modelica(unit: str) -> str:
    """Write a unit by the grammar of the Modelica language, which tools that import FMUs read.

    Parameters
    ----------
    unit : str
        As pint reads it.

    Returns
    -------
    str
        Factors with points between them, powers behind names, one slash; `unit` as it is if that cannot be done.

    Examples
    --------
    >>> [to_modelica(unit) for unit in ("N*m", "ohm", "m/s/s", "A/V/s", "kg*m^2", "1/s", "1", "degC")]
    ['N.m', 'Ohm', 'm/s2', 'A/(V.s)', 'kg.m2', '1/s', '1', 'degC']
    """
    text = unit.strip().replace("^", "**").replace("·", "*").replace(".", "*").replace("°C", "degC")
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    try:
        powers = _powers(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError):
        return unit
    names = {name: re.sub("(ohm|Ω|Ω)$", "Ohm", name).replace("μ", "u") for name in powers}
    above, below = (
        [
            names[name] + (str(abs(power)) if abs(power) != 1 else "")
            for name, power in powers.items()
            if sign * power > 0
        ]
        for sign in (1, -1)
    )
    top, bottom = ".".join(above) or "1", ".".join(below)
    return f"{top}/({bottom})" if len(below) > 1 else f"{top}/{bottom}" if below else top


def _powers(node: ast.expr) -> dict[str, int]:
    """Power of each name, in the order in which they stand; ValueError if there is anything else."""
    match node:
        case ast.Name(id=name) if not any(map(str.isdigit, name)):
            return {name: 1}
        case ast.Constant(value=1):
            return {}
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
            powers, sign = _powers(left), 1 if isinstance(node.op, ast.Mult) else -1
            for name, power in _powers(right).items():
                powers[name] = powers.get(name, 0) + sign * power
            return powers
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            times = ast.literal_eval(exponent)
            if isinstance(times, int):
                return {name: times * power for name, power in _powers(base).items()}
    raise ValueError(node)


def from_modelica(unit: str) -> str:
    """Write a unit that may be in Modelica's grammar as pint reads it; nothing says whether it knows the names.

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
    text = _FACTOR.sub(
        lambda found: _renamed(found[1]) + (f"^{found[2]}" if found[2] else ""), unit
    )
    text = re.sub(r"\.(?!\d)", "*", text)
    return _DIVISORS.sub(lambda found: "/" + found[1].replace("*", "/"), text)


def _renamed(name: str) -> str:
    return name.removesuffix("Ohm") + "ohm" if name.endswith("Ohm") else name
