"""Terms: what a law of a model may lack, as a law, a signal, a memory of it and a shape."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.law_terms import ABRUPT, ROUNDED, STEEPEST
from orchestration.identify.fitting import Scale

KNOTS = 13  # of a curve at most, as in free_run.c
_SMOOTH = 8  # degrees of freedom of a curve at most: neighbours in a smooth one are not independent


class Shape(IntEnum):
    """The function of a term, of a signal in its scale; in the order of ``free_run.c``."""

    CONSTANT = 0
    LINEAR = 1
    MODULUS = 2
    SQUARE = 3
    ODD_SQUARE = 4
    CUBE = 5
    ROOT = 6
    DRY = 7
    DEAD_ZONE = 8
    ABOVE = 9
    BELOW = 10
    EXPONENTIAL = 11
    LEVELLING = 12
    SINH = 13
    STEP = 14
    CURVE = 15

    @property
    def has_width(self) -> bool:
        """True if a width is searched with it, in scales of the signal."""
        return Shape.DRY <= self <= Shape.STEP


class Memory(IntEnum):
    """The memory through which a term sees its signal; in the order of ``free_run.c``.

    A lag follows its signal, fading is the signal less its lag. Two lags are the signal less a lag
    that differs by direction, a rate limit is the signal less one that follows no faster than a
    rate. Play follows at a distance (Prandtl), and backlash is the signal less its play; a Dahl
    element gives before it slides. Heat is the lag of the square, from rest. An integral and a
    throughput, the integral of the modulus, count from the start of a record.
    """

    NONE = 0
    LAG = 1
    FADING = 2
    TWO_LAGS = 3
    RATE_LIMIT = 4
    PLAY = 5
    DAHL = 6
    HEAT = 7
    INTEGRAL = 8
    THROUGHPUT = 9
    BACKLASH = 10

    @property
    def counts(self) -> bool:
        """True if it is an integral since the start, which forgets nothing."""
        return self in (Memory.INTEGRAL, Memory.THROUGHPUT)

    @property
    def constants(self) -> int:
        """The number of constants that are searched with it, in their logarithm."""
        return len(MEMORIES[self].constants)

    @property
    def is_behind(self) -> bool:
        """True if a term sees its signal less what it remembers."""
        return self in (Memory.FADING, Memory.TWO_LAGS, Memory.RATE_LIMIT, Memory.BACKLASH)

    @property
    def is_sampled(self) -> bool:
        """True if it has no rate, but follows its signal from sample to sample."""
        return self in (Memory.PLAY, Memory.DAHL, Memory.BACKLASH)


class Form(NamedTuple):
    """A shape as a function of the signal x, with a width w.

    Attributes
    ----------
    text : str
        For people, with its coefficient a and a typical size s of the signal.
    source : str
        In Python, as `fmus.kit.law_terms` computes it.
    power : float
        Of x in the coefficient's unit.
    widths : tuple of float
        From which a screen proposes it, in scales of the signal.
    width : float
        From which it is fitted in place of another shape.
    """

    text: str
    source: str
    power: float = 0.0
    widths: tuple[float, ...] = (1.0,)
    width: float = 1.0


_RISE, _FALL = (f"exp(minimum({power}, {STEEPEST}))" for power in ("x / {w}", "-x / {w}"))
FORMS = {
    Shape.CONSTANT: Form("a", "1.0"),
    Shape.LINEAR: Form("a x", "x", 1.0),
    Shape.MODULUS: Form("a |x|", "absolute(x)", 1.0),
    Shape.SQUARE: Form("a x^2", "x * x", 2.0),
    Shape.ODD_SQUARE: Form("a x |x|", "x * absolute(x)", 2.0),
    Shape.CUBE: Form("a x^3", "x * x * x", 3.0),
    # FMI knows no root of a unit
    Shape.ROOT: Form(
        "a sign(x) sqrt(|x|/s)", f"x / sqrt((absolute(x) + {ROUNDED} * {{s}}) * {{s}})"
    ),
    Shape.DRY: Form("a tanh(x/w)", "tanh(x / {w})", 0.0, (0.05, 0.4), 0.3),
    Shape.DEAD_ZONE: Form(
        "a (x - clip(x, -w, w))", "(x - clip(x, -{w}, {w}))", 1.0, (0.4, 1.0), 0.6
    ),
    Shape.ABOVE: Form("a max(x - w, 0)", "maximum(x - {w}, 0.0)", 1.0, (0.5,), 0.6),
    Shape.BELOW: Form("a min(x + w, 0)", "minimum(x + {w}, 0.0)", 1.0, (0.5,), 0.6),
    Shape.EXPONENTIAL: Form("a (exp(x/w) - 1)", f"({_RISE} - 1.0)"),
    Shape.LEVELLING: Form("a (1 - exp(-x/w))", f"(1.0 - {_FALL})"),
    Shape.SINH: Form("a sinh(x/w)", f"0.5 * ({_RISE} - {_FALL})"),
    Shape.STEP: Form("a step(x - w)", f"(0.5 + 0.5 * tanh((x - {{w}}) / ({ABRUPT} * {{s}})))"),
    # no knot is at zero
    Shape.CURVE: Form("a curve", "smooth_table(knot, range(1, {end}), {table}_VALUES)"),
}


class MemoryKind(NamedTuple):
    """Properties of a memory.

    Attributes
    ----------
    text : str
        For people, with its signal.
    constants : tuple of str
        Their names.
    rate : str
        In Python, of a signal ``now``, as `fmus.kit.law_terms` computes it.
    unit : str
        Of what it keeps, by that of its signal in brackets, if it is another.
    """

    text: str
    constants: tuple[str, ...] = ()
    rate: str = ""
    unit: str = ""


_LAG = "(now - {memory}) / {time}"
_BY_DIRECTION = f"where(now < {{memory}}, {_LAG} / {{ratio}}, {_LAG})"
_LIMITED = f"{{rate}} * tanh({_LAG} / {{rate}})"
MEMORIES = {
    Memory.NONE: MemoryKind("{}"),
    Memory.LAG: MemoryKind("lagging {}", ("time",), _LAG),
    Memory.FADING: MemoryKind("changes of {}", ("time",), _LAG),
    Memory.TWO_LAGS: MemoryKind(
        "{} with a lag that depends on its direction", ("time", "ratio"), _BY_DIRECTION
    ),
    Memory.RATE_LIMIT: MemoryKind("{} limited in its rate", ("time", "rate"), _LIMITED),
    Memory.PLAY: MemoryKind("{} with play", ("way",)),
    Memory.DAHL: MemoryKind("{} with pre-sliding", ("way",)),
    Memory.HEAT: MemoryKind(
        "the lagging square of {}", ("time",), "(now * now - {memory}) / {time}", "{}^2"
    ),
    Memory.INTEGRAL: MemoryKind("the integral of {}", (), "now", "{}*s"),
    Memory.THROUGHPUT: MemoryKind("the throughput of {}", (), "absolute(now)", "{}*s"),
    Memory.BACKLASH: MemoryKind("the backlash in {}", ("way",)),
}


class TermStructure(ctypes.Structure):
    """A term as ``free_run.c`` reads it."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("law", "signal", "memory", "shape", "factor", "knots")),
        *((name, ctypes.c_double) for name in ("size", "scale", "middle")),
        ("places", ctypes.c_double * KNOTS),
    )


@dataclass(frozen=True)
class Term:
    """An addition to a law: ``size * factor * sum_j c_j phi_j((v - middle) / scale)``.

    Attributes
    ----------
    law : str
        The law that is added to.
    signal : str
        Input, state, law or ``time``, of which `v` is the value or a memory.
    shape : Shape
    memory : Memory
    constants : tuple of float
        Of the memory, where a search starts: seconds; the ratio of two lags; a rate or a way in
        scales of the signal.
    factor : str
        Signal that the addition is in proportion to; the law itself for a change in percent; empty
        for none.
    size : float
        Typical magnitude of the law, SI; 1 over that of the factor.
    scale, middle : float
        Of the signal, SI.
    width : float
        Of the shape, in scales of the signal, where a search starts.
    places : tuple of float
        Knots of a curve in equal steps, in scales of the signal; cubics between them, whose slopes
        at a knot are those of the parabola through it and its neighbours, and constant beyond.
    """

    law: str
    signal: str
    shape: Shape
    memory: Memory = Memory.NONE
    constants: tuple[float, ...] = ()
    factor: str = ""
    size: float = 1.0
    scale: float = 1.0
    middle: float = 0.0
    width: float = 1.0
    places: tuple[float, ...] = ()

    @property
    def coefficients(self) -> int:
        """The number of coefficients, in which it is linear."""
        return len(self.places) if self.shape is Shape.CURVE else 1

    @property
    def start(self) -> Array:
        """Start of a search, without the coefficients: logarithms of constants and width."""
        own = [*self.constants, *([self.width] if self.shape.has_width else [])]
        return np.log(np.array(own, dtype=float))

    def values(self, coefficient: float | Array) -> Array:
        """Return the values where a search starts, with coefficients that may all be the same."""
        return np.append(np.broadcast_to(coefficient, self.coefficients), self.start)

    @property
    def freedom(self) -> int:
        """Degrees of freedom; of a curve one value is the constant that its law has anyway."""
        own = min(len(self.places) - 1, _SMOOTH) if self.shape is Shape.CURVE else 1
        return own + len(self.start)

    @property
    def knots(self) -> tuple[float, ...]:
        """Values of the signal at the knots of a curve, in the unit of the signal."""
        return tuple(float(self.middle + self.scale * place) for place in self.places)

    @property
    def has_memory(self) -> bool:
        """True if it has a state."""
        return self.memory is not Memory.NONE

    @property
    def is_instant(self) -> bool:
        """True if it is a function of its signal at the same instant."""
        return not self.has_memory

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Both ends (k,) of the ranges of its values."""
        wide = np.full(self.coefficients + len(self.start), np.inf)
        return -wide, wide

    @property
    def cause(self) -> tuple[str, str]:
        """Law and signal, by which a cause is named."""
        return self.law, self.signal

    @property
    def name(self) -> str:
        """Name in a list of causes."""
        return f"{self.law}({self.signal})"

    @property
    def is_trend(self) -> bool:
        """True if it is a course over time, which is no cause; a change at an instant is one."""
        return self.signal == "time" and self.shape is not Shape.STEP

    @property
    def source(self) -> tuple[str, str, Memory, str]:
        """All but shape and constants: two terms of one source are never in one set."""
        return self.law, self.signal, self.memory, self.factor

    def structure(self, laws: list[str], signals: list[str]) -> TermStructure:
        """Return the term as ``free_run.c`` reads it, with positions in place of names."""
        one = TermStructure(
            laws.index(self.law),
            signals.index(self.signal or "time"),
            int(self.memory),
            int(self.shape),
            signals.index(self.factor) if self.factor else -1,
            len(self.places),
            self.size,
            self.scale,
            self.middle,
        )
        one.places[: len(self.places)] = self.places
        return one

    def __str__(self) -> str:
        seen = self.signal or "1"
        if self.memory is not Memory.NONE:
            constants = ", ".join(f"{value:.3g}" for value in self.constants)
            seen = f"{self.memory.name.lower()} of {seen} [{constants}]"
        times = f" * {self.factor}" if self.factor else ""
        return f"{self.law} += {self.shape.name.lower()}({seen}){times}"


@dataclass(frozen=True)
class Released:
    """A parameter of an effect that is searched.

    Attributes
    ----------
    name, unit : str
    scale : Scale
        Its map to a searched coordinate.
    low, high : float
        Ends of its range, SI.
    """

    name: str
    unit: str
    scale: Scale
    low: float
    high: float

    def value(self, coordinate: float) -> float:
        """Return the SI value at a searched coordinate, within the range."""
        return float(np.clip(self.scale.value(coordinate), self.low, self.high))

    def slope(self, coordinate: float) -> float:
        """Return d value / d coordinate: zero beyond the range."""
        inside = self.low <= self.scale.value(coordinate) <= self.high
        return self.scale.slope(coordinate) if inside else 0.0


@dataclass(frozen=True)
class NamedTerm(Term):
    """An effect of a catalogue: a class laid over the model, whose parameters are searched.

    Its law and signal are those that the effect declares. Its coefficient is the parameter that
    switches it, in a size that moves the outputs by about their spread; its constants are where a
    search of its other parameters starts, SI.

    Attributes
    ----------
    effect, title, formula : str
        Name in the catalogue, name for people, and the function as the effect declares it.
    family : str
        What effects that are one cause in several shapes have in common; else their name.
    released : tuple of Released
        The switch, then its other parameters.
    """

    effect: str = ""
    title: str = ""
    formula: str = ""
    family: str = ""
    released: tuple[Released, ...] = ()

    @property
    def start(self) -> Array:
        """Start of a search, without the switch."""
        pairs = zip(self.constants, self.released[1:], strict=True)
        return np.array([one.scale.position(value) for value, one in pairs], dtype=float)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Both ends (k,) of the ranges of its values."""
        ends = [sorted((r.scale.position(r.low), r.scale.position(r.high))) for r in self.released]
        low, high = np.array(ends).T
        return low, high

    @property
    def cause(self) -> tuple[str, str]:
        """Family, of which the shapes are one cause."""
        return self.family, ""

    @property
    def name(self) -> str:
        """Name in the catalogue."""
        return self.effect

    @property
    def is_instant(self) -> bool:
        """True if it has no time constant."""
        return all(one.unit != "s" for one in self.released)

    @property
    def source(self) -> tuple[str, str, Memory, str]:
        """The effect with any constants."""
        return self.effect, "", Memory.NONE, ""

    def __str__(self) -> str:
        return self.effect


@dataclass(frozen=True)
class SensorTerm(Term):
    """A fault of the sensor of an output: a term of the output over itself or the time."""

    @property
    def fault(self) -> str:
        """``offset``, ``drift``, ``lag`` or ``gain``."""
        if not self.signal:
            return "offset"
        if self.signal == "time":
            return "drift"
        return "lag" if self.has_memory else "gain"

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Both ends (k,) of the ranges of its values: a sensor that lags enlarges no change.

        Of one it shows ``1 + a`` at once, in modulus at most 1; `a` is the amount of the lag.
        """
        low, high = super().bounds
        if self.has_memory:
            low[0], high[0] = -2.0 * self.scale / self.size, 0.0
        return low, high

    @property
    def name(self) -> str:
        """The fault with its output."""
        return f"sensor_{self.fault}({self.law})"

    @property
    def cause(self) -> tuple[str, str]:
        """The fault, whatever its shape."""
        return self.name, ""

    @property
    def is_trend(self) -> bool:
        """A drift of a sensor is a cause."""
        return False


@dataclass(frozen=True)
class DelayTerm(SensorTerm):
    """A measured output that is late: its coefficient times its size is the delay, s."""

    @property
    def fault(self) -> str:
        """``delay``."""
        return "delay"

    @property
    def name(self) -> str:
        """The effect of measurement, with its output."""
        return f"transport_delay({self.law})"

    @property
    def is_instant(self) -> bool:
        """It shows its signal of another instant."""
        return False

    @property
    def source(self) -> tuple[str, str, Memory, str]:
        """The output, late by any time."""
        return self.law, self.fault, Memory.NONE, ""

    def __str__(self) -> str:
        return self.name


def effects_in(terms: Sequence[Term]) -> tuple[str, ...]:
    """Return the effects of named terms, sorted."""
    return tuple(sorted(term.effect for term in terms if isinstance(term, NamedTerm)))
