"""A law that is linear in its parameters, and estimates of them. Oracle: closed forms."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from fmus.kit import Component, Input, Output, Parameter
from orchestration.identify.uncertainty.estimate import Estimate

HALF = float(norm.ppf(0.975))
TIME = 0.1 * np.arange(101)


class Line(Component):
    """A law with an offset, which may have either sign, and a gain, which may not."""

    name = "line_of_bands"
    offset = Parameter(1.0, "V", doc="offset")
    gain = Parameter(2.0, "ohm", min=0.0, doc="gain")
    u = Input("A", start=0.0, doc="current")

    @Output("V", nominal=1.0)
    def y(self):
        """Return a value that is linear in both parameters."""
        return self.offset + self.gain * self.u


def estimates(**of):
    """Return estimates by value and standard error, in the logarithm for names in capitals."""
    made = {}
    for name, (value, error) in of.items():
        ends = (value - HALF * error, value + HALF * error)
        if name.isupper():
            ends = (value * np.exp(-HALF * error), value * np.exp(HALF * error))
        made[name] = Estimate(value, value, ends, "1")
    return made
