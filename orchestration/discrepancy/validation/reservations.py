"""What makes a verdict less than it says: parameters that the record does not determine, and fits that went nowhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.note import Note, NoteCode

# Standard errors in searched coordinates, most of which are logarithms. Above the first, which is near that of the
# prior, a value may be half or twice as large: the record tells next to nothing. Below the second, with all others
# known, it would be known to a tenth: then it is determined together with others (Belsley, Kuh, Welsch: Regression
# Diagnostics, chapter 3).
_OPEN, _KNOWN = 0.6, 0.1
_AT_END = 1e-6  # in searched coordinates
_UNMOVED = 1e-6
_WRONG = 3.0  # times its noise, from which on an error is one that a refit should have lowered


def reservations(model: FittedCandidate, physical: Sequence[str]) -> list[Note]:
    """Gather what is to be said beside a verdict about the fit that it rests on.

    Parameters
    ----------
    model : FittedCandidate
        The best one, fitted to all that was measured.
    physical : sequence of str
        Parameters of the base model that were searched, without starts of states.
    """
    problem, fit = model.problem, model.fit
    at = {name: i for i, name in enumerate(problem.names) if name in physical}
    low, high = problem.bounds()
    ends = [n for n, i in at.items() if min(fit.q[i] - low[i], high[i] - fit.q[i]) < _AT_END]
    errors, alone = fit.covariance.standard_errors, _alone(model)
    loose = [n for n, i in at.items() if errors[i] > _OPEN and n not in ends]
    together = [n for n in loose if alone[at[n]] < _KNOWN]
    unknown = [n for n in loose if n not in together]
    if len(together) == 1:  # with starts of states or with an effect
        unknown, together = unknown + together, []
    found = [
        (NoteCode.UNDETERMINED, unknown),
        (NoteCode.DETERMINED_TOGETHER, together),
        (NoteCode.AT_BOUND, ends),
    ]
    notes = [Note(code, "", {"names": tuple(names)}) for code, names in found if names]
    moved = np.abs(fit.q - problem.position(problem.start))[list(at.values())]
    if not fit.converged:
        notes.append(Note(NoteCode.NOT_CONVERGED))
    if at and moved.max() < _UNMOVED and _wrong(model):
        notes.append(Note(NoteCode.NOT_MOVED))
    return notes


def _alone(model: FittedCandidate) -> np.ndarray:
    """Standard errors (p,) that parameters would have if all others were known."""
    known = np.diag(model.fit.information)
    return np.divide(1.0, np.sqrt(known), out=np.full(len(known), np.inf), where=known > 0.0)


def _wrong(model: FittedCandidate) -> bool:
    """Whether errors are far beyond what is not explained from sample to sample."""
    fit = model.fit
    return any(np.std(e) > _WRONG * fit.noise[o].deviation for o, e in fit.residual.items())
