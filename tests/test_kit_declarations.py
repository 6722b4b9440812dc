import subprocess
import sys

import pytest

import fmus
from fmus.kit import Component, Output, Parameter, State, UserError, stack
from fmus.kit.declare import OutputDeclaration, ParameterDeclaration

from .kit_samples import Curved, Divider, Doubled, Thermostat, Warmer


def test_memory_layout_is_in_order_of_declaration():
    assert Thermostat.layout.names == [
        "loss", "capacity", "setpoint", "heater", "enabled", "stages", "sampling",
        "temperature_start", "energy_start", "on_start", "changes_start", "reading_start",
        "outside", "boost",
        "temperature", "energy",
        "on", "changes", "reading",
        "power", "warm",
        "der(temperature)", "der(energy)",
    ]  # fmt: skip


def test_start_parameters_take_after_their_state():
    parameters = {p.name: p for p in Thermostat.layout.parameters}
    start = parameters["temperature_start"]
    assert (start.start, start.unit, start.display, start.nominal) == (290.0, "K", "degC", 300.0)
    assert parameters["on_start"].type == "boolean"
    assert parameters["changes_start"].type == "integer"
    assert parameters["changes_start"].min == 0


def test_description_of_an_output_is_the_first_line_of_its_docstring():
    power, warm = Thermostat.layout.outputs
    assert power.doc == "Electric power. The second sentence is no part of the description"
    assert warm.doc == "Whether the room is warm"


def test_measurable_are_outputs_and_output_states():
    assert [v.name for v in Thermostat.layout.measurable] == ["temperature", "on", "reading", "power", "warm"]


def test_sampled_groups_by_period():
    groups = [(period, [d.name for d in members]) for period, members in Thermostat.layout.sampled]
    assert groups == [("sampling", ["on", "changes"]), (0.3, ["reading"])]


def test_instances_hold_values_and_do_not_share_them():
    one, other = Thermostat(loss=2.0, temperature_start=300.0), Thermostat()
    assert (one.loss, one.temperature, one.outside) == (2.0, 300.0, 280.0)
    assert (other.loss, other.temperature, other.on) == (0.5, 290.0, False)
    one.temperature = 5.0
    one.start()
    assert one.temperature == 300.0


@pytest.mark.parametrize("name", ["los", "temperature", "power", "on"])
def test_values_that_are_not_parameters_or_inputs_are_refused(name):
    with pytest.raises(UserError, match=f"thermostat: no parameter or input named '{name}'"):
        Thermostat(**{name: 1.0})


def test_laws_are_plain_methods_and_declarations_leave_the_class():
    assert Divider().tap() == 6.0
    assert "supply" not in vars(Divider)
    assert isinstance(Divider.declared["tap"], OutputDeclaration)
    assert isinstance(Divider.declared["upper"], ParameterDeclaration)


def test_a_subclass_overrides_a_law_and_adds_after_its_base():
    class Loaded(Divider):
        load = Parameter(3.0, "ohm")
        heat = State("J", rate="tap")

        def tap(self):
            return super().tap() * self.load

        @Output("V")
        def drop(self):
            return self.supply - self.tap()

    assert Loaded.layout.names == [
        "upper", "lower", "load", "heat_start", "supply", "heat", "tap", "drop", "der(heat)",
    ]  # fmt: skip
    assert Loaded().outputs() == [18.0, -10.0]
    assert Loaded().rates() == [18.0]
    assert Divider.layout.names == ["upper", "lower", "supply", "tap"]


def test_a_subclass_may_redeclare_a_default_in_place():
    class Other(Divider):
        upper = Parameter(5.0, "ohm")

    assert [p.name for p in Other.layout.parameters] == ["upper", "lower"]
    assert Other().tap() == 8.0 * 3.0 / 8.0
    assert Divider().upper == 1.0


def test_effects_stack_and_later_ones_see_earlier_ones():
    values = {"boost": True, "extra": 4.0, "factor": 3.0}
    inner = stack(Thermostat, Warmer, Doubled)(**values)
    outer = stack(Thermostat, Doubled, Warmer)(**values)
    assert inner.power() == (30.0 + 4.0) * 3.0
    assert outer.power() == 30.0 * 3.0 + 4.0
    assert Thermostat(boost=True).power() == 30.0


def test_effects_bring_their_own_variables_after_the_base():
    cls = stack(Thermostat, Warmer, Doubled)
    base = [p.name for p in Thermostat.layout.parameters]
    names = [p.name for p in cls.layout.parameters]
    assert names == [*base[:7], "extra", "factor", *base[7:9], "age_start", *base[9:]]
    assert [s.name for s in cls.layout.states] == ["temperature", "energy", "age"]
    assert cls().age == 2.0
    assert cls().rates()[2] == 1.0


def test_stacks_are_named_and_remember_their_parts():
    cls = stack(Thermostat, Warmer, Doubled)
    assert cls.name == "thermostat_with_warmer_with_doubled"
    assert cls.stacked == (Thermostat, (Warmer, Doubled))
    assert stack(Thermostat, Warmer, name="mine").name == "mine"
    assert cls.__doc__ == Thermostat.__doc__
    assert cls.experiment == (60.0, 0.5)
    assert cls.presets is Thermostat.presets


def test_stacking_on_a_stack_is_stacking_at_once():
    twice, once = stack(stack(Thermostat, Warmer), Doubled), stack(Thermostat, Warmer, Doubled)
    assert twice.stacked == once.stacked
    assert (twice.name, twice.__name__) == (once.name, once.__name__)
    assert twice.layout.names == once.layout.names
    assert stack(stack(Thermostat, Warmer, name="mine"), Doubled).name == "mine_with_doubled"


def test_an_effect_twice_is_refused():
    with pytest.raises(UserError, match="thermostat: effect 'warmer' is laid over it twice"):
        stack(Thermostat, Warmer, Warmer)
    with pytest.raises(UserError, match="'warmer' is laid over it twice"):
        stack(stack(Thermostat, Warmer), Doubled, Warmer)


def test_components_are_found_by_name():
    for name in fmus.COMPONENTS:
        assert fmus.component(name).name == name
    with pytest.raises(UserError, match="did you mean ppy_actuator"):
        fmus.component("ppy_actuater")


def test_variables_have_unique_names_and_proper_ranges():
    for cls in (Thermostat, Divider, Curved, *map(fmus.component, fmus.COMPONENTS)):
        assert len(set(cls.layout.names)) == len(cls.layout.names)
        for v in cls.layout.variables:
            assert v.min <= v.max
            assert v.nominal > 0
            if hasattr(v, "start"):
                assert v.min <= v.start <= v.max


def test_importing_the_kit_needs_the_standard_library_only():
    # -S: no site-packages at all
    code = "import sys; sys.path.insert(0, '.'); import fmus.kit, fmus.kit.slave, fmus.ppy_actuator.effects"
    subprocess.run([sys.executable, "-I", "-S", "-c", code], check=True)


def test_a_component_without_variables():
    class Empty(Component):
        name = "empty"

    assert Empty.layout.names == []
    assert Empty().rates() == Empty().outputs() == []
