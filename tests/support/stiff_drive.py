"""A drive with a fast electrical and a slow mechanical part, and the ladder of a record of it."""

import numpy as np

from fmus.kit import Component, Input, Output, Parameter, State, maximum
from fmus.kit.record.linearisation import Linearisation
from fmus.kit.symbolic import trace, with_sensitivities


class Drive(Component):
    """A coil that moves a mass against a spring: a fast electrical and a slow mechanical part."""

    name = "drive"

    R = Parameter(3.0, "ohm", min=1e-3)
    L = Parameter(1e-3, "H", min=1e-9)
    K = Parameter(4.0, "N/A", min=0)
    m = Parameter(0.3, "kg", min=1e-6)
    b = Parameter(1.5, "N*s/m", min=0)
    k = Parameter(20.0, "N/m", min=0)
    voltage = Input("V")
    current = State("A", rate="current_rate", output=True)
    position = State("m", rate="position_rate", nominal=0.1, output=True)
    velocity = State("m/s", rate="velocity_rate")

    def current_rate(self):
        return (self.voltage - self.R * self.current - self.K * self.velocity) / self.L

    def position_rate(self):
        return self.velocity

    def spring(self):
        return self.k * self.position

    def velocity_rate(self):
        return (self.K * self.current - self.b * self.velocity - self.spring()) / self.m

    @Output("N")
    def force(self):
        """Of the coil."""
        return self.K * self.current


class Nonlinear(Drive):
    """The same with a spring that hardens, and a stop."""

    name = "nonlinear"

    hardening = Parameter(300.0, "N/m^3", min=0, nominal=100.0)
    stop = Parameter(0.0, "N/m", min=0, nominal=100.0)
    edge = Parameter(0.1, "m", min=0)

    def spring(self):
        x = self.position
        return self.k * x + self.hardening * x * x * x + self.stop * maximum(x - self.edge, 0.0)


STEP = 0.05


def ladder_of(time, cls=Drive, linear=False, inputs=1, sensitivities=()):
    """Return the preparation for a record, of which only the clock counts here."""
    graph = trace(cls)
    extended = with_sensitivities(graph, sensitivities)
    parameters = np.array([float(p.start) for p in extended.layout.parameters])
    return Linearisation(graph, extended).ladder(
        time, np.ones((len(time), inputs)), linear, parameters
    )
