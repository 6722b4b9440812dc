"""Two tanks in a row with a pump ahead and a valve between; both levels are measured."""

from fmus.kit import Component, Constant, Input, Output, Parameter, State, maximum, sqrt


class Tank(Component):
    """A1 dh1/dt = a p - b w sqrt(h1), and A2 dh2/dt = b w sqrt(h1) - c sqrt(h2)."""

    name = "tank"
    experiment = (900.0, 1.0)
    first_area = Parameter(0.05, "m2", min=1e-3, max=10, doc="area of the first tank (A1)")
    second_area = Parameter(0.04, "m2", min=1e-3, max=10, doc="area of the second tank (A2)")
    delivery = Parameter(0.002, "m3/s", min=1e-5, max=1, doc="flow of the pump at 1 (a)")
    passage = Parameter(0.0025, "m3/s", min=1e-5, max=1, doc="flow of the valve at 1 and 1 m (b)")
    outlet = Parameter(0.0013, "m3/s", min=1e-5, max=1, doc="flow of the outlet at 1 m (c)")
    metre = Constant(1.0, "m")
    pump = Input("1", nominal=0.5, doc="pump (p)")
    valve = Input("1", nominal=0.5, doc="opening of the valve (w)")
    upper = State("m", rate="upper_rate", start=0.6, nominal=0.5, doc="level of the first (h1)")
    lower = State("m", rate="lower_rate", start=0.6, nominal=0.5, doc="level of the second (h2)")

    def inflow(self):
        """Flow of the pump."""
        return self.delivery * self.pump

    def passed(self):
        """Flow between the tanks."""
        return self.passage * self.valve * sqrt(maximum(self.upper / self.metre, 1e-4))

    def outflow(self):
        """Flow out of the second tank."""
        return self.outlet * sqrt(maximum(self.lower / self.metre, 1e-4))

    def upper_rate(self):
        """Balance of the first tank."""
        return (self.inflow() - self.passed()) / self.first_area

    def lower_rate(self):
        """Balance of the second tank."""
        return (self.passed() - self.outflow()) / self.second_area

    @Output("m", nominal=0.5)
    def upper_level(self):
        """Level of the first tank, as measured."""
        return self.upper

    @Output("m", nominal=0.5)
    def lower_level(self):
        """Level of the second tank, as measured."""
        return self.lower
