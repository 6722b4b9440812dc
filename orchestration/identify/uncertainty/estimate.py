"""Fitted parameters: value with interval, significance of a change, and joint distribution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri

from fmus.kit import UserError
from fmus.kit.arrays import Array, Interval, Mask
from orchestration.identify.metrics import finite_or_none

if TYPE_CHECKING:
    import pandas

SIGNIFICANT = 5.0  # standard errors by which a parameter counts as another than nominal
NOTICEABLE = 0.02  # relative difference below which a parameter counts as nominal, or as unchanged
# eigenvalue below zero of a matrix of correlations that may have been written with seven digits
_ROUNDING = 1e-6


def is_significantly_different(
    change: float, standard_error: float, noticeable: float = NOTICEABLE
) -> bool:
    """Return whether a parameter differs from nominal both significantly and noticeably.

    Parameters
    ----------
    change, standard_error : float
        In a searched coordinate: of the logarithm, or relative to the size of the parameter.
    noticeable : float
        Largest change that counts as none.
    """
    return bool(abs(change) > noticeable and abs(change) > SIGNIFICANT * standard_error)


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter, SI.

    Attributes
    ----------
    value, nominal : float
        Fitted value and the value the fit started from; NaN where there was none.
    interval : tuple of float
        95 % confidence interval; infinite where the record says nothing about the parameter.
    unit : str
    """

    value: float
    nominal: float
    interval: Interval
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: None for an open end of ``ci95``, or no nominal."""
        interval = [finite_or_none(end) for end in self.interval]
        nominal = finite_or_none(self.nominal)
        return {"value": self.value, "ci95": interval, "nominal": nominal, "unit": self.unit}


def estimates_frame(estimates: Mapping[str, Estimate]) -> pandas.DataFrame:
    """Return estimates as a table by name: value, ends of the interval, nominal value and unit."""
    import pandas

    columns = ["value", "low", "high", "nominal", "unit"]
    rows = [[e.value, *e.interval, e.nominal, e.unit] for e in estimates.values()]
    index = pandas.Index([*estimates], name="parameter")
    return pandas.DataFrame(rows, columns=columns, index=index)


@dataclass(frozen=True)
class Distribution:
    """Joint distribution of the estimates of p parameters.

    Attributes
    ----------
    names : tuple of str
    logarithmic : ndarray of bool, shape (p,)
        Parameters whose logarithm is normally distributed; the others are so themselves.
    centre : ndarray, shape (p,)
        In the logarithm where that is normal.
    covariance : ndarray, shape (p, p)
        Likewise.
    """

    names: tuple[str, ...]
    logarithmic: Mask
    centre: Array
    covariance: Array

    def draws(self, count: int, seed: int = 0) -> dict[str, Array]:
        """Draw parameters at random.

        Parameters
        ----------
        count : int
        seed : int
            The same seed gives the same draws.

        Returns
        -------
        dict of str to ndarray, shape (count,)
            By parameter, in the units of the fit.

        Raises
        ------
        UserError
            If count or seed is not possible, or the covariance is not positive semidefinite.
        """
        if not (
            isinstance(count, Integral) and isinstance(seed, Integral) and count >= 1 and seed >= 0
        ):
            raise UserError(
                f"{count} draws with seed {seed}: whole numbers, of one draw or more and a seed"
                " from zero on"
            )
        self._check_covariance()
        values, directions = np.linalg.eigh(self.covariance)
        # the symmetric root does not depend on the signs of the eigenvectors
        root = (directions * np.sqrt(np.clip(values, 0.0, None))) @ directions.T
        normal = np.random.default_rng(seed).standard_normal((count, len(self.names)))
        drawn = self.centre + normal @ root
        drawn = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, drawn, 0.0)), drawn)
        return {
            name: np.ascontiguousarray(column)
            for name, column in zip(self.names, drawn.T, strict=True)
        }

    def _check_covariance(self) -> None:
        """Refuse correlations that contradict each other."""
        sizes = np.sqrt(np.diag(self.covariance))
        scale = np.where(sizes > 0.0, sizes, 1.0)  # so that units do not count
        least = np.linalg.eigvalsh(self.covariance / np.outer(scale, scale))[0]
        if not least >= -_ROUNDING:
            raise UserError(
                f"the correlations of {', '.join(self.names)} contradict each other: their matrix"
                f" has the eigenvalue {least:.3g}, and none below zero is possible"
            )


def joint_distribution(
    estimates: Mapping[str, Estimate],
    correlations: Mapping[tuple[str, str], float],
    logarithmic: Sequence[str],
) -> Distribution:
    """Make a joint distribution from single estimates and correlations of pairs.

    Parameters
    ----------
    estimates : Mapping of str to Estimate
    correlations : Mapping of tuple of str to float
        Of every pair, in the coordinates of the search.
    logarithmic : sequence of str
        Parameters that were searched in their logarithm, in which their interval is symmetric.

    Raises
    ------
    UserError
        If a parameter has no finite interval: nothing can be drawn of a parameter that a
        record does not determine.
    """
    names = tuple(estimates)
    open_ended = [
        name for name, e in estimates.items() if not np.isfinite([e.value, *e.interval]).all()
    ]
    if open_ended:
        raise UserError(
            f"the record does not determine {', '.join(open_ended)}: fit without, and it can be"
            " drawn from"
        )
    log = np.array([name in logarithmic for name in names], dtype=bool)
    ends = np.array([[e.interval[0], e.value, e.interval[1]] for e in estimates.values()])
    if (ends[log] <= 0.0).any():
        raise UserError(
            "a parameter that was searched in its logarithm has no positive value and interval"
        )
    ends[log] = np.log(ends[log])
    errors = (ends[:, 2] - ends[:, 0]) / (2.0 * ndtri(0.975))
    matrix = np.eye(len(names))
    for (one, other), value in correlations.items():
        i, j = names.index(one), names.index(other)
        matrix[[i, j], [j, i]] = value
    return Distribution(names, log, ends[:, 1], matrix * np.outer(errors, errors))
