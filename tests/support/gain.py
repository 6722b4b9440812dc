"""The simplest model there is."""

from __future__ import annotations

from fmus.kit import Component, Input, Output, Parameter


class Gain(Component):
    """What is fed, times a factor."""

    name = "gain"
    factor = Parameter(1.0, "1", min=0)
    u = Input("1")

    @Output("1")
    def y(self):
        """Proportional."""
        return self.factor * self.u
