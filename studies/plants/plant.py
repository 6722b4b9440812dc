"""Base of all plants: parameters, signals, how it is driven and sampled, and laws by name."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from fmus.kit.arrays import Array
from studies.plants.change import Change
from studies.plants.place import Place
from studies.plants.simulation import FINEST, Matrices, Values

Signals = dict[str, float]
OWN = "without"  # signal: of a law that hangs on itself, its value without what is hidden
_PROBE = 0.5  # of a state or an input, at which a linear plant is evaluated; a power of two


@dataclass(frozen=True)
class Range:
    """An input: unit, centre and amplitude of what drives it."""

    unit: str
    centre: float
    amplitude: float


@dataclass(frozen=True)
class Loop:
    """A velocity-form PI controller from one output, as measured, to one input.

    It acts about where both are at first.
    """

    output: str
    input: str
    proportional: float
    integral: float  # per second
    amplitude: float  # of the reference


@dataclass(frozen=True)
class Plant:
    """A plant by its laws, any of which may have changes hidden in it.

    What a change remembers comes behind the plant's own states.

    Attributes
    ----------
    hidden : mapping of str to tuple of Change and slice
        Changes by place, with the states that each remembers by.
    spread : float
        Largest distance of a specimen's parameters from nominal, in the logarithm.
    finest : float
        Longest step of what is not linear, s, where records are drawn.
    free : bool
        Whether what the plant is clamped to is an input, as it is for the model under test; else it
        is a function of the states.
    """

    model: ClassVar[str]
    nominal: ClassVar[Mapping[str, float]]
    own_states: ClassVar[tuple[str, ...]]
    inputs: ClassVar[Mapping[str, Range]]  # the first is driven by the stimulus
    outputs: ClassVar[Mapping[str, str]]  # units
    shown_by: ClassVar[tuple[str, ...]]  # signal of each output
    rate: ClassVar[float]  # Hz
    duration: ClassVar[float]  # s
    period: ClassVar[float]  # s, time scale of stimuli
    timings: ClassVar[tuple[str, ...]] = ("usual", "one minute", "1 Hz", "long")
    loops: ClassVar[Mapping[str, Loop]] = {}
    released: ClassVar[
        Mapping[str, float]
    ] = {}  # states of a free decay, by how far they start off
    begins_at_rest: ClassVar[bool] = False  # whether no record begins in motion
    # the clock of a logger, and units of columns that are not the model's: name, size in s or in
    # the model's unit
    clock: ClassVar[tuple[str, float]] = ("s", 1.0)
    written: ClassVar[Mapping[str, tuple[str, float]]] = {}
    # of the model, where its defaults are not what is wanted
    settings: ClassVar[Mapping[str, float]] = {}
    known: ClassVar[tuple[str, ...]] = ()  # parameters of the model that nobody would fit
    starts: ClassVar[Mapping[str, float]] = {}  # of states that do not rest at zero
    # inputs that are never held, since nothing commands them
    continuous: ClassVar[tuple[str, ...]] = ()
    sampled: ClassVar[tuple[str, ...]] = ()  # inputs that the plant holds itself, however they come
    slight: ClassVar[Mapping[str, float]] = {}  # parameters that vary less than others
    linear: ClassVar[bool] = True
    coarsest: ClassVar[float] = FINEST  # s, longest step where something is hidden
    aliases: ClassVar[Mapping[str, str]] = {}  # short names of places

    hidden: Mapping[str, tuple[Change, slice]] | None = None
    spread: float = 0.3
    finest: float = FINEST
    free: bool = False

    @property
    def name(self) -> str:
        """Short."""
        return type(self).__name__

    @property
    def order(self) -> int:
        """Number of the plant's own states."""
        return len(self.own_states)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Own states, then those that changes remember by."""
        memories = [
            f"{text}_memory_{k}"
            for text, (change, _) in self.changes.items()
            for k in range(len(change.rest))
        ]
        return (*self.own_states, *memories)

    @property
    def changes(self) -> Mapping[str, tuple[Change, slice]]:
        """Hidden changes by place; empty in a clean plant."""
        return self.hidden or {}

    @cached_property
    def places(self) -> dict[str, list[tuple[Place, str]]]:
        """Places of hidden changes by law."""
        by_law: dict[str, list[tuple[Place, str]]] = {}
        for text in self.changes:
            if text in self.outputs:  # a sensor, behind all laws
                continue
            place = self.place(text)
            by_law.setdefault(place.law, []).append((place, text))
        return by_law

    def place(self, text: str) -> Place:
        """Return law and signal of a place."""
        return Place.of(self.aliases.get(text, text))

    @abstractmethod
    def evaluate(self, x: list[float], u: list[float], p: Values) -> Signals:
        """Evaluate inputs, states, and laws with what is hidden in them, by name."""

    @abstractmethod
    def derivatives(self, k: Signals) -> list[float]:
        """Return derivatives of the plant's own states."""

    def equivalents(self, p: Values) -> list[dict[str, float]]:
        """Group laws to which something may be added with the same consequences.

        Each group has the amount that is added to each of its laws.
        """
        return []

    def equals(self, law: str, p: Values) -> dict[str, float]:
        """Return laws that do the same as this one, by the amount added there for 1 here."""
        group = next((g for g in self.equivalents(p) if law in g), {law: 1.0})
        return {name: amount / group[law] for name, amount in group.items()}

    def settled(self, p: Values) -> list[float]:
        """Return outputs before anything happened, from which the memory of a sensor counts."""
        return [0.0] * len(self.outputs)

    def more(self, text: str, signal: float, x: list[float]) -> float:
        """Return what the change hidden at a place adds."""
        if text not in self.changes:
            return 0.0
        change, memory = self.changes[text]
        return change.more(signal, x[memory])

    def law(self, name: str, value: float, k: Signals, x: list[float]) -> float:
        """Put a law among the signals, with what is hidden in it."""
        for place, text in self.places.get(name, ()):
            if place.signal == name:
                k[OWN] = value
                signal = value
            else:
                signal = k.get(place.signal, 0.0)
            more = self.more(text, signal, x)
            value = value + more if place.kind == "add" else value * (1.0 + more)
        k[name] = value
        return value

    def specimen(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw the parameters of one specimen."""
        return {
            n: value * float(np.exp(self.slight.get(n, self.spread) * rng.uniform(-1.0, 1.0)))
            for n, value in self.nominal.items()
        }

    def rest(self) -> Array:
        """Return where states start: the plant's own, then what changes remember."""
        own = [self.starts.get(n, 0.0) for n in self.own_states]
        memories = [rest for change, _ in self.changes.values() for rest in change.rest]
        return np.array([*own, *memories])

    def start(self, rng: np.random.Generator) -> Array:
        """Draw where a record's states start: at rest, or where a free decay is released."""
        off = {n: by * rng.uniform(0.6, 1.0) for n, by in self.released.items()}
        return self.rest() + np.array([off.get(n, 0.0) for n in self.states])

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Return derivatives of all states."""
        k = self.evaluate(x, u, p)
        rates = self.derivatives(k)
        for text, (change, memory) in self.changes.items():
            if change.rest:
                rates = rates + change.rates(self.signal(text, k, u, p), x[memory])
        return rates

    def signal(self, text: str, k: Signals, u: list[float], p: Values) -> float:
        """Return the signal a change remembers: a raw input, a reading, or a signal."""
        if text in self.inputs:
            return u[list(self.inputs).index(text)]
        if text in self.outputs:
            at = list(self.outputs).index(text)
            return k[self.shown_by[at]] - self.settled(p)[at]
        return k.get(self.place(text).signal, 0.0)

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Return outputs: readings with what their sensors make of them."""
        k = self.evaluate(x, u, p)
        read = zip(self.outputs, self.shown_by, self.settled(p), strict=True)
        return [k[by] + self.more(output, k[by] - start, x) for output, by, start in read]

    def matrices(self, p: Values) -> Matrices | None:
        """Return A, B, C, D for a model whose clamp is an input; None where it is not linear."""
        return None if self.changes or not self.linear else replace(self, free=True)._probed(p)

    def drawn(self, p: Values) -> Matrices | None:
        """Return A, B, C, D with the clamp as a function of the states."""
        return None if self.changes or not self.linear else self._probed(p)

    def bias(self, p: Values) -> Array:
        """Return outputs at rest without inputs, shape (o,)."""
        zeros = [0.0] * len(self.inputs)
        return np.array(self.shown([0.0] * self.order, zeros, p))

    def _probed(self, p: Values) -> Matrices:
        """Evaluate the laws at one state or input after another."""
        count = self.order + len(self.inputs)
        at_zero = np.concatenate(self._evaluated([0.0] * count, p))
        rows = []
        for k in range(count):
            point = [0.0] * count
            point[k] = _PROBE
            rows.append((np.concatenate(self._evaluated(point, p)) - at_zero) / _PROBE)
        n = self.order
        whole = np.array(rows).T
        return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]

    def _evaluated(self, point: list[float], p: Values) -> tuple[list[float], list[float]]:
        x = point[: self.order]
        u = point[self.order :]
        return self.rates(x, u, p), self.shown(x, u, p)

    def static(self, p: Values, u: Array) -> Array:
        """Return inputs (m, n) as they act, where something without memory precedes the states."""
        return u

    def reaction(self, p: Values, u: Array, x: Array) -> Array | None:
        """Return inputs that the states cause through the clamp; None without one."""
        return None

    def recorded(self, y: Array, step: float) -> Array:
        """Return outputs (o, n) as a logger has them before noise: late where the logger is."""
        late = {text: round(change.delay / step) for text, (change, _) in self.changes.items()}
        rows = []
        for output, row in zip(self.outputs, y, strict=True):
            samples = late.get(output, 0)
            rows.append(np.r_[np.full(samples, row[0]), row[:-samples]] if samples else row)
        return np.array(rows)

    def with_hidden(self, *changes: Change) -> Plant:
        """Hide changes in the plant, each at a place of its own.

        Raises
        ------
        ValueError
            If two are at one place.
        """
        hidden: dict[str, tuple[Change, slice]] = {}
        count = self.order
        for change in changes:
            if change.place in hidden:
                raise ValueError(f"two changes at {change.place} of {self.name}")
            hidden[change.place] = change, slice(count, count + len(change.rest))
            count += len(change.rest)
        finest = min([self.coarsest, *(change.finest for change in changes)])
        return replace(self, hidden=hidden, finest=finest)
