"""The parts of the diagnosis against closed forms and SciPy, and the whole on records of the emulated rig."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, rosen
from scipy.signal import lfilter

from fmus.kit import Component, Output, Parameter
from fmus.kit.errors import UserError
from fmus.kit.sensors import sensor_lag
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.candidate import Candidate, catalogue, label, own_parameters
from orchestration.discrepancy.diagnosis import diagnose, searched
from orchestration.discrepancy.report.wording import sentence
from orchestration.discrepancy.residuals.lines import jumps, lines
from orchestration.discrepancy.selection import search as evidence
from orchestration.discrepancy.selection.search import Dataset
from orchestration.identify.levenberg_marquardt import minimise
from orchestration.identify.noise import ORDER, Noise, estimate, segments
from orchestration.rig.emulator.records import draw, write
from tests.support.command import ppy, works

EVERY = np.ones(4000, dtype=bool)
FEW = [EFFECTS[name] for name in ("strain_saturation", "quadratic_strain", "strain_lag", "force_to_voltage")]


def coloured(colour: float, seed: int, n: int = 4000) -> np.ndarray:
    return np.asarray(lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).standard_normal(n)))


# --- noise ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9])
def test_noise_of_a_known_colour_is_found_and_whitened(colour):
    noise = estimate(coloured(colour, 1), EVERY)
    assert noise.deviation == pytest.approx(1.0, rel=0.05)
    assert sum(noise.coefficients) == pytest.approx(colour, abs=0.08)
    white = noise.whiten(coloured(colour, 2), EVERY)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.06


def test_a_filter_does_not_reach_over_a_gap():
    present = EVERY.copy()
    present[1000:1003] = False
    assert segments(present) == [(0, 1000), (1000, 3997)]
    jump = np.where(np.arange(3997) < 1000, 0.0, 5.0)
    white = Noise(np.array([1.0]), 1.0).whiten(jump, present)
    assert white.size == 3997 - 2 * ORDER
    assert np.all(white == 0.0)


# --- search ---------------------------------------------------------------------------------------------------------


def test_the_search_finds_what_scipy_finds():
    def rows(q):
        return np.array([10.0 * (q[1] - q[0] ** 2), 1.0 - q[0]])

    def slopes(q):
        return np.array([[-20.0 * q[0], 10.0], [-1.0, 0.0]])

    wide, start = np.array([5.0, 5.0]), np.array([-1.2, 1.0])
    assert rosen(minimise(rows, slopes, start, -wide, wide, 1e-14, 200)) < 1e-12
    bound = np.array([0.5, 5.0])
    expected = least_squares(rows, [-1.2, 1.0], slopes, bounds=(-wide, bound)).x
    assert minimise(rows, slopes, start, -wide, bound, 1e-14, 200) == pytest.approx(expected, rel=1e-4)


def test_the_search_steps_back_from_what_is_not_finite():
    def rows(q):
        return np.array([np.log(q[0]) - 1.0 if q[0] > 0.0 else np.inf])

    found = minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([9.0]), np.array([-1.0]), np.array([99.0]))
    assert found == pytest.approx([np.e], rel=1e-3)


# --- structure ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_hum_is_found_and_noise_has_none(colour):
    time = 0.1 * np.arange(4000)
    for seed in range(40):
        assert lines(coloured(colour, seed), 0.1) == []
    (line, *_) = lines(coloured(colour, 1) + 1.5 * np.sin(2.0 * np.pi * 0.83 * time), 0.1)
    assert line.frequency == pytest.approx(0.83, abs=0.003)
    assert line.amplitude == pytest.approx(1.5, rel=0.2)


def test_jumps_are_found_where_no_input_jumps():
    time, noise = 0.1 * np.arange(4000), coloured(0.0, 1)
    stepped = noise + 20.0 * (time >= 100.0) - 15.0 * (time >= 250.0)
    current = np.where(time >= 250.0, 1.0, -1.0)
    (found,) = jumps(stepped, time, {"current": current})
    assert found.time == pytest.approx(100.0)
    assert found.size == pytest.approx(20.0, abs=6.0)
    assert jumps(noise, time, {"current": current}) == []


# --- candidates -----------------------------------------------------------------------------------------------------


def test_the_catalogue_speaks_of_what_was_measured():
    names = [label(effect) for effect in catalogue(PpyActuator, EFFECTS, ["voltage"])]
    assert set(EFFECTS) <= set(names)
    assert "transport_delay(voltage)" in names
    assert not [name for name in names if "displacement)" in name]


def test_a_candidate_has_its_switch_first():
    assert own_parameters(EFFECTS["second_kelvin"])[0] == "second_creep_compliance"
    assert own_parameters(sensor_lag(PpyActuator, "voltage")) == ["voltage_lag_time"]
    both = Candidate((), PpyActuator).with_effect(FEW[0]).with_effect(sensor_lag(PpyActuator, "voltage"))
    assert both.name == "strain_saturation + sensor_lag(voltage)"
    assert both.parameters == ["strain_saturation_coefficient", "voltage_lag_time"]


def test_what_is_searched():
    starts = ["charge_start", "kelvin_elongation_start", "maxwell_elongation_start"]
    assert searched(PpyActuator) == ["R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2", *starts]


def fails(*arguments, cwd):
    """What is told on a refusal, which is one line and exit code 2."""
    done = ppy(*arguments, cwd=cwd)
    assert done.returncode == 2
    assert done.stderr.strip().splitlines()[-1].startswith("error: ")
    return done.stderr


# --- the whole ------------------------------------------------------------------------------------------------------


def record(hidden, **options):
    drawn = draw(hidden, 1, duration=300.0, rate=5.0, **options)
    return Dataset(drawn.time, drawn.inputs, drawn.outputs)


def test_a_hidden_saturation_is_named_and_its_gain_holds():
    found = diagnose(PpyActuator, record("strain_saturation"), FEW)
    assert found.causes[:1] == ["strain_saturation"]
    assert found.after["displacement"] < 0.7 * found.before["displacement"]
    assert found.as_json()["causes"][0]["evidence"]["delta_bic"] > 50.0


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_clean_record_has_no_cause(colour):
    found = diagnose(PpyActuator, record(None, noise_colour=colour), FEW)
    assert found.causes == []
    assert found.verdict == "recalibrate"  # the rig is off nominal by up to 15 %


def test_a_changed_parameter_is_recalibrated():
    found = diagnose(PpyActuator, record(None, changed={"R1": 1.4}, spread=0.0), FEW)
    assert found.verdict == "recalibrate"
    assert found.changed[0] == "R1"
    low, high = found.estimates["R1"].interval
    assert low < 1.4 * 0.43 < high


def test_a_hum_is_not_explained():
    assert diagnose(PpyActuator, record("hum"), FEW).verdict == "unexplained"


def test_without_excitation_nothing_is_named():
    idle = record(None)
    still = {name: np.full_like(values, values[0]) for name, values in idle.inputs.items()}
    noise = {name: 1e-3 * coloured(0.0, 3, values.size) for name, values in idle.measured.items()}
    found = diagnose(PpyActuator, Dataset(idle.time, still, noise), FEW)
    assert found.causes == []
    assert found.verdict == "ambiguous"
    assert "no input moves" in found.notes[0]


def test_the_command_names_and_writes_it_down(tmp_path):
    write(draw("strain_saturation", 1, duration=300.0, rate=5.0), tmp_path / "record.csv")
    effects = ",".join(effect.id for effect in FEW)
    text = works("diagnose", "record.csv", "--effects", effects, "--json", "found.json", cwd=tmp_path)
    assert "strain_saturation" in text
    written = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert written["causes"][0]["effect"] == "strain_saturation"
    low, high = written["parameters"]["R1"]["ci95"]
    assert low < written["parameters"]["R1"]["value"] < high
    told = fails("diagnose", "record.csv", "--effects", "strain_saturatoin", cwd=tmp_path)
    assert "no effect named 'strain_saturatoin' (did you mean strain_saturation?)" in told
    told = fails("diagnose", "record.csv", "--json", "record.csv", cwd=tmp_path)
    assert "will not be overwritten" in told


def test_an_unknown_model_is_told(tmp_path):
    write(draw(None, 1, duration=100.0, rate=5.0), tmp_path / "record.csv")
    assert "no component named" in fails("diagnose", "record.csv", "--model", "ppy_actuatr", cwd=tmp_path)


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(UserError, match="3 samples are too few for a diagnosis; 225 are the least"):
        diagnose(PpyActuator, Dataset(np.arange(3.0), {}, {"voltage": np.zeros(3)}), FEW)


def test_what_is_written_is_json_as_others_read_it(tmp_path):
    """A record of the voltage says nothing about springs: only what is believed of them, nothing where they start."""
    drawn = record("double_layer", outputs=("voltage",))
    found = diagnose(PpyActuator, drawn, [EFFECTS["double_layer"]])
    assert found.causes == ["double_layer"]
    text = json.dumps(found.as_json(), allow_nan=False)
    known = json.loads(text)["parameters"]
    low, high = known["k1"]["ci95"]
    assert 5.0 * low < known["k1"]["nominal"] < 0.2 * high
    assert known["maxwell_elongation_start"]["ci95"] == [None, None]


def test_an_effect_that_cannot_be_simulated_is_told(monkeypatch):
    def fails_to(problem, effect):
        raise UserError("no derivative there")

    monkeypatch.setattr(evidence, "leads", fails_to)
    found = diagnose(PpyActuator, record(None), FEW[:1])
    assert found.notes == ["strain_saturation was not judged: no derivative there"]


# --- records as they are ---------------------------------------------------------------------------------------------


def test_a_gap_is_no_jump():
    """Red noise moves far while nobody looks; held against the samples on either side it has jumped."""
    time, noise = 0.1 * np.arange(3000), coloured(0.95, 3, 3000)
    there = np.ones(3000, dtype=bool)
    for start in range(200, 2900, 140):
        there[start : start + 60] = False
    drive = {"drive": np.repeat(np.arange(100) % 3, 30)[there].astype(float)}
    assert jumps(noise[there], time[there], drive) == []
    slipped = noise + np.where(time > 101.0, 30.0 * noise.std(), 0.0)
    (found,) = jumps(slipped[there], time[there], drive)
    assert found.time == pytest.approx(101.1)


def test_an_output_full_of_gaps_is_left_out_with_a_note():
    data = record(None)
    gaps = data.measured["voltage"].copy()
    gaps[::3] = np.nan
    found = diagnose(PpyActuator, replace(data, measured=data.measured | {"voltage": gaps}), [])
    assert list(found.left) == ["displacement"]
    assert "voltage: too little of it is without gaps to say anything" in found.notes


def test_an_output_that_ends_early_does_not_take_the_record_with_it():
    data = record(None)
    short = data.measured["displacement"].copy()
    short[80:] = np.nan
    found = diagnose(PpyActuator, replace(data, measured=data.measured | {"displacement": short}), [])
    assert list(found.left) == ["voltage"]
    assert any(note.startswith("displacement: ends at 15.8 s, long before the others") for note in found.notes)


def test_what_only_one_of_two_records_has_is_not_judged():
    data, other = record(None), record(None)
    dead = data.measured | {"displacement": np.zeros(len(data.time))}
    for fitted, unseen in ((replace(data, measured=dead), other), (other, replace(data, measured=dead))):
        assert list(diagnose(PpyActuator, fitted, [], holdout=unseen).after) == ["voltage"]


def test_a_model_without_states_or_inputs_can_be_diagnosed():
    class Gauge(Component):
        """A line over time that is wrongly scaled."""

        name = "gauge"
        slope = Parameter(2.0, "V/s", min=0, doc="slope")

        @Output("V", doc="what is shown")
        def shown(self):
            return self.slope * self.time

    time = 0.1 * np.arange(600)
    data = Dataset(time, {}, {"shown": 2.5 * time + 1e-3 * coloured(0.0, 1, 600)})
    for holdout in (None, data):
        found = diagnose(Gauge, data, [], holdout=holdout)
        assert found.estimates["slope"].value == pytest.approx(2.5, rel=1e-3)
        assert found.causes == []


def test_inputs_that_only_jitter_tell_nothing():
    data = record(None)
    jitter = {name: 0.5 + 1e-5 * coloured(0.0, k, u.size) for k, (name, u) in enumerate(data.inputs.items())}
    noise = {name: 1e-3 * np.ptp(y) * coloured(0.0, 7, y.size) for name, y in data.measured.items()}
    found = diagnose(PpyActuator, replace(data, inputs=jitter, measured=noise), FEW)
    assert (found.verdict, found.causes, found.changed) == ("ambiguous", [], [])
    assert any("lost in the noise" in note for note in found.notes)


def test_a_wrong_unit_is_no_cause():
    data = record("strain_saturation")
    wrong = data.measured | {"displacement": 1e3 * data.measured["displacement"]}
    found = diagnose(PpyActuator, replace(data, measured=wrong), FEW)
    assert found.verdict == "unexplained"
    assert "look at units, signs and columns first" in sentence(found)


def test_what_is_left_where_the_cause_does_not_act_is_told():
    """A saturation of the strain does not touch the voltage, which wanders."""
    data = record("strain_saturation")
    wander = 2e-3 * np.cumsum(coloured(0.0, 5, data.time.size))
    found = diagnose(
        PpyActuator, replace(data, measured=data.measured | {"voltage": data.measured["voltage"] + wander}), FEW
    )
    assert found.verdict == "unexplained"
    assert found.causes[:1] == ["strain_saturation"]
    assert sentence(found).startswith("Beside strain_saturation, something is left")


def test_numbers_that_no_sensor_gives_are_refused():
    data = record(None)
    with pytest.raises(UserError, match="voltage: values beyond"):
        diagnose(PpyActuator, replace(data, measured={"voltage": 1e300 * data.measured["voltage"]}), FEW)


def test_an_input_that_is_absent_is_told_and_taken_as_it_starts(tmp_path):
    drawn = draw(None, 1, duration=300.0, rate=5.0)
    write(replace(drawn, inputs={"current": drawn.inputs["current"]}), tmp_path / "record.csv")
    text = works("diagnose", "record.csv", "--effects", "none", cwd=tmp_path)
    assert "record.csv has no force: taken to be 0 N throughout; --set force=... says otherwise" in " ".join(
        text.split()
    )


def test_the_file_of_the_model_is_not_overwritten(tmp_path):
    shutil.copy("examples/positioning_stage.py", tmp_path / "stage.py")
    write(draw(None, 1, duration=100.0, rate=5.0), tmp_path / "record.csv")
    for option in (["--json", "stage.py"], ["--fmu", "s.fmu", "--json", "s.fmu"]):
        told = fails("diagnose", "record.csv", "--model", "stage.py:PositioningStage", *option, cwd=tmp_path)
        assert "will not be overwritten" in told or "both name" in told
