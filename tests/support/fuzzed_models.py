"""Models drawn at random from what the kit allows, as the files that a user would write.

A model is a class in source text; :func:`written` gives the text, and :func:`plain_class` the same
class with functions of NumPy and nothing of the kit, by which records are simulated.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


PLAIN_NAMES = _words(
    "gain mass loss drag flow level swing omega heat room load stiffness damping supply drive"
    " current force tension position velocity angle torque voltage charge pressure leak thrust"
    " weight spring friction R1 R2 C k1 k2 tau1 tau2 alpha beta x y z u v w q i I T Q K J L"
)
# of the kit and of what is laid over a model, of Python, and of what reads and writes them
AWKWARD_NAMES = _words(
    "output id term neutral assumption effect effects state states input inputs parameter laws law"
    " rate update signal record value data noise time_ times step holdout families label model"
    " made_by made_with stacked names scale nominal unit display doc min max abs sum list type"
    " object int float len e E N S pi t s m l O lag gain_ offset drift delay a b c d f g h n p r"
    " sin exp tanh where sqrt np self_ cls x_start y_gain y_offset y_lag_time y_delay y_drift"
    " u_lag u_play u_dead_zone u_passed_on u_behind v_coulomb w_offset drag_coulomb friction_offset"
    " drive_of_x_quadratic_law law_correction curve knots width constant"
    " a_very_long_name_that_somebody_wrote_because_he_likes_to_say_all_that_there_is_to_say_of_it"
)
# which the kit refuses
REFUSED_NAMES = ("time", "name", "laws", "start", "rates", "höhe", "_hidden", "declared", "State")

DOMAINS: dict[str, tuple[str, ...]] = {
    "translation": ("m", "m/s", "N", "kg", "N/m", "N*s/m", "m/s^2"),
    "rotation": ("rad", "rad/s", "N*m", "kg*m^2", "rad/s^2"),
    "electric": ("A", "V", "ohm", "F", "A*s", "C", "W"),
    "thermal": ("K", "W", "J/K", "W/K", "W/m^2", "K/s"),
    "hydraulic": ("m", "m^3/s", "kg/s", "Pa", "m^2"),
    "numbers": ("1",),
    "mixed": ("m", "N", "A", "V", "K", "W", "1", "rad/s", "N*m", "Pa", "s", "1/s", "mol/m^3"),
}
DISPLAYED = {"m": "mm", "K": "degC", "rad": "deg", "Pa": "bar", "A": "mA", "s": "min"}

# of a signal x, and of parameters that are multiplied by it (a), and that it is divided by (b)
SHAPES = (
    ("$a * $x", 8),
    ("$a * $x * absolute($x)", 1),
    ("$a * $x * $x", 1),
    ("$a * tanh($x / $b)", 2),
    ("$a * sin($x / $b)", 2),
    ("$x / $b", 2),
    ("$x", 3),
    ("-$x", 1),
    ("$a", 1),
    ("$a * ($x - $y)", 3),
    ("$a * $x * $y", 1),
    ("$a * sqrt(absolute($x))", 0.2),
    ("$a * sqrt(absolute($x) + 1e-6)", 1),
    ("$a * where($x > 0, $x, 0.5 * $x)", 1),
    ("$a * exp(minimum($x / $b, 5.0))", 1),
    ("$a * maximum($x, 0.0)", 1),
    ("$a * sign($x)", 1),
    ("$a * clip($x, -1.0, 1.0)", 1),
    ("$a * $x / (1.0 + absolute($x / $b))", 1),
    ("$a * cos(self.time)", 1),
    ("0.0 * $x", 1),
    ("2.5", 1),
)
FUNCTIONS = (
    "sin",
    "cos",
    "tanh",
    "exp",
    "sqrt",
    "absolute",
    "minimum",
    "maximum",
    "where",
    "sign",
    "clip",
)
FROM_KIT = (
    "Component",
    "Discrete",
    "Input",
    "Output",
    "Parameter",
    "State",
)
_QUOTED = re.compile(r'"(\w+)"')
_REFERENCE = re.compile(r"\$(\w+)")


@dataclass(frozen=True)
class Variable:
    """A declared variable.

    Attributes
    ----------
    kind : {"Parameter", "Input", "State", "Discrete"}
    name, unit : str
    value : float
        Start value or default.
    nominal : float
        Typical magnitude.
    about : dict of str to object
        Further arguments of the declaration.
    """

    kind: str
    name: str
    unit: str
    value: float
    nominal: float
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Law:
    """A method: the sum of terms, in which ``$name`` stands for a variable and ``$name()`` for a
    law.

    Attributes
    ----------
    name, unit : str
    terms : tuple of str
    kind : {"law", "rate", "update", "output"}
    nominal : float
        Typical magnitude.
    """

    name: str
    unit: str
    terms: tuple[str, ...]
    kind: str = "law"
    nominal: float = 1.0


@dataclass(frozen=True)
class FuzzedModel:
    """A model.

    Attributes
    ----------
    name : str
    variables : tuple of Variable
    laws : tuple of Law
    step : float
        s, between samples of its records.
    listed : tuple of str
        Calls that make the effects its file lists, if any.
    """

    name: str
    variables: tuple[Variable, ...]
    laws: tuple[Law, ...]
    step: float
    listed: tuple[str, ...] = ()

    def of_kind(self, kind: str) -> list[Variable]:
        """Return the variables of a kind, in order."""
        return [v for v in self.variables if v.kind == kind]

    @property
    def measured(self) -> dict[str, str]:
        """Unit of every output by name, states that are outputs among them."""
        outputs = {law.name: law.unit for law in self.laws if law.kind == "output"}
        return outputs | {v.name: v.unit for v in self.variables if v.about.get("output")}

    @property
    def parts(self) -> list[str]:
        """Names of what can be left out, outermost first."""
        listed = [f"listed {k}" for k in range(len(self.listed))]
        terms = [f"{law.name} {k}" for law in self.laws for k in range(len(law.terms))]
        laws = [law.name for law in reversed(self.laws)]
        return listed + laws + [v.name for v in self.variables] + terms

    def without(self, parts: frozenset[str]) -> FuzzedModel:
        """Return the model without some of its parts, and without what refers to them."""
        gone = set(parts)
        for law in self.laws:  # a state and its rate go together
            owner = _owner(self, law)
            if gone & {law.name, owner}:
                gone |= {law.name, owner}

        def kept(name: str, texts: tuple[str, ...], reference: re.Pattern[str]) -> tuple[str, ...]:
            return tuple(
                text
                for k, text in enumerate(texts)
                if f"{name} {k}" not in gone and gone.isdisjoint(reference.findall(text))
            )

        left = [law for law in self.laws if law.name not in gone]
        return replace(
            self,
            variables=tuple(v for v in self.variables if v.name not in gone),
            laws=tuple(replace(w, terms=kept(w.name, w.terms, _REFERENCE)) for w in left),
            listed=kept("listed", self.listed, _QUOTED),
        )


def _owner(model: FuzzedModel, law: Law) -> str:
    """Return the state of which a law is the rate or the update; empty for others."""
    methods = {v.about.get("rate") or v.about.get("update"): v.name for v in model.variables}
    return methods.get(law.name, "")


def written(model: FuzzedModel) -> str:
    """Write a model as a file."""
    lines = [
        f"from fmus.kit import {', '.join(FROM_KIT)}, {', '.join(FUNCTIONS)}",
        "from fmus.kit.effects import effects_by_name",
    ]
    if model.listed:
        lines += ["from fmus.kit.generic import *", "from fmus.kit.sensors import *"]
    lines += ["", *_class_lines(model)]
    if model.listed:
        lines += ["", "", "EFFECTS = effects_by_name("]
        lines += [f"    {call}," for call in model.listed]
        lines += [")"]
    return "\n".join(lines) + "\n"


def _class_lines(model: FuzzedModel) -> list[str]:
    lines = ["", "class Fuzzed(Component):", f"    name = {model.name!r}"]
    lines += [f"    experiment = ({100 * model.step!r}, {model.step!r})"]
    # units are drawn at random, and would be refused
    lines += [f"    unchecked = {tuple(law.name for law in model.laws)!r}"]
    for v in model.variables:
        start = f", {v.value!r}" if v.kind == "Input" else f", start={v.value!r}"
        value = f"{v.value!r}, {v.unit!r}" if v.kind == "Parameter" else f"{v.unit!r}{start}"
        about = "".join(f", {key}={argument!r}" for key, argument in v.about.items())
        lines.append(f"    {v.name} = {v.kind}({value}{about})")
    methods = {law.name for law in model.laws}

    def referred(match: re.Match[str]) -> str:
        name = match[1]
        return f"self.{name}()" if name in methods else f"self.{name}"

    for law in model.laws:
        lines.append("")
        if law.kind == "output":
            lines.append(f"    @Output({law.unit!r}, nominal={law.nominal!r})")
        value = " + ".join(_REFERENCE.sub(referred, term) for term in law.terms) or "0.0"
        lines += [f"    def {law.name}(self):", f"        return {value}"]
    return lines


def plain_class(model: FuzzedModel) -> type:
    """Return the class with nothing of the kit: its methods compute with NumPy."""

    def declared(*arguments: Any, **about: Any) -> float:
        return 0.0

    names: dict[str, Any] = {
        "Component": object,
        "Output": lambda *arguments, **about: lambda law: law,
        **dict.fromkeys(("Parameter", "Input", "State", "Discrete"), declared),
    }
    names |= {function: getattr(np, function) for function in FUNCTIONS}
    exec("\n".join(_class_lines(model)), names)
    made: type = names["Fuzzed"]
    return made


class _Names:
    """Names that are drawn once each."""

    def __init__(self, draw: random.Random):
        self.draw = draw
        self.awkward = draw.choice((0.0, 0.1, 0.5))
        self.refused = 0.02 if draw.random() < 0.1 else 0.0
        self.taken: set[str] = set()

    def new(self, preferred: str = "") -> str:
        draw = self.draw
        while True:
            name = preferred or draw.choice(PLAIN_NAMES)
            if draw.random() < self.awkward:
                name = draw.choice(AWKWARD_NAMES)
            if draw.random() < self.refused:
                name = draw.choice(REFUSED_NAMES)
            preferred = ""
            # a name of something that is made of another one, if there is another
            if self.taken and draw.random() < 0.3 * self.awkward:
                endings = "_start _gain _offset _lag_time _rate _coulomb _play _lag _drift _delay"
                name = draw.choice(sorted(self.taken)) + draw.choice(endings.split())
            if name not in self.taken:
                self.taken.add(name)
                return name


def _size(draw: random.Random) -> float:
    """Return a typical magnitude: mostly of order one, at times micrometres or gigapascals."""
    spread = draw.choice((0.3, 0.3, 1.0, 3.0))
    return float(f"{10 ** draw.gauss(0.0, spread):.2g}")


def _per(unit: str, below: str) -> str:
    if below == "1":
        return unit
    one, other = (f"({u})" if set(u) & set("/*^") else u for u in (unit, below))
    return "1" if unit == below else f"{one}/{other}"


class _Drawing:
    """A model while it is drawn."""

    def __init__(self, draw: random.Random):
        self.draw = draw
        self.names = _Names(draw)
        self.units = DOMAINS[draw.choice(list(DOMAINS))]
        self.fits = draw.random() < 0.8  # whether units of parameters fit those of laws
        self.variables: list[Variable] = []
        self.laws: list[Law] = []
        self.step = float(f"{10 ** draw.choice((-2, -2, -1, 0, draw.uniform(-5, 4))):.2g}")

    def declare(self, kind: str, unit: str, value: float, nominal: float, **about: Any) -> str:
        name = self.names.new(about.pop("preferred", ""))
        if self.draw.random() < 0.7:
            about["nominal"] = nominal
        if self.draw.random() < 0.2 and unit in DISPLAYED:
            about["display"] = DISPLAYED[unit]
        self.variables.append(Variable(kind, name, unit, value, nominal, about))
        return name

    def parameter(self, unit: str, size: float, positive: bool = False) -> str:
        """Declare a parameter of a size."""
        draw = self.draw
        value = float(f"{size * draw.choice((1.0, 1.0, -1.0 if not positive else 1.0)):.3g}")
        if not positive and draw.random() < 0.1:
            value = 0.0
        about: dict[str, Any] = {}
        ends = draw.choice(("none", "both", "least", "touching"))
        if positive:
            about |= {"min": 1e-3 * value} if draw.random() < 0.8 else {}
            about |= {"max": 1e3 * value} if draw.random() < 0.5 else {}
        elif ends in ("both", "least"):
            about["min"] = -10.0 * size
            about |= {"max": 10.0 * size} if ends == "both" else {}
        elif ends == "touching":
            about["min"] = min(value, 0.0)
            about["max"] = value + 10.0 * size
        if draw.random() < 0.3:
            about["doc"] = "of the thing; 5 % <b>at least</b>"
        return self.declare("Parameter", unit, value, size, **about)

    def signals(self) -> list[Variable]:
        return [v for v in self.variables if v.kind != "Parameter"]

    def term(self, unit: str, size: float, pool: list[Any]) -> str:
        """Return a term of a unit and a size, of signals and laws."""
        draw = self.draw
        shape = draw.choices([s for s, _ in SHAPES], [n for _, n in SHAPES])[0]
        if not pool:
            shape = draw.choice(("$a", "2.5"))
        x = draw.choice(pool) if pool else None
        alike = [v for v in pool if x is not None and v.unit == x.unit and v is not x]
        y = draw.choice(alike or pool) if pool else None
        names = {"x": x.name if x else "", "y": y.name if y else ""}
        if "$a" in shape:
            below = x.unit if x is not None and "$b" not in shape and "$x" in shape else "1"
            amount = size * draw.uniform(0.2, 2.0)
            if x is not None and below == x.unit:
                amount /= x.nominal
            wanted = _per(unit, below) if self.fits else draw.choice(("1", unit))
            names["a"] = self.parameter(wanted, amount)
        if "$b" in shape:
            names["b"] = self.parameter(x.unit, x.nominal, positive=True)
        return _REFERENCE.sub(lambda match: f"${names[match[1]]}", shape)

    def law(self, unit: str, kind: str = "law", preferred: str = "", most: int = 3) -> Law:
        draw = self.draw
        size = _size(draw)
        pool = [*self.signals(), *(one for one in self.laws if one.kind in ("law", "rate"))]
        terms = [self.term(unit, size, pool) for _ in range(draw.randint(1, most))]
        made = Law(self.names.new(preferred), unit, tuple(terms), kind, size)
        self.laws.append(made)
        return made

    def rate(self, state: str, unit: str, size: float) -> None:
        """Write the rate of a state: driven and stable, mostly."""
        draw = self.draw
        time = self.step * 10 ** draw.uniform(0.3, 2.2)
        others = [v for v in self.signals() if v.name != state]
        pool = [*others, *(law for law in self.laws if law.kind == "law")]
        kind = draw.choices(
            ("lag", "balance", "integral", "decay", "unstable", "definition", "constant"),
            (8, 5, 2, 2, 0.5, 1, 0.5),
        )[0]
        per_second = _per(unit, "s")
        terms: list[str] = []
        if kind == "lag":
            tau = self.parameter("s", time, positive=True)
            terms = [f"(({self.term(unit, size, pool)}) - ${state}) / ${tau}"]
        elif kind == "balance":
            loss = self.parameter("1/s", 1 / time, positive=True)
            terms = [self.term(per_second, size / time, pool), f"-${loss} * ${state}"]
            if draw.random() < 0.5:
                terms.append(self.term(per_second, size / time, pool))
        elif kind == "integral":
            terms = [self.term(per_second, 0.1 * size / time, pool)]
        elif kind == "decay":
            loss = self.parameter("1/s", 1 / time, positive=True)
            terms = [f"-${loss} * ${state}"]
        elif kind == "unstable":
            gain = self.parameter("1/s", 0.1 / time, positive=True)
            terms = [f"${gain} * ${state}", self.term(per_second, size / time, pool)]
        elif kind == "definition" and others:
            terms = [f"${draw.choice(others).name}"]
        owner = next(v for v in self.variables if v.name == state)
        self.laws.append(Law(owner.about["rate"], per_second, tuple(terms), "rate", size / time))


def draw_model(draw: random.Random) -> FuzzedModel:
    """Draw a model: names, units, variables, laws and listed effects."""
    drawing = _Drawing(draw)
    for _ in range(draw.choices((0, 1, 2, 3, 4), (1, 5, 4, 2, 0.5))[0]):
        size = _size(draw)
        value = draw.choice((0.0, 0.0, float(f"{size:.2g}")))
        about = {"type": "boolean"} if draw.random() < 0.03 else {}
        value = bool(value) if about else value
        drawing.declare("Input", "1" if about else draw.choice(drawing.units), value, size, **about)
    states = draw.choices((0, 1, 2, 3, 4), (2, 5, 4, 1, 0.5))[0]
    drawn: list[tuple[str, str, float]] = []
    for _ in range(states):
        size, unit = _size(draw), draw.choice(drawing.units)
        start = draw.choice((0.0, 0.0, float(f"{size * draw.uniform(-2, 2):.2g}")))
        about: dict[str, Any] = {"rate": drawing.names.new(f"rate_{len(drawn)}")}
        if draw.random() < 0.3:
            about["output"] = True
        if draw.random() < 0.1:
            about["min"] = min(start, -5.0 * size)
        drawn.append((drawing.declare("State", unit, start, size, **about), unit, size))
    for _ in range(draw.choices((0, 1, 2), (9, 1.5, 0.5))[0]):
        unit, size = draw.choice(drawing.units), _size(draw)
        period: Any = drawing.step * draw.choice((1, 2, 5, 3.3))
        if draw.random() < 0.3:
            period = drawing.parameter("s", period, positive=True)
        update = drawing.names.new("update_law")
        name = drawing.declare("Discrete", unit, 0.0, size, update=update, period=period)
        share = draw.choice((0.0, 0.5, 0.9))
        term = drawing.term(unit, size, [v for v in drawing.signals() if v.kind != "Discrete"])
        drawing.laws.append(Law(update, unit, (f"{share} * ${name}", term), "update", size))
    for _ in range(draw.choices((0, 1, 2, 3, 4), (1, 2, 3, 2, 1))[0]):
        drawing.law(draw.choice(drawing.units))
    for state, unit, size in drawn:
        drawing.rate(state, unit, size)
    seen = any(v.about.get("output") for v in drawing.variables)
    outputs = draw.choices((0, 1, 2, 3), (2 if seen else 0.1, 6, 3, 1))[0]
    for k in range(outputs):
        drawing.law(draw.choice(drawing.units), "output", draw.choice(("y", f"y{k}", "")), 2)
    if draw.random() < 0.3:  # an unused parameter
        drawing.parameter("1", 1.0)
    model = FuzzedModel(
        draw.choice(("fuzzed", "x", "model", "motor", "output", "m" * 60)),
        tuple(drawing.variables),
        tuple(drawing.laws),
        drawing.step,
    )
    return replace(model, listed=_listed(draw, model)) if draw.random() < 0.15 else model


def _listed(draw: random.Random, model: FuzzedModel) -> tuple[str, ...]:
    """Return calls that make the effects which the file lists."""
    laws = [law for law in model.laws if law.kind == "law"]
    signals = [v for v in model.variables if v.kind in ("Input", "State")]
    calls: dict[str, str] = {}
    for _ in range(draw.randint(1, 4)):
        kind = draw.choice(
            ("coulomb_friction", "asymmetric_friction", "force_offset", "cubic_stiffness")
        )
        if not laws or not signals:
            break
        law = draw.choice(laws)
        over = "" if kind == "force_offset" else f', "{draw.choice(signals).name}"'
        calls[kind] = f'{kind}(Fuzzed, "{law.name}"{over}, unit={law.unit!r}, nominal=1.0)'
    outputs = [law.name for law in model.laws if law.kind == "output"]
    if outputs and draw.random() < 0.5:
        calls["gain"] = f'sensor_gain(Fuzzed, "{draw.choice(outputs)}")'
    return tuple(calls.values())
