"""Records that another simulation made: without noise, and off by no more than its solver is.

What a solver errs by is smooth and repeats itself, and there is no noise beside it, so that any
effect which resembles it would be beyond all doubt.
"""

from __future__ import annotations

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import white_noise
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.records.quality import is_on_grid, resolution_of

# Of the spread of an output: what forward Euler errs by with a hundred steps to a time constant,
# which is half a step (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I, section
# II.3). Default tolerances of solvers with step control are a fifth of it.
SOLVER_ERROR = 5e-3
# Of that spread: less noise, or finer steps, than a converter of 16 bit has.
_NOISELESS = 1e-5
_ROUNDING = 1e-9  # of its spread, up to which an output is met but for rounding


def solver_error_notes(model: FittedCandidate) -> list[Note]:
    """Return a note if no output has noise and a fitted model errs by no more than a solver does.

    There is nothing to look for then, as whatever explains more of it explains the solver.
    """
    shares = []
    for output, residual in model.fit.residual.items():
        measured = model.problem.measured[output][model.problem.present[output]]
        spread = float(np.std(measured))
        error = float(np.std(residual))
        is_met = error <= _ROUNDING * spread  # even if it is of a few levels
        if not (is_met or _is_noiseless(measured, residual, _NOISELESS * spread)):
            return []
        if spread > 0.0:
            shares.append(error / spread)
    if not shares or max(shares) > SOLVER_ERROR:
        return []
    return [Note(NoteCode.SOLVER_ERROR, "", {"share": max(shares)})]


def _is_noiseless(measured: Array, residual: Array, least: float) -> bool:
    """Return whether an output (n,) has neither steps of a converter nor noise, which is left."""
    resolution = resolution_of(measured)
    if resolution == 0.0 or (resolution > least and is_on_grid(measured, resolution)):
        return False
    return white_noise(residual) < least
