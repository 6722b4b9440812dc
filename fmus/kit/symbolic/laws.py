"""Laws of a model, with their units, which follow from those of its variables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from math import isclose
from typing import NamedTuple

from fmus.kit import units
from fmus.kit.component import Component
from fmus.kit.symbolic.calls import Calls
from fmus.kit.symbolic.law_units import Unit
from fmus.kit.symbolic.symbols import Symbol

# usual spellings of units; the first one of a dimension is preferred
_PREFERRED_UNITS = (
    "1",
    "N",
    "N*m",
    "V",
    "A",
    "W",
    "Pa",
    "ohm",
    "F",
    "C",
    "N/m",
    "N*s/m",
    "m",
    "m/s",
    "m/s^2",
    "rad",
    "rad/s",
    "rad/s^2",
    "A/s",
    "V/s",
    "N/s",
    "Pa/s",
    "K",
    "K/s",
    "kg",
    "kg/s",
    "m^3/s",
    "s",
    "1/s",
)


class RequiredUnit(NamedTuple):
    """The unit of a law that follows from a declaration.

    Attributes
    ----------
    law : str
        Name of the law.
    powers : Mapping of str to float
        Required unit of the law, as powers of units.
    words : str
        Reason, for a message.
    """

    law: str
    powers: Mapping[str, float]
    words: str


@dataclass(frozen=True)
class LawOfModel:
    """A law of a model, with its unit.

    Attributes
    ----------
    name : str
        Name of the method.
    unit : str
        Unit of its value; empty if the units in it are inconsistent.
    is_output : bool
    """

    name: str
    unit: str
    is_output: bool


def list_laws(cls: type[Component]) -> list[LawOfModel]:
    """Return the laws that the rates and outputs of a component call, in the order of the calls.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    list of LawOfModel
    """
    layout = cls.layout
    rates = [state.rate for state in layout.states]
    outputs = [output.name for output in layout.measured_outputs]
    calls = Calls(cls)
    for name in (*rates, *outputs):
        getattr(calls.instance, name)()
    units_of = units_of_laws(cls, calls.names)
    return [LawOfModel(name, units_of.get(name, ""), name in outputs) for name in calls.names]


def required_units(cls: type[Component]) -> Iterator[RequiredUnit]:
    """Yield the laws that declarations name, with their required units.

    Parameters
    ----------
    cls : type[Component]

    Yields
    ------
    RequiredUnit
    """
    layout = cls.layout
    for state in layout.states:
        powers = Counter[str](units.powers_of_names(state.unit))
        powers.subtract(["s"])
        words = f"it is the rate of {state.name}, which is in {state.unit}"
        yield RequiredUnit(state.rate, powers, words)
    others = [
        (d.update, d.unit, f"it is the next value of {d.name}, which is in {d.unit}")
        for d in layout.discretes
    ]
    others += [(o.name, o.unit, f"it is an output in {o.unit}") for o in layout.outputs]
    for law, unit, words in others:
        yield RequiredUnit(law, units.powers_of_names(unit), words)


def _same_dimension(one: str, other: str) -> bool:
    """Return whether two units have the same dimension, with the radian as a base unit."""
    return bool(one) and units.base_unit(one).exponents == units.base_unit(other).exponents


def _usual_spelling(unit: Unit) -> str:
    """Return the usual spelling of a unit; empty if FMI cannot express it."""
    exponents = unit.exponents
    if not all(float(power).is_integer() for power in exponents.values()):
        return ""
    # products with an angle, such as a damping by an angular velocity, are written without it
    omits_angle = exponents.get("rad", 0.0) > 0.0 and bool(exponents.keys() - {"rad", "s"})

    def without_angle(powers: Mapping[str, float]) -> Unit:
        return Unit({name: p for name, p in powers.items() if not (omits_angle and name == "rad")})

    declared = str(without_angle(unit.powers))
    if declared in _PREFERRED_UNITS or not isclose(unit.factor, 1.0, rel_tol=1e-9):
        return declared
    in_bases = str(without_angle(dict(sorted(exponents.items()))))
    return next((known for known in _PREFERRED_UNITS if _same_dimension(known, in_bases)), in_bases)


def units_of_laws(cls: type[Component], laws: Iterable[str]) -> dict[str, str]:
    """Return the unit of every law whose units are consistent.

    The units of rates and outputs are declared. Those of the laws that they call follow from them,
    also for laws with a numeric factor.

    Parameters
    ----------
    cls : type[Component]
    laws : iterable of str
        Laws without arguments, which call other laws.

    Returns
    -------
    dict of str to str
        Unit by law, in its usual spelling; empty if it is not determined.
    """
    declared = {required.law: Unit(required.powers) for required in required_units(cls)}
    calls = Calls(cls)
    for v in chain(*cls.layout.arguments):
        if v.type == "real":
            calls.instance.__dict__[v.name] = Symbol(units.powers_of_names(v.unit))
    calls.instance.time = Symbol({"s": 1.0})
    for law in laws:
        try:
            value = getattr(calls.instance, law)()
            if law in declared and isinstance(value, Symbol):
                value.match(Symbol(declared[law].powers))
        except Exception:  # a law may raise any exception on a symbol
            continue
    known = {}
    for law, values in calls.values.items():
        symbols = [value for value in values if isinstance(value, Symbol)]
        if symbols:  # a call after which the unit is certain comes first
            known[law] = min(symbols, key=lambda symbol: bool(symbol.numbers)).unit
    return {law: _usual_spelling(unit) for law, unit in (known | declared).items()}
