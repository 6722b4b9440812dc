"""State feedback of charge and creep, which a Kalman filter estimates from displacement and
voltage.

Thesis section 1.5.2, after its reference 20: a controller in state space that protects the actuator
by the charge it estimates. The gains are those of ``design.py`` for the sampled model of the
actuator, whose states charge, Kelvin and Maxwell elongation are decoupled.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..kit import Discrete, Input, Parameter, maximum, minimum
from .signals import CurrentController, largest_current, sampled_length
from .tracking import tracking_share

_DESIGN = "design.gains of the actuator"

# gains(PpyActuator) of design.py
GAINS = {
    "sample_period": 0.02,
    "charge_pole": 0.9973390116840287,
    "kelvin_pole": 0.9999000049998333,
    "maxwell_pole": 1.0,
    "charge_per_current": 0.01688397086483798,
    "kelvin_per_force": 9.999500016666251e-09,
    "maxwell_per_force": 1.176470588235294e-08,
    "displacement_per_charge": 6.8e-05,
    "displacement_per_force": 0.00015873015873015873,
    "voltage_per_charge": 0.31308286703970156,
    "voltage_per_current": 0.36348920863309353,
    "charge_by_displacement": 20.11041140108541,
    "charge_by_voltage": 0.847920766057308,
    "kelvin_by_displacement": 0.001345449524728607,
    "kelvin_by_voltage": -2.8636293692764845e-07,
    "maxwell_by_displacement": 0.003317210309864414,
    "maxwell_by_voltage": -7.062218257717958e-07,
    "charge_gain": 2.949212073572939,
    "integral_gain": 22617.063058673568,
    "reference_gain": 34152.26781850914,
}


def design_remark(gains: Mapping[str, float], plant: str) -> str:
    """Return the remark on a design for the description of an FMU.

    Parameters
    ----------
    gains : Mapping of str to float
    plant : str
        Name of the actuator that it is for.

    Returns
    -------
    str
        One line.
    """
    listed = ", ".join(f"{name} {value:.6g}" for name, value in gains.items())
    return f"Designed for {plant} from its linearisation, in SI units: {listed}"


def _designed(name: str, unit: str, doc: str, least: float = -1e12, **about: Any) -> Any:
    """Declare a parameter whose default is that of the design."""
    start = GAINS[name]
    nominal = abs(start) or 1.0
    return Parameter(
        start, unit, min=least, max=1e12, nominal=nominal, source=_DESIGN, doc=doc, **about
    )


class StateFeedback(CurrentController):
    """State feedback of estimated charge and creep, with limits of current and charge (thesis
    section 1.5.2).
    """

    name = "state_feedback"
    experiment = (20.0, 0.02)
    remark = design_remark(GAINS, "ppy_actuator")

    sample_period = Parameter(
        GAINS["sample_period"],
        "s",
        min=1e-4,
        max=10.0,
        nominal=0.01,
        doc="sample period of the controller (h), which the design is for",
    )
    charge_pole = _designed("charge_pole", "1", "share of the charge that is left after a sample")
    kelvin_pole = _designed(
        "kelvin_pole", "1", "share of the Kelvin elongation that is left after a sample"
    )
    maxwell_pole = _designed(
        "maxwell_pole", "1", "share of the Maxwell elongation that is left after a sample"
    )
    charge_per_current = _designed(
        "charge_per_current", "C/A", "charge per current of a sample", least=1e-12
    )
    kelvin_per_force = _designed(
        "kelvin_per_force", "m/N", "Kelvin elongation per force of a sample"
    )
    maxwell_per_force = _designed(
        "maxwell_per_force", "m/N", "Maxwell elongation per force of a sample"
    )
    displacement_per_charge = _designed(
        "displacement_per_charge", "m/C", "displacement per charge (alpha)"
    )
    displacement_per_force = _designed(
        "displacement_per_force", "m/N", "displacement at once per force (1/k1)"
    )
    voltage_per_charge = _designed("voltage_per_charge", "V/C", "voltage per charge")
    voltage_per_current = _designed("voltage_per_current", "V/A", "voltage at once per current")
    charge_by_displacement = _designed(
        "charge_by_displacement", "C/m", "correction of the charge per innovation of displacement"
    )
    charge_by_voltage = _designed(
        "charge_by_voltage", "C/V", "correction of the charge per innovation of voltage"
    )
    kelvin_by_displacement = _designed(
        "kelvin_by_displacement", "1", "correction of the Kelvin elongation per displacement"
    )
    kelvin_by_voltage = _designed(
        "kelvin_by_voltage", "m/V", "correction of the Kelvin elongation per voltage"
    )
    maxwell_by_displacement = _designed(
        "maxwell_by_displacement", "1", "correction of the Maxwell elongation per displacement"
    )
    maxwell_by_voltage = _designed(
        "maxwell_by_voltage", "m/V", "correction of the Maxwell elongation per voltage"
    )
    charge_gain = _designed("charge_gain", "A/C", "current taken back per charge", tunable=True)
    integral_gain = _designed(
        "integral_gain", "A/m/s", "current per integral of the error", tunable=True
    )
    reference_gain = _designed(
        "reference_gain",
        "A/m",
        "current per displacement that the charge has to make",
        tunable=True,
    )
    tracking_time = Parameter(
        1.5,
        "s",
        min=0,
        max=1e9,
        source="the second time constant of the design",
        tunable=True,
        doc="time in which a command that was cut is forgotten (T_t)",
    )
    current_limit = largest_current()
    charge_limit = Parameter(
        2.5,
        "C",
        min=1e-9,
        max=1e9,
        tunable=True,
        doc="largest estimated charge in either direction",
    )

    voltage = Input("V", doc="voltage across the actuator")
    current = Input("A", doc="current that flowed into the actuator since the latest sample")
    force = Input("N", doc="load, tension positive")

    charge = Discrete(
        "C",
        update="next_charge",
        period="sample_period",
        output=True,
        doc="estimate of the charge on the films",
    )
    kelvin_elongation = sampled_length(
        "next_kelvin", "estimate of the elongation of the Kelvin element", output=True
    )
    maxwell_elongation = sampled_length(
        "next_maxwell", "estimate of the elongation of the Maxwell dashpot", output=True
    )
    integral = Discrete(
        "A", update="next_integral", period="sample_period", doc="integral part of the command"
    )
    command_within_limits = Discrete(
        "A", update="next_command", period="sample_period", doc="current within all limits"
    )

    # --- observer
    # ----------------------------------------------------------------------------------------------

    def predicted_charge(self) -> Any:
        """Charge at this sample after the current since the latest (eq. 3.5, row 1, sampled)."""
        return self.charge_pole * self.charge + self.charge_per_current * self.current

    def predicted_kelvin(self) -> Any:
        """Kelvin elongation at this sample (eq. 3.5, row 2, sampled)."""
        return self.kelvin_pole * self.kelvin_elongation + self.kelvin_per_force * self.force

    def predicted_maxwell(self) -> Any:
        """Maxwell elongation at this sample (eq. 3.5, row 3, sampled)."""
        return self.maxwell_pole * self.maxwell_elongation + self.maxwell_per_force * self.force

    def displacement_innovation(self) -> Any:
        """Measured displacement less the predicted one (eq. 3.8)."""
        return self.displacement - (
            self.displacement_per_charge * self.predicted_charge()
            + self.predicted_kelvin()
            + self.predicted_maxwell()
            + self.displacement_per_force * self.force
        )

    def voltage_innovation(self) -> Any:
        """Measured voltage less the predicted one (eq. 3.9)."""
        return self.voltage - (
            self.voltage_per_charge * self.predicted_charge()
            + self.voltage_per_current * self.current
        )

    def next_charge(self) -> Any:
        """Charge, corrected by both innovations."""
        return (
            self.predicted_charge()
            + self.charge_by_displacement * self.displacement_innovation()
            + self.charge_by_voltage * self.voltage_innovation()
        )

    def next_kelvin(self) -> Any:
        """Kelvin elongation, corrected by both innovations."""
        return (
            self.predicted_kelvin()
            + self.kelvin_by_displacement * self.displacement_innovation()
            + self.kelvin_by_voltage * self.voltage_innovation()
        )

    def next_maxwell(self) -> Any:
        """Maxwell elongation, corrected by both innovations."""
        return (
            self.predicted_maxwell()
            + self.maxwell_by_displacement * self.displacement_innovation()
            + self.maxwell_by_voltage * self.voltage_innovation()
        )

    # --- feedback
    # ----------------------------------------------------------------------------------------------

    def wanted_elongation(self) -> Any:
        """Elongation wanted of the charge: reference less elongation due to load (eq. 3.8)."""
        mechanical = (
            self.next_kelvin() + self.next_maxwell() + self.displacement_per_force * self.force
        )
        return self.reference - mechanical

    def wanted_current(self) -> Any:
        """State feedback with integral part, before its limits."""
        feedback = self.charge_gain * self.next_charge()
        return self.reference_gain * self.wanted_elongation() - feedback + self.integral

    def current_to(self, charge: Any) -> Any:
        """Current that brings the charge to a value at the next sample."""
        return (charge - self.charge_pole * self.next_charge()) / self.charge_per_current

    def next_command(self) -> Any:
        """Wanted current within the limits of charge and current."""
        below = minimum(self.wanted_current(), self.current_to(self.charge_limit))
        within = maximum(below, self.current_to(-self.charge_limit))
        return maximum(minimum(within, self.current_limit), -self.current_limit)

    def next_integral(self) -> Any:
        """Integral of the error, less the excess over the limits by back-calculation."""
        increment = self.integral_gain * self.sample_period * (self.reference - self.displacement)
        limitation = self.next_command() - self.wanted_current()
        share = tracking_share(self.sample_period, self.tracking_time)
        return self.integral + increment + share * limitation

    def issued_current(self) -> Any:
        """Command of the controller to the actuator."""
        return self.command_within_limits
