"""The degradation estimator: impedance of the actuator while it works, and the voltage limit that
follows from it.

Thesis chapter 4. Samples (``measurement.py``) of a current that moves (``excitation.py``) give a
recursive estimate of eq. 4.6 with forgetting (``regression.py``); here it becomes the circuit ``R1
R2 C`` behind it, the impedance at one frequency (eq. 4.10), and the derating of fig. 4-3.
"""

from __future__ import annotations

from typing import Any

from ..kit import Discrete, Output, Parameter, Preset, floor, logical_and, maximum, minimum, where
from .circuit import exists, magnitude, solved
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
        1.5, "V", min=0, max=100.0, source=_DESIGN, doc="voltage limit before derating (V_max)"
    )
    voltage_step = Parameter(
        0.05,
        "V",
        min=0,
        max=100.0,
        source=_DESIGN,
        doc="what a derating step takes off (delta V_der)",
    )
    impedance_step = Parameter(
        0.05,
        "1",
        min=1e-4,
        max=100.0,
        display="%",
        source=_DESIGN,
        doc="impedance change of a derating step (delta Z)",
    )
    minimum_voltage_limit = Parameter(
        0.5,
        "V",
        min=0,
        max=100.0,
        source=_DESIGN,
        doc="voltage limit below which derating does not go",
    )

    R1 = Discrete(
        "ohm",
        update="next_R1",
        period="sample_period",
        min=0,
        output=True,
        doc="series resistance; 0 before there is an estimate",
    )
    R2 = Discrete(
        "ohm",
        update="next_R2",
        period="sample_period",
        min=0,
        output=True,
        doc="leakage resistance; 0 before there is an estimate",
    )
    C = Discrete(
        "F",
        update="next_C",
        period="sample_period",
        min=0,
        output=True,
        doc="capacitance; 0 before there is an estimate",
    )
    estimate_valid = Discrete(
        "1",
        update="next_estimate_valid",
        period="sample_period",
        type="boolean",
        start=False,
        output=True,
        doc="whether excitation and settling suffice and the estimate is a circuit",
    )
    reference_R1 = Discrete(
        "ohm",
        update="next_reference_R1",
        period="sample_period",
        min=0,
        doc="R1 of the first valid estimate",
    )
    reference_R2 = Discrete(
        "ohm",
        update="next_reference_R2",
        period="sample_period",
        min=0,
        doc="R2 of the first valid estimate",
    )
    reference_C = Discrete(
        "F",
        update="next_reference_C",
        period="sample_period",
        min=0,
        doc="C of the first valid estimate",
    )
    reference_impedance = Discrete(
        "ohm",
        update="next_reference_impedance",
        period="sample_period",
        min=0,
        doc="impedance of the first valid estimate; 0 before there is one",
    )
    derating_steps = Discrete(
        "1",
        update="next_derating_steps",
        period="sample_period",
        min=0,
        doc="derating steps taken so far",
    )

    # --- circuit
    # ----------------------------------------------------------------------------------------------

    def circuit(self) -> Vector:
        """R1, R2 and C of the estimate; kept while it is that of no circuit, and without
        excitation.
        """
        estimate = self.estimate()
        R1, R2, C = solved(estimate, self.zero_order_hold, self.sample_period)
        new = logical_and(exists(estimate, self.zero_order_hold), self.excited())
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

    # --- validity
    # ----------------------------------------------------------------------------------------------

    def settled(self) -> Any:
        """Whether excitation and time suffice."""
        long = self.next_excited_time() >= self.settling_time - ROUNDING * self.sample_period
        return logical_and(self.next_reversals() >= self.minimum_reversals, long)

    def next_estimate_valid(self) -> Any:
        """Whether to trust the estimate; without excitation it stays what it was, as the estimate
        does.
        """
        now = where(
            logical_and(self.settled(), exists(self.estimate(), self.zero_order_hold)), 1.0, 0.0
        )
        return where(self.excited(), now, where(self.estimate_valid, 1.0, 0.0))

    # --- reference: the first valid estimate, the base of all changes (section 4.2)
    # -----------------------------------

    def reference_of(self, kept: Any, latest: Any) -> Any:
        """Element of the reference circuit; the first valid estimate is taken over at the sample
        after it.
        """
        return where(logical_and(self.estimate_valid, self.reference_R2 <= 0.0), latest, kept)

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
        """Impedance of the reference; evaluated anew while the frequency is tracked, to compare
        like with like.
        """
        anew = logical_and(self.track_frequency, self.reference_R2 > 0.0)
        circuit = self.reference_R1, self.reference_R2, self.reference_C
        return where(anew, magnitude(circuit, angular_frequency), self.reference_impedance)

    def next_impedances(self) -> tuple[Any, Any]:
        """Impedance after this sample, and that of the reference so far, at one frequency."""
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
        """Change of the impedance from the reference; 0 while there is none."""
        return where(reference > 0.0, impedance / where(reference > 0.0, reference, 1.0) - 1.0, 0.0)

    def next_derating_steps(self) -> Any:
        """Steps taken: one per ``impedance_step`` of a valid estimate's change, and none taken back
        (fig. 4-3).
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
