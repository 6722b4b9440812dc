"""Claims: a flat model has no connectors, events and samples, and no division."""

from fmus.kit import Component, Discrete, Input, Output, Parameter, PowerPort, State, where
from fmus.kit.modelica.flat import flat_text
from fmus.kit.modelica.model import trace_model


class Tank(Component):
    """A tank that is drained, with a port, a switch and a counter."""

    name = "tank"
    ports = (PowerPort("wall", "thermal", "temperature", "heat", ("wall",)),)

    capacity = Parameter(20.0, "J/K", min=1e-3)
    heat = Input("W")
    on = Input("1", start=True, type="boolean")
    temperature = State("K", rate="heating", output=True)
    count = Discrete("1", update="counted", period=0.5, type="integer")

    def heating(self):
        return self.heat / self.capacity

    def counted(self):
        return self.count + where(self.on, 1.0, 0.0)

    @Output("1", type="boolean")
    def hot(self):
        return self.temperature > 300.0


def test_equations_of_rates_outputs_and_samples():
    lines = [line.strip() for line in flat_text(trace_model(Tank)).splitlines()]
    start = lines.index("equation")
    assert lines[start + 1 :] == [
        "heating = heat * capacity ^ (-1.0);",
        "der(temperature) = heating;",
        "hot = if 300.0 < temperature then 1.0 else 0.0;",
        "next_count = count + (if on then 1.0 else 0.0);",
        "end Tank;",
    ]
    for line in (
        'input Real heat(unit="W");',
        "input Boolean on;",
        "input Integer count(start=count_start);",
        'output Real temperature(start=temperature_start, unit="K");',
        "output Real hot;",
        "output Real next_count;",
    ):
        assert line in lines, lines
    assert not [line for line in lines if "Interfaces" in line or "wall" in line]
