"""Measurement of the sensors, sampled: current and voltage without single faults, and those of the
sample before.
"""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Parameter, where


class Measurement(Component):
    """Samples of current and voltage."""

    sample_period = Parameter(
        0.1, "s", min=1e-3, max=1e3, source="thesis appendix A3", doc="time between samples (T_s)"
    )
    largest_current = Parameter(
        10.0,
        "A",
        min=1e-6,
        max=1e6,
        doc="reading beyond which there is a fault, and the one before is used",
    )
    largest_voltage = Parameter(
        20.0,
        "V",
        min=1e-6,
        max=1e6,
        doc="reading beyond which there is a fault, and the one before is used",
    )

    current = Input("A", doc="measured current into the actuator")
    voltage = Input("V", doc="measured voltage across the actuator")

    samples = Discrete(
        "1", update="next_samples", period="sample_period", min=0, doc="samples so far"
    )
    last_current = Discrete(
        "A", update="measured_current", period="sample_period", doc="current at the latest sample"
    )
    last_voltage = Discrete(
        "V", update="measured_voltage", period="sample_period", doc="voltage at the latest sample"
    )

    def next_samples(self) -> Any:
        """Count the sample."""
        return self.samples + 1.0

    def measured_current(self) -> Any:
        """Current as the sensor shows it; the reading before where it is beyond what
        there can be.
        """
        return where(abs(self.current) <= self.largest_current, self.current, self.last_current)

    def measured_voltage(self) -> Any:
        """Voltage as the sensor shows it; the reading before where it is beyond what
        there can be.
        """
        return where(abs(self.voltage) <= self.largest_voltage, self.voltage, self.last_voltage)
