"""Parameters of a member adjusted to a record without its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.systems.member import BudgetExceeded, MemberSimulation
from orchestration.discrepancy.systems.parameter_search import ParameterSearch, Point

Array = NDArray[np.float64]
_BETTER = 0.98  # of the cost, for another view of what an input does between samples


@dataclass(frozen=True)
class AdjustmentResult:
    """Parameters that were adjusted.

    Attributes
    ----------
    values, nominal : dict of str to float
        In the units of the FMU.
    change, standard_error : dict of str to float
        By how much and its standard error: of the logarithm where a parameter is positive by nature, else relative to
        its size.
    complete : bool
        Whether the search ended by itself, not because there were no more simulations to make.
    """

    values: dict[str, float]
    nominal: dict[str, float]
    change: dict[str, float]
    standard_error: dict[str, float]
    complete: bool


def adjust(
    simulation: MemberSimulation,
    simulated: Mapping[str, Array],
    most: int,
    interpolation: bool = True,
) -> AdjustmentResult:
    """Adjust the few parameters that help most.

    Parameters
    ----------
    simulation : MemberSimulation
        Its choice of inputs that are held may change.
    simulated : Mapping of str to ndarray, shape (n,)
        With the parameters as they are.
    most : int
        Parameters that are adjusted.
    interpolation : bool
        Whether to look again, with the parameters free, at what inputs do between samples: that an input is held can
        look like a parameter that is off.

    Returns
    -------
    AdjustmentResult
    """
    search, inputs = ParameterSearch(simulation, simulated), simulation.inputs
    complete, held = True, set(inputs.held)
    try:
        search.choose(simulated, most)
        if search.names:
            search.fit(search.start)
            search.reweight()
            search.fit(search.best.q)
            for name in inputs.continuous if interpolation else ():
                before, held = search.best, set(inputs.held)
                inputs.held = held ^ {name}
                search.restart()
                search.fit(before.q)
                if search.best.cost >= _BETTER * before.cost:
                    search.best, inputs.held = before, held
    except BudgetExceeded:
        complete = False
        if not np.isfinite(search.best.cost) and search.names:
            search.best = Point(np.inf, search.start)
    if not complete and search.previous is not None and search.previous.cost <= search.best.cost:
        search.best, inputs.held = search.previous, held
    q, names = search.best.q, search.names
    return AdjustmentResult(
        search.values(q),
        {n: search.declared[n].start for n in names},
        dict(zip(names, (q - search.start).tolist(), strict=True)),
        dict(zip(names, search.standard_errors().tolist(), strict=True)),
        complete,
    )
