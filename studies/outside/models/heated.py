"""Heated body that a fan cools; its rise of temperature is measured by a slow sensor."""

from fmus.kit import Component, Input, Output, Parameter, State


class Heated(Component):
    """C dT/dt = P - h0 T - h1 f T, and tau ds/dt = T - s."""

    name = "heated"
    experiment = (1800.0, 2.0)
    capacity = Parameter(60.0, "J/K", min=1, max=1e4, doc="heat capacity (C)")
    still = Parameter(0.3, "W/K", min=1e-3, max=100, doc="loss without the fan (h0)")
    blown = Parameter(0.6, "W/K", min=1e-3, max=100, doc="loss that a full fan adds (h1)")
    sensor_time = Parameter(8.0, "s", min=0.5, max=100, doc="time constant of the sensor (tau)")
    power = Input("W", nominal=10.0, doc="power of the heater (P)")
    fan = Input("1", nominal=0.5, doc="fan (f)")
    warm = State("K", rate="warm_rate", nominal=15.0, doc="rise of temperature (T)")
    shown = State("K", rate="shown_rate", nominal=15.0, doc="rise at the sensor (s)")

    def heating(self):
        """Heat of the heater."""
        return self.power

    def loss(self):
        """Heat that is lost without the fan."""
        return self.still * self.warm

    def cooling(self):
        """Heat that the fan takes away."""
        return self.blown * self.fan * self.warm

    def warm_rate(self):
        """Balance of heat."""
        return (self.heating() - self.loss() - self.cooling()) / self.capacity

    def shown_rate(self):
        """Sensor."""
        return (self.warm - self.shown) / self.sensor_time

    @Output("K", nominal=15.0)
    def rise(self):
        """As measured."""
        return self.shown
