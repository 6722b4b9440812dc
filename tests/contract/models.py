"""Small components for the contract: a sampled one, and faults to lay over the real ones.

They are built as a user's own model would be, from a module outside the package.
"""

from fmus.kit import Component, Discrete, Effect, Input, Output, Parameter, State, sqrt, where


class Tuned(Component):
    """Tunable parameters of all types, in a rate, at samples and in an output."""

    name = "tuned"
    experiment = (10.0, 0.25)

    period = Parameter(0.25, "s", min=1e-3, max=10.0, doc="sample period")
    gain = Parameter(2.0, "1/s", min=0, max=10.0, tunable=True, doc="rate per input")
    step = Parameter(1, "1", type="integer", min=0, max=9, tunable=True, doc="count of a sample")
    counts = Parameter(True, "1", type="boolean", tunable=True, doc="whether samples count")

    u = Input("1", start=1.0, doc="input")
    switch = Input("1", start=False, type="boolean", doc="a discrete input")

    x = State("1", rate="product_law", output=True, doc="integral of the product")
    count = Discrete("1", update="next_count", period="period", output=True, doc="counts samples")
    seen = Discrete(
        "1",
        update="next_seen",
        period="period",
        type="boolean",
        output=True,
        doc="switch at the latest sample",
    )

    def product_law(self):
        return self.gain * self.u

    def next_count(self):
        return self.count + where(self.counts, self.step, 0.0)

    def next_seen(self):
        return where(self.switch, 1.0, 0.0)

    @Output("1/s")
    def product(self):
        """Gain times input."""
        return self.product_law()

    @Output("1")
    def twice(self):
        """Twice the switch."""
        return where(self.switch, 2.0, 0.0)


class Sampler(Component):
    """Two sampled groups beside a continuous state, with all three types of variables."""

    name = "sampler"
    experiment = (10.0, 0.1)

    period = Parameter(0.1, "s", min=1e-3, max=10.0, doc="sample period of the slow group")
    rate = Parameter(3.0, "1/s", min=0, max=1e3, doc="rate of the state")
    step = Parameter(1, "1", type="integer", min=1, max=9, doc="what is counted per sample")

    u = Input("1", doc="wanted value of the state")
    enabled = Input("1", start=True, type="boolean", doc="whether the accumulator runs")

    x = State("1", rate="x_rate", start=0.25, output=True, doc="first-order lag of the input")

    instant = Discrete(
        "s", update="now", period="period", output=True, doc="time of the latest sample"
    )
    count = Discrete(
        "1",
        update="one_more",
        period="period",
        output=True,
        type="integer",
        doc="samples times step",
    )
    last = Discrete(
        "1", update="sample", period="period", output=True, doc="state at the latest sample"
    )
    total = Discrete(
        "1",
        update="accumulate",
        period=0.025,
        output=True,
        doc="sum of the samples of the fast group",
    )
    high = Discrete(
        "1",
        update="compare",
        period=0.025,
        output=True,
        type="boolean",
        doc="state above the last sample",
    )

    def x_rate(self):
        return self.rate * (self.u - self.x)

    def now(self):
        return self.time

    def one_more(self):
        return self.count + self.step

    def sample(self):
        return self.x

    def accumulate(self):
        return self.total + where(self.enabled, 1.0, 0.0) * (self.x - 0.1 * self.total)

    def compare(self):
        return where(self.x > self.last, 1.0, 0.0)

    @Output("1")
    def difference(self):
        """Change of the state since the latest sample."""
        return self.x - self.last


class Oscillator(Component):
    """Two poles whose speed is an input; one can run away, so that the step has to change."""

    name = "oscillator"

    u = Input("1", doc="force")
    speed = Input("rad/s", start=1.0, doc="angular frequency")
    growth = Input("1/s", doc="gain of the runaway")
    position = State("1", rate="position_rate", start=1.0, output=True, doc="position")
    velocity = State("1", rate="velocity_rate", output=True, doc="velocity over angular frequency")
    runaway = State(
        "1", rate="runaway_rate", start=1.0, output=True, doc="reaches infinity in finite time"
    )

    def position_rate(self):
        return self.speed * self.velocity

    def velocity_rate(self):
        return self.speed * (self.u - self.position)

    def runaway_rate(self):
        return self.growth * self.runaway * self.runaway


class _Fault(Effect):
    """A bug that shows at a current above 5 A: an exception in Python, a NaN in C."""

    def _bug(self):
        if type(self.current) is float and self.current > 5.0:
            raise ValueError("100 % broken, %s %n")
        return sqrt(where(self.current > 5.0, -1.0, 0.0))


class BrokenRate(_Fault):
    """A bug in a law that the integration needs."""

    id = "broken_rate"

    def kelvin_rate(self):
        return super().kelvin_rate() + self._bug()


class BrokenOutput(_Fault):
    """A bug in a law of an output."""

    id = "broken_output"

    def voltage(self):
        return super().voltage() + self._bug()


class DoubledVoltage(Effect):
    """Another law under the same names."""

    id = "doubled_voltage"

    def voltage(self):
        return 2.0 * super().voltage()
