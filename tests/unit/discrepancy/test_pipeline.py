"""Record and model in; verdict, extended model, gain and next experiment out."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

import orchestration as ppy
from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from fmus.kit.record import CompiledModel
from fmus.kit.units import convert
from orchestration.discrepancy import pipeline
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose
from orchestration.discrepancy.report.tables import run_errors
from orchestration.fmu.model import find_model, load_class, model_of
from orchestration.fmu.model.effects import find_effects
from orchestration.records import Record
from orchestration.records.writing import write_record
from tests.support.diagnosis import rig_record
from tests.support.source import ROOT

by_effects = partial(ppy.diagnose, engine="old")


@pytest.fixture(scope="module")
def actuator():
    return find_model("ppy_actuator")


def at_rest(record):
    """Return the same record while no input moves, nor any output by more than its noise."""
    rng = np.random.default_rng(1)
    still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
    noise = {
        name: 1e-3 * np.ptp(values) * rng.standard_normal(len(values))
        for name, values in record.signals.items()
        if name not in still
    }
    return replace(record, signals=still | noise)


# --- from a record to data
# ------------------------------------------------------------------------------------------


def test_inputs_and_outputs_of_a_record_are_those_of_the_model(actuator):
    record = rig_record()
    data = dataset_of(record, actuator, {})
    assert (set(data.inputs), set(data.measured)) == (
        {"current", "force"},
        {"voltage", "displacement"},
    )
    assert all(data.inputs[n] is record.signals[n] for n in data.inputs)
    assert data.linear is None
    assert dataset_of(record, actuator, {}, interpolate=True).linear is True


def test_an_input_that_is_absent_is_constant(actuator):
    record = rig_record(None, "current", "voltage")
    assert np.array_equal(
        dataset_of(record, actuator, {}).inputs["force"], np.zeros(record.time.size)
    )
    given = dataset_of(record, actuator, {"force": 0.7, "R1": 0.5}).inputs
    assert set(given) == {"current", "force"}
    assert np.array_equal(given["force"], np.full(record.time.size, 0.7))


def test_what_is_given_of_an_input_goes_before_what_was_recorded(actuator):
    assert set(dataset_of(rig_record(), actuator, {"force": 0.7}).inputs["force"]) == {0.7}


def test_an_absent_input_is_noted_unless_it_is_given(actuator):
    record, noted = rig_record(None, "current", "voltage"), []
    for given in ({}, {"force": 0.7}):
        notes = diagnose(record, actuator, options=DiagnosisOptions(given, effects=[])).notes
        noted.append([note for note in notes if note.code is NoteCode.ABSENT_INPUT])
    facts = {"record": "lab record.csv", "value": 0.0, "unit": "N"}
    assert noted == [[Note(NoteCode.ABSENT_INPUT, "force", facts)], []]


# --- what follows from it
# -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_cause_comes_with_its_model_and_its_gain(actuator):
    result = diagnose(
        rig_record("strain_saturation"),
        actuator,
        options=DiagnosisOptions(effects=["strain_saturation"]),
    )
    assert result.diagnosis.verdict is Verdict.CAUSE
    assert "strain_saturation_coefficient" in {p.name for p in result.component.layout.parameters}
    assert result.gain.before == pytest.approx(result.diagnosis.before, rel=1e-6)
    assert result.gain.after == pytest.approx(result.diagnosis.after, rel=1e-6)
    assert result.experiment is None


def test_where_nothing_moves_there_is_no_model_but_an_experiment(actuator):
    limits = {"current": (-1.0, 1.0), "force": (0.0, 2.0)}
    result = diagnose(
        at_rest(rig_record()), actuator, options=DiagnosisOptions(effects=[], limits=limits)
    )
    assert result.diagnosis.inconclusive
    assert (result.component, result.gain) == (None, None)
    assert result.experiment.limits == limits
    assert result.experiment.expected == []


def test_another_record_is_what_is_judged_by(actuator):
    other = rig_record("strain_saturation", "current", "force", "voltage")
    result = diagnose(rig_record(), actuator, other, DiagnosisOptions(effects=[]))
    assert list(result.gain.after) == ["voltage"]
    assert not result.diagnosis.validation.continued
    assert result.holdout is other


@pytest.mark.parametrize(
    ("wanted", "considered"),
    [
        (["sensor_lag"], ["sensor_lag(voltage)", "sensor_lag(displacement)"]),
        (["sensor_lag(voltage)", "slack"], ["slack", "slack(smooth)", "sensor_lag(voltage)"]),
        pytest.param([], [], marks=pytest.mark.slow),
    ],
)
def test_effects_are_considered_by_id_or_by_output(actuator, wanted, considered):
    result = diagnose(at_rest(rig_record()), actuator, options=DiagnosisOptions(effects=wanted))
    assert [label(effect) for effect in result.effects] == considered


@pytest.mark.slow
def test_what_fails_afterwards_does_not_take_the_diagnosis_with_it(actuator, monkeypatch):
    def fails(*arguments):
        raise UserError("no compiler")

    monkeypatch.setattr(pipeline, "measure_gain", fails)
    monkeypatch.setattr(pipeline, "design_experiment", fails)
    moving, idle = (
        diagnose(r, actuator, options=DiagnosisOptions(effects=[]))
        for r in (rig_record(), at_rest(rig_record()))
    )
    assert moving.gain is None
    assert Note(NoteCode.FMU_FAILED, "", {"reason": "no compiler"}) in moving.notes
    assert idle.experiment is None
    assert Note(NoteCode.NO_EXPERIMENT, "", {"reason": "no compiler"}) in idle.notes


# --- refusals
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            DiagnosisOptions(effects=["slac"]),
            r"effects: no effect named 'slac' \(did you mean slack\?\); ppy info ppy_actuator",
        ),
        (
            DiagnosisOptions(effects=["sensor_lag(force)"]),
            r"effects: no effect named 'sensor_lag\(force\)'",
        ),
        (
            DiagnosisOptions(hold=["R3"]),
            r"hold: ppy_actuator has no parameter named 'R3' \(did you mean",
        ),
    ],
)
def test_names_that_are_unknown_are_refused(actuator, options, message):
    with pytest.raises(UserError, match=message):
        diagnose(rig_record(), actuator, options=options)


def test_an_effect_of_an_output_that_was_not_measured_is_refused_as_such(actuator):
    record = rig_record()
    signals = {n: values for n, values in record.signals.items() if n != "displacement"}
    less = replace(record, signals=signals)
    message = r"effects: sensor_gain\(displacement\) is of an output that .* \(it has: voltage\)"
    with pytest.raises(UserError, match=message):
        diagnose(less, actuator, options=DiagnosisOptions(effects=["sensor_gain(displacement)"]))


def test_a_model_without_equations_is_refused(actuator):
    with pytest.raises(
        UserError, match=r"ppy_actuator is an FMU without equations; name a component or file\.py"
    ):
        diagnose(rig_record(), replace(actuator, cls=None))


def test_a_record_to_judge_by_must_have_an_output_of_the_other(actuator):
    other = rig_record(None, "current", "displacement")
    with pytest.raises(
        UserError, match=r"lab record\.csv: it has none of the outputs of the record, voltage"
    ):
        diagnose(
            rig_record(None, "current", "voltage"), actuator, other, DiagnosisOptions(effects=[])
        )


def test_the_same_record_twice_is_refused_however_it_is_written(actuator):
    """On another clock, and rounded: noise is never the same."""
    record, options = rig_record(), DiagnosisOptions(effects=[])
    signals = {n: np.array([float(f"{x:.8g}") for x in v]) for n, v in record.signals.items()}
    same = replace(record, time=record.time + 100.0, signals=signals, source=Path("same.csv"))
    told = r"same\.csv: this is the same record as lab record\.csv"
    with pytest.raises(UserError, match=told):
        diagnose([record, same], actuator, options=options)
    with pytest.raises(UserError, match=told):
        diagnose(record, actuator, same, options)


# --- records with gaps, without noise, and of models whose file lists no effects
# -------------------------------------------------------------------------------------------


def test_a_file_with_a_gap_is_diagnosed_as_two_runs_and_one_without_has_nothing_of_its_own(
    actuator,
):
    record = rig_record()
    kept = np.r_[0:500, 700:1500]
    cut = replace(
        record, time=record.time[kept], signals={n: v[kept] for n, v in record.signals.items()}
    )
    estimates = diagnose(cut, actuator, options=DiagnosisOptions(effects=[])).diagnosis.estimates
    assert {"R1", "charge_start@1", "charge_start@2"} <= estimates.keys()
    whole = diagnose(record, actuator, options=DiagnosisOptions(effects=[], each=["R1"]))
    assert "R1" in whole.diagnosis.estimates
    assert not [name for name in whole.diagnosis.estimates if "@" in name]
    assert run_errors(whole) == [], "a record by itself is told once"


TIME = 0.1 * np.arange(1200)


class Lag(Component):
    """First order."""

    name = "lag"

    tau = Parameter(0.8, "s", min=1e-3, max=1e3)
    gain = Parameter(2.0, "1", min=1e-3, max=1e3)
    u = Input("1")
    x = State("1", rate="x_rate")

    def x_rate(self):
        return (self.u - self.x) / self.tau

    @Output("1")
    def y(self):
        """Return the state."""
        return self.gain * self.x

    @Output("1")
    def seen(self):
        """Return the input, as it is."""
        return self.u


@pytest.mark.slow
@pytest.mark.parametrize("hold", [[], ["gain"], ["tau"], ["tau", "gain"]])
def test_no_cause_is_named_in_a_record_that_the_model_made_itself(tmp_path, hold):
    """Nothing is left where parameters are held, and rounding where they are not."""
    u = np.sign(np.sin(0.3 * TIME))
    made = ppy.simulate(model_of(Lag), {"u": u}, time=TIME)
    signals = {"u": u, "y": np.array(made["y"]), "seen": u.copy()}
    record = Record(TIME, signals, dict.fromkeys(signals, "1"), tmp_path / "made.csv")
    found = by_effects(record, model_of(Lag), hold=hold, effects=[], interpolate=False)
    assert not found.causes
    for name, true in (("tau", 0.8), ("gain", 2.0)):
        if name in found.parameters:
            assert found.parameters[name].value == pytest.approx(true, rel=1e-6)


DRIVE = '''
from fmus.kit import Component, Input, Output, Parameter, State


class Drive(Component):
    """First order."""

    name = "drive"
    gain = Parameter(3.0, "rad/s/V", min=1e-6, max=1e6, doc="speed per volt")
    lag = Parameter(0.3, "s", min=1e-3, max=1e3, doc="time constant")
    voltage = Input("V", doc="what is commanded")
    omega = State("rad/s", rate="omega_rate", doc="speed")

    def drag(self):
        """Speed that is lost."""
        return self.omega

    def omega_rate(self):
        """First order."""
        return (self.gain * self.voltage - self.drag()) / self.lag

    @Output("rad/s")
    def speed(self):
        """As measured."""
        return self.omega
'''
GAIN, LAG, DEAD, STEP = 4.0, 0.25, 1.2, 0.02


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Write a model without effects, and a record of a drive that has a dead zone."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.py").write_text(DRIVE, encoding="utf-8")
    rng = np.random.default_rng(7)
    voltage = np.repeat(rng.uniform(-5.0, 5.0, 100), 20)
    arrives = np.sign(voltage) * np.maximum(np.abs(voltage) - DEAD, 0.0)
    speed, keeps = [0.0], np.exp(-STEP / LAG)
    for u in arrives[:-1]:  # exact for an input that is held
        speed.append(keeps * speed[-1] + (1.0 - keeps) * GAIN * u)
    time = STEP * np.arange(voltage.size)
    measured = np.array(speed) + 0.05 * rng.standard_normal(voltage.size)
    write_record(
        folder / "drive.csv",
        time,
        {"voltage": voltage, "speed": measured},
        {"voltage": "V", "speed": "rad/s"},
    )
    return folder


@pytest.mark.slow
def test_a_dead_zone_is_named_that_no_file_lists(drive):
    model = f"{drive / 'drive.py'}:Drive"
    said = by_effects(drive / "drive.csv", model)
    assert (said.verdict, said.causes) == ("cause", ["dead_zone(voltage)"])
    for name, true in (("gain", GAIN), ("lag", LAG), ("voltage_dead_zone", DEAD)):
        low, high = said.parameters[name].interval
        margin = 0.5 * (high - low)
        assert low - margin <= true <= high + margin, name
    native, _ = said.fmu(drive / "better.fmu", [host_platform()])
    assert native.exists()


@pytest.mark.slow
def test_they_have_to_be_asked_for_where_a_file_lists_its_own(drive):
    listing = "from fmus.kit.generic import force_offset\n" + DRIVE
    listing += '\n\nEFFECTS = {"force_offset": force_offset(Drive, "drag", unit="rad/s")}\n'
    (drive / "listing.py").write_text(listing, encoding="utf-8")
    model = f"{drive / 'listing.py'}:Drive"
    assert by_effects(drive / "drive.csv", model).causes != ["dead_zone(voltage)"]
    assert by_effects(drive / "drive.csv", model, effects=["families"]).causes == [
        "dead_zone(voltage)"
    ]


@pytest.mark.slow
def test_one_of_them_can_be_asked_for_by_name(drive):
    model = f"{drive / 'drive.py'}:Drive"
    said = by_effects(drive / "drive.csv", model, effects=["dead_zone(voltage)"])
    assert said.causes == ["dead_zone(voltage)"]
    with pytest.raises(UserError, match=r"no effect named 'dead_zone\(speed\)'"):
        by_effects(drive / "drive.csv", model, effects=["dead_zone(speed)"])
    cls = load_class(model)
    (effect,) = find_effects(cls, ["backlash(voltage)"], "drive")
    assert effect.id == "backlash"


@pytest.mark.slow
def test_a_second_volume_is_named_in_the_unit_of_the_model(tmp_path):
    """Oracle: the matrix exponential of the vessel with a second volume behind a pipe."""
    feed, leak, volume, pipe, time_constant, step = 4.0, 2.0, 16.0, 0.6, 25.0, 0.5
    rng = np.random.default_rng(11)
    opening = np.repeat(rng.uniform(0.1, 0.9, 30), 30)
    system = np.zeros((3, 3))
    system[0] = [-(leak + pipe) / volume, pipe / volume, feed / volume]
    system[1, :2] = [1.0 / time_constant, -1.0 / time_constant]
    over_step = expm(step * system)
    pressures = [np.array([1.0, 1.0])]
    for u in opening[:-1]:
        pressures.append((over_step @ [*pressures[-1], u])[:2])
    signals = {
        "opening": opening,
        "gauge": np.array(pressures)[:, 0] + 0.005 * rng.standard_normal(opening.size),
        "meter": feed * opening + 0.02 * rng.standard_normal(opening.size),
    }
    record = tmp_path / "vessel.csv"
    units = {"opening": "1", "gauge": "bar", "meter": "g/s"}
    write_record(record, step * np.arange(opening.size), signals, units)
    said = by_effects(record, f"{ROOT / 'studies/plants/models/vessel.py'}:Vessel", laws=False)
    assert said.causes[0] == "storing_law(outflow)"
    amount = said.parameters["outflow_storing_law"]
    assert convert(1.0, amount.unit, "kg/s/Pa") == pytest.approx(1e-8)
    for name, true in (
        ("outflow_storing_law", pipe),
        ("outflow_storing_law_constant", time_constant),
    ):
        low, high = said.parameters[name].interval
        margin = 0.5 * (high - low)
        assert low - margin <= true <= high + margin, name


EFFECTS_IN_TIME = ["transport_delay(speed)", "sensor_lag(speed)", "backlash(voltage)"]


def played(voltage, gap):
    """Return a commanded voltage behind a play, which follows at once."""
    arrived = [0.0]
    for u in voltage:
        arrived.append(float(np.clip(arrived[-1], u - gap, u + gap)))
    return np.array(arrived[1:])


def late_drive(step, kind):
    """Return commands and readings of a drive, exact in fifths of a sample; noise of a thousandth.

    The time constant is 12 samples; late is the sensor, by 3.4 samples or with a lag of 3, or there
    is a play of 0.8 V.
    """
    rng = np.random.default_rng(3)
    voltage = np.repeat(rng.uniform(-5.0, 5.0, 60), 20)
    arrives = np.repeat(played(voltage, 0.8) if kind == "backlash" else voltage, 5)
    lags = np.polymul([12.0, 1.0], [3.0, 1.0]) if kind == "sensor_lag" else [12.0, 1.0]
    _, speed, _ = lsim((GAIN, lags), arrives, 0.2 * np.arange(arrives.size), interp=False)
    if kind == "transport_delay":
        speed = np.concatenate([np.zeros(17), speed[:-17]])
    shown = speed[::5] + 0.01 * rng.standard_normal(voltage.size)
    return step * np.arange(voltage.size), {"voltage": voltage, "speed": shown}


@pytest.mark.slow
@pytest.mark.parametrize("step", [25e-6, 60.0])
@pytest.mark.parametrize("kind", ["transport_delay", "sensor_lag", "backlash"])
def test_what_takes_a_few_samples_is_named_whatever_the_clock(tmp_path, step, kind):
    """The clock is of 40 kHz, or of one sample a minute."""
    time, signals = late_drive(step, kind)
    written = DRIVE.replace("0.3", f"{12.0 * step}").replace("1e-3, max=1e3", f"{step}, max=1e6")
    (tmp_path / "drive.py").write_text(written, encoding="utf-8")
    write_record(tmp_path / "drive.csv", time, signals, {"voltage": "V", "speed": "rad/s"})
    said = by_effects(
        tmp_path / "drive.csv",
        f"{tmp_path / 'drive.py'}:Drive",
        effects=EFFECTS_IN_TIME,
        hold=["lag"],
        laws=False,
        interpolate=False,
    )
    (named,) = said.causes
    assert named.startswith(kind)
    value, true = {
        "transport_delay": ("speed_delay", 3.4 * step),
        "sensor_lag": ("speed_lag_time", 3.0 * step),
        "backlash": ("voltage_play", 0.8),
    }[kind]
    assert said.parameters[value].value == pytest.approx(true, rel=0.03)
    if kind == "transport_delay":
        native, _ = said.fmu(tmp_path / "better.fmu", [host_platform()])
        again = find_model(str(native))
        found = CompiledModel(again.cls).run(time, {"voltage": signals["voltage"]}, {})
        assert np.std(found.signals["speed"] - signals["speed"]) < 0.1
