"""A cause with its best model."""

from __future__ import annotations

from dataclasses import dataclass

from orchestration.diagnosis.comparison import Comparison, Judged
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.terms import DelayTerm, NamedTerm, SensorTerm, Term


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause with its best model.

    Attributes
    ----------
    law, signal : str
        Of the leading term; kind and columns of a reading that leads.
    probability : float
    judged : Judged
    parts : tuple of Reading or Term
        In the order in which they explain.
    comparison : Comparison
        To the model without terms.
    score : float
        Of that comparison, nats.
    members : frozenset of (str, str)
        Laws with their signals that are this cause in other words, its own among them.
    aliases : tuple of str
        Names of laws with their signals that are this cause in other words.
    """

    law: str
    signal: str
    probability: float
    judged: Judged
    parts: tuple[Reading | Term, ...]
    comparison: Comparison
    score: float
    members: frozenset[tuple[str, str]]
    aliases: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str]:
        """Law and signal, by which a cause is one with another."""
        return self.law, self.signal

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms, in the order in which they explain."""
        return tuple(part for part in self.parts if isinstance(part, Term))

    @property
    def reading(self) -> Reading | None:
        """The reading of the file, if that is the cause: the file is misread."""
        lead = self.parts[0]
        return lead if isinstance(lead, Reading) else None

    @property
    def is_effect(self) -> bool:
        """True if it is an effect of the catalogue."""
        return isinstance(self.parts[0], NamedTerm)

    @property
    def is_of_a_law(self) -> bool:
        """True if it is in a law of the model, rather than in a sensor or a file."""
        return not isinstance(self.parts[0], Reading | SensorTerm | DelayTerm)

    @property
    def name(self) -> str:
        """Law and signal, or the name of an effect; of a reading its kind and columns."""
        lead = self.parts[0]
        return lead.name if isinstance(lead, Term) else str(lead)
