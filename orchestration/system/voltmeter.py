"""The voltmeter, a component for measurement noise that can also be built as a Python FMU."""

from __future__ import annotations

from typing import Any

from fmus.kit import Component, Input, Output


class Voltmeter(Component):
    """Voltage as it is measured: the true voltage, and an error that comes from outside."""

    name = "voltmeter"
    experiment = (10.0, 0.1)

    voltage = Input("V", doc="true voltage")
    error = Input("V", doc="error of the measurement: noise, hum, an offset")

    @Output("V")
    def measured_voltage(self) -> Any:
        """Sum of the true voltage and the error."""
        return self.voltage + self.error
