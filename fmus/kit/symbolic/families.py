"""Which effects fit a model's laws: every law, each signal that it reads, and the shapes that go with their units.

Nobody has to list them. The laws are called once on dimensioned numbers, which tells their units, and once on a
component that writes down who reads what.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from fmus.kit import units
from fmus.kit.arms import ARMS, arm
from fmus.kit.component import Component, Effect
from fmus.kit.curves import SHAPES, curve, variable
from fmus.kit.generic import force_offset
from fmus.kit.inputs import INPUT_EFFECTS
from fmus.kit.symbolic.trace import trace

# Derived units that people write, the first of those of one dimension.
_WRITTEN = (
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
_POINTS, _SAME = (
    64,
    1e-4,
)  # at which a law is compared with a shape, and the share in which they may differ
_TIME = 1.0  # s, where a search for a time constant starts if nothing is known of the record


@dataclass(frozen=True)
class LawOfModel:
    """A law, as its model has it.

    Attributes
    ----------
    name : str
        The method.
    unit : str
        SI; empty where its units do not fit together.
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
_OUTFLOW = {"linear": "laminar_outflow", "square_root": "square_root_outflow", "weir": "overflow"}
# Units of a law (any where there is none) and of a signal, and what shapes of one over the other are called.
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
            "leading": "thermal_node",
        },
    ),
    ("K/s", "K", {"quadratic": "quadratic_heat_loss", "odd_quadratic": "odd_quadratic_heat_loss"}),
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
}


def laws_of(cls: type[Component]) -> list[LawOfModel]:
    """Laws of a component that its rates and outputs come to, in the order in which they are called.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    list of LawOfModel
    """
    layout = cls.layout
    rates = {state.rate for state in layout.states}
    outputs = {output.name for output in layout.outputs}
    signals = [v.name for v in (*layout.inputs, *layout.states) if v.type == "real"]
    reads = _reads(
        cls, [*(s.rate for s in layout.states), *(o.name for o in layout.outputs)], set(signals)
    )
    units_of = _units(cls, list(reads))
    return [
        LawOfModel(
            name,
            units_of.get(name, ""),
            tuple(s for s in signals if s in read),
            name in rates,
            name in outputs,
        )
        for name, read in reads.items()
    ]


def families_for(
    cls: type[Component], scales: Mapping[str, float] | None = None
) -> list[type[Effect]]:
    """Effects that fit a component's laws by their units, beside those that its file lists.

    Parameters
    ----------
    cls : type[Component]
    scales : Mapping of str to float, optional
        Typical magnitudes of signals and laws, SI; nominal values otherwise.

    Returns
    -------
    list of type[Effect]
        None of which is of the same law, signal and shape as another.
    """
    layout = cls.layout
    scale = {v.name: v.nominal for v in (*layout.inputs, *layout.states, *layout.outputs)} | dict(
        scales or {}
    )
    fed = [v.name for v in layout.inputs if v.type == "real"]
    made: list[type[Effect]] = []
    graph = trace(cls)
    rates = {s.rate: graph.rates[i] for i, s in enumerate(layout.states)}
    for law in laws_of(cls):
        if law.is_output or not law.unit or (law.is_rate and rates[law.name].is_symbolic()):
            continue  # what is wrong with measuring is for the sensors, and a definition is not wrong
        signals = [s for s in law.reads if not (law.is_rate and s in fed)]
        signals += _free(cls, law, rates)
        made += _of_law(cls, law, signals, scale)
    forces = [
        law
        for law in laws_of(cls)
        if not law.is_output and any(_alike(law.unit, u) for u in ("N", "N*m"))
    ]
    made += [force_offset(cls, law.name, law.unit, scale.get(law.name, 1.0)) for law in forces[:1]]
    return made + [make(cls, name, scale[name]) for name in fed for make in INPUT_EFFECTS]


def _of_law(
    cls: type[Component], law: LawOfModel, signals: list[str], scale: Mapping[str, float]
) -> Iterator[type[Effect]]:
    unit_of = {v.name: v.unit for v in (*cls.layout.inputs, *cls.layout.states)}
    several, nominal = len(signals) > 1, scale.get(law.name, 1.0)
    for signal in signals:
        of = f"{law.name}, {signal}" if several else law.name
        own = f"of_{signal}_" if several else ""
        shapes = _shapes(law.unit, unit_of[signal])
        for shape, name in shapes.items():
            about = (law.unit, nominal, scale[signal], name)
            if law.is_rate and shape in ARMS:
                continue  # a rate is a memory itself
            if shape in SHAPES and not SHAPES[shape].width and _has(cls, law.name, signal, shape):
                continue  # it would be the same as a parameter
            if shape in ARMS:
                own_name = f"{law.name}_{own}{name}"
                ends = own_name, f"{own_name}_constant", f"{own_name}_state"
                ways = {"sliding": 1e-3, "hysteresis": 0.1, "play": 0.1}
                constant = (
                    ways[shape] * scale[signal] if shape in ways else scale.get("time", _TIME)
                )
                yield arm(cls, law.name, signal, shape, constant, *about, ends, of)
            else:
                suffixes = f"{own}{name}", f"{own}{name}_width"
                yield curve(cls, law.name, signal, shape, *about, suffixes, of, law.is_rate)


def _free(cls: type[Component], law: LawOfModel, rates: Mapping[str, Any]) -> list[str]:
    """Velocity whose rate a law is and that nothing brakes: no law of a force or torque reads it."""
    moving = [
        s
        for s in cls.layout.states
        if s.rate == law.name and any(_alike(s.unit, u) for u in ("m/s", "rad/s"))
    ]
    named = {symbol.name() for symbol in ca.symvar(rates[law.name])} if moving else set()
    return [s.name for s in moving if s.name not in named]


def _has(cls: type[Component], law: str, signal: str, shape: str) -> bool:
    """Whether the law's own parameters give a shape already: it is a sum of the slopes by them, at points drawn."""
    rng, one = np.random.default_rng(0), cls()
    for v in (*cls.layout.inputs, *cls.layout.states):
        if v.type == "real":
            setattr(one, v.name, v.nominal * rng.normal(size=_POINTS))
    x = getattr(one, signal)
    wanted = SHAPES[shape].form(x, 1.0, variable(cls, signal).nominal)
    slopes = []
    for p in (p for p in cls.layout.parameters if p.type == "real"):
        value, step = getattr(one, p.name), 1e-6 * p.nominal
        ends = []
        for moved in (value - step, value + step):
            setattr(one, p.name, moved)
            try:
                ends.append(np.broadcast_to(np.asarray(getattr(one, law)(), dtype=float), x.shape))
            except (
                ArithmeticError,
                TypeError,
                ValueError,
            ):  # of what cannot be computed nothing is known
                return False
        setattr(one, p.name, value)
        slopes.append((ends[1] - ends[0]) / (2.0 * step))
    known = [
        slope / size
        for slope in slopes
        if np.isfinite(slope).all() and (size := np.abs(slope).max()) > 0.0
    ]
    if not known:
        return False
    basis = np.column_stack(known)
    left = wanted - basis @ np.linalg.lstsq(basis, wanted, rcond=1e-9)[0]
    return bool(np.std(left) < _SAME * np.std(wanted))


def _shapes(law: str, signal: str) -> dict[str, str]:
    """Shapes that are known of a law in one unit over a signal in another, with their names."""
    for above, below, shapes in _KNOWN:
        if (not above or _alike(law, above)) and _alike(signal, below):
            return shapes
    return _ANYTHING


def _alike(one: str, other: str) -> bool:
    """Whether units are of one dimension, a radian counted."""
    return bool(one) and units.base_unit(one).exponents == units.base_unit(other).exponents


def _written(unit: str) -> str:
    """A unit in base units, as people write it if they do."""
    return next((known for known in _WRITTEN if _alike(known, unit)), unit)


def _reads(cls: type[Component], names: list[str], signals: set[str]) -> dict[str, set[str]]:
    """Which signals every law reads by itself, by the name of the law, as it is called."""
    calls: list[str] = []
    found: dict[str, set[str]] = {}

    def get(self: Any, name: str) -> Any:
        value = object.__getattribute__(self, name)
        if name in signals:
            if calls:
                found[calls[-1]].add(name)
            return value
        is_law = callable(value) and not name.startswith("_") and not hasattr(Component, name)
        return _watched(name, value) if is_law else value

    def _watched(name: str, law: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            calls.append(name)
            found.setdefault(name, set())
            try:
                return law(*arguments)
            finally:
                calls.pop()

        return call

    spy = type(cls.__name__, (cls,), {"__getattribute__": get})
    one = spy()
    for name in names:
        getattr(one, name)()
    return found


def _units(cls: type[Component], laws: list[str]) -> dict[str, str]:
    """SI unit of every law whose units fit together."""
    registry, layout = units.registry(), cls.layout
    one = cls()
    for v in (*layout.parameters, *layout.inputs, *layout.states, *layout.discretes):
        if v.type == "real":
            size = getattr(v, "start", 0.0) or v.nominal
            one.__dict__[v.name] = registry.Quantity(float(size), units.parse(v.unit))
    one.time = registry.Quantity(1.0, "s")
    found = {}
    for law in laws:
        try:
            value = getattr(one, law)()
            found[law] = _written(f"{value.to_base_units().units:~C}".replace("**", "^") or "1")
        except Exception:  # whatever a law does to a number that has a unit, it is not told then
            continue
    return found
