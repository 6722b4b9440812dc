"""Claims: variables have their order, and mistakes in declarations show at the class."""

import math
import re

import pytest

import fmus
from fmus.kit import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    Preset,
    State,
    UserError,
    stack,
)
from fmus.kit.declare import OutputDeclaration
from fmus.kit.sensors import sensor_gain
from fmus.ppy_actuator.model import PpyActuator
from tests.support.kit_samples import Curved, Divider, Thermostat


def test_memory_layout_is_in_order_of_declaration():
    assert Thermostat.layout.names == [
        "loss",
        "capacity",
        "setpoint",
        "heater",
        "enabled",
        "stages",
        "sampling",
        "temperature_start",
        "energy_start",
        "on_start",
        "changes_start",
        "reading_start",
        "outside",
        "boost",
        "temperature",
        "energy",
        "on",
        "changes",
        "reading",
        "power",
        "warm",
        "der(temperature)",
        "der(energy)",
    ]


def test_start_parameters_take_after_their_state():
    parameters = {p.name: p for p in Thermostat.layout.parameters}
    start = parameters["temperature_start"]
    assert (start.start, start.unit, start.display, start.nominal) == (290.0, "K", "degC", 300.0)
    assert parameters["on_start"].type == "boolean"
    assert parameters["changes_start"].type == "integer"
    assert parameters["changes_start"].min == 0


def test_a_layout_says_which_parameters_are_start_values():
    layout = Thermostat.layout
    states = ["temperature", "energy", "on", "changes", "reading"]
    assert layout.start_of == {state: f"{state}_start" for state in states}
    assert layout.start_parameters == {f"{state}_start": state for state in states}
    assert {
        p.name: p.starts for p in layout.parameters if p.starts is not None
    } == layout.start_parameters


def test_a_parameter_that_is_merely_called_like_one_is_no_start_value():
    class Ramp(Component):
        name = "ramp"
        ramp_start = Parameter(3.0, "s")
        drive_start = Parameter(0.5, "1")
        drive = Input("1")
        level = State("1", rate="level_rate")

        def level_rate(self):
            return self.drive + self.drive_start

    assert Ramp.layout.start_parameters == {"level_start": "level"}
    assert Ramp().level == 0.0
    other = stack(Ramp, defaults={"ramp_start": 5.0, "level_start": 2.0})
    assert other.layout.start_parameters == {"level_start": "level"}
    assert (other().ramp_start, other().level, other().drive) == (5.0, 2.0, 0.0)
    with pytest.raises(TypeError, match="starts"):
        Parameter(1.0, "s", starts="level")


def test_what_only_the_model_tells_is_shown_and_not_measured():
    layout = fmus.component("ppy_actuator").layout
    told = {v.name for v in layout.shown} - {v.name for v in layout.measurable}
    assert told == {f"{of}_margin" for of in ("compression", "displacement", "force", "voltage")}
    assert not told & {v.name for v in layout.measured_outputs}


def test_measurable_are_outputs_and_output_states():
    assert [v.name for v in Thermostat.layout.measurable] == [
        "temperature",
        "on",
        "reading",
        "power",
        "warm",
    ]


def test_sampled_groups_by_period():
    groups = [(period, [d.name for d in members]) for period, members in Thermostat.layout.sampled]
    assert groups == [(("sampling", ()), ["on", "changes"]), ((0.3, ()), ["reading"])]


def declare(concrete=True, **body):
    """Make a component class with this body; a law named ``law`` is there."""
    return type(
        "Faulty",
        (Component,),
        {"law": lambda self: 1.0, "name": "faulty" if concrete else ""} | body,
    )


@pytest.mark.parametrize(
    "name",
    [
        "time",
        "tolerance",
        "experiment",
        "presets",
        "declared",
        "layout",
        "start",
        "laws",
        "rates",
        "outputs",
        "author",
        "license",
        "law",
        "_hidden",
        "lambda",
        "a b",
        "1a",
        "",
    ],
)
@pytest.mark.parametrize(
    "variable", [lambda: Parameter(1.0, "1"), lambda: Output("1")(lambda self: 1.0)]
)
def test_names_that_cannot_be_variables_are_refused(name, variable):
    body = {name: variable()}
    if name == "law" and isinstance(body[name], OutputDeclaration):
        declare(**body)  # replaces the method
        return
    with pytest.raises(UserError, match=rf"test_layout.Faulty: variable '{re.escape(name)}' "):
        type("Faulty", (declare(),), {"__module__": __name__} | body)


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        (Parameter(2.0, "V", max=1.0), "starts at 2 V, outside its range, -inf to 1 V"),
        (Parameter(math.nan, "V"), "starts at nan V, outside"),
        (Input("V", min=1.0), "starts at 0 V, outside its range, 1 to inf V"),
        (Parameter(1.0, "V", min=1.0, max=1.0), "has an empty range, 1 to 1 V"),
        (Parameter(1.0, "V", nominal=0.0), "has the nominal value 0 V; it must be positive"),
        (State("V", rate="law", nominal=-1.0), "has the nominal value -1 V"),
        (State("V", rate="lwa"), "has the rate 'lwa', which is no method"),
        (State("V", rate="tolerance"), "has the rate 'tolerance', which is no method"),
        (Discrete("V", update="lwa", period=0.1), "has the update 'lwa', which is no method"),
        (
            Discrete("V", update="law", period="priod"),
            "has the period 'priod', which is neither a parameter nor",
        ),
        (Discrete("V", update="law", period=0.0), "has the period 0.0, which is neither"),
    ],
)
def test_declarations_that_cannot_work_are_refused(variable, message):
    with pytest.raises(UserError, match=f"Faulty: variable 'v' {message}"):
        declare(v=variable)


def test_what_an_abstract_base_leaves_open_is_for_its_subclass():
    base = declare(concrete=False, v=State("V", rate="missing"))
    with pytest.raises(UserError, match="'v' has the rate 'missing'"):
        type("Concrete", (base,), {"name": "concrete"})
    cls = type("Concrete", (base,), {"name": "concrete", "missing": lambda self: 2.0})
    assert cls().rates() == [2.0]


def test_a_start_parameter_is_not_declared_beside_its_state():
    with pytest.raises(UserError, match="'x_start' is declared twice"):
        declare(x=State("1", rate="law"), x_start=Parameter(1.0, "1"))


def test_variables_have_unique_names_and_proper_ranges():
    for cls in (Thermostat, Divider, Curved, *map(fmus.component, fmus.COMPONENTS)):
        assert len(set(cls.layout.names)) == len(cls.layout.names)
        for v in cls.layout.variables:
            assert v.min <= v.max
            assert v.nominal > 0
            if hasattr(v, "start"):
                assert v.min <= v.start <= v.max


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ({"n": Parameter(2.5, "1", type="integer")}, "is an integer but starts at 2.5"),
        ({"n": State("1", rate="rate", type="integer")}, "a continuous state is real"),
        ({"n": Parameter(1, "1", type="text")}, "is of type 'text'"),
        ({"α": Parameter(1.0, "1")}, "ASCII identifier"),
        ({"name": "my component"}, "'my component' must be an ASCII identifier"),
        ({"presets": {"big": Preset({"gone": 1.0}, "")}}, "preset 'big' sets gone to 1"),
        (
            {"k": Parameter(1.0, "1", max=5.0), "presets": {"big": Preset({"k": 9.0}, "")}},
            "preset 'big' sets k to 9",
        ),
    ],
)
def test_what_would_show_far_away_is_told_at_the_class(body, says):
    with pytest.raises(UserError, match=re.escape(says)):
        type("Wrong", (Component,), {"name": "wrong", "rate": lambda self: 0.0} | body)


@pytest.mark.parametrize("name", ["output", "id", "term", "neutral", "assumption"])
def test_a_variable_may_be_called_like_what_is_said_of_effects(name):
    def speed(self):
        return self.u

    def shown(self):
        return getattr(self, name)

    body = {
        "name": "named",
        "u": Input("V"),
        name: State("V", rate="speed", start=2.0),
        "speed": speed,
        "shown": Output("V")(shown),
    }
    base = type("Named", (Component,), body)
    laid_over = stack(base, sensor_gain(base, "shown"))
    assert laid_over(shown_gain=3.0).shown() == 6.0
    assert stack(base, defaults={f"{name}_start": 5.0})().shown() == 5.0
    again = stack(laid_over, defaults={f"{name}_start": 5.0, "shown_gain": 2.0})
    assert again().shown() == 10.0


def test_a_plain_value_over_a_declaration_is_refused():
    with pytest.raises(UserError, match="'R1' has the name of something else"):
        type("Stiffer", (PpyActuator,), {"name": "stiffer", "R1": 0.6})


@pytest.mark.parametrize(
    "name", ["laws", "rates", "outputs", "layout", "declared", "start", "name"]
)
def test_a_law_with_the_name_of_what_every_component_has_is_refused(name):
    with pytest.raises(UserError, match=f"law '{name}' has the name of something that every"):
        type("Taken", (Component,), {"name": "taken", name: lambda self: 1.0})
