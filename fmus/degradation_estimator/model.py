"""The degradation estimator: impedance of the working actuator and the derived voltage limit.

Thesis chapter 4. Samples (``measurement.py``) of a current with reversals (``excitation.py``) give
a recursive estimate of eq. 4.6 with forgetting (``regression.py``). This module computes from it
the circuit of ``R1``, ``R2`` and ``C``, its impedance at one frequency (eq. 4.10), and the derating
of fig. 4-3.
"""

from __future__ import annotations

from typing import Any

from ..kit import Output, Parameter, Preset, floor, logical_and, maximum, minimum, where
from .circuit import circuit_parameters, is_circuit, magnitude
from .measurement import sampled_state
from .recursion import Vector
from .regression import ROUNDING, Regression

_DESIGN = "design choice; the thesis gives no number (section 4.2)"


class DegradationEstimator(Regression):
    """Recursive impedance estimate with forgetting, and the derated voltage limit (thesis chapter
    4).
    """

    name = "degradation_estimator"
    experiment = (600.0, 0.1)

    zero_order_hold = Parameter(
        True,
        "1",
        type="boolean",
        doc="conversion exact for held current; false is Tustin (eqs. 4.3-4.5)",
    )
    minimum_reversals = Parameter(
        6, "1", type="integer", min=1, max=1000000, doc="reversals before the estimate is valid"
    )
    settling_time = Parameter(
        120.0, "s", min=0, max=1e7, doc="excited time before the estimate is valid"
    )
    initial_voltage_limit = Parameter(
        1.5,
        "V",
        min=0,
        max=100.0,
        source=_DESIGN,
        tunable=True,
        doc="voltage limit before derating (V_max)",
    )
    voltage_step = Parameter(
        0.05,
        "V",
        min=0,
        max=100.0,
        source=_DESIGN,
        tunable=True,
        doc="voltage by which a derating step lowers the limit (delta V_der)",
    )
    impedance_step = Parameter(
        0.05,
        "1",
        min=1e-4,
        max=100.0,
        display="%",
        source=_DESIGN,
        tunable=True,
        doc="impedance change of a derating step (delta Z)",
    )
    minimum_voltage_limit = Parameter(
        0.5,
        "V",
        min=0,
        max=100.0,
        source=_DESIGN,
        tunable=True,
        doc="voltage limit below which derating does not go",
    )

    R1 = sampled_state(
        "ohm", "next_R1", "series resistance; 0 before there is an estimate", min=0, output=True
    )
    R2 = sampled_state(
        "ohm", "next_R2", "leakage resistance; 0 before there is an estimate", min=0, output=True
    )
    C = sampled_state(
        "F", "next_C", "capacitance; 0 before there is an estimate", min=0, output=True
    )
    estimate_valid = sampled_state(
        "1",
        "next_estimate_valid",
        "whether excitation and settling suffice and the estimate is a circuit",
        type="boolean",
        start=False,
        output=True,
    )
    reference_R1 = sampled_state(
        "ohm", "next_reference_R1", "R1 of the first valid estimate", min=0
    )
    reference_R2 = sampled_state(
        "ohm", "next_reference_R2", "R2 of the first valid estimate", min=0
    )
    reference_C = sampled_state("F", "next_reference_C", "C of the first valid estimate", min=0)
    reference_impedance = sampled_state(
        "ohm",
        "next_reference_impedance",
        "impedance of the first valid estimate; 0 before there is one",
        min=0,
    )
    derating_steps = sampled_state("1", "next_derating_steps", "derating steps taken so far", min=0)

    # --- circuit
    # ----------------------------------------------------------------------------------------------

    def circuit(self) -> Vector:
        """R1, R2 and C of the estimate; unchanged without excitation and while the estimate is not
        that of a circuit.
        """
        estimate = self.estimate()
        R1, R2, C = circuit_parameters(estimate, self.zero_order_hold, self.sample_period)
        new = logical_and(is_circuit(estimate, self.zero_order_hold), self.excited())
        return where(new, R1, self.R1), where(new, R2, self.R2), where(new, C, self.C)

    def next_R1(self) -> Any:
        """Series resistance R1 after this sample."""
        return self.circuit()[0]

    def next_R2(self) -> Any:
        """Leakage resistance R2 after this sample."""
        return self.circuit()[1]

    def next_C(self) -> Any:
        """Capacitance C after this sample."""
        return self.circuit()[2]

    # --- validity
    # ----------------------------------------------------------------------------------------------

    def has_converged(self) -> Any:
        """True after the minimum of reversals and the settling time."""
        is_late = self.next_excited_time() >= self.settling_time - ROUNDING * self.sample_period
        return logical_and(self.next_reversals() >= self.minimum_reversals, is_late)

    def next_estimate_valid(self) -> Any:
        """True while the estimate is valid; unchanged without excitation, as the estimate is."""
        has_circuit = is_circuit(self.estimate(), self.zero_order_hold)
        now = where(logical_and(self.has_converged(), has_circuit), 1.0, 0.0)
        return where(self.excited(), now, where(self.estimate_valid, 1.0, 0.0))

    # --- reference: the first valid estimate, the base of all changes (section 4.2)
    # ----------------------------------------------------------------------------------------------

    def reference_of(self, reference: Any, latest: Any) -> Any:
        """Element of the reference circuit, set one sample after the first valid estimate."""
        is_first = logical_and(self.estimate_valid, self.reference_R2 <= 0.0)
        return where(is_first, latest, reference)

    def next_reference_R1(self) -> Any:
        """R1 of the first valid estimate."""
        return self.reference_of(self.reference_R1, self.R1)

    def next_reference_R2(self) -> Any:
        """R2 of the first valid estimate."""
        return self.reference_of(self.reference_R2, self.R2)

    def next_reference_C(self) -> Any:
        """C of the first valid estimate."""
        return self.reference_of(self.reference_C, self.C)

    def reference_at(self, angular_frequency: Any) -> Any:
        """Impedance of the reference; at the present frequency if that is tracked, so that both
        impedances are comparable.
        """
        is_tracked = logical_and(self.track_frequency, self.reference_R2 > 0.0)
        circuit = self.reference_R1, self.reference_R2, self.reference_C
        return where(is_tracked, magnitude(circuit, angular_frequency), self.reference_impedance)

    def next_impedances(self) -> tuple[Any, Any]:
        """Impedance after this sample and that of the reference before it, at one frequency."""
        angular_frequency = self.evaluation_frequency(self.next_excitation_period())
        return magnitude(self.circuit(), angular_frequency), self.reference_at(angular_frequency)

    def next_reference_impedance(self) -> Any:
        """Impedance of the first valid estimate."""
        now, reference = self.next_impedances()
        first = logical_and(reference <= 0.0, self.next_estimate_valid() > 0.5)
        return where(first, now, reference)

    # --- derating
    # ----------------------------------------------------------------------------------------------

    def relative_change(self, impedance: Any, reference: Any) -> Any:
        """Relative change of the impedance from the reference; 0 while there is no reference."""
        return where(reference > 0.0, impedance / where(reference > 0.0, reference, 1.0) - 1.0, 0.0)

    def next_derating_steps(self) -> Any:
        """Derating steps: one per ``impedance_step`` of the change of a valid estimate; their
        number never falls (fig. 4-3).
        """
        due = floor(self.relative_change(*self.next_impedances()) / self.impedance_step)
        return where(
            self.next_estimate_valid() > 0.5, maximum(self.derating_steps, due), self.derating_steps
        )

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    def present_impedance(self) -> Any:
        """Magnitude of the impedance of the latest circuit (eq. 4.10)."""
        return magnitude(
            (self.R1, self.R2, self.C), self.evaluation_frequency(self.excitation_period)
        )

    @Output("ohm")
    def impedance(self) -> Any:
        """Magnitude of the impedance at the angular frequency, given or tracked (eq. 4.10)."""
        return self.present_impedance()

    @Output("1", display="%")
    def impedance_change(self) -> Any:
        """Change of the impedance from the first valid estimate, both at the same angular
        frequency.
        """
        return self.relative_change(self.present_impedance(), self.reference_impedance)

    @Output("V")
    def voltage_limit(self) -> Any:
        """Derated voltage limit, for both signs of the voltage (fig. 4-3)."""
        derated = self.initial_voltage_limit - self.voltage_step * self.derating_steps
        return minimum(self.initial_voltage_limit, maximum(derated, self.minimum_voltage_limit))

    presets = {
        "thesis_10_hz": Preset(
            {
                "sample_period": 0.1,
                "forgetting_time": 10.0,
                "remaining_weight": 0.91**100,
                "initial_covariance": 1.0,
                "reset_interval": 10.0,
                "maximum_trace": 1e15,
                "instrumental_variable": 0,
                "zero_order_hold": 0,
            },
            doc=(
                "least squares of appendix A3: 10 Hz, forgetting factor 0.91, covariance reset to"
                " unity every 10 s, Tustin conversion; biased by noise (errata 8, 9, 11)"
            ),
        ),
        "thesis_15_hz": Preset(
            {
                "sample_period": 1.0 / 15.0,
                "forgetting_time": 5.0,
                "remaining_weight": 0.985**75,
                "initial_covariance": 1.0,
                "reset_interval": 5.0,
                "maximum_trace": 1e15,
                "instrumental_variable": 0,
                "zero_order_hold": 0,
            },
            doc=(
                "least squares of section 4.3: 15 Hz, forgetting factor 0.985, covariance reset to"
                " unity every 5 s, Tustin conversion; biased by noise (errata 8, 9, 11)"
            ),
        ),
    }
