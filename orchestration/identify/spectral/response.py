"""A measured frequency response: one ratio of two signals, with intervals of all that is read off.

The error of a response is circular, so that real and imaginary part have half its variance each and
any smooth function of it the variance of the delta method (Pintelon and Schoukens, section 2.4).
Quantiles are Student's and F's, as the variance is estimated from few lines.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri, stdtrit

from fmus.kit.arrays import Array, Mask
from fmus.kit.units import measure_alike
from orchestration.identify.metrics import finite_or_none

LEVEL = 0.95  # of all intervals
_STIFFNESS = ("N/m", "Pa", "N*m/rad")


class Interval(NamedTuple):
    """A quantity over the lines with the ends of its 95 % interval, each of shape (n,)."""

    value: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Response:
    """A frequency response, such as an impedance or a dynamic stiffness.

    Attributes
    ----------
    name : str
        Such as ``voltage/current``.
    unit : str
    frequency : ndarray, shape (n,)
        Hz.
    values : ndarray of complex, shape (n,)
    variance : ndarray, shape (n,)
        Of the complex error, ``E |dG|**2``, in the unit squared.
    freedom : ndarray, shape (n,)
        Real degrees of freedom of that.
    model : ndarray of complex, shape (n,), or None
        The same estimate from the model's outputs.
    left_out : Mapping of str to ndarray, shape (m,)
        Frequencies in Hz of lines that are left out, by the reason.
    """

    name: str
    unit: str
    frequency: Array
    values: NDArray[np.complex128]
    variance: Array
    freedom: Array
    model: NDArray[np.complex128] | None
    left_out: Mapping[str, Array]

    @property
    def is_stiffness(self) -> bool:
        """True if real and imaginary part are those of a stiffness: storage and loss."""
        return any(measure_alike(self.unit, one) for one in _STIFFNESS)

    @property
    def magnitude(self) -> Interval:
        """The magnitude, in the unit."""
        made = self._interval(np.abs(self.values), self._deviation)
        return made._replace(low=np.maximum(made.low, 0.0))

    @property
    def phase(self) -> Interval:
        """The phase in degrees, without jumps; its interval is a turn where nothing is seen."""
        phase = np.angle(self.values)
        seen = np.flatnonzero(self.seen)
        if seen.size:
            # unwrapped where it is seen, and elsewhere the turn that is nearest to the line between
            unwrapped = np.interp(np.arange(phase.size), seen, np.unwrap(phase[seen]))
            phase = unwrapped + np.angle(np.exp(1j * (phase - unwrapped)))
        made = self._interval(np.degrees(phase), np.degrees(self._deviation / np.abs(self.values)))
        half = np.where(self.seen, np.minimum(made.high - made.value, 180.0), 180.0)
        return Interval(made.value, made.value - half, made.value + half)

    @property
    def real(self) -> Interval:
        """The real part: of an impedance the resistance, of a stiffness the storage."""
        return self._interval(self.values.real, self._deviation)

    @property
    def imaginary(self) -> Interval:
        """The imaginary part: of an impedance the reactance, of a stiffness the loss."""
        return self._interval(self.values.imag, self._deviation)

    storage = real
    loss = imaginary

    @property
    def loss_tangent(self) -> Interval:
        """Tan delta: the imaginary part over the real one; loss over storage of a stiffness."""
        real = self.values.real
        deviation = self._deviation * np.abs(self.values) / real**2
        return self._interval(self.values.imag / real, deviation)

    @property
    def covariance(self) -> Array:
        """Covariance of real and imaginary part (n, 2, 2), in the unit squared."""
        return 0.5 * self.variance[:, np.newaxis, np.newaxis] * np.eye(2)

    @property
    def radius(self) -> Array:
        """Radius (n,) of the circle in the complex plane that is the 95 % region."""
        return np.sqrt(self.variance * fdtri(2.0, self.freedom, LEVEL))

    @property
    def seen(self) -> Mask:
        """True where a response is significant (n,): its 95 % region excludes zero."""
        return self.radius < np.abs(self.values)

    @property
    def agrees(self) -> Mask | None:
        """True where the model is within the 95 % region (n,); None without a model."""
        return None if self.model is None else np.abs(self.model - self.values) <= self.radius

    @property
    def _deviation(self) -> Array:
        """Standard deviation of real and imaginary part (n,)."""
        return np.sqrt(0.5 * self.variance)

    def _interval(self, value: Array, deviation: Array) -> Interval:
        half = stdtrit(self.freedom, 0.5 + 0.5 * LEVEL) * deviation
        return Interval(value, value - half, value + half)

    @property
    def quantities(self) -> dict[str, Interval]:
        """All quantities by their names."""
        parts = ("storage", "loss", "loss_tangent") if self.is_stiffness else ("real", "imaginary")
        return {name: getattr(self, name) for name in ("magnitude", "phase", *parts)}

    def columns(self) -> dict[str, Array]:
        """Return frequency, quantities with ends of intervals, and the model's, (n,) by column."""
        made = {"frequency": self.frequency}
        for name, interval in self.quantities.items():
            made |= {
                name: interval.value,
                f"{name}_low": interval.low,
                f"{name}_high": interval.high,
            }
        if self.model is not None:
            made["model_magnitude"] = np.abs(self.model)
            made["model_phase"] = self.model_phase
        return made

    def unit_of(self, column: str) -> str:
        """Return the unit of a column."""
        if column == "frequency":
            return "Hz"
        if "phase" in column:
            return "deg"
        return "1" if column.startswith("loss_tangent") else self.unit

    @property
    def model_phase(self) -> Array:
        """Phase of the model in degrees (n,), within half a turn of the measured one."""
        if self.model is None:
            return np.full(self.frequency.shape, np.nan)
        difference = np.degrees(np.angle(self.model / self.values))
        return self.phase.value + difference

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON."""
        agrees = self.agrees
        return {
            "unit": self.unit,
            **{
                name: [finite_or_none(one) for one in column]
                for name, column in self.columns().items()
            },
            "degrees_of_freedom": self.freedom.astype(int).tolist(),
            "left_out": {reason: lines.tolist() for reason, lines in self.left_out.items()},
            "model_agrees": None if agrees is None else agrees.tolist(),
        }
