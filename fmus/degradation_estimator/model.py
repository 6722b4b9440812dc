"""The degradation estimator: impedance of the actuator while it works, and the voltage limit that follows from it.

Thesis chapter 4. A sampled recursive estimator of ``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)`` (eq. 4.6) with forgetting,
the circuit ``R1 R2 C`` behind it, the impedance at one frequency (eq. 4.10) and the derating of fig. 4-3. The printed
least squares is biased by voltage noise (``docs/errata.md``, row 9); the default is an instrumental variable.
"""

from __future__ import annotations

from typing import Any

from ..kit import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    Preset,
    clip,
    exp,
    floor,
    hypot,
    log,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    where,
)
from . import recursion
from .recursion import Matrix, Vector

_DESIGN = "design choice; the thesis gives no number (section 4.2)"
# Margins of a circuit that can be computed: a resistance, a share of a decay.
_SMALL = 1e-9
# Fastest forgetting; below it a single sample would be all that counts.
_LEAST_FORGETTING = 0.01
_SLOWEST_POLE = 0.9999
# Counted times are sums of rounded periods.
_ROUNDING = 1e-6


def _number(doc: str, law: str) -> Any:
    """Discrete state without a unit."""
    return Discrete("1", update=law, period="sample_period", doc=doc)


class DegradationEstimator(Component):
    """Recursive impedance estimate with forgetting, and the derated voltage limit (thesis chapter 4)."""

    name = "degradation_estimator"
    experiment = (600.0, 0.1)

    sample_period = Parameter(
        0.1, "s", min=1e-3, max=1e3, source="thesis appendix A3", doc="time between samples (T_s)"
    )
    forgetting_time = Parameter(
        600.0, "s", min=0.1, max=1e7, doc="age at which a sample has the remaining weight (T_f, eq. 4.11)"
    )
    remaining_weight = Parameter(
        0.1, "1", min=1e-6, max=0.999, display="%", doc="weight of a sample of that age (epsilon, eq. 4.11)"
    )
    initial_covariance = Parameter(
        1e4, "1", min=1e-6, max=1e9, nominal=1e4, doc="diagonal of the covariance matrix at the start and after a reset"
    )
    reset_interval = Parameter(
        0.0, "s", min=0, max=1e7, doc="excited time between resets of the covariance matrix; 0 is never"
    )
    maximum_trace = Parameter(
        3e4, "1", min=1e-6, max=1e15, nominal=1e4, doc="largest trace of the covariance matrix, which is scaled down"
    )
    instrumental_variable = Parameter(
        True, "1", type="boolean", doc="instrumental variable, without bias from noise; false is plain least squares"
    )
    least_squares_time = Parameter(
        60.0, "s", min=0, max=1e6, doc="excited time at the start with least squares, before there is an instrument"
    )
    instrument_time = Parameter(
        30.0, "s", min=0.1, max=1e6, doc="time constant with which the auxiliary model follows the estimate"
    )
    zero_order_hold = Parameter(
        True, "1", type="boolean", doc="conversion exact for held current; false is Tustin (eqs. 4.3-4.5)"
    )
    minimum_swing = Parameter(
        0.1, "A", min=1e-9, max=1e3, doc="change of the current that counts as a reversal of its direction"
    )
    excitation_timeout = Parameter(
        20.0, "s", min=1e-3, max=1e7, doc="time after the latest reversal when estimation stops until the next"
    )
    minimum_reversals = Parameter(
        6, "1", type="integer", min=1, max=1000000, doc="reversals before the estimate is valid"
    )
    settling_time = Parameter(120.0, "s", min=0, max=1e7, doc="excited time before the estimate is valid")
    angular_frequency = Parameter(
        0.628, "rad/s", min=0, max=1e6, source="thesis section 4.3", doc="where the impedance is evaluated"
    )
    initial_voltage_limit = Parameter(
        1.5, "V", min=0, max=100.0, source=_DESIGN, doc="voltage limit before derating (V_max)"
    )
    voltage_step = Parameter(
        0.05, "V", min=0, max=100.0, source=_DESIGN, doc="what a derating step takes off (delta V_der)"
    )
    impedance_step = Parameter(
        0.05, "1", min=1e-4, max=100.0, display="%", source=_DESIGN, doc="impedance change of a derating step (delta Z)"
    )
    minimum_voltage_limit = Parameter(0.5, "V", min=0, max=100.0, source=_DESIGN, doc="what derating does not go below")

    largest_current = Parameter(
        10.0, "A", min=1e-6, max=1e6, doc="reading beyond which there is a fault, and the one before is used"
    )
    largest_voltage = Parameter(
        20.0, "V", min=1e-6, max=1e6, doc="reading beyond which there is a fault, and the one before is used"
    )

    current = Input("A", doc="measured current into the actuator")
    voltage = Input("V", doc="measured voltage across the actuator")

    # --- the estimate -----------------------------------------------------------------------------------------------

    b0 = Discrete("ohm", update="next_b0", period="sample_period", doc="estimate of the gain of the current")
    b1 = Discrete("ohm", update="next_b1", period="sample_period", doc="estimate of the gain of the current before")
    a = _number("estimate of the gain of the voltage before, negative", "next_a")
    p11 = _number("covariance matrix, row 1, column 1", "next_p11")
    p12 = _number("covariance matrix, row 1, column 2", "next_p12")
    p13 = _number("covariance matrix, row 1, column 3", "next_p13")
    p21 = _number("covariance matrix, row 2, column 1", "next_p21")
    p22 = _number("covariance matrix, row 2, column 2", "next_p22")
    p23 = _number("covariance matrix, row 2, column 3", "next_p23")
    p31 = _number("covariance matrix, row 3, column 1", "next_p31")
    p32 = _number("covariance matrix, row 3, column 2", "next_p32")
    p33 = _number("covariance matrix, row 3, column 3", "next_p33")

    # --- what the next sample needs of the ones before ----------------------------------------------------------------

    auxiliary_b0 = Discrete("ohm", update="next_auxiliary_b0", period="sample_period", doc="b0 of the auxiliary model")
    auxiliary_b1 = Discrete("ohm", update="next_auxiliary_b1", period="sample_period", doc="b1 of the auxiliary model")
    auxiliary_a = _number("a of the auxiliary model", "next_auxiliary_a")
    last_current = Discrete("A", update="measured_current", period="sample_period", doc="current at the latest sample")
    last_voltage = Discrete("V", update="measured_voltage", period="sample_period", doc="voltage at the latest sample")
    filtered_current = Discrete(
        "A", update="next_filtered_current", period="sample_period", doc="current through the auxiliary model's pole"
    )
    filtered_voltage = Discrete(
        "V", update="next_filtered_voltage", period="sample_period", doc="voltage through the auxiliary model's pole"
    )
    instrument = Discrete(
        "V", update="next_instrument", period="sample_period", doc="filtered voltage of the auxiliary model, noise-free"
    )

    # --- excitation ---------------------------------------------------------------------------------------------------

    samples = Discrete("1", update="next_samples", period="sample_period", min=0, doc="samples so far")
    direction = Discrete(
        "1", update="next_direction", period="sample_period", min=-1, max=1,
        doc="direction in which the current moves; 0 before it has moved",
    )  # fmt: skip
    turning_current = Discrete(
        "A", update="next_turning_current", period="sample_period", doc="extreme of the current since it turned"
    )
    reversals = Discrete(
        "1", update="next_reversals", period="sample_period", min=0, doc="how often the current changed its direction"
    )
    time_since_reversal = Discrete(
        "s", update="next_time_since_reversal", period="sample_period", min=0, doc="time since the latest reversal"
    )
    excited_time = Discrete("s", update="next_excited_time", period="sample_period", min=0, doc="time spent estimating")
    time_since_reset = Discrete(
        "s", update="next_time_since_reset", period="sample_period", min=0, doc="time since the latest covariance reset"
    )

    # --- what comes of it ---------------------------------------------------------------------------------------------

    R1 = Discrete(
        "ohm", update="next_R1", period="sample_period", min=0, output=True, doc="series resistance; 0 before the first"
    )
    R2 = Discrete(
        "ohm",
        update="next_R2",
        period="sample_period",
        min=0,
        output=True,
        doc="leakage resistance; 0 before the first",
    )
    C = Discrete(
        "F", update="next_C", period="sample_period", min=0, output=True, doc="capacitance; 0 before the first"
    )
    estimate_valid = Discrete(
        "1", update="next_estimate_valid", period="sample_period", type="boolean", start=False, output=True,
        doc="whether excitation and settling suffice and the estimate is a circuit",
    )  # fmt: skip
    reference_impedance = Discrete(
        "ohm", update="next_reference_impedance", period="sample_period", min=0,
        doc="impedance of the first valid estimate; 0 before there is one",
    )  # fmt: skip
    derating_steps = Discrete(
        "1", update="next_derating_steps", period="sample_period", min=0, doc="derating steps taken so far"
    )

    # --- measurement --------------------------------------------------------------------------------------------------

    def measured_current(self) -> Any:
        """Current as the sensor shows it; the reading before where it is beyond what there can be."""
        return where(abs(self.current) <= self.largest_current, self.current, self.last_current)

    def measured_voltage(self) -> Any:
        """Voltage as the sensor shows it; the reading before where it is beyond what there can be."""
        return where(abs(self.voltage) <= self.largest_voltage, self.voltage, self.last_voltage)

    # --- excitation ---------------------------------------------------------------------------------------------------

    def extreme_current(self) -> Any:
        """Extreme of the current in its direction, this sample included."""
        now, before = self.measured_current(), self.turning_current
        return where(
            self.direction > 0.0, maximum(before, now), where(self.direction < 0.0, minimum(before, now), before)
        )

    def reverses(self) -> Any:
        """Whether the current has come back from its extreme by more than the swing, or first moves."""
        back = self.measured_current() - self.extreme_current()
        swing = where(self.direction == 0.0, abs(back), -self.direction * back)
        return swing > self.minimum_swing

    def next_direction(self) -> Any:
        """Direction of the current after this sample."""
        moved = where(self.measured_current() > self.extreme_current(), 1.0, -1.0)
        return where(self.reverses(), moved, self.direction)

    def next_turning_current(self) -> Any:
        """Extreme of the current since it turned."""
        return where(self.reverses(), self.measured_current(), self.extreme_current())

    def next_reversals(self) -> Any:
        """Count a reversal."""
        return self.reversals + where(self.reverses(), 1.0, 0.0)

    def next_time_since_reversal(self) -> Any:
        """Time since the latest reversal."""
        return where(self.reverses(), 0.0, self.time_since_reversal + self.sample_period)

    def next_samples(self) -> Any:
        """Count the sample."""
        return self.samples + 1.0

    def excited(self) -> Any:
        """Whether this sample counts: there is one before it, and the current turned lately before it."""
        turned = logical_and(self.reversals > 0.0, self.time_since_reversal < self.excitation_timeout)
        return logical_and(self.samples > 0.0, turned)

    def next_excited_time(self) -> Any:
        """Time spent estimating."""
        return self.excited_time + where(self.excited(), self.sample_period, 0.0)

    def with_instrument(self) -> Any:
        """Whether this sample is taken with the instrument."""
        late = self.excited_time >= self.least_squares_time - _ROUNDING * self.sample_period
        return logical_and(self.instrumental_variable, late)

    # --- regressor and instrument -------------------------------------------------------------------------------------

    def auxiliary_pole(self) -> Any:
        """Pole of the auxiliary model, kept stable."""
        return clip(-self.auxiliary_a, 0.0, _SLOWEST_POLE)

    def next_filtered_current(self) -> Any:
        """Current filtered by ``1 / (1 + a z^-1)`` of the auxiliary model, which whitens noise on the voltage."""
        return self.measured_current() + self.auxiliary_pole() * self.filtered_current

    def next_filtered_voltage(self) -> Any:
        """Voltage filtered in the same way."""
        return self.measured_voltage() + self.auxiliary_pole() * self.filtered_voltage

    def next_instrument(self) -> Any:
        """Voltage of the auxiliary model from the filtered current alone: free of noise."""
        driven = self.auxiliary_b0 * self.next_filtered_current() + self.auxiliary_b1 * self.filtered_current
        return driven + self.auxiliary_pole() * self.instrument

    def regression(self) -> tuple[Vector, Vector, Any]:
        """Data vector of eq. 4.6, ``[i(t), i(t-1), -v(t-1)]``, its instrument, and the voltage to explain.

        With the instrument all are filtered, and the auxiliary model's voltage stands in it for the measured one; in
        least squares it is the data vector itself.
        """
        late = self.with_instrument()
        before = where(late, self.filtered_current, self.last_current)
        now = where(late, self.next_filtered_current(), self.measured_current())
        old = where(late, self.filtered_voltage, self.last_voltage)
        clean = where(late, self.instrument, self.last_voltage)
        wanted = where(late, self.next_filtered_voltage(), self.measured_voltage())
        return (now, before, -old), (now, before, -clean), wanted

    # --- recursion ----------------------------------------------------------------------------------------------------

    def forgetting_factor(self) -> Any:
        """Forgetting factor of eq. 4.11, ``epsilon^(T_s / T_f)`` with the weight as a fraction; at least 0.01."""
        return maximum(exp(log(self.remaining_weight) * self.sample_period / self.forgetting_time), _LEAST_FORGETTING)

    def covariance(self) -> Matrix:
        """Covariance matrix before this sample."""
        return self.p11, self.p12, self.p13, self.p21, self.p22, self.p23, self.p31, self.p32, self.p33

    def gain(self, phi: Vector, zeta: Vector) -> Vector:
        """Gain of this sample (eq. 4.7 with errata 6); zero without excitation."""
        x, y, z = recursion.gain(self.covariance(), phi, zeta, self.forgetting_factor())
        used = self.excited()
        return where(used, x, 0.0), where(used, y, 0.0), where(used, z, 0.0)

    def estimate(self) -> Vector:
        """Estimate after this sample (eq. 4.7)."""
        before = self.b0, self.b1, self.a
        phi, zeta, wanted = self.regression()
        return recursion.corrected(before, self.gain(phi, zeta), wanted - recursion.dot(phi, before))

    def reset_due(self) -> Any:
        """Whether the covariance matrix is reset after this sample (section 4.1.1)."""
        full = self.time_since_reset + self.sample_period >= self.reset_interval - _ROUNDING * self.sample_period
        return logical_and(self.reset_interval > 0.0, full)

    def next_time_since_reset(self) -> Any:
        """Time since the latest reset, while estimating."""
        counted = where(self.reset_due(), 0.0, self.time_since_reset + self.sample_period)
        return where(self.excited(), counted, self.time_since_reset)

    def next_covariance(self, row: int, column: int) -> Any:
        """Element of the covariance matrix after this sample (eq. 4.9 with errata 6), reset or bounded.

        It is kept without excitation, and put at its start before anything was estimated.
        """
        before, forgetting = self.covariance(), self.forgetting_factor()
        phi, zeta, _ = self.regression()
        gain = self.gain(phi, zeta)
        carried = recursion.transposed_times(before, phi)
        total = (recursion.trace(before) - recursion.dot(gain, carried)) / forgetting
        old = before[3 * row + column]
        new = (old - gain[row] * carried[column]) / forgetting * recursion.bound(total, self.maximum_trace)
        initial = self.initial_covariance if row == column else 0.0
        fresh = logical_or(self.reset_due(), logical_not(total > 0.0))
        kept = where(self.excited_time > 0.0, old, initial)
        return where(self.excited(), where(fresh, initial, new), kept)

    def next_p11(self) -> Any:
        """Element 1, 1 of :meth:`next_covariance`."""
        return self.next_covariance(0, 0)

    def next_p12(self) -> Any:
        """Element 1, 2 of :meth:`next_covariance`."""
        return self.next_covariance(0, 1)

    def next_p13(self) -> Any:
        """Element 1, 3 of :meth:`next_covariance`."""
        return self.next_covariance(0, 2)

    def next_p21(self) -> Any:
        """Element 2, 1 of :meth:`next_covariance`."""
        return self.next_covariance(1, 0)

    def next_p22(self) -> Any:
        """Element 2, 2 of :meth:`next_covariance`."""
        return self.next_covariance(1, 1)

    def next_p23(self) -> Any:
        """Element 2, 3 of :meth:`next_covariance`."""
        return self.next_covariance(1, 2)

    def next_p31(self) -> Any:
        """Element 3, 1 of :meth:`next_covariance`."""
        return self.next_covariance(2, 0)

    def next_p32(self) -> Any:
        """Element 3, 2 of :meth:`next_covariance`."""
        return self.next_covariance(2, 1)

    def next_p33(self) -> Any:
        """Element 3, 3 of :meth:`next_covariance`."""
        return self.next_covariance(2, 2)

    def next_b0(self) -> Any:
        """First element of :meth:`estimate`."""
        return self.estimate()[0]

    def next_b1(self) -> Any:
        """Second element of :meth:`estimate`."""
        return self.estimate()[1]

    def next_a(self) -> Any:
        """Third element of :meth:`estimate`."""
        return self.estimate()[2]

    def auxiliary_share(self) -> Any:
        """Share of the new estimate in the auxiliary model: all of it at first, then a low-pass; none when frozen."""
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

    # --- circuit ------------------------------------------------------------------------------------------------------

    def physical(self, estimate: Vector) -> Any:
        """Whether an estimate is that of a circuit with positive R1, R2 and C."""
        b0, b1, a = estimate
        decays = logical_and(1.0 + a > _SMALL, where(self.zero_order_hold, -a, b0 - b1) > _SMALL)
        return logical_and(decays, logical_and(logical_and(b0 > _SMALL, b0 + b1 > _SMALL), b1 - a * b0 > _SMALL))

    def circuit(self) -> Vector:
        """R1, R2 and C of the estimate: exact for held current, or Tustin (eqs. 4.3-4.5); kept if it is no circuit.

        With a held current ``a = -exp(-T_s / tau)``, ``b0 = R1 R2 / (R1 + R2)`` and ``b1 = (1 + a) R2 - b0``, where
        ``tau = (R1 + R2) C``.
        """
        b0, b1, a = estimate = self.estimate()
        known = self.physical(estimate)
        total, excess = where(known, b0 + b1, 1.0), where(known, b1 - a * b0, 1.0)
        R2 = total / where(known, 1.0 + a, 1.0)
        R1 = where(self.zero_order_hold, b0 * total / excess, total * (b0 - b1) / (2.0 * excess))
        decay = log(clip(where(known, -a, 0.5), _SMALL, 1.0 - _SMALL))
        held = -self.sample_period / (decay * where(known, R1 + R2, 1.0))
        C = where(self.zero_order_hold, held, excess * self.sample_period / (total * total))
        new = logical_and(known, self.excited())
        return where(new, R1, self.R1), where(new, R2, self.R2), where(new, C, self.C)

    def next_R1(self) -> Any:
        """First element of :meth:`circuit`."""
        return self.circuit()[0]

    def next_R2(self) -> Any:
        """Second element of :meth:`circuit`."""
        return self.circuit()[1]

    def next_C(self) -> Any:
        """Third element of :meth:`circuit`."""
        return self.circuit()[2]

    def magnitude(self, circuit: Vector) -> Any:
        """Magnitude of the impedance of a circuit at the angular frequency (eq. 4.10)."""
        R1, R2, C = circuit
        w = self.angular_frequency
        return R2 * hypot(1.0, R1 * C * w) / hypot(1.0, (R1 + R2) * C * w)

    def relative_change(self, magnitude: Any, reference: Any) -> Any:
        """Change of the impedance from the reference; 0 while there is none."""
        return where(reference > 0.0, magnitude / where(reference > 0.0, reference, 1.0) - 1.0, 0.0)

    # --- validity and derating ----------------------------------------------------------------------------------------

    def settled(self) -> Any:
        """Whether excitation and time suffice."""
        long = self.next_excited_time() >= self.settling_time - _ROUNDING * self.sample_period
        return logical_and(self.next_reversals() >= self.minimum_reversals, long)

    def next_estimate_valid(self) -> Any:
        """Whether to trust the estimate; without excitation it stays what it was, as the estimate does."""
        now = where(logical_and(self.settled(), self.physical(self.estimate())), 1.0, 0.0)
        return where(self.excited(), now, where(self.estimate_valid, 1.0, 0.0))

    def next_reference_impedance(self) -> Any:
        """Impedance of the first valid estimate, the base of all changes (section 4.2)."""
        first = logical_and(self.reference_impedance <= 0.0, self.next_estimate_valid() > 0.5)
        return where(first, self.magnitude(self.circuit()), self.reference_impedance)

    def next_derating_steps(self) -> Any:
        """Steps taken: one per ``impedance_step`` of a valid estimate's change, and none taken back (fig. 4-3)."""
        change = self.relative_change(self.magnitude(self.circuit()), self.reference_impedance)
        due = floor(change / self.impedance_step)
        return where(self.next_estimate_valid() > 0.5, maximum(self.derating_steps, due), self.derating_steps)

    # --- outputs ------------------------------------------------------------------------------------------------------

    @Output("ohm")
    def impedance(self) -> Any:
        """Magnitude of the impedance at the angular frequency (eq. 4.10)."""
        return self.magnitude((self.R1, self.R2, self.C))

    @Output("1", display="%")
    def impedance_change(self) -> Any:
        """Change of the impedance from the first valid estimate."""
        return self.relative_change(self.magnitude((self.R1, self.R2, self.C)), self.reference_impedance)

    @Output("V")
    def voltage_limit(self) -> Any:
        """Derated voltage limit, for both signs of the voltage (fig. 4-3)."""
        derated = self.initial_voltage_limit - self.voltage_step * self.derating_steps
        return minimum(self.initial_voltage_limit, maximum(derated, self.minimum_voltage_limit))

    presets = {
        "thesis_10_hz": Preset(
            {"sample_period": 0.1, "forgetting_time": 10.0, "remaining_weight": 0.91**100, "initial_covariance": 1.0,
             "reset_interval": 10.0, "maximum_trace": 1e15, "instrumental_variable": 0, "zero_order_hold": 0},
            doc="least squares of appendix A3: 10 Hz, forgetting factor 0.91, covariance reset to unity every 10 s, "
            "Tustin conversion; biased by noise (errata 8, 9, 11)",
        ),
        "thesis_15_hz": Preset(
            {"sample_period": 1.0 / 15.0, "forgetting_time": 5.0, "remaining_weight": 0.985**75,
             "initial_covariance": 1.0, "reset_interval": 5.0, "maximum_trace": 1e15, "instrumental_variable": 0,
             "zero_order_hold": 0},
            doc="least squares of section 4.3: 15 Hz, forgetting factor 0.985, covariance reset to unity every 5 s, "
            "Tustin conversion; biased by noise (errata 8, 9, 11)",
        ),
    }  # fmt: skip
