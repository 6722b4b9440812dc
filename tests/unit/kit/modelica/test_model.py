"""Claims: a model has the variables, attributes, connectors and equations of its component."""

import pytest
import rumoca

import fmus
from fmus.kit import Component, Discrete, Input, Output, Parameter, PowerPort, State, stack, where
from fmus.kit.modelica import package_files
from fmus.kit.modelica.model import trace_model
from tests.support.kit_samples import Thermostat, Warmer
from tests.support.modelica import flatten_by_pymoca, parse_by_pymoca, write


class Oven(Component):
    """A heated wall: a port of heat, names that the language reserves, two clocks."""

    name = "oven"
    ports = (PowerPort("wall", "thermal", "temperature", "heat", ("wall",)),)

    capacity = Parameter(20.0, "J/K", min=1e-3, max=1e6, nominal=10.0, doc='the "thermal" mass')
    period = Parameter(0.5, "s", min=1e-3)
    late = Parameter(0.1, "s", min=0)
    flow = Parameter(True, "1", type="boolean")
    heat = Input("W", doc="into the wall")
    when = Input("1", start=False, type="boolean")
    temperature = State("K", rate="heating", start=290.0, output=True, display="degC", nominal=300)
    count = Discrete("1", update="counted", period="period", shift=("late",), type="integer")
    reading = Discrete("K", update="read", period=0.25, start=280.0, output=True, min=0.0)

    def heating(self):
        """Rate of the temperature."""
        return self.heat / self.capacity

    def counted(self):
        return self.count + where(self.when, 1.0, 0.0) * self.flow

    def read(self):
        return self.temperature + 0.1 * self.count

    @Output("1", type="boolean")
    def hot(self):
        """Whether the wall is hot."""
        return self.temperature > 300.0


def lines_of(cls):
    return [line.strip() for line in trace_model(cls).text().splitlines()]


def test_variables_with_their_attributes():
    text = trace_model(Oven).text()
    for line in (
        'parameter Real capacity(unit="J/K", nominal=10.0, min=0.001, max=1000000.0) = 20.0'
        ' "the \\"thermal\\" mass";',
        "parameter Boolean flow_ = true;",
        'Real heat(start=0.0, unit="W") "into the wall";',
        "Interfaces.BooleanInput when_(start=false)",
        'Interfaces.RealOutput temperature(start=temperature_start, fixed=true, unit="K",'
        ' displayUnit="degC", nominal=300.0)',
        "Integer count(start=count_start, fixed=true);",
        'Interfaces.BooleanOutput hot "Whether the wall is hot"',
        'Interfaces.HeatPort wall "of wall"',
        'Real heating(unit="K/s") "Rate of the temperature";',
    ):
        assert line in text, line


def test_equations_of_port_rate_and_samples():
    lines = lines_of(Oven)
    start = lines.index("equation")
    assert lines[start + 1 : -2] == [
        "temperature = wall.T;",
        "heat = wall.Q_flow;",
        "heating = heat / capacity;",
        "der(temperature) = heating;",
        "hot = 300.0 < temperature;",
        "event_1 = 0.0 < 0.00390625 * (300.0 - temperature);",
        "when sample(late, period) then",
        "counted = pre(count) + (if pre(when_) and flow_ then 1.0 else 0.0);",
        "count = integer(counted + 0.5);",
        "end when;",
        "when sample(0.0, 0.25) then",
        "reading = temperature + 0.1 * count;",
        "end when;",
    ]


def test_a_component_without_ports_is_a_block():
    assert trace_model(Thermostat).text().startswith('block Thermostat "A heated room under')
    assert trace_model(Oven).text().startswith('model Oven "A heated wall: a port')


def test_effects_carry_over_with_their_parameters():
    text = trace_model(stack(Thermostat, Warmer)).text()
    assert text.startswith("block ThermostatWithWarmer ")
    assert 'parameter Real extra(unit="W") = 0.0' in text


@pytest.mark.parametrize("cls", [Oven, Thermostat, stack(Thermostat, Warmer)])
def test_two_compilers_read_it(cls, tmp_path):
    """A variable more or less than equations would be told."""
    files = package_files([cls], "1.0")
    name = next(path for path in files if path.count("/") == 1 and "package" not in path)
    model = name.removesuffix(".mo").replace("/", ".")
    flat = flatten_by_pymoca(parse_by_pymoca(files), model)
    assert set(cls.layout.names[: -len(cls.layout.states)]) <= {n.rstrip("_") for n in flat.symbols}
    write(files, tmp_path)
    inputs = [v.name for v in cls.layout.inputs if v.name != "heat"]
    given = "".join(f"m.{n.replace('when', 'when_')} = {start(cls, n)};" for n in inputs)
    session = rumoca.Session(roots=[str(tmp_path / "PpyRig")])
    session.loads(f"model T {model} m; equation {given} end T;", model="T")


def start(cls, name):
    v = next(v for v in cls.layout.inputs if v.name == name)
    return str(v.start).lower() if v.type == "boolean" else repr(v.start)


def test_what_is_sampled_sees_inputs_before_the_instant_and_earlier_clocks_after_it():
    lines = lines_of(fmus.component("galvanostat"))
    assert "sampled_voltage = pre(voltage);" in lines
    assert "sampled_lower_current = -current_limit * (if sampled_voltage < 0.0 then" in (
        " ".join(lines)
    )
