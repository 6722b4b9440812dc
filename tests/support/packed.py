"""Small components with solutions on paper, for systems that become one FMU."""

from __future__ import annotations

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, where


class Section(Component):
    """A resistor and a capacitor."""

    name = "section"
    tolerance = 1e-12
    tau = Parameter(0.5, "s", min=1e-3, doc="time constant")
    u = Input("V", doc="voltage at the resistor")
    v = State("V", rate="slope", output=True, doc="voltage of the capacitor")

    def slope(self):
        return (self.u - self.v) / self.tau


class Amplifier(Component):
    """A gain without memory, with a second input that is not amplified."""

    name = "amplifier"
    gain = Parameter(1.0, "1", doc="gain")
    u = Input("V", doc="amplified")
    w = Input("V", doc="added")

    @Output("V")
    def y(self):
        """The sum."""
        return self.gain * self.u + self.w


class Filter(Component):
    """A sampled filter: half of what it was and half of what comes, and whether that is high."""

    name = "filter"
    period = Parameter(0.3, "s", min=1e-3, doc="sample period")
    u = Input("mV", doc="filtered")
    x = Discrete("mV", update="next", period="period", output=True, doc="the mean")
    high = Discrete(
        "1", update="is_high", period="period", output=True, type="boolean", doc="above 400 mV"
    )

    def next(self):
        return 0.5 * (self.x + self.u)

    def is_high(self):
        return where(self.next() > 400.0, 1.0, 0.0)


class Lamp(Component):
    """A lamp behind a switch."""

    name = "lamp"
    on = Input("1", start=False, type="boolean", doc="whether the switch is closed")

    @Output("W")
    def power(self):
        """What it takes."""
        return where(self.on, 60.0, 0.0)
