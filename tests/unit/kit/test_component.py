"""Claims: a component holds its values, and effects laid over it change its laws."""

import subprocess
import sys

import pytest

import fmus
from fmus.kit import (
    Component,
    Effect,
    Input,
    Output,
    Parameter,
    SignalTerm,
    State,
    Term,
    UserError,
    correction,
    curve,
    effect_maker,
    law_of,
    made_by,
    made_with,
    make_effect,
    stack,
    unstack,
)
from fmus.kit.build.provenance import effect_name
from fmus.kit.inputs import dead_zone
from fmus.kit.sensors import sensor_gain
from tests.support.kit_samples import Divider, Doubled, Thermostat, Warmer


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
    assert unstack(cls) == (Thermostat, (Warmer, Doubled))
    assert stack(Thermostat, Warmer, name="mine").name == "mine"
    assert cls.__doc__ == Thermostat.__doc__
    assert cls.experiment == (60.0, 0.5)
    assert cls.presets is Thermostat.presets


def test_a_long_name_is_cut_and_stays_its_own():
    many = [
        type(f"Effect{k}", (Effect,), {"id": f"a_rather_long_identifier_{k}"}) for k in range(12)
    ]
    name, other = stack(Thermostat, *many).name, stack(Thermostat, *many[::-1]).name
    assert name != other
    assert max(len(name), len(other)) <= 120
    assert name.startswith("thermostat_with_a_rather_long_identifier_0_with_")


def test_stacking_on_a_stack_is_stacking_at_once():
    twice, once = stack(stack(Thermostat, Warmer), Doubled), stack(Thermostat, Warmer, Doubled)
    assert unstack(twice) == unstack(once)
    assert (twice.name, twice.__name__) == (once.name, once.__name__)
    assert twice.layout.names == once.layout.names
    assert stack(stack(Thermostat, Warmer, name="mine"), Doubled).name == "mine_with_doubled"


def test_a_stack_may_have_other_defaults():
    values = {
        "loss": 0.7,
        "temperature_start": 280.0,
        "stages": 3,
        "enabled": False,
        "factor": 4.0,
        "age_start": 9.0,
    }
    cls = stack(Thermostat, Warmer, Doubled, defaults=values)
    plain = stack(Thermostat, Warmer, Doubled)
    starts = {p.name: p.start for p in plain.layout.parameters}
    assert {p.name: p.start for p in cls.layout.parameters} == starts | values
    assert cls.layout.names == plain.layout.names
    assert (cls().temperature, cls().age) == (280.0, 9.0)
    assert Thermostat().loss == plain().loss == 0.5, "others keep theirs"


def test_other_defaults_stay_when_more_is_laid_over():
    mended = stack(Thermostat, name="mended", defaults={"loss": 0.7, "capacity": 30.0})
    mended.remark = "Mended"
    cls = stack(mended, Warmer, defaults={"capacity": 40.0})
    assert (cls().loss, cls().capacity, cls.remark, cls.name) == (
        0.7,
        40.0,
        "Mended",
        "mended_with_warmer",
    )
    assert Thermostat.remark == ""


def test_defaults_that_cannot_be_are_refused():
    with pytest.raises(
        UserError, match=r"thermostat: no parameter named 'los' \(did you mean loss\?\)"
    ):
        stack(Thermostat, defaults={"los": 1.0})
    with pytest.raises(
        UserError, match=r"variable 'capacity' starts at 0 J/K, outside its range, 0\.001 to 1e"
    ):
        stack(Thermostat, defaults={"capacity": 0.0})


def test_an_effect_twice_is_refused():
    with pytest.raises(UserError, match="thermostat: effect 'warmer' is laid over it twice"):
        stack(Thermostat, Warmer, Warmer)
    with pytest.raises(UserError, match="'warmer' is laid over it twice"):
        stack(stack(Thermostat, Warmer), Doubled, Warmer)


def test_two_effects_of_one_id_are_refused():
    class Other(Effect):
        id = "warmer"

    with pytest.raises(UserError, match="thermostat: effect 'warmer' is laid over it twice"):
        stack(Thermostat, Warmer, Other)


def test_a_variable_of_two_classes_is_refused():
    class Reheated(Effect):
        id = "reheated"
        extra = Parameter(0.0, "W")

    class Shadow(Effect):
        id = "shadow"
        loss = Parameter(0.0, "W/K")

    class Startled(Effect):
        id = "startled"
        temperature_start = Parameter(0.0, "K")

    with pytest.raises(
        UserError, match="thermostat: Warmer and Reheated both declare variable 'extra'"
    ):
        stack(Thermostat, Warmer, Reheated)
    with pytest.raises(
        UserError, match="thermostat: Thermostat and Shadow both declare variable 'loss'"
    ):
        stack(Thermostat, Shadow)
    with pytest.raises(UserError, match="variable 'temperature_start' is declared twice"):
        stack(Thermostat, Startled)


def test_effects_may_share_what_one_base_declares():
    class Shared(Effect):
        size = Parameter(0.0, "1")

    class One(Shared):
        id = "one"

    class Two(Shared):
        id = "two"

    assert [p.name for p in stack(Divider, One, Two).layout.parameters] == [
        "upper",
        "lower",
        "size",
    ]


def test_components_are_found_by_name():
    for name in fmus.COMPONENTS:
        assert fmus.component(name).name == name
    with pytest.raises(UserError, match="did you mean ppy_actuator"):
        fmus.component("ppy_actuater")


def test_effects_are_found_by_the_name_of_their_component(monkeypatch):
    for name in fmus.COMPONENTS:
        for key, effect in fmus.effects(name).items():
            assert key == effect_name(effect)
            assert effect.neutral in effect.declared
            assert effect.assumption
            assert stack(fmus.component(name), effect).name.startswith(f"{name}_with_{effect.id}")
    with pytest.raises(UserError, match="no component named 'x'"):
        fmus.effects("x")
    monkeypatch.setitem(fmus.MODELS, "plain", "kit.component:Component")
    assert fmus.effects("plain") == {}


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


SAID = ["output", "id", "term", "neutral", "assumption"]


@pytest.mark.parametrize("name", SAID)
@pytest.mark.parametrize("kind", ["law", "input", "output"])
def test_effects_leave_laws_and_inputs_whatever_they_are_called(name, kind):
    law, fed, shown = ({"law": 0, "input": 1, "output": 2}[kind] == k for k in range(3))
    law_name = name if law else "doubled"
    input_name = name if fed else "u"
    output_name = name if shown else "y"

    def value(self):
        return 2.0 * getattr(self, input_name)

    def seen(self):
        return getattr(self, law_name)()

    body = {
        "name": "named",
        input_name: Input("V"),
        law_name: value,
        output_name: Output("V")(seen),
    }
    base = type("Named", (Component,), body)
    effects = [
        curve(base, law_name, input_name, "quadratic"),
        dead_zone(base, input_name),
        sensor_gain(base, output_name),
        correction(base, law_name, SignalTerm(input_name), "quadratic"),
    ]
    assert [e.output for e in effects] == ["", "", output_name, ""]
    assert all(isinstance(e.id, str) and isinstance(e.term, Term) for e in effects)
    at = {input_name: 3.0}
    expected = [2 * 3.0 + 0.5 * 9.0, 2 * 2.5, 0.5 * 6.0, 2 * 3.0 + 0.5 * 9.0]
    for effect, of_it in zip(effects, expected, strict=True):
        one = stack(base, effect)(**{effect.neutral: 0.5}, **at)
        assert one.outputs() == pytest.approx([of_it])
        assert stack(base, effect)(**at).outputs() == [6.0]
    everything = stack(base, *effects)
    assert law_of(everything, law_name) is not None
    assert made_with(effects[0])["law"] == law_name
    assert [e.neutral for e in unstack(everything)[1]] == [e.neutral for e in effects]


@effect_maker
def louder(component, law, factor=2.0, *, names=("gain",)):
    """Return an effect that does nothing, as long as it is known how it was made."""
    return make_effect("Louder", {names[0]: Parameter(factor, "1")}, id="louder", neutral=names[0])


def test_an_effect_has_all_arguments_by_which_it_is_made_anew_however_they_were_given():
    by_position = louder(Divider, "tap", 3.0)
    by_name = louder(component=Divider, names=("gain",), factor=3.0, law="tap")
    expected = {"law": "tap", "factor": 3.0, "names": ("gain",)}
    for effect in (by_position, by_name):
        assert made_by(effect) is louder
        assert list(made_with(effect).items()) == list(expected.items())
        again = louder(Divider, **made_with(effect))
        assert again.declared["gain"].start == effect.declared["gain"].start == 3.0
