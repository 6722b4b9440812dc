"""Claims: a model knows its signals from the description alone, and reads settings with their
units.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

import numpy as np
import pytest

import orchestration as ppy
from fmus import component, effects
from fmus.kit import UserError, stack
from fmus.kit.build import build_cached
from fmus.kit.inputs import dead_zone
from fmus.kit.law_terms import LawTerm, law_term_effect
from fmus.kit.symbolic import trace
from fmus.kit.units import format_value
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model.model import built, declared_model, find_class, find_model
from orchestration.fmu.simulation import simulate, simulate_instance
from tests.support.archive import anonymous, edited
from tests.support.other_laws import built_by, package_with


def test_a_start_value_that_is_none_is_refused(fmu, tmp_path):
    path = edited(
        fmu("ppy_actuator", "native"),
        tmp_path / "other.fmu",
        lambda n, c: (n, c.replace(b'"0.43"', b'"0x1"')),
    )
    with pytest.raises(UserError) as caught:
        find_model(str(path))
    assert str(caught.value) == f"{path}: modelDescription.xml: R1: start '0x1' is no number"


def test_a_model_knows_its_signals_from_the_description_alone(fmu, tmp_path):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "ppy_actuator.fmu", anonymous)
    model = find_model(str(path))
    assert (model.name, model.cls, model.path) == ("ppy_actuator.fmu", None, Path(path))
    alpha = model.parameters["alpha"]
    assert (alpha.unit, alpha.display, alpha.start, alpha.min, alpha.max) == (
        "m/C",
        "mm/C",
        6.8e-5,
        -1.0,
        1.0,
    )
    assert format_value(6.8e-5, alpha) == "0.068 mm/C"
    assert list(model.inputs) == ["current", "force"]
    assert "displacement" in model.outputs


def test_a_model_is_a_line_and_in_a_notebook_a_table_of_its_variables(fmu):
    model = find_model(str(fmu("ppy_actuator", "native")))
    assert repr(model).startswith("<Model ppy_actuator.fmu: current, force -> ")
    assert len(repr(model)) <= 102
    page = model._repr_html_()
    variables = (*model.inputs, *model.outputs, *model.parameters)
    assert page.count("<tr>") == 1 + len(variables)
    assert all(f">{name}</td>" in page for name in variables)
    assert ">0.068 mm/C</td>" in page


def test_settings_are_read_with_their_units(fmu, tmp_path):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", anonymous)
    model = find_model(str(path))
    texts = ["R1=610mohm", "k1 = 6.3[N/mm]", "b1=1.5e6", "alpha=-0.05 mm/C", "current=.5"]
    assert model.settings(texts) == pytest.approx(
        {"R1": 0.61, "k1": 6300.0, "b1": 1.5e6, "alpha": -5e-5, "current": 0.5}
    )
    with pytest.raises(UserError, match="no preset named 'five_layer'; there are: none"):
        model.settings([], "five_layer")
    own = find_model("ppy_actuator")
    values = own.settings(["R1=2"], "five_layer")  # a setting goes over the preset
    assert (values["R1"], values["C"]) == (2.0, 0.46)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("stages=2.7", "2.7 is not a whole number from -2147483648 to 2147483647"),
        ("stages=3e9", "3000000000 is not a whole number"),
        ("stages=6", "6 is out of range; allowed is 1 … 5"),
        ("enabled=0.5", "0.5 is neither true (1) nor false (0)"),
        ("boost=2", "2 is neither true (1) nor false (0)"),
        ("boost=maybe", "'maybe' is not a number with an optional unit (nor true or false)"),
        ("heater=true", "'true' is not a number with an optional unit"),
    ],
)
def test_settings_that_their_type_cannot_hold_are_refused(thermostat, setting, told):
    name, _, value = setting.partition("=")
    with pytest.raises(UserError) as caught:
        find_model(str(thermostat)).settings([setting])
    assert str(caught.value).startswith(f"settings={{{name!r}: {value!r}}}: {told}")


def test_settings_of_integers_and_booleans_arrive(thermostat):
    """With n heaters of p on, the power is n p, and one more with the boost."""
    model = find_model(str(thermostat))
    values = model.settings(
        ["stages=3", "enabled=false", "on_start=true", "heater=0.05kW", "boost=1"]
    )
    assert values == {"stages": 3.0, "enabled": 0.0, "on_start": 1.0, "heater": 50.0, "boost": 1.0}
    assert format_value(values["enabled"], model.parameters["enabled"]) == "false"
    assert format_value(values["stages"], model.parameters["stages"]) == "3"
    with Fmu(thermostat, values) as instance:
        instance.start()
        boost = {"boost": np.array([1.0, 0.0, 1.0])}
        power = simulate_instance(instance, np.array([0.0, 0.1, 0.2]), boost, ["power", "on"])
    assert power["power"].tolist() == [
        200.0,
        0.0,
        50.0,
    ]  # at the first sample instant the heater, disabled, goes off
    assert power["on"].tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize("name", ["ppy_actuator", "galvanostat", "foot", "rig_proxy"])
def test_a_model_that_is_declared_has_the_signals_of_its_fmu(name):
    declared, made = declared_model(name), find_model(name, "python")
    assert dict(declared.inputs) == dict(made.inputs)
    assert dict(declared.outputs) == dict(made.outputs)
    assert list(declared.parameters) == list(made.parameters)
    assert declared.title == made.title
    assert built(declared, "python") == made


def test_an_fmu_has_no_other_build_to_choose(fmu):
    path = str(fmu("galvanostat", "python"))
    for runtime in ("native", "python"):
        with pytest.raises(UserError) as refused:
            find_model(path, runtime)
        told = f"runtime='{runtime}': galvanostat.fmu is taken as it is; only components are built"
        assert str(refused.value) == told


def test_effects_are_declared_as_they_are_built():
    effects = ["strain_saturation", "sensor_lag(voltage)"]
    declared = declared_model("ppy_actuator", effects)
    assert declared.effects == tuple(effects)
    assert dict(declared.outputs) == dict(find_model("ppy_actuator", "python", effects).outputs)


# --- laws that are those of today, and others
# -----------------------------------------------------------------------------------------

BUILDS = [("native", 2), ("python", 2), ("native", 3)]
EFFECTS = [(), ("strain_saturation",)]
DOUBLED = {
    "of the component": (
        "model.py",
        "return self.alpha * charge",
        "return 2 * self.alpha * charge",
    ),
    "of the effect": (
        "effects/coupling.py",
        "square = self.strain_saturation_coefficient *",
        "square = 2.0 * self.strain_saturation_coefficient *",
    ),
}


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """Return copies of the package, in which laws may be others."""

    @functools.cache
    def changed(what=None):
        file, *texts = DOUBLED.get(what, ("",))
        place = file and f"ppy_actuator/{file}"
        return package_with(tmp_path_factory.mktemp("package"), place, *texts)

    return changed


@pytest.mark.parametrize(("runtime", "fmi"), BUILDS)
@pytest.mark.parametrize("added", EFFECTS, ids=["plain", "stacked"])
def test_an_fmu_of_the_laws_of_today_has_its_class_with_the_values_it_has(
    package, tmp_path, added, runtime, fmi
):
    path = built_by(package(), tmp_path / "a.fmu", added, runtime, fmi)
    model = find_model(str(path))
    assert model.notes == ()
    assert model.cls().R1 == 0.43
    other = edited(path, tmp_path / "o.fmu", lambda n, c: (n, c.replace(b'"0.43"', b'"0.6"')))
    assert find_model(str(other)).cls().R1 == 0.6
    assert ppy.linearise(other).method == "Jacobians of the laws"


@pytest.mark.parametrize(("runtime", "fmi"), BUILDS)
@pytest.mark.parametrize(
    ("added", "what"),
    [
        ((), "of the component"),
        pytest.param(("strain_saturation",), "of the component", marks=pytest.mark.slow),
        (("strain_saturation",), "of the effect"),
    ],
)
def test_an_fmu_of_other_laws_is_an_fmu_without_equations(
    package, tmp_path, added, what, runtime, fmi
):
    path = built_by(package(what), tmp_path / "old.fmu", added, runtime, fmi)
    model = find_model(str(path))
    assert model.cls is None
    told = (
        "old.fmu was made from ppy_actuator, but its laws have changed since the FMU was"
        " built; it serves as an FMU without equations"
    )
    assert model.notes == (told,)
    refusals = [
        lambda: find_class(str(path)),
        lambda: ppy.optimise(str(path), {"R1": "0.3..0.5"}, maximise=["voltage"]),
        lambda: ppy.linearise(path, trim=True),
    ]
    for call in refusals:
        with pytest.raises(UserError, match="but its laws have changed since"):
            call()
    if runtime == "native":
        linear = ppy.linearise(path)
        assert (linear.method, linear.notes) == ("directional derivatives of the FMU", (told,))
    if not added:
        time = np.array([0.0, 1.0])
        ours, old = (
            simulate(of, time, {"current": np.ones(2), "force": np.zeros(2)}, {})
            for of in (find_model("ppy_actuator"), model)
        )
        own = ours["electrochemical_displacement"]
        assert old["electrochemical_displacement"] == pytest.approx(2.0 * own, rel=1e-9)


@pytest.mark.parametrize("added", EFFECTS, ids=["plain", "stacked"])
def test_an_fmu_that_does_not_tell_its_laws_is_one_without_equations(tmp_path, added):
    """As builds were whose provenance had no digest yet."""
    made = find_model("ppy_actuator", effects=added).path
    path = edited(
        made, tmp_path / "old.fmu", lambda n, c: (n, re.sub(rb' laws="[0-9a-f]{64}"', b"", c))
    )
    model = find_model(str(path))
    assert model.cls is None
    (note,) = model.notes
    assert note.startswith("old.fmu was made from ppy_actuator, but its description has no digest")


@pytest.mark.parametrize("sampling", [b'step="x" duration="60"', b'step="0.1"'])
def test_a_sampling_that_is_not_two_numbers_leaves_an_fmu_without_equations(tmp_path, sampling):
    made = find_model("ppy_actuator", effects=["transport_delay(voltage)"]).path
    effect = b'<Effect name="transport_delay(voltage)"'
    path = edited(
        made, tmp_path / "old.fmu", lambda n, c: (n, c.replace(effect, effect + b" " + sampling))
    )
    model = find_model(str(path))
    assert model.cls is None
    (note,) = model.notes
    assert note.startswith("old.fmu records how it was built, but the effect transport_delay(")
    assert "must be two numbers, in s" in note


def test_an_effect_of_a_user_is_not_taken_for_ours_of_the_same_name(tmp_path):
    ours = effects("ppy_actuator")["strain_saturation"]

    class Doubled(ours):
        def charge_elongation(self, charge):
            return 2.0 * super().charge_elongation(charge)

    made = build_cached(stack(component("ppy_actuator"), Doubled), "native")
    model = find_model(str(made))
    assert model.cls is None
    assert "but its laws have changed" in model.notes[0]


def test_an_fmu_that_tells_no_origin_is_anybody_s(fmu, tmp_path):
    model = find_model(
        str(edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", anonymous))
    )
    assert (model.cls, model.notes) == (None, ())


TERM = LawTerm(
    "charge_elongation", "charge", "root", "none", "elongation_of_charge", "m", "C", 0.0, 1e-4, 2.0
)
LAG = LawTerm("terminal_voltage", "current", "linear", "lag", "second_pair", "ohm", "A", 1.0)


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_an_fmu_with_terms_of_its_laws_keeps_its_equations(tmp_path, runtime):
    """As a diagnosis makes them, after an effect by name, of the catalogue or of an input."""
    base = component("ppy_actuator")
    zone = dead_zone(base, "current")
    named = (effects("ppy_actuator")["strain_saturation"], zone)
    made = stack(base, *named)
    terms = (law_term_effect(made, term.law, term) for term in (TERM, LAG))
    values = {"R1": 0.5, "second_pair": 0.3, "second_pair_time": 40.0, TERM.stem: -2e-5}
    cls = stack(made, *terms, name="extended", defaults=values)
    cls.remark = "Fitted to record.csv"
    path = tmp_path / "extended.fmu"
    path.write_bytes(build_cached(cls, runtime).read_bytes())
    model = find_model(str(path))
    assert model.cls is not None
    assert trace(model.cls).digest == trace(cls).digest
    assert {name: model.cls.declared[name].start for name in values} == values
    assert model.cls.remark == cls.remark
