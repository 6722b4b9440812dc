"""Records in which a term is hidden that has exactly a form by which a law may be extended.

So what an interval misses is not the form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from studies.clean import KINDS, Case, CleanRecord, conditions, draw
from studies.plants import PLANTS, static

_STRENGTHS = 0.5, 1.5  # of a hidden term


@dataclass(frozen=True)
class HiddenTerm:
    """A term that a law of a plant lacks: ``amount f(x / at)`` of a signal x.

    Attributes
    ----------
    plant, law, signal : str
    amount : float
        In the SI unit of the law.
    at : float
        In that of the signal.
    form : callable
        f itself.
    state : str
        That the signal follows, if it is a law.
    """

    plant: str
    law: str
    signal: str
    amount: float
    at: float
    form: Callable[[float], float]
    state: str = ""

    @property
    def right(self) -> frozenset[str]:
        """The answers that name it."""
        signals = filter(None, (self.signal, self.state))
        return frozenset(f"{self.law} over {signal}" for signal in signals)


def _cube(z: float) -> float:
    return z * z * z


TERMS = (
    HiddenTerm("Motor", "friction", "omega", 0.1, 150.0, _cube),
    HiddenTerm("Pendulum", "friction", "velocity", 0.4, 0.6, _cube),
    HiddenTerm("Pendulum", "gravity", "angle", 0.6, 0.3, _cube),
    HiddenTerm("ThermalNodes", "loss", "loss", 2.5, 8.0, _cube, "outer"),
    HiddenTerm("Cell", "drop", "current", 0.03, 2.0, abs),
)


@dataclass(frozen=True)
class TermCase(Case):
    """A record to draw, with the term hidden in it, by its place in `TERMS`, and its strength."""

    term: int = 0
    strength: float = 1.0

    @property
    def hidden(self) -> HiddenTerm:
        """The term."""
        return TERMS[self.term]

    def __str__(self) -> str:
        return (
            f"{self.hidden.law} over {self.hidden.signal}, {self.strength:.2f}, {super().__str__()}"
        )


def cases_of_terms(count: int, seed: int) -> list[TermCase]:
    """Draw cases: terms and kinds of noise in turn, all else as for clean records."""
    rng = np.random.default_rng([seed, 32])
    drawn = []
    for k in range(count):
        term = (k + k // len(KINDS)) % len(TERMS)
        plant = PLANTS[TERMS[term].plant]
        noise = KINDS[k % len(KINDS)]
        if noise == "jitter" and plant.rate > 200.0:
            noise = KINDS[0]
        strength = float(rng.uniform(*_STRENGTHS))
        case = conditions(plant, noise, 100_000 * seed + k, rng)
        drawn.append(TermCase(**asdict(case), term=term, strength=strength))
    return drawn


def draw_term(case: TermCase) -> CleanRecord:
    """Draw one record."""
    term = case.hidden
    amount = case.strength * term.amount
    place = f"{term.law} + {term.signal}"
    change = static(place, lambda x: amount * term.form(x / term.at))
    return draw(case, plant=PLANTS[term.plant].with_hidden(change))
