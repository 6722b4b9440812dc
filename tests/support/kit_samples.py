"""Small components for the tests of the kit: every kind of variable, none of it about actuators."""

from fmus.kit import (
    Array,
    Component,
    Discrete,
    Effect,
    Input,
    Output,
    Parameter,
    Preset,
    State,
    cos,
    exp,
    maximum,
    sign,
    table,
    where,
)


class Thermostat(Component):
    """A heated room under a sampled two-point controller."""

    name = "thermostat"
    experiment = (60.0, 0.5)

    loss = Parameter(0.5, "W/K", min=0, doc="heat loss to the outside", source="made up")
    capacity = Parameter(20.0, "J/K", min=1e-3, max=1e6, doc="heat capacity of the room")
    setpoint = Parameter(295.0, "K", min=0, display="degC", doc="wanted temperature")
    heater = Parameter(30.0, "W", min=0, doc="power of the heater")
    enabled = Parameter(True, "1", type="boolean", doc="whether the heater may run")
    stages = Parameter(2, "1", type="integer", min=1, max=5, doc="number of heaters")
    sampling = Parameter(0.4, "s", min=1e-3, doc="sample period of the controller")

    outside = Input("K", start=280.0, min=0, display="degC", doc="outside temperature")
    boost = Input("1", start=False, type="boolean", doc="another heater")

    temperature = State(
        "K",
        rate="warming",
        start=290.0,
        output=True,
        display="degC",
        nominal=300.0,
        doc="of the room",
    )
    energy = State("J", rate="power", display="kJ", doc="used so far")

    on = Discrete(
        "1", update="switch", period="sampling", output=True, type="boolean", doc="heater on"
    )
    changes = Discrete(
        "1", update="count", period="sampling", type="integer", min=0, doc="switchings so far"
    )
    reading = Discrete(
        "K",
        update="read",
        period=0.3,
        start=290.0,
        output=True,
        display="degC",
        doc="of the display",
    )

    presets = {
        "hall": Preset(
            {"capacity": 200.0, "enabled": True, "stages": 3, "setpoint": 288.15}, doc="a big room"
        )
    }

    def warming(self):
        return (self.power() - self.loss * (self.temperature - self.outside)) / self.capacity

    def switch(self):
        cold, warm = self.temperature < self.setpoint - 0.5, self.temperature > self.setpoint + 0.5
        return where(cold, 1.0, where(warm, 0.0, 1.0 * self.on)) * self.enabled

    def count(self):
        return self.changes + where(self.switch() != self.on, 1.0, 0.0)

    def read(self):
        return self.temperature

    @Output("W", nominal=10.0)
    def power(self):
        """Electric power. The second sentence is no part of the description."""
        return self.heater * (self.stages * self.on + self.boost)

    @Output("1", type="boolean")
    def warm(self):
        """Whether the room is warm"""
        return where(self.temperature > self.setpoint, 1.0, 0.0)


class Divider(Component):
    """Two resistors: no state, no sampling."""

    name = "divider"

    upper = Parameter(1.0, "ohm", min=1e-9)
    lower = Parameter(3.0, "ohm", min=1e-9)
    supply = Input("V", start=8.0)

    @Output("V")
    def tap(self):
        """Voltage across the lower resistor."""
        return self.supply * self.lower / (self.upper + self.lower)


class Curved(Component):
    """Nonlinear in everything, dependent on time, with structural zeros worth finding."""

    name = "curved"

    a = Parameter(0.7, "1")
    b = Parameter(1.3, "1")
    u = Input("1", start=0.2)
    v = Input("1", start=-0.4)
    x = State("1", rate="x_rate", start=0.3, output=True)
    y = State("1", rate="y_rate", start=-0.2)
    z = State("1", rate="z_rate", start=0.1)
    last = Discrete("1", update="keep", period=0.25, start=0.5)

    def x_rate(self):
        return -self.a * self.x + exp(-self.y * self.y) * self.u

    def y_rate(self):
        return cos(self.z) - self.y * self.b + 0.1 * cos(self.time)

    def z_rate(self):
        return where(self.x > 0.0, self.last, -self.z)

    def keep(self):
        return self.x * self.v + 0.5 * self.last

    @Output("1")
    def mixed(self):
        """Of a state and a direct input."""
        return maximum(self.y, self.v) * self.b

    @Output("1")
    def stepped(self):
        """Of a sign only."""
        return sign(self.z)

    @Output("1")
    def sampled(self):
        """Of nothing that is continuous."""
        return 2.0 * self.last


class Mixed(Component):
    """A chain of lags whose variables are named like what unrolled and generated code uses
    itself.
    """

    name = "mixed"

    h = Parameter(0.5, "1/s")
    w = Parameter(2.0, "1/s")
    t = Input("1", start=1.0)
    m = State("1", rate="r0", output=True)
    x0 = State("1", rate="a0", start=0.3, output=True)
    y = Discrete("1", update="g", period=0.25, output=True)

    def r0(self):
        return self.h * (self.t - self.m)

    def a0(self):
        return self.w * (self.m - self.x0)

    def g(self):
        return self.m + self.y

    @Output("1")
    def n0(self):
        """Difference of the lags."""
        return self.m - self.x0


class Warmer(Effect):
    """Adds a constant to the power."""

    id = "warmer"
    extra = Parameter(0.0, "W", doc="added power")

    def power(self):
        return super().power() + self.extra


class Doubled(Effect):
    """Scales the power, and counts something of its own."""

    id = "doubled"
    factor = Parameter(1.0, "1", doc="factor")
    age = State("s", rate="ageing", start=2.0, doc="age")

    def power(self):
        return super().power() * self.factor

    def ageing(self):
        return 1.0


class Sledge(Component):
    """Nothing brakes it; its force is that of a table of three points."""

    name = "sledge"

    mass = Parameter(2.0, "kg", min=1e-3)
    low, middle, high = Parameter(-1.0, "N"), Parameter(0.5, "N"), Parameter(3.0, "N")
    command = Input("1")
    velocity = State("m/s", rate="acceleration")

    def thrust(self):
        """Table of the command."""
        return table(self.command, (-1.0, 0.5, 2.0), (self.low, self.middle, self.high))

    def acceleration(self):
        """Newton's law."""
        return self.thrust() / self.mass

    @Output("N")
    def force(self):
        """As measured."""
        return self.thrust()


class Adder(Component):
    """Inputs and outputs of every type."""

    name = "adder"

    level = Input("1", doc="what is summed up")
    on = Input("1", type="boolean", doc="whether it counts twice")
    count = Input("1", type="integer", doc="what is added")
    more = Input("1", type="integer", doc="and what more is added")
    total = State("1", rate="rate", output=True, doc="the sum")

    def rate(self):
        return self.level * (1.0 + self.on) + 0.01 * self.count + 0.03 * self.more

    @Output("1", type="integer")
    def lacking(self):
        """Number that is missing to three."""
        return 3 - self.count

    @Output("1", type="integer")
    def excess(self):
        """Excess of the count."""
        return self.count - 5 * self.more

    @Output("1", type="boolean")
    def off(self):
        """Not on."""
        return 1.0 - self.on


class Wall(Component):
    """Layers in a row that exchange heat: arrays of every kind beside scalars."""

    name = "wall"
    experiment = (2.0, 0.25)
    layers = 3

    exchange = Array(Parameter(1.0, "1/s", min=0, max=9, doc="rate of each layer"), 3)
    offset = Parameter(0.5, "K", tunable=True, doc="of all sums")
    heat = Array(Input("K/s", doc="rate of warming"), lambda wall: wall.layers)
    counts = Array(Input("1", start=True, type="boolean", doc="whether a layer counts"), 2)
    temperature = Array(
        State("K", rate="warming", nominal=10.0, output=True, doc="of each layer"),
        lambda wall: wall.layers,
        starts=(1.0, 2.0, 4.0),
    )
    count = Array(
        Discrete("1", update="counted", period=0.5, type="integer", output=True, doc="samples"), 2
    )

    def at(self, layer):
        """Temperature of a layer; outside it is 0."""
        return self.temperature[layer] if 1 <= layer <= self.layers else 0.0

    def warming(self, layer):
        """Exchange with both neighbours, and heat."""
        curvature = self.at(layer - 1) - 2.0 * self.at(layer) + self.at(layer + 1)
        return self.exchange[layer] * curvature + self.heat[layer]

    def counted(self, place):
        """Samples so far; the second place counts in steps of 10."""
        return self.count[place] + where(self.counts[place], 10.0 ** (place - 1), 0.0)

    def product(self, row, column):
        """Row times a temperature."""
        return row * self.temperature[column]

    products = Array(Output("K", doc="of row and temperature")(product), 2, 3)

    @Output("K")
    def total(self):
        """Sum of all temperatures."""
        return self.temperature[1] + self.temperature[2] + self.temperature[3] + self.offset
