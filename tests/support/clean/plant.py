"""What a plant says of itself: parameters, signals, how it is driven and sampled, and its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tests.support.clean.simulation import FINEST, Matrices, Values

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Range:
    """An input: unit, centre and amplitude of what drives it."""

    unit: str
    centre: float
    amplitude: float


@dataclass(frozen=True)
class Loop:
    """A velocity-form PI controller from one output, as measured, to one input, about where both are at first."""

    output: str
    input: str
    proportional: float
    integral: float  # per second
    amplitude: float  # of the reference


@dataclass(frozen=True)
class Plant:
    """A linear plant; the one that is not overrides `rates` and `shown`."""

    model: ClassVar[str]
    nominal: ClassVar[Mapping[str, float]]
    states: ClassVar[tuple[str, ...]]
    inputs: ClassVar[Mapping[str, Range]]  # the first is driven by the stimulus
    outputs: ClassVar[Mapping[str, str]]  # units
    rate: ClassVar[float]  # Hz
    duration: ClassVar[float]  # s
    period: ClassVar[float]  # s, time scale of stimuli
    timings: ClassVar[tuple[str, ...]] = ("usual", "one minute", "1 Hz", "long")
    loops: ClassVar[Mapping[str, Loop]] = {}
    settings: ClassVar[
        Mapping[str, float]
    ] = {}  # of the model, where its defaults are not what is wanted
    known: ClassVar[tuple[str, ...]] = ()  # parameters of the model that nobody would fit
    starts: ClassVar[Mapping[str, float]] = {}  # of states that do not rest at zero
    continuous: ClassVar[
        tuple[str, ...]
    ] = ()  # inputs that are never held, since nothing commands them
    sampled: ClassVar[tuple[str, ...]] = ()  # inputs that the plant holds itself, however they come
    slight: ClassVar[Mapping[str, float]] = {}  # parameters that vary less than others
    finest: ClassVar[float] = FINEST
    spread: float = field(default=0.3)

    @property
    def name(self) -> str:
        """Short."""
        return type(self).__name__

    def specimen(self, rng: np.random.Generator) -> dict[str, float]:
        """Parameters of one specimen."""
        return {
            n: value * float(np.exp(self.slight.get(n, self.spread) * rng.uniform(-1.0, 1.0)))
            for n, value in self.nominal.items()
        }

    def rest(self) -> Array:
        """Where states start."""
        return np.array([self.starts.get(n, 0.0) for n in self.states])

    def matrices(self, p: Values) -> Matrices | None:
        """A, B, C, D."""
        raise NotImplementedError

    def static(self, p: Values, u: Array) -> Array:
        """Inputs act as they are."""
        return u

    def bias(self, p: Values) -> Array:
        """Nothing is added to outputs."""
        return np.zeros(len(self.outputs))

    def rates(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Not needed of a linear plant."""
        raise NotImplementedError

    def shown(self, x: list[float], u: list[float], p: Values) -> list[float]:
        """Not needed of a linear plant."""
        raise NotImplementedError

    def drawn(self, p: Values) -> Matrices | None:
        """A, B, C, D with what the plant is clamped to, which acts at once and not from sample to sample."""
        return self.matrices(p)

    def reaction(self, p: Values, u: Array, x: Array) -> Array | None:
        """Inputs that the states of the plant cause by way of what it is clamped to; None if there is none such."""
        return None

    def recorded(self, y: Array, step: float) -> Array:
        """Outputs (o, n) as a logger has them before noise: as they are."""
        return y
