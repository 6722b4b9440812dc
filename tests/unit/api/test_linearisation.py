"""Claims: ``ppy.linearise`` takes components, FMUs and systems, and hands on what is asked.

Oracles: thesis eqs. 3.4 and 3.9 on paper.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import orchestration as ppy
from fmus import component, effects
from fmus.kit import UserError, stack
from orchestration.system import library, ssp
from tests.support.archive import edited, of_other_laws

R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
POLE = -1.0 / ((R1 + R2) * C)


@pytest.mark.parametrize("form", ["name", "class", "file", "model"])
def test_a_model_is_given_in_any_form(form, tmp_path):
    given = {
        "name": lambda: "ppy_actuator",
        "class": lambda: component("ppy_actuator"),
        "file": lambda: ppy.build("ppy_actuator", tmp_path / "a.fmu"),
        "model": lambda: ppy.find_model("ppy_actuator"),
    }[form]()
    found = ppy.linearise(given, inputs="current", outputs="voltage")
    assert found.poles().tolist() == pytest.approx([POLE], rel=1e-12)
    assert found.method == "Jacobians of the laws"


@pytest.mark.parametrize("form", ["name", "system", "file"])
def test_a_system_is_given_in_any_form(form, tmp_path):
    system = library.system("dma_bench")
    if form == "file":
        ssp.write(system, tmp_path / "bench.ssp")
    given = {"name": "dma_bench", "system": system, "file": tmp_path / "bench.ssp"}[form]
    found = ppy.linearise(given, {"force_reference": 1.0}, at="1 s", cut="bench.force_filtered")
    assert round(found.margins().phase, 1) == 70.2


def test_an_extended_model_and_its_fmu_are_models(tmp_path):
    extended = stack(
        component("ppy_actuator"),
        effects("ppy_actuator")["strain_saturation"],
        defaults={"strain_saturation_coefficient": 0.05},
    )
    built = tmp_path / "extended.fmu"
    ppy.build(extended, built)
    still = ppy.linearise(built, inputs="current", outputs="displacement")
    moved = ppy.linearise(
        extended, {"current": 1.0}, at=10.0, inputs="current", outputs="displacement"
    )

    def gain(model):
        return abs(model.response(np.array([1e-4]))[0])

    assert gain(still) == pytest.approx(ALPHA * R2 * C, rel=1e-4)
    assert gain(moved) < 0.9 * gain(still)


def test_an_equilibrium_with_units():
    found = ppy.linearise(
        "ppy_actuator", trim=True, fix={"displacement": "0.1 mm"}, free=["current"]
    )
    assert found.point.inputs["current"] == pytest.approx(1e-4 / (ALPHA * R2 * C), rel=1e-9)
    with pytest.raises(ppy.UserError, match=r"fix=.* cannot be converted"):
        ppy.linearise("ppy_actuator", trim=True, fix={"displacement": "0.1 N"}, free=["current"])
    with pytest.raises(ppy.UserError, match=r"no signal named 'displacment' \(did you mean"):
        ppy.linearise("ppy_actuator", trim=True, fix={"displacment": 1e-4})
    with pytest.raises(ppy.UserError, match=r"fix= is of an equilibrium: add trim=True"):
        ppy.linearise("ppy_actuator", fix={"displacement": 1e-4})


def test_an_output_of_a_system_is_fixed_by_its_name():
    moving = ["bench.position", "bench.position_filtered", "actuator.maxwell_elongation"]
    found = ppy.linearise(
        "dma_bench",
        {"force_reference": 0.5},
        at=1.0,
        trim=True,
        fix={"tension": 1.0},
        free=["force_reference"],
        drift=moving,
    )
    assert found.point.inputs["force_reference"] == pytest.approx(1.0, rel=1e-9)
    assert any(line.startswith("bench.position drifts by") for line in found.notes)


def test_several_operating_points_and_a_band():
    found = ppy.linearise(
        "ppy_actuator",
        {"current": 0.5},
        at=[0.0, "2 s"],
        over={"C": [2.0, 4.0]},
        inputs="current",
        outputs="voltage",
    )
    times = [found.point.time, *(one.point.time for one in found.further)]
    assert times == [0.0, 2.0]
    charge = 0.5 * R2 * C * (1.0 - np.exp(2.0 * POLE))
    assert found.further[0].point.states["charge"] == pytest.approx(charge, rel=1e-7)
    poles = [float(one.poles()[0].real) for one in found.variations]
    assert poles == pytest.approx([-1.0 / ((R1 + R2) * c) for c in (2.0, 4.0)], rel=1e-12)
    drawn = ppy.linearise("ppy_actuator", over={"C": "2..4"}, samples=7)
    assert len(drawn.variations) == 7
    assert all(2.0 <= one.point.parameters["C"] <= 4.0 for one in drawn.variations)


def test_a_band_of_a_fit(tmp_path):
    fitted = {
        "parameters": {"C": {"value": 3.0, "ci95": [2.9, 3.1], "unit": "F", "logarithmic": False}},
        "correlations": [],
    }
    (tmp_path / "fit.json").write_text(json.dumps({"set": {}, "fitted": fitted}))
    found = ppy.linearise("ppy_actuator", fitted=tmp_path / "fit.json", samples=400)
    drawn = np.array([one.point.parameters["C"] for one in found.variations])
    assert (drawn.mean(), drawn.std()) == pytest.approx((3.0, 0.1 / 1.96), rel=0.1)
    assert found.point.parameters["C"] == pytest.approx(3.0, rel=1e-12)
    given = ppy.linearise("ppy_actuator", fitted=tmp_path / "fit.json", settings={"C": 2.0})
    assert given.point.parameters["C"] == 2.0


def test_inputs_that_vary_need_their_instants():
    time = np.linspace(0.0, 4.0, 401)
    found = ppy.linearise(
        "ppy_actuator", {"current": lambda t: np.where(t < 2.0, 0.5, 0.0)}, time=time, at=3.0
    )
    charge = 0.5 * R2 * C * (1.0 - np.exp(2.0 * POLE)) * np.exp(POLE)
    assert found.point.states["charge"] == pytest.approx(charge, rel=1e-6)
    with pytest.raises(ppy.UserError, match="current: inputs that vary need time="):
        ppy.linearise("ppy_actuator", {"current": np.zeros(3)}, at=3.0)


def test_a_communication_step_is_part_of_the_model():
    found = ppy.linearise("ppy_actuator", step="0.1 s", inputs="current", outputs="voltage")
    assert found.period == 0.1
    assert found.poles().tolist() == pytest.approx([np.exp(0.1 * POLE)], rel=1e-12)


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf])
def test_a_step_that_is_no_time_is_refused(step):
    with pytest.raises(ppy.UserError, match=r"step=.*: a time above 0 s"):
        ppy.linearise("ppy_actuator", step=step)


def test_values_that_are_given_and_drawn_do_not_mix():
    with pytest.raises(ppy.UserError, match="over=: C has its values, and others are drawn"):
        ppy.linearise("ppy_actuator", over={"C": "2..4:3", "R1": "0.3..0.7"})


def test_an_fmu_without_equations(lag):
    found = ppy.linearise(lag, settings={"tau": 0.5}, step=0.1)
    assert found.poles().tolist() == pytest.approx([np.exp(-0.2)], rel=1e-6)
    with pytest.raises(ppy.UserError, match="trim=True needs the equations of a component"):
        ppy.linearise(lag, trim=True)
    with pytest.raises(ppy.UserError, match="cut='x': no state and no connection of this name"):
        ppy.linearise(lag, cut="x")
    with pytest.raises(ppy.UserError, match="u: inputs that vary need time="):
        ppy.linearise(lag, {"u": np.zeros(3)})


def test_a_member_of_other_laws_is_linearised_from_outside(tmp_path):
    from orchestration.system import Member, Port, System

    path = edited(ppy.find_model("ppy_actuator").path, tmp_path / "old.fmu", of_other_laws)
    fed = {"current": (Port("film", "current"),)}
    alone = System("alone", (Member("film", path),), (), fed, {"volts": Port("film", "voltage")})
    found = ppy.linearise(alone, inputs="current", outputs="volts")
    assert found.method == "directional derivatives of the FMU"
    assert found.poles().tolist() == pytest.approx([POLE], rel=1e-9)
    assert any("old.fmu" in note for note in found.notes)


@pytest.mark.parametrize(
    "of_equations",
    [{"fix": {"x": 1.0}}, {"free": ["u"]}, {"drift": ["x"]}, {"preset": "worn"}],
    ids=lambda given: next(iter(given)),
)
def test_what_needs_equations_is_not_passed_over(lag, of_equations):
    (name,) = of_equations
    with pytest.raises(UserError, match=rf"; {name}=.* needs the equations of a component"):
        ppy.linearise(lag, **of_equations)


def test_a_cut_has_its_own_signals():
    with pytest.raises(ppy.UserError, match=r"cut='bench\.tension' has its own input and output"):
        ppy.linearise("dma_bench", cut="bench.tension", inputs="current")


def test_no_values_are_no_band():
    with pytest.raises(UserError, match="samples=0: from 1 to 10,000"):
        ppy.linearise("ppy_actuator", over={"k1": "4e3..8e3"}, samples=0)


def test_a_band_is_of_as_many_models_as_can_be_kept():
    with pytest.raises(UserError, match="samples=1000000000: from 1 to 10,000"):
        ppy.linearise("ppy_actuator", over={"k1": "4e3..8e3"}, samples=10**9)


def test_values_are_drawn_of_something():
    with pytest.raises(UserError, match="samples=5: nothing is drawn without over= or fitted="):
        ppy.linearise("ppy_actuator", samples=5)


def test_an_operating_point_lies_within_what_drives():
    time = np.arange(11.0)
    driven = {"current": 0.1 * time}
    assert ppy.linearise("ppy_actuator", driven, time=time, at=10.0).point.time == 10.0
    with pytest.raises(UserError, match="at='11': the inputs that vary end at 10 s"):
        ppy.linearise("ppy_actuator", driven, time=time, at=[2.0, 11.0])
