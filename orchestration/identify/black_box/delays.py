"""Delays from inputs to the output: those of the output-error model with the least BIC.

For every delay the model is at its optimum, so that the error of its simulation decides, whatever
the colour of the noise (Björklund and Ljung: A review of time-delay estimation techniques, IEEE
Conference on Decision and Control, 2003). ARX models need no search, but in noise that does not
pass their poles their delays are several samples late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fmus.kit.arrays import Array, single_threaded
from fmus.kit.errors import UserError
from orchestration.identify.black_box.data import InputOutputData
from orchestration.identify.black_box.gauss_newton import minimise
from orchestration.identify.black_box.orders import orders
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.start_values import denominators
from orchestration.identify.black_box.variable_projection import ReducedPredictionError

_USUAL = 1  # sample: that of a system which is sampled at the instants at which it is driven
_LONGEST = 100  # samples
_SHORTEST_RECORD = 10  # in longest delays
_TURNS = 6
_CLEARLY = 4.0  # difference of BIC: odds of e^2
_TRIALS = 12
_ENOUGH = 1e-4
_ONE = np.ones(1)


@single_threaded
def estimate_delays(
    data: InputOutputData,
    path_orders: Sequence[int],
    progress: Callable[[int, int], None] = lambda done, whole: None,
) -> tuple[int, ...]:
    """Estimate the delay from every input, one input after the other, with the order that BIC has.

    A path of higher order begins earlier, so that it is searched up to the delays of the order
    before.

    Parameters
    ----------
    data : InputOutputData
    path_orders : sequence of int
        Of the path from every input.
    progress : callable
        Called with the number of delays that were tried, and the number of all.

    Returns
    -------
    tuple of int
        In samples, from 0 to 100 and to a tenth of the record; 1 where no other is clearly better,
        and where the record is too short for the orders.
    """
    limit = min(_LONGEST, len(data) // _SHORTEST_RECORD)
    delays = (_USUAL,) * len(data.input_names)
    limits = [limit] * len(delays)
    known = []
    for order in sorted(set(path_orders)):
        criterion = _Criterion(data, order, limit + max(path_orders))
        try:
            known.append(_least(criterion, delays, limits, progress))
        except UserError:  # too few samples
            break
        limits = [max(delay, _USUAL) for delay in known[-1][1]]
    return min(known, default=(0.0, delays))[1]


def _least(
    criterion: _Criterion,
    usual: tuple[int, ...],
    limits: Sequence[int],
    progress: Callable[[int, int], None],
) -> tuple[float, tuple[int, ...]]:
    """Return the least criterion of a model, and the delays that have it.

    A delay that is wrong draws off that of another input, so that inputs are searched by turns.
    """
    delays = list(usual)
    value = criterion(delays)
    for _ in range(_TURNS if len(delays) > 1 else 1):
        before = list(delays)
        for i, limit in enumerate(limits):
            bic = {}
            for delay in range(limit + 1):
                progress(sum(limits[:i]) + i + delay, sum(limits) + len(limits))
                bic[delay] = criterion([*delays[:i], delay, *delays[i + 1 :]])
            best = min(bic, key=bic.__getitem__)
            delays[i] = best if bic[usual[i]] - bic[best] > _CLEARLY else usual[i]
            value = bic[delays[i]]
        if delays == before:
            break
    return value, tuple(delays)


class _Criterion:
    """BIC of output-error models of one order, of the same samples for all delays."""

    def __init__(self, data: InputOutputData, order: int, first: int):
        self._data = data
        self._inputs = data.inputs - data.inputs.mean(axis=0)
        self._output = data.output - data.output.mean()
        self._order = order
        self._first = first
        self._before: list[Array] = []  # where the search for the delays before ended
        self._known: dict[tuple[int, ...], float] = {}

    def __call__(self, delays: Sequence[int]) -> float:
        """Return the least BIC, times the number of samples, of models with and without zeros."""
        key = tuple(delays)
        if key not in self._known:
            self._known[key] = self._least_of(delays)
        return self._known[key]

    def _least_of(self, delays: Sequence[int]) -> float:
        all_zeros = [self._order + (delay == 0) for delay in delays]
        counts = [all_zeros] if max(all_zeros) == 1 else [all_zeros, [1] * len(delays)]
        return min(self._of(numerators, delays) for numerators in counts)

    def _of(self, numerators: Sequence[int], delays: Sequence[int]) -> float:
        chosen = orders(self._data, numerators, delays, nf=self._order)
        problem = PredictionError(self._inputs, self._output, chosen, self._first)
        reduced = ReducedPredictionError(problem)
        start = reduced.coordinates([*next(denominators(problem)), _ONE, _ONE])
        minima = [minimise(reduced, x, _TRIALS, _ENOUGH) for x in (start, *self._before)]
        best = min(minima, key=lambda minimum: minimum.cost)
        self._before = [best.theta]
        rounding = np.finfo(float).eps * (self._output @ self._output)
        n = problem.samples
        return float(n * np.log(max(best.cost, rounding)) + problem.size * np.log(n))
