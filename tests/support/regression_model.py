"""A model without states: an amplifier."""

from __future__ import annotations

from fmus.kit import Component, Input, Output, Parameter

GAIN = 2.0


class Amplifier(Component):
    """The input, times a gain."""

    name = "amplifier"
    gain = Parameter(GAIN, "1", min=1e-6, max=1e6, doc="gain")
    signal = Input("V", doc="what goes in")

    def amplified(self):
        """Proportional."""
        return self.gain * self.signal

    @Output("V")
    def shown(self):
        """The output."""
        return self.amplified()
