"""Effects for the laws of any model, chosen by units, over every signal that a law reads.

The laws are evaluated once on symbols with units, which gives the units of laws, and once on a
component that records the signals that each law reads. The units of law and signal select the
shapes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isclose
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit import units
from fmus.kit.arms import ARMS, lag_effect, storing_wall
from fmus.kit.arrays import Array
from fmus.kit.component import Component
from fmus.kit.curves import SHAPES, EffectNames, curve, variable
from fmus.kit.declare import Declaration, ParameterDeclaration
from fmus.kit.effects import Effect
from fmus.kit.generic import force_offset
from fmus.kit.inputs import INPUT_CURVES, INPUT_MEMORIES
from fmus.kit.interrupt import uninterrupted
from fmus.kit.sampling import Sampling
from fmus.kit.symbolic.calls import Calls
from fmus.kit.symbolic.law_units import Unit
from fmus.kit.symbolic.symbols import Symbol
from fmus.kit.symbolic.tracing import trace

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
_POINTS = 64  # number of points at which a law is compared with a shape
_TOLERANCE = 1e-4  # largest residual of a shape, relative to its standard deviation
# displacement at which a loop yields, in typical magnitudes of its signal, where a fit starts
_DISPLACEMENTS = {"sliding": 1e-3, "hysteresis": 0.1, "play": 0.1}


@dataclass(frozen=True)
class LawOfModel:
    """A law of a model, with its unit and the signals it reads.

    Attributes
    ----------
    name : str
        Name of the method.
    unit : str
        Unit of its value; empty if the units in it are inconsistent.
    reads : tuple of str
        Inputs and states that it reads itself, not through another law.
    is_rate, is_output : bool
        Whether it is the time derivative of a state, or an output.
    """

    name: str
    unit: str
    reads: tuple[str, ...]
    is_rate: bool
    is_output: bool


_FRICTION = {
    "linear": "viscous_drag",
    "stribeck": "stribeck_friction",
    "sign": "coulomb_friction",
    "asymmetric": "asymmetric_friction",
    "odd_quadratic": "quadratic_drag",
    "sliding": "sliding_friction",
}
_SPRING = {
    "quadratic": "quadratic_stiffness",
    "cubic": "cubic_stiffness",
    "exponential": "exponential_stiffness",
    "upper_stop": "upper_stop",
    "lower_stop": "lower_stop",
    "stops": "end_stops",
    "leading": "maxwell_arm",
    "hysteresis": "bouc_wen_hysteresis",
    "play": "prandtl_play",
}
_OUTFLOW = {
    "linear": "laminar_outflow",
    "square_root": "square_root_outflow",
    "weir": "overflow",
    "leading": "storing_law",
}
# Unit of a law (empty for any), unit of a signal, and names of effects by shape.
_KNOWN: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("", "m/s", _FRICTION),
    ("", "rad/s", _FRICTION),
    ("N", "m", _SPRING),
    ("N*m", "rad", _SPRING),
    (
        "m",
        "N",
        {
            "quadratic": "quadratic_compliance",
            "cubic": "cubic_compliance",
            "saturating": "saturating_compliance",
            "lagging": "kelvin_element",
        },
    ),
    (
        "V",
        "A",
        {
            "asymmetric": "asymmetric_resistance",
            "cubic": "cubic_resistance",
            "saturating": "saturating_resistance",
            "lagging": "rc_pair",
            "heating": "resistance_heating",
        },
    ),
    (
        "ohm",
        "A",
        {
            "asymmetric": "asymmetric_resistance",
            "quadratic": "current_dependent_resistance",
            "warming": "resistance_heating",
        },
    ),
    *((flow, "m", _OUTFLOW) for flow in ("m^3/s", "kg/s", "m/s")),
    (
        "W",
        "K",
        {
            "quadratic": "quadratic_heat_loss",
            "odd_quadratic": "odd_quadratic_heat_loss",
            "quartic": "radiative_heat_loss",
            "leading": "thermal_node",
        },
    ),
    (
        "K/s",
        "K",
        {
            "quadratic": "quadratic_heat_loss",
            "odd_quadratic": "odd_quadratic_heat_loss",
            "quartic": "radiative_heat_loss",
        },
    ),
    (
        "V",
        "A*s",
        {
            "quadratic": "capacitance_of_voltage",
            "cubic": "even_capacitance_of_voltage",
            "exponential": "exponential_capacitance_of_voltage",
        },
    ),
    (
        "A",
        "V",
        {
            "quadratic": "quadratic_leakage",
            "cubic": "cubic_leakage",
            "exponential": "exponential_leakage",
            "leading": "parallel_rc_branch",
        },
    ),
)
_ANYTHING = {
    "quadratic": "quadratic_law",
    "cubic": "cubic_law",
    "saturating": "saturating_law",
    "exponential": "exponential_law",
    "lagging": "lagging_law",
    "leading": "storing_law",
}
NAMELESS = frozenset(_ANYTHING.values())  # ids of effects without an established name


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
    signals = [v.name for v in (*layout.inputs, *layout.states) if v.type == "real"]
    calls = Calls(cls, set(signals))
    for name in (*rates, *outputs):
        getattr(calls.instance, name)()
    reads = calls.reads
    units_of = units_of_laws(cls, reads)
    laws = []
    for name, read in reads.items():
        in_order = tuple(signal for signal in signals if signal in read)
        laws.append(
            LawOfModel(name, units_of.get(name, ""), in_order, name in rates, name in outputs)
        )
    return laws


@uninterrupted()
def families_for(cls: type[Component], sampling: Sampling | None = None) -> list[type[Effect]]:
    """Make the effects that fit a component's laws by their units.

    Parameters
    ----------
    cls : type[Component]
    sampling : Sampling, optional
        Sampling of the record that the effects are made for.

    Returns
    -------
    list of type[Effect]
        One for each combination of law, signal and shape.
    """
    layout = cls.layout
    inputs = [v.name for v in layout.inputs if v.type == "real"]
    graph = trace(cls)
    rates = {s.rate: graph.rates[i] for i, s in enumerate(layout.states)}
    definitions = {s.rate for s in layout.states if _is_definition(s.name, rates[s.rate])}
    # errors of outputs are effects of sensors
    laws = [law for law in list_laws(cls) if not law.is_output]
    effects: list[type[Effect]] = []
    for law in laws:
        if law.unit and law.name not in definitions:
            signals = [s for s in law.reads if not law.is_rate or s not in inputs]
            signals += _undamped_velocities(cls, law, rates)
            effects += _effects_of_law(cls, law, signals, sampling)
            effects += _walls(cls, law, sampling)
    forces = [law for law in laws if any(_same_dimension(law.unit, u) for u in ("N", "N*m"))]
    for law in forces[:1]:
        effects.append(force_offset(cls, law.name, law.unit, _nominal(cls, law)))
    for name in inputs:
        effects += [make(cls, name) for make in INPUT_CURVES]
        effects += [make(cls, name, sampling=sampling) for make in INPUT_MEMORIES]
    return effects


def _nominal(cls: type[Component], law: LawOfModel) -> float:
    """Return the nominal value of a law: that of the output of its name, else 1."""
    return next((o.nominal for o in cls.layout.outputs if o.name == law.name), 1.0)


def _effects_of_law(
    cls: type[Component],
    law: LawOfModel,
    signals: list[str],
    sampling: Sampling | None,
) -> Iterator[type[Effect]]:
    """Yield the effects on a law over each signal: curves and memories."""
    inputs = {v.name for v in cls.layout.inputs}
    nominal = _nominal(cls, law)
    several = len(signals) > 1
    for signal in signals:
        argument = variable(cls, signal)
        qualifier = f"{law.name}, {signal}" if several else law.name
        prefix = f"{law.name}_of_{signal}" if several else law.name
        for shape, name in _shapes_for_units(law.unit, argument.unit).items():
            stem = f"{prefix}_{name}"
            if shape in ARMS:
                # a rate already has a memory, its state; hysteresis needs the rate of its signal
                if law.is_rate or (shape == "hysteresis" and signal in inputs):
                    continue
                yield lag_effect(
                    cls,
                    law.name,
                    signal,
                    shape,
                    _start_of_constant(shape, argument, sampling),
                    law.unit,
                    nominal=nominal,
                    names=EffectNames(name, (stem, f"{stem}_constant", f"{stem}_state"), qualifier),
                    sampling=sampling,
                )
            elif SHAPES[shape].width or not _contains_shape(cls, law.name, signal, shape):
                yield curve(
                    cls,
                    law.name,
                    signal,
                    shape,
                    law.unit,
                    nominal,
                    names=EffectNames(name, (stem, f"{stem}_width"), qualifier),
                    either_way=law.is_rate,
                )


def _walls(
    cls: type[Component], law: LawOfModel, sampling: Sampling | None
) -> Iterator[type[Effect]]:
    """Yield the effect of a heat store, if a law is a flow of heat between two temperatures."""
    declared = {v.name: v for v in (*cls.layout.inputs, *cls.layout.states)}
    sides = [s for s in law.reads if _same_dimension(declared[s].unit, "K")]
    if law.is_rate or not _same_dimension(law.unit, "W") or len(sides) != 2:
        return
    # the first side is the one whose temperature increases the flow
    instance = cls()
    base = getattr(instance, law.name)()
    setattr(instance, sides[0], getattr(instance, sides[0]) + declared[sides[0]].nominal)
    first, second = sides if getattr(instance, law.name)() > base else sides[::-1]
    yield storing_wall(
        cls,
        law.name,
        (first, second),
        _start_of_constant("leading", declared[first], sampling),
        law.unit,
        nominal=_nominal(cls, law),
        scale=declared[first].nominal,
    )


def _is_definition(state: str, rate: ca.SX) -> bool:
    """Return whether a rate is another signal times a constant, such as ``1e3 * self.speed``."""
    signals = ca.symvar(rate)
    if len(signals) != 1 or signals[0].name() == state:
        return False
    slope = ca.jacobian(rate, signals[0])
    at_zero = ca.substitute(rate, signals[0], 0.0)
    return bool(slope.is_constant() and at_zero.is_zero())


def _start_of_constant(kind: str, signal: Declaration, sampling: Sampling | None) -> float:
    """Return the start value of an arm's constant: a displacement of a loop, or a time in s."""
    if kind in _DISPLACEMENTS:
        return _DISPLACEMENTS[kind] * signal.nominal
    return (sampling or Sampling()).time_constant


def _undamped_velocities(
    cls: type[Component], law: LawOfModel, rates: Mapping[str, Any]
) -> list[str]:
    """Return the velocity whose rate is a law, if the law does not depend on the velocity."""
    velocities = [
        s.name
        for s in cls.layout.states
        if s.rate == law.name and any(_same_dimension(s.unit, u) for u in ("m/s", "rad/s"))
    ]
    if not velocities:
        return []
    dependencies = {symbol.name() for symbol in ca.symvar(rates[law.name])}
    return [name for name in velocities if name not in dependencies]


def _contains_shape(cls: type[Component], law: str, signal: str, shape: str) -> bool:
    """Return whether other values of a law's parameters add a shape of a signal to it.

    They do if, at random points, the shape is a linear combination of the derivatives of the law by
    its parameters.
    """
    rng = np.random.default_rng(0)  # fixed, so that a component always has the same effects
    instance = cls()
    for v in (*cls.layout.inputs, *cls.layout.states):
        if v.type == "real":
            setattr(instance, v.name, v.nominal * rng.normal(size=_POINTS))
    x = getattr(instance, signal)
    target = SHAPES[shape].form(x, 1.0, variable(cls, signal).nominal)
    columns = []
    for p in cls.layout.parameters:
        if p.type != "real":
            continue
        slope = _derivative_by_parameter(instance, law, p)
        if slope is None:
            return False
        if np.isfinite(slope).all() and slope.any():
            columns.append(slope / np.abs(slope).max())
    if not columns:
        return False
    basis = np.column_stack(columns)
    residual = target - basis @ np.linalg.lstsq(basis, target, rcond=1e-9)[0]
    return bool(np.std(residual) < _TOLERANCE * np.std(target))


def _derivative_by_parameter(
    instance: Component, law: str, parameter: ParameterDeclaration
) -> Array | None:
    """Return the derivative of a law by a parameter from central differences; None if undefined."""
    value = getattr(instance, parameter.name)
    step = 1e-6 * parameter.nominal
    ends = []
    for shifted in (value - step, value + step):
        setattr(instance, parameter.name, shifted)
        try:
            result = np.asarray(getattr(instance, law)(), dtype=float)
            ends.append(np.broadcast_to(result, (_POINTS,)))
        except (ArithmeticError, TypeError, ValueError):
            return None
    setattr(instance, parameter.name, value)
    slope: Array = (ends[1] - ends[0]) / (2.0 * step)
    return slope


def _shapes_for_units(law_unit: str, signal_unit: str) -> dict[str, str]:
    """Return the names of the effects for a law and a signal in some units, by shape."""
    for of_law, of_signal, names in _KNOWN:
        fits_law = not of_law or _same_dimension(law_unit, of_law)
        if fits_law and _same_dimension(signal_unit, of_signal):
            return names
    return _ANYTHING


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
    layout = cls.layout
    declared = {v.name: Unit(units.powers_of_names(v.unit)) for v in layout.outputs}
    for state in layout.states:
        per_second = Counter(units.powers_of_names(state.unit))
        per_second.subtract(["s"])
        declared[state.rate] = Unit(per_second)
    calls = Calls(cls, set())
    for v in (*layout.parameters, *layout.inputs, *layout.states, *layout.discretes):
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
