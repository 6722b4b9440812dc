"""Recursive estimate of ``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)`` (eq. 4.6), by least squares or
an instrumental variable.

Noise in ``v(t-1)`` biases least squares (``docs/errata.md``, row 9). The instrumental variable
avoids this bias: an auxiliary model, which follows the estimate, computes the voltage from the
current alone.
"""

from __future__ import annotations

from typing import Any, cast

from ..kit import (
    Array,
    Parameter,
    clip,
    exp,
    log,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    where,
)
from . import recursion
from .excitation import Excitation
from .measurement import sampled_state
from .recursion import Matrix, Vector

# Smallest forgetting factor; below it only the latest sample would count.
_LEAST_FORGETTING = 0.01
_SLOWEST_POLE = 0.9999
# Tolerance, in periods, of times that are sums of rounded periods.
ROUNDING = 1e-6
_COVARIANCE = [f"p[{row},{column}]" for row in (1, 2, 3) for column in (1, 2, 3)]


class Regression(Excitation):
    """Estimate of ``b0``, ``b1`` and ``a`` while there is excitation."""

    # laws that return vectors or matrices whose elements differ in unit
    unchecked = ("gain", "estimate", "next_covariance")

    forgetting_time = Parameter(
        600.0,
        "s",
        min=0.1,
        max=1e7,
        tunable=True,
        doc="age at which a sample has the remaining weight (T_f, eq. 4.11)",
    )
    remaining_weight = Parameter(
        0.1,
        "1",
        min=1e-6,
        max=0.999,
        display="%",
        doc="weight of a sample of that age (epsilon, eq. 4.11)",
    )
    initial_covariance = Parameter(
        1e4,
        "1",
        min=1e-6,
        max=1e9,
        nominal=1e4,
        doc="diagonal of the covariance matrix at the start and after a reset",
    )
    reset_interval = Parameter(
        0.0,
        "s",
        min=0,
        max=1e7,
        tunable=True,
        doc="excited time between resets of the covariance matrix; 0 is never",
    )
    maximum_trace = Parameter(
        3e4,
        "1",
        min=1e-6,
        max=1e15,
        nominal=1e4,
        tunable=True,
        doc="largest trace of the covariance matrix, which is scaled down",
    )
    instrumental_variable = Parameter(
        True,
        "1",
        type="boolean",
        doc="instrumental variable, without bias from noise; false is plain least squares",
    )
    least_squares_time = Parameter(
        60.0,
        "s",
        min=0,
        max=1e6,
        doc="excited time at the start with least squares, before there is an instrument",
    )
    instrument_time = Parameter(
        30.0,
        "s",
        min=0.1,
        max=1e6,
        tunable=True,
        doc="time constant with which the auxiliary model follows the estimate",
    )

    b0 = sampled_state("ohm", "next_b0", "estimate of the gain of the current")
    b1 = sampled_state("ohm", "next_b1", "estimate of the gain of the current before")
    a = sampled_state("1", "next_a", "estimate of the gain of the voltage before, negative")
    p = Array(sampled_state("1", "next_covariance", "covariance matrix"), 3, 3)
    time_since_reset = sampled_state(
        "s", "next_time_since_reset", "time since the latest covariance reset", min=0
    )
    auxiliary_b0 = sampled_state("ohm", "next_auxiliary_b0", "b0 of the auxiliary model")
    auxiliary_b1 = sampled_state("ohm", "next_auxiliary_b1", "b1 of the auxiliary model")
    auxiliary_a = sampled_state("1", "next_auxiliary_a", "a of the auxiliary model")
    filtered_current = sampled_state(
        "A", "next_filtered_current", "current through the auxiliary model's pole"
    )
    filtered_voltage = sampled_state(
        "V", "next_filtered_voltage", "voltage through the auxiliary model's pole"
    )
    instrument = sampled_state(
        "V", "next_instrument", "filtered voltage of the auxiliary model, noise-free"
    )

    # --- regressor and instrument
    # -----------------------------------------------------------------------------------

    def with_instrument(self) -> Any:
        """True if this sample is used with the instrumental variable."""
        late = self.excited_time >= self.least_squares_time - ROUNDING * self.sample_period
        return logical_and(self.instrumental_variable, late)

    def auxiliary_pole(self) -> Any:
        """Pole of the auxiliary model, kept stable."""
        return clip(-self.auxiliary_a, 0.0, _SLOWEST_POLE)

    def next_filtered_current(self) -> Any:
        """Current filtered by ``1 / (1 + a z^-1)`` of the auxiliary model, which whitens noise on
        the voltage.
        """
        return self.measured_current() + self.auxiliary_pole() * self.filtered_current

    def next_filtered_voltage(self) -> Any:
        """Voltage filtered like the current."""
        return self.measured_voltage() + self.auxiliary_pole() * self.filtered_voltage

    def next_instrument(self) -> Any:
        """Filtered voltage of the auxiliary model, from the current alone and so free of noise."""
        driven = (
            self.auxiliary_b0 * self.next_filtered_current()
            + self.auxiliary_b1 * self.filtered_current
        )
        return driven + self.auxiliary_pole() * self.instrument

    def regression(self) -> tuple[Vector, Vector, Any]:
        """Regressor of eq. 4.6, ``[i(t), i(t-1), -v(t-1)]``, its instrument, and the voltage v(t).

        With the instrumental variable all signals are filtered, and the instrument has the voltage
        of the auxiliary model in place of the measured one; for least squares it is the regressor.
        """
        filtered = self.with_instrument()
        previous_current = where(filtered, self.filtered_current, self.last_current)
        current = where(filtered, self.next_filtered_current(), self.measured_current())
        previous_voltage = where(filtered, self.filtered_voltage, self.last_voltage)
        noise_free = where(filtered, self.instrument, self.last_voltage)
        voltage = where(filtered, self.next_filtered_voltage(), self.measured_voltage())
        phi = current, previous_current, -previous_voltage
        zeta = current, previous_current, -noise_free
        return phi, zeta, voltage

    # --- estimate
    # ----------------------------------------------------------------------------------------------

    def forgetting_factor(self) -> Any:
        """Forgetting factor of eq. 4.11, ``epsilon^(T_s / T_f)``, at least 0.01."""
        return maximum(
            exp(log(self.remaining_weight) * self.sample_period / self.forgetting_time),
            _LEAST_FORGETTING,
        )

    def covariance(self) -> Matrix:
        """Covariance matrix before this sample."""
        elements = [getattr(self, name) for name in _COVARIANCE]  # faster than self.p[1, 1]
        return cast(Matrix, tuple(elements))

    def gain(self, phi: Vector, zeta: Vector) -> Vector:
        """Gain of this sample (eq. 4.7 with errata 6); zero without excitation."""
        x, y, z = recursion.gain(self.covariance(), phi, zeta, self.forgetting_factor())
        used = self.excited()
        return where(used, x, 0.0), where(used, y, 0.0), where(used, z, 0.0)

    def estimate(self) -> Vector:
        """Estimate after this sample (eq. 4.7)."""
        theta = self.b0, self.b1, self.a
        phi, zeta, voltage = self.regression()
        residual = voltage - recursion.dot(phi, theta)
        return recursion.update(theta, self.gain(phi, zeta), residual)

    def next_b0(self) -> Any:
        """Estimate of b0 after this sample."""
        return self.estimate()[0]

    def next_b1(self) -> Any:
        """Estimate of b1 after this sample."""
        return self.estimate()[1]

    def next_a(self) -> Any:
        """Estimate of a after this sample."""
        return self.estimate()[2]

    def auxiliary_share(self) -> Any:
        """Weight of the new estimate in the auxiliary model: 1 with least squares, then that of a
        low-pass; 0 without excitation.
        """
        slow = 1.0 - exp(-self.sample_period / self.instrument_time)
        return where(self.excited(), where(self.with_instrument(), slow, 1.0), 0.0)

    def next_auxiliary_b0(self) -> Any:
        """``b0`` of the auxiliary model follows the estimate."""
        return self.auxiliary_b0 + self.auxiliary_share() * (self.next_b0() - self.auxiliary_b0)

    def next_auxiliary_b1(self) -> Any:
        """``b1`` of the auxiliary model follows the estimate."""
        return self.auxiliary_b1 + self.auxiliary_share() * (self.next_b1() - self.auxiliary_b1)

    def next_auxiliary_a(self) -> Any:
        """``a`` of the auxiliary model follows the estimate."""
        return self.auxiliary_a + self.auxiliary_share() * (self.next_a() - self.auxiliary_a)

    # --- covariance matrix
    # ------------------------------------------------------------------------------------------

    def reset_due(self) -> Any:
        """True if the covariance matrix is reset after this sample (section 4.1.1)."""
        elapsed = self.time_since_reset + self.sample_period
        is_over = elapsed >= self.reset_interval - ROUNDING * self.sample_period
        return logical_and(self.reset_interval > 0.0, is_over)

    def next_time_since_reset(self) -> Any:
        """Excited time since the latest reset."""
        elapsed = where(self.reset_due(), 0.0, self.time_since_reset + self.sample_period)
        return where(self.excited(), elapsed, self.time_since_reset)

    def next_covariance(self, row: int, column: int) -> Any:
        """Element of the covariance matrix P after this sample, from 1 (eq. 4.9 with errata 6).

        It is that of ``(P - K phi' P) / alpha`` with the gain K and the forgetting factor alpha,
        scaled so that the trace does not exceed its maximum, or that of the initial matrix at a
        reset. Without excitation it is unchanged; before the first estimate it is the initial one.
        """
        covariance = self.covariance()
        forgetting = self.forgetting_factor()
        phi, zeta, _ = self.regression()
        gain = self.gain(phi, zeta)
        projection = recursion.transposed_times(covariance, phi)  # phi' P
        previous = self.p[row, column]
        updated = (previous - gain[row - 1] * projection[column - 1]) / forgetting
        # of the whole updated matrix, as the trace of K phi' P is the inner product of both
        trace = (recursion.trace(covariance) - recursion.dot(gain, projection)) / forgetting
        bounded = updated * recursion.bound(trace, self.maximum_trace)
        initial = self.initial_covariance if row == column else 0.0
        # by rounding the trace may become negative or NaN
        is_reset = logical_or(self.reset_due(), logical_not(trace > 0.0))
        excited = where(is_reset, initial, bounded)
        unexcited = where(self.excited_time > 0.0, previous, initial)
        return where(self.excited(), excited, unexcited)
