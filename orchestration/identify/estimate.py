"""A parameter as a fit gives it."""

from __future__ import annotations

from dataclasses import dataclass


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
