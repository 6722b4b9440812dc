"""Line 13: tunable parameters are taken between steps, act from there on, are part of the state."""

from __future__ import annotations

import math

import fmpy
import pytest

from fmus import COMPONENTS, component
from fmus.kit.build.building import RUNTIMES
from tests.contract import checks
from tests.contract.models import Tuned
from tests.contract.raw import ERROR, OK, Instance, doubles, instance, integers
from tests.support.pace import slow_but

each_build = pytest.mark.parametrize("runtime", RUNTIMES)
WITH_TUNABLE = [n for n in COMPONENTS if any(p.tunable for p in component(n).layout.parameters)]


@pytest.fixture
def tuned(built, runtime):
    """Open an instance that has made two steps of half a second."""
    with instance(built(Tuned, runtime)) as one:
        one.initialize({"u": 1.0, "gain": 2.0})
        one.step(0.5)
        one.step(0.5)
        yield one


def put(one: Instance, values: dict[str, float]) -> int:
    return one.call(
        "fmi2SetReal", one.references(list(values)), len(values), doubles(*values.values())
    )


@each_build
def test_the_description_names_them(built, runtime):
    description = fmpy.read_model_description(str(built(Tuned, runtime)))
    varying = {v.name for v in description.modelVariables if v.variability == "tunable"}
    assert varying == {"gain", "step", "counts"}


@each_build
def test_a_new_value_acts_from_the_communication_point_on(tuned):
    """A rate of 2 for a second, then of 5; samples each quarter that count 1, then 3, then none."""
    assert tuned.get("x", "count", "product") == pytest.approx([2.0, 4.0, 2.0], abs=1e-12)
    held = tuned.get("x", "count")
    tuned.set({"gain": 5.0, "step": 3})
    assert tuned.get("x", "count") == held
    assert tuned.get("product", "der(x)") == [5.0, 5.0]
    tuned.step(0.5)
    assert tuned.get("x", "count") == pytest.approx([4.5, 10.0], abs=1e-12)
    tuned.set({"counts": 0, "gain": 0.0})
    tuned.step(0.5)
    assert tuned.get("x", "count") == pytest.approx([4.5, 10.0], abs=1e-12)


@each_build
def test_out_of_range_nothing_changes(tuned):
    before = tuned.everything()
    for value in (10.5, -0.5, math.nextafter(10.0, 11.0)):
        assert put(tuned, {"u": 7.0, "gain": value}) == ERROR
    assert tuned.call("fmi2SetInteger", tuned.references(["step"]), 1, integers(10)) == ERROR
    assert tuned.messages == [
        "parameter 'gain' = 10.5 1/s is outside its range [0, 10] 1/s",
        "parameter 'gain' = -0.5 1/s is outside its range [0, 10] 1/s",
        "parameter 'gain' = 10 1/s is outside its range [0, 10] 1/s",
        "parameter 'step' = 10 is outside its range [0, 9]",
    ]
    assert put(tuned, {"gain": math.nan}) == ERROR
    assert tuned.everything() == before
    tuned.step(0.5)


@each_build
def test_others_are_fixed(tuned):
    before = tuned.everything()
    for name in ("period", "x_start"):
        assert put(tuned, {"gain": 3.0, name: 0.5}) == ERROR
        assert tuned.messages[-1].endswith(f"parameter '{name}' cannot be set after initialization")
    assert tuned.everything() == before


@each_build
def test_they_belong_to_the_state(tuned):
    tuned.set({"gain": 5.0})
    state, time = tuned.save(), tuned.time
    tuned.step(0.25)
    expected = tuned.everything()
    tuned.set({"gain": 7.0})
    tuned.step(0.25)
    tuned.restore(state)
    tuned.time = time
    assert tuned.get("gain", "product") == [5.0, 5.0]
    tuned.step(0.25)
    assert tuned.everything() == expected
    tuned.forget(state)
    tuned.do("fmi2Reset")
    assert tuned.initialize().get("gain") == [2.0]


@each_build
def test_after_an_error_or_the_end_nothing_is_taken(tuned):
    tuned.do("fmi2Terminate")
    assert put(tuned, {"gain": 3.0}) == ERROR
    assert tuned.messages[-1] == "fmi2SetReal is not allowed after termination"


@pytest.mark.parametrize(
    ("name", "runtime"),
    slow_but([(n, r) for n in WITH_TUNABLE for r in RUNTIMES], ("pid", "native")),
)
def test_every_bound_holds_in_a_run(archive):
    checked = 0
    with instance(archive) as one:
        one.initialize()
        one.step(one.library.step)
        for name, unit, low, high in checks.ranges(archive):
            kind = one.variables[name][1]
            if one.library.variability[name] != "tunable" or kind != "Real":
                continue
            before = one.everything()
            for bound, sign in ((low, -1), (high, 1)):
                value = checks.beyond(bound, sign, kind)
                if math.isfinite(value):
                    assert put(one, {name: value}) == ERROR
                    assert (
                        f"parameter '{name}' = {value:.10g}{unit} is outside its range"
                        in (one.messages[-1])
                    )
                    assert one.everything() == before
                    assert put(one, {name: bound}) == OK
                    assert one.get(name) == [bound]
                    one.set({name: before[list(one.variables).index(name)]})
                    checked += 1
    assert checked
