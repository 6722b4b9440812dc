"""A relaxation of first order, for tests of fits."""

from __future__ import annotations

from fmus.kit import Component, Input, Output, Parameter, State


class Relaxation(Component):
    """First order."""

    name = "relaxation"

    tau = Parameter(0.4, "s", min=1e-3)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def y(self):
        """Return the state."""
        return self.x
