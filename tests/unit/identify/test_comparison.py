"""Claims: the figures of a comparison are those of its definition, in plain JSON.

Gaps are left out.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from fmus.kit import UserError
from orchestration.experiment.waveforms import multilevel
from orchestration.fmu import simulation as simulate
from orchestration.fmu.model import find_model
from orchestration.identify import comparison as comparing
from orchestration.identify.fitting import Assumptions
from orchestration.records import Record, write_record

UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
TIME: np.ndarray = 0.1 * np.arange(600)
INPUTS = {
    "current": multilevel(TIME, [-0.9, 0.0, 0.9], (2.0, 8.0), 1),
    "force": multilevel(TIME, [0.5, 1.0, 2.75], (5.0, 12.0), 2),
}


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


@pytest.fixture
def record():
    measured = EmulatedRig(RigParameters(R1=0.6, C=2.0), seed=1).run(TIME, **INPUTS)
    return Record(TIME, INPUTS | measured, UNITS, Path("record.csv"))


def exact_voltage(R1, R2, C):
    """Voltage from the matrix exponential of the circuit and its held input."""
    transition = expm(np.array([[-1 / C, R2], [0.0, 0.0]]) / np.array([[R1 + R2], [1.0]]) * 0.1)
    charge = np.zeros(TIME.size)
    for k in range(TIME.size - 1):
        charge[k + 1] = transition[0] @ [charge[k], INPUTS["current"][k]]
    return (R1 * R2 * INPUTS["current"] + R2 * charge / C) / (R1 + R2)


def test_figures_are_those_of_their_definition(model, record):
    judged = comparing.compare(model, record).before["voltage"]
    y, simulated = record.signals["voltage"], exact_voltage(0.43, 2.35, 2.7)
    assert judged.simulated == pytest.approx(simulated, abs=1e-8)
    assert judged.residual == pytest.approx(y - simulated, abs=1e-8)
    assert judged.rms == pytest.approx(np.sqrt(np.mean((y - simulated) ** 2)), rel=1e-6)
    expected = 100 * (1 - np.linalg.norm(y - simulated) / np.linalg.norm(y - y.mean()))
    assert judged.fit_percent == pytest.approx(expected, abs=1e-5)
    assert judged.whiteness is not None
    assert not judged.whiteness.is_white


def test_single_values_far_from_the_others_are_remarked_with_their_share(model, record):
    assert not any("single values" in one for one in comparing.compare(model, record).remarks)
    spoilt = record.signals["voltage"].copy()
    moves = np.flatnonzero(np.diff(INPUTS["current"]) + np.diff(INPUTS["force"]))
    places = [k for k in range(50, 600, 10) if np.abs(moves - k).min() > 5][:2]
    spoilt[places] += 3.0
    signals = record.signals | {"voltage": spoilt}
    *_, remark = comparing.compare(model, replace(record, signals=signals)).remarks
    others = np.delete(np.arange(TIME.size), places)
    y, simulated = spoilt[others], exact_voltage(0.43, 2.35, 2.7)[others]
    fit = 100 * (1 - np.linalg.norm(y - simulated) / np.linalg.norm(y - y.mean()))
    assert remark.startswith("voltage has single values far from those beside them: 2, the first")
    assert f"at {TIME[places[0]]:.6g} s" in remark
    assert float(remark.split()[-2]) == pytest.approx(fit, abs=0.02)


def test_settings_change_the_model_and_a_fit_starts_there(model, record):
    result = comparing.compare(model, record, {"R1": 0.5, "R2": 2.35}, ["R1", "C"])
    assert result.before["voltage"].simulated == pytest.approx(
        exact_voltage(0.5, 2.35, 2.7), abs=1e-8
    )
    assert result.fit is not None
    assert result.after is not None
    assert result.fit.estimates["R1"].nominal == 0.5
    assert result.fit.values == pytest.approx({"R1": 0.6, "C": 2.0}, rel=0.01)
    fitted = exact_voltage(result.fit.values["R1"], 2.35, result.fit.values["C"])
    assert result.after["voltage"].simulated == pytest.approx(fitted, abs=1e-8)
    assert result.after["voltage"].whiteness is not None
    assert result.after["voltage"].whiteness.is_white


def test_a_constant_input_given_as_a_setting_reaches_the_fit_too(model, record):
    inputs = {"current": INPUTS["current"], "force": np.full(TIME.size, 1.5)}
    measured = EmulatedRig(RigParameters(k1=5000.0), displacement_noise=0.0).run(TIME, **inputs)
    signals = {"current": inputs["current"], "displacement": measured["displacement"]}
    result = comparing.compare(
        model, Record(TIME, signals, UNITS, Path("r.csv")), {"force": 1.5}, ["k1"]
    )
    assert result.fit is not None
    assert result.fit.values["k1"] == pytest.approx(5000.0, rel=1e-5)


def test_gaps_are_left_out_of_every_figure(model, record):
    whole = comparing.compare(model, record).before["voltage"]
    record.signals["voltage"] = record.signals["voltage"].copy()
    record.signals["voltage"][50:250] = np.nan
    judged = comparing.compare(model, record).before["voltage"]
    there = np.r_[0:50, 250:600]
    assert judged.rms == pytest.approx(np.sqrt(np.mean(whole.residual[there] ** 2)))
    assert math.isfinite(judged.fit_percent)


def test_a_record_too_short_for_whiteness_is_judged_all_the_same(model, record):
    short = Record(TIME[:15], {n: v[:15] for n, v in record.signals.items()}, UNITS, Path("r.csv"))
    judged = comparing.compare(model, short).before["voltage"]
    assert judged.whiteness is None
    assert math.isfinite(judged.fit_percent)


def test_a_fit_has_values_intervals_and_figures_by_name(model, record):
    fitted = comparing.compare(model, record, {}, ["R1", "alpha"]).fit
    low, high = fitted.intervals["R1"]
    assert low < fitted.values["R1"] < high
    assert (
        repr(fitted)
        == f"<Fit R1 = {fitted.values['R1']:.6g} ohm, alpha = {1e3 * fitted.values['alpha']:.6g}"
        " mm/C>"
    )
    figures = fitted.to_dict()
    assert figures["parameters"]["R1"]["ci95"] == [low, high]
    assert figures["simulations"] == fitted.evaluations
    assert '<th style="text-align:left">parameter</th>' in fitted._repr_html_()
    assert fitted.to_frame().loc["R1", ["low", "high"]].tolist() == [low, high]


def test_both_builds_give_the_same_figures(model, record):
    other = comparing.compare(find_model("ppy_actuator", "python"), record)
    for output, judged in comparing.compare(model, record).before.items():
        assert other.before[output].rms == pytest.approx(judged.rms, rel=1e-9)


def test_what_cannot_be_fitted_is_refused_before_anything_is_simulated(model, record):
    told: list[str] = []
    with pytest.raises(UserError, match=r"no parameter named 'R3' \(did you mean R"):
        comparing.compare(model, record, {}, ["R3"], told.append)
    with pytest.raises(UserError, match="R1 is named twice in R1,R1"):
        comparing.compare(model, record, {}, ["R1", "R1"], told.append)
    count = {**model.parameters, "R1": replace(model.parameters["R1"], type="integer")}
    with pytest.raises(UserError, match="R1 is integer; only real parameters can be fitted"):
        comparing.compare(replace(model, parameters=count), record, {}, ["R1"], told.append)
    assert told == []


def test_a_record_of_inputs_only_is_refused(model, tmp_path):
    write_record(tmp_path / "r.csv", TIME, INPUTS, UNITS)
    with pytest.raises(
        UserError, match=r"r\.csv: no column is an output of ppy_actuator \(charge, voltage, "
    ):
        comparing.read_for(model, tmp_path / "r.csv")


@pytest.mark.parametrize(
    ("start", "stop", "step", "expected"),
    [
        (0.0, 1.0, 0.25, [0.0, 0.25, 0.5, 0.75, 1.0]),
        (0.0, 1.0, 0.4, [0.0, 0.4, 0.8, 1.0]),  # a shorter last step
        (2.0, 2.3, 0.1, [2.0, 2.1, 2.2, 2.3]),  # 0.3 / 0.1 is not 3 in floating point
        (0.0, 5.0, 1e300, [0.0, 5.0]),
        (-1.0, 0.0, 0.5, [-1.0, -0.5, 0.0]),
    ],
)
def test_communication_points_reach_the_stop_time(start, stop, step, expected):
    assert simulate.grid(start, stop, step) == pytest.approx(expected, abs=1e-12)


def test_a_recorded_input_is_held_until_its_next_sample():
    record = Record(
        np.array([0.0, 1.0, 2.0]), {"u": np.array([3.0, 4.0, 5.0])}, {"u": "1"}, Path("r.csv")
    )
    assert simulate.held(record, "u", np.array([0.0, 0.99, 1.0, 1.5, 2.0, 9.0])).tolist() == [
        3,
        3,
        4,
        4,
        5,
        5,
    ]


def measured_circuit(current, *, linear):
    """Return a record of the circuit by lsim, its current linear between samples or held."""
    R1, R2, C = 0.6, 2.35, 2.0
    leak = R1 + R2
    circuit = ([[-1.0 / (C * leak)]], [[R2 / leak]], [[R2 / (C * leak)]], [[R1 * R2 / leak]])
    _, voltage, _ = lsim(circuit, current, TIME, interp=linear)
    noisy = voltage + 1e-3 * np.random.default_rng(1).normal(size=TIME.size)
    return Record(TIME, {"current": current, "voltage": noisy}, UNITS, Path("record.csv"))


def warnings_of_held(fit):
    return [text for text in fit.warnings if "constant between samples" in text]


@pytest.mark.parametrize("linear", [False, True])
def test_a_smooth_input_leaves_open_how_it_goes_between_samples(model, linear):
    """Where it is linear but taken as held, R1 is too large by half a sample period over C."""
    current = 0.5 * np.sin(2.0 * np.pi * TIME / 4.0) + 0.3 * np.sin(2.0 * np.pi * TIME / 17.0)
    record = measured_circuit(current, linear=True)
    found = comparing.compare_fitted(
        model, [record], {}, ["R1", "R2", "C"], Assumptions(linear=linear)
    )
    fit = found.fit
    (goodness,) = (one.latest["voltage"] for one in found.comparisons.values())
    assert goodness.rms == pytest.approx(1e-3, rel=0.1)
    low, high = fit.intervals["R1"]
    too_large = 0.0 if linear else 0.05 / 2.0
    assert low < 0.6 + too_large < high
    assert fit.values["R1"] == pytest.approx(0.6 + too_large, abs=1e-3)
    told = warnings_of_held(fit)
    assert len(told) == (not linear)
    if told:
        assert "interpolate=True) the record follows the model as well with R1 0." in told[0]


def test_steps_tell_that_an_input_is_held(model):
    record = measured_circuit(INPUTS["current"], linear=False)
    fit = comparing.compare_fitted(model, [record], {}, ["R1", "R2", "C"]).fit
    assert fit.values["R1"] == pytest.approx(0.6, abs=1e-3)
    assert warnings_of_held(fit) == []
