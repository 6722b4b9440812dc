"""Models whose fronts are known in closed form."""

import numpy as np
import pytest

from fmus.kit import Component, Output, Parameter, State, exp
from orchestration.sweeps.pareto import Objective, Objectives
from orchestration.sweeps.ranges import Range

APART = 2.0**-0.5


class Bells(Component):
    """Two bells turned upside down, after Fonseca and Fleming: their front is concave."""

    name = "bells"

    x = Parameter(0.5, "1", min=-4, max=4, doc="first parameter")
    y = Parameter(-1.0, "1", min=-4, max=4, doc="second parameter")

    @Output("1")
    def one(self):
        """One bell."""
        return 1.0 - exp(-((self.x - APART) ** 2) - (self.y - APART) ** 2)

    @Output("1")
    def two(self):
        """The other bell."""
        return 1.0 - exp(-((self.x + APART) ** 2) - (self.y + APART) ** 2)

    @Output("m", display="mm")
    def length(self):
        """A length."""
        return self.x * 1e-3


class Decay(Component):
    """A decay that is driven."""

    name = "decay"

    tau = Parameter(1.0, "s", min=1e-3, max=1e3, doc="time constant")
    gain = Parameter(1.0, "1", min=0, max=10, doc="gain")
    level = State("1", rate="rate", start=1.0, output=True, doc="what decays")

    def rate(self):
        """Rate of the decay."""
        return (self.gain - self.level) / self.tau


def span(name, low, high, logarithmic=False):
    return Range(name, "1", np.array([low, high]), logarithmic, counted=False)


@pytest.fixture
def bells():
    """Both bells, minimised."""
    objectives = [Objective((name,), "1", -1.0) for name in ("one", "two")]
    return Objectives(
        Bells, [span("x", -4.0, 4.0), span("y", -4.0, 4.0)], objectives, np.zeros(1), {}, {}
    )


@pytest.fixture
def ruler():
    """The length, maximised, and a bell, minimised, over one parameter."""
    objectives = [Objective(("length",), "m", 1.0), Objective(("one",), "1", -1.0)]
    return Objectives(Bells, [span("x", -4.0, 4.0)], objectives, np.zeros(1), {}, {})


@pytest.fixture
def decay():
    """The level after 2 s, over a time constant by ratios and a gain, minimised."""
    ranges = [span("tau", 0.1, 10.0, True), span("gain", 0.2, 0.8)]
    time = np.linspace(0.0, 2.0, 21)
    return Objectives(Decay, ranges, [Objective(("level",), "1", -1.0)], time, {}, {})
