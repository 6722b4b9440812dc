"""A parameter as a fit gives it, and whether it is another than nominal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from orchestration.identify.metrics import number

SIGNIFICANT = 5.0  # standard errors by which a parameter counts as another than nominal
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
