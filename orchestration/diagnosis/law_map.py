"""The map of laws over signals: what each law would gain by a term of each signal."""

from __future__ import annotations

from dataclasses import dataclass

from fmus.kit.arrays import single_threaded
from orchestration.diagnosis.courses import courses_of_fit
from orchestration.diagnosis.engine import Diagnosis
from orchestration.diagnosis.screening import screen_of
from orchestration.diagnosis.terms import SensorTerm, Term


@dataclass(frozen=True)
class LawEntry:
    """The best term of a law over a signal, to first order.

    Attributes
    ----------
    term : Term
        Of laws that act alike in the one that owns the signal.
    gain : float
        In log likelihood on the fitted samples, nats; less what its columns and its words cost.
    """

    term: Term
    gain: float


@dataclass(frozen=True, eq=False)
class LawMap:
    """A diagnosis with the map of its laws.

    Attributes
    ----------
    diagnosis : Diagnosis
    entries : tuple of LawEntry
        Of every law over every signal that it may depend on, the largest gain first.
    """

    diagnosis: Diagnosis
    entries: tuple[LawEntry, ...]


@single_threaded
def map_laws(diagnosis: Diagnosis) -> LawMap:
    """Compute the linear response of the model without terms to a term of each law and signal.

    Parameters
    ----------
    diagnosis : Diagnosis

    Returns
    -------
    LawMap
        Without entries if the model runs away.
    """
    subject = diagnosis.found.subject
    base = (subject.fewer or subject).base
    along = courses_of_fit(base)
    if along is None:
        return LawMap(diagnosis, ())
    screen = screen_of(along, is_candidate=_is_dependence)
    terms = [candidate.term for candidate in screen.candidates]
    gains = screen.values([(i,) for i in range(len(terms))]).tolist()
    best: dict[tuple[str, str], LawEntry] = {}
    for term, gain in sorted(zip(terms, gains, strict=True), key=lambda pair: -pair[1]):
        best.setdefault(term.cause, LawEntry(term, gain))
    return LawMap(diagnosis, tuple(best.values()))


def _is_dependence(term: Term) -> bool:
    """Return whether a term makes a law depend on a signal."""
    return bool(term.signal) and not isinstance(term, SensorTerm)
