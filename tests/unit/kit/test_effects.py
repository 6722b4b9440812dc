"""Effects: stacked, named, refused where they do not fit, and made anew."""

import pytest

from fmus.kit import Component, Effect, Input, Output, Parameter, Term, UserError, stack
from fmus.kit.curves import curve
from fmus.kit.effects import effect_maker, made_by, made_with, make_effect, unstack
from fmus.kit.inputs import dead_zone
from fmus.kit.layout import law_of
from fmus.kit.sensors import sensor_gain
from tests.support.kit_samples import Divider, Doubled, Thermostat, Warmer


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
    assert cls.presets == Thermostat.presets


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
    ]
    assert [e.output for e in effects] == ["", "", output_name]
    assert all(isinstance(e.id, str) and isinstance(e.term, Term) for e in effects)
    at = {input_name: 3.0}
    expected = [2 * 3.0 + 0.5 * 9.0, 2 * 2.5, 0.5 * 6.0]
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


def test_the_parameter_that_switches_an_effect_is_tunable_unless_it_is_declared_not_to_be():
    class Tuned(Effect):
        id = "tuned"
        neutral = "size"

        size = Parameter(0.0, "1")
        width = Parameter(1.0, "1")

    class Held(Effect):
        id = "held"
        neutral = "duration"

        duration = Parameter(0.0, "s", tunable=False)

    parameters = stack(
        Divider, Tuned, Held, defaults={"size": 2.0, "duration": 1.0}
    ).layout.parameters
    assert {p.name for p in parameters if p.tunable} == {"size"}
