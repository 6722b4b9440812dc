"""Claims: a component holds its values, and effects laid over it change its laws."""

import subprocess
import sys

import pytest

import fmus
from fmus.kit import Component, Output, Parameter, State, UserError, stack
from fmus.kit.build.provenance import effect_name
from tests.support.kit_samples import Divider, Thermostat


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
        "upper",
        "lower",
        "load",
        "heat_start",
        "supply",
        "heat",
        "tap",
        "drop",
        "der(heat)",
    ]
    assert Loaded().outputs() == [18.0, -10.0]
    assert Loaded().rates() == [18.0]
    assert Divider.layout.names == ["upper", "lower", "supply", "tap"]


def test_a_subclass_may_redeclare_a_default_in_place():
    class Other(Divider):
        upper = Parameter(5.0, "ohm")

    assert [p.name for p in Other.layout.parameters] == ["upper", "lower"]
    assert Other().tap() == 8.0 * 3.0 / 8.0
    assert Divider().upper == 1.0


def test_components_are_found_by_name():
    for name in fmus.COMPONENTS:
        assert fmus.component(name).name == name
    with pytest.raises(UserError, match="did you mean ppy_actuator"):
        fmus.component("ppy_actuater")


def test_effects_are_found_by_the_name_of_their_component():
    for name in fmus.COMPONENTS:
        for key, effect in fmus.effects(name).items():
            assert key == effect_name(effect)
            assert effect.neutral in effect.declared
            assert effect.assumption
            assert stack(fmus.component(name), effect).name.startswith(f"{name}_with_{effect.id}")
    with pytest.raises(UserError, match="no component named 'x'"):
        fmus.effects("x")
    assert fmus.effects("rig_proxy") == {}


def test_importing_the_kit_needs_the_standard_library_only():
    # -S: no site-packages at all
    code = (
        "import sys; sys.path.insert(0, '.'); import fmus.kit, fmus.kit.slave,"
        " fmus.ppy_actuator.effects"
    )
    subprocess.run([sys.executable, "-I", "-S", "-c", code], check=True)


def test_a_component_without_variables():
    class Empty(Component):
        name = "empty"

    assert Empty.layout.names == []
    assert Empty().rates() == Empty().outputs() == []
