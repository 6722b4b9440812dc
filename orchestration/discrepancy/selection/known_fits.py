"""Fits made so far: a search comes to the same model from the same place by several ways."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from threading import Lock

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import Candidate
from orchestration.discrepancy.data import Dataset
from orchestration.identify.fitting import FitResult, Problem
from orchestration.identify.noise import Noise

_SERIES = 4  # of every output, in a result
_KEPT = 1e7  # numbers


class KnownFits:
    """Fits by all that they depend on, the latest of them as far as memory allows."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._fits: dict[Hashable, tuple[Dataset, FitResult]] = {}

    def get(
        self, key: Hashable, data: Dataset, samples: int, make: Callable[[], FitResult]
    ) -> FitResult:
        """Return the fit that is known by a key; make it where there is none.

        Parameters
        ----------
        key : Hashable
            See `fit_key`.
        data : Dataset
            The record. A key has its identity, which is its own as long as it is kept.
        samples : int
            Measured values of the record.
        make : callable
        """
        whole = (id(data), key)
        with self._lock:
            if whole in self._fits:
                return self._fits[whole][1]
        fit = make()
        with self._lock:
            self._fits[whole] = (data, fit)
            while len(self._fits) * samples * _SERIES > _KEPT:
                del self._fits[next(iter(self._fits))]
        return fit


def fit_key(
    candidate: Candidate, problem: Problem, q: Array, noise: Mapping[str, Noise] | None
) -> Hashable:
    """Return what tells a fit from others over the same record, but for its method.

    Parameters
    ----------
    candidate : Candidate
    problem : Problem
    q : ndarray, shape (p,)
        Where the fit starts.
    noise : Mapping of str to Noise, optional
        In which it starts.
    """
    begun_in = tuple(
        (o, n.coefficients.tobytes(), n.deviation, n.freedom) for o, n in (noise or {}).items()
    )
    colour = tuple((o, c.tobytes()) for o, c in problem.colour.items())
    freedom = tuple(problem.freedom.items())
    values = tuple(problem.start.items())
    return (
        (candidate.effects, tuple(problem.names), q.tobytes()),
        (values, problem.effort, problem.tolerance),
        (begun_in, colour, freedom),
    )
