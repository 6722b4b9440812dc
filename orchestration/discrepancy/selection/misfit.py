"""The misfit of a free run, by which ways to read a record are compared, and the nominal model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import Candidate, FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.selection.search import FAILURES, Search
from orchestration.identify.fitting import FitResult, Problem

MUCH_NEARER = 0.5  # of an error, up to which it must fall


def free_run_error(fitted: FittedCandidate) -> float:
    """Return the relative error of the nearest free run of a model, or of its fit if it has none.

    Parameters
    ----------
    fitted : FittedCandidate

    Returns
    -------
    float
        See `relative_error`.
    """
    return relative_error(fitted.problem, fitted.free_run or fitted.fit)


def relative_error(problem: Problem, fit: FitResult) -> float:
    """Return the RMS error of a fit over the spread of what was measured, pooled over outputs.

    Outputs that do not vary tell nothing.
    """
    shares = [
        share_of_power(problem.measured[output][problem.present[output]], residual)
        for output, residual in fit.residual.items()
    ]
    return pooled(shares)


def share_of_power(measured: Array, residual: Array) -> float:
    """Return the mean square of a residual (n,) over the variance of what was measured (n,)."""
    power = float(np.var(measured))
    if not power > 0.0:
        return np.nan
    with np.errstate(over="ignore"):  # a simulation that runs away is far off
        return float(np.mean(residual**2)) / power


def pooled(shares: list[float]) -> float:
    """Return the root of the mean of shares of power that are known; zero of none."""
    known = [share for share in shares if not np.isnan(share)]
    return float(np.mean(known or [0.0])) ** 0.5


def change_from_nominal(problem: Problem, fit: FitResult) -> Array:
    """Return how far each parameter but starts is from nominal, in searched coordinates (k,)."""
    physical = [not problem.declared[name].starts for name in problem.names]
    return (fit.q - problem.position(problem.start))[physical]


def refitted_error(search: Search, data: Dataset, each: Sequence[str] = ()) -> float:
    """Return the relative error of the model without effects fitted to other data.

    Parameters
    ----------
    search : Search
    data : Dataset
    each : sequence of str
        More parameters that differ from run to run.

    Returns
    -------
    float
        Infinite if it cannot be fitted.
    """
    again = replace(search, data=data, each=(*search.each, *each), progress=lambda text: None)
    try:
        with np.errstate(over="ignore"):  # a simulation that runs away is far off
            return relative_error(*again.free_run())
    except FAILURES:
        return np.inf


def nominal_outputs(search: Search, data: Dataset) -> dict[str, Array]:
    """Return the measured outputs (n,) of the nominal model; none if it cannot be simulated."""
    problem = search.problem(Candidate((), search.base), list(search.parameters), search.fixed)
    try:
        ran = problem.model.run(data.time, data.inputs, problem.start, runs=data.runs)
    except FAILURES:
        return {}
    # copies, as a column of all signals would keep all of them in memory
    return {output: ran.signals[output].copy() for output in data.measured}
