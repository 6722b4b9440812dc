"""A model whose input starts at a value of its own."""

from __future__ import annotations

from fmus.kit import Component, Input, Output, Parameter


class Amplifier(Component):
    """The input, times a factor."""

    name = "amplifier"
    factor = Parameter(1.0, "1", min=0.0, doc="a factor")
    u = Input("V", start=1.5, doc="what is fed")

    @Output("V")
    def y(self):
        """Proportional."""
        return self.factor * self.u
