"""A parameter as a fit gives it, whether it is another than nominal, and how several are distributed together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fmus.kit.errors import UserError
from orchestration.identify.metrics import number

Array = NDArray[np.float64]
SIGNIFICANT = 5.0  # standard errors by which a parameter counts as another than nominal
_ROUNDING = (
    1e-6  # eigenvalue below zero, of correlations that may have been written with seven digits
)
NOTICEABLE = 0.02  # relative difference below which that is not worth a word


def significantly_different(change: float, standard_error: float) -> bool:
    """Whether a parameter is surely and noticeably another than nominal.

    Parameters
    ----------
    change, standard_error : float
        In a searched coordinate: of the logarithm, or relative to the size of the parameter.
    """
    return bool(abs(change) > NOTICEABLE and abs(change) > SIGNIFICANT * standard_error)


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, SI.

    Attributes
    ----------
    value, nominal : float
        Fitted value and the value the fit started from.
    interval : tuple of float
        95 % confidence interval; infinite where the record says nothing about the parameter.
    unit : str
    """

    value: float
    nominal: float
    interval: tuple[float, float]
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON: ``value``, ``ci95`` (None for an open end), ``nominal`` and ``unit``."""
        interval = [number(end) for end in self.interval]
        return {"value": self.value, "ci95": interval, "nominal": self.nominal, "unit": self.unit}


@dataclass(frozen=True)
class Distribution:
    """Joint distribution of the estimates of p parameters.

    Attributes
    ----------
    names : tuple of str
    logarithmic : ndarray of bool, shape (p,)
        Parameters whose logarithm is normal; of the others they are themselves.
    centre : ndarray, shape (p,)
        In these coordinates.
    covariance : ndarray, shape (p, p)
        Likewise.
    """

    names: tuple[str, ...]
    logarithmic: NDArray[np.bool_]
    centre: Array
    covariance: Array

    def draws(self, count: int, seed: int = 0) -> dict[str, Array]:
        """Draw parameters at random.

        Parameters
        ----------
        count : int
        seed : int
            The same seed comes to the same draws.

        Returns
        -------
        dict of str to ndarray, shape (count,)
            By parameter, in the units of the fit.

        Raises
        ------
        UserError
            If count or seed are none, or the covariance is that of nothing.
        """
        if not (
            isinstance(count, Integral) and isinstance(seed, Integral) and count >= 1 and seed >= 0
        ):
            raise UserError(
                f"{count} draws with seed {seed}: whole numbers, of one draw or more and a seed from zero on"
            )
        sizes = np.sqrt(np.diag(self.covariance))
        scaled = self.covariance / np.outer(
            *[np.where(sizes > 0.0, sizes, 1.0)] * 2
        )  # so that units do not count
        if not (least := np.linalg.eigvalsh(scaled)[0]) >= -_ROUNDING:
            raise UserError(
                f"the correlations of {', '.join(self.names)} contradict each other: their matrix has the eigenvalue "
                f"{least:.3g}, and none below zero is possible"
            )
        values, directions = np.linalg.eigh(self.covariance)
        # the symmetric root is the only one, whatever signs the directions have
        root = (directions * np.sqrt(np.clip(values, 0.0, None))) @ directions.T
        drawn = (
            self.centre
            + np.random.default_rng(seed).standard_normal((count, len(self.names))) @ root
        )
        drawn = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, drawn, 0.0)), drawn)
        return {
            name: np.ascontiguousarray(column)
            for name, column in zip(self.names, drawn.T, strict=True)
        }


def distribution(
    estimates: Mapping[str, Estimate],
    correlations: Mapping[tuple[str, str], float],
    logarithmic: Sequence[str],
) -> Distribution:
    """Put together what a fit says of its parameters one by one and in pairs.

    Parameters
    ----------
    estimates : Mapping of str to Estimate
    correlations : Mapping of tuple of str to float
        Of every pair, in the coordinates of the search.
    logarithmic : sequence of str
        Parameters that were searched in their logarithm, in which their interval is even.

    Raises
    ------
    UserError
        If a parameter has no finite interval: nothing can be drawn of what a record does not determine.
    """
    names = tuple(estimates)
    open_ended = [
        name for name, e in estimates.items() if not np.isfinite([e.value, *e.interval]).all()
    ]
    if open_ended:
        raise UserError(
            f"the record does not determine {', '.join(open_ended)}: fit without, and it can be drawn from"
        )
    log = np.array([name in logarithmic for name in names], dtype=bool)
    ends = np.array([[e.interval[0], e.value, e.interval[1]] for e in estimates.values()])
    if (ends[log] <= 0.0).any():
        raise UserError(
            "a parameter that was searched in its logarithm has no positive value and interval"
        )
    ends[log] = np.log(ends[log])
    errors = (ends[:, 2] - ends[:, 0]) / (2.0 * norm.ppf(0.975))
    matrix = np.eye(len(names))
    for (one, other), value in correlations.items():
        i, j = names.index(one), names.index(other)
        matrix[i, j] = matrix[j, i] = value
    return Distribution(names, log, ends[:, 1], matrix * np.outer(errors, errors))
