"""Samples of current and voltage, in which the previous reading replaces a faulty one."""

from __future__ import annotations

from typing import Any

from ..kit import Component, Discrete, Input, Parameter, where


def sampled_state(unit: str, law: str, doc: str, **about: Any) -> Any:
    """Declare a discrete state that a law updates at every sample."""
    return Discrete(unit, update=law, period="sample_period", doc=doc, **about)


class Measurement(Component):
    """Sampled current and voltage, and those of the previous sample."""

    sample_period = Parameter(
        0.1, "s", min=1e-3, max=1e3, source="thesis appendix A3", doc="time between samples (T_s)"
    )
    largest_current = Parameter(
        10.0,
        "A",
        min=1e-6,
        max=1e6,
        tunable=True,
        doc="reading beyond which there is a fault, and the one before is used",
    )
    largest_voltage = Parameter(
        20.0,
        "V",
        min=1e-6,
        max=1e6,
        tunable=True,
        doc="reading beyond which there is a fault, and the one before is used",
    )

    current = Input("A", doc="measured current into the actuator")
    voltage = Input("V", doc="measured voltage across the actuator")

    samples = sampled_state("1", "next_samples", "samples so far", min=0)
    last_current = sampled_state("A", "measured_current", "current at the latest sample")
    last_voltage = sampled_state("V", "measured_voltage", "voltage at the latest sample")

    def next_samples(self) -> Any:
        """Number of samples, this one included."""
        return self.samples + 1.0

    def measured_current(self) -> Any:
        """Reading of the current; the previous one where it exceeds ``largest_current``."""
        return where(abs(self.current) <= self.largest_current, self.current, self.last_current)

    def measured_voltage(self) -> Any:
        """Reading of the voltage; the previous one where it exceeds ``largest_voltage``."""
        return where(abs(self.voltage) <= self.largest_voltage, self.voltage, self.last_voltage)
