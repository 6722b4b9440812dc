"""Searches from several points, where the error may have more than one minimum.

A residual that is white leaves nothing to explain, and no other minimum is deeper by more than
chance: then one search is enough. Else points are drawn over the ranges, and searches begin at the
best of them (Rinnooy Kan and Timmer, Mathematical Programming 39, 1987).
"""

from __future__ import annotations

from collections.abc import Callable
from math import log
from typing import NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, single_threaded
from fmus.kit.interrupt import Interrupt, deferred
from orchestration.identify.fitting.output_error import FitResult, fit_output_error
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.fitting.simulation_error import error_at
from orchestration.identify.noise import WHITENESS_SAMPLES, whiteness

_STARTS = 5  # searches, unless their number is given
_DRAWN = 4  # points drawn for each search that begins at one of them
# half the width, in searched coordinates, over which points are drawn where a range is wider: a
# factor of ten in a logarithm, three sizes else
_REACH = {True: log(10.0), False: 3.0}
_ROUNDING = 1e-6  # of what an output moves by: a residual that is no larger leaves nothing
_DEEPER = 1.0  # fall of the deviance beyond which a minimum is another one


class Searches(NamedTuple):
    """The best of several searches.

    Attributes
    ----------
    best : FitResult
    made : int
    gain : float
        Fall of the deviance below the end of the first search.
    is_interrupted : bool
        Whether Ctrl-C ended them.
    """

    best: FitResult
    made: int = 1
    gain: float = 0.0
    is_interrupted: bool = False


@single_threaded
def fit_from_starts(
    problem: Problem,
    start: Array,
    count: int | None,
    progress: Callable[[str], None] = lambda text: None,
) -> Searches:
    """Fit from a start, and from others where a deeper minimum may exist.

    The first Ctrl-C ends it with the best so far.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
    count : int or None
        Searches; None for `_STARTS`, or one if its residual is white.
    progress : callable
        Takes what is done next, and what is best so far.

    Raises
    ------
    UserError
        If the simulation fails at the start.
    """
    with deferred() as problem.interrupt:
        searches = _searches(problem, start, count, progress)
    problem.interrupt = Interrupt()  # profiles are searches of their own
    return searches


def _searches(
    problem: Problem, start: Array, count: int | None, progress: Callable[[str], None]
) -> Searches:
    """Search from one point after the other, until Ctrl-C."""
    first = fit_output_error(problem, start)
    made = 1
    best = first
    if count is None:
        count = 1 if _is_white(problem, first) else _STARTS
    for number, point in enumerate(_points(problem, start, count - 1) if count > 1 else [], 2):
        values = ", ".join(f"{name}={value:.4g}" for name, value in best.values.items())
        progress(f"search {number} of {count}; best so far: {values}")
        if problem.interrupt.pressed:
            break
        try:
            found = fit_output_error(problem, point)
        except UserError:
            continue
        made += 1
        if found.deviance < best.deviance - _DEEPER:
            best = found
    return Searches(best, made, first.deviance - best.deviance, problem.interrupt.pressed)


def _is_white(problem: Problem, fitted: FitResult) -> bool:
    """Return whether the residual of every output is white, or of the size of rounding errors."""
    for output, y in problem.measured.items():
        residual = fitted.residual[output]
        is_tested = len(residual) >= WHITENESS_SAMPLES
        is_noise = is_tested and whiteness(residual).is_white
        if not is_noise and np.std(residual) > _ROUNDING * np.nanstd(y):
            return False
    return True


def _points(problem: Problem, start: Array, count: int) -> list[Array]:
    """Return the points with the least error of a Latin hypercube over the ranges."""
    low, high = problem.bounds()
    reach = np.array([_REACH[scale.logarithmic] for scale in problem.scales])
    given = [name in problem.assumptions.bounds for name in problem.names]
    low = np.where(given & np.isfinite(low), low, np.maximum(low, start - reach))
    high = np.where(given & np.isfinite(high), high, np.minimum(high, start + reach))
    from scipy.stats.qmc import LatinHypercube

    drawn = LatinHypercube(len(start), rng=0).random(_DRAWN * count)
    points = low + (high - low) * drawn
    errors = [error_at(problem, point) for point in points]
    best = np.argsort(errors)[:count]
    return [points[i] for i in best if np.isfinite(errors[i])]
