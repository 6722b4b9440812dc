"""Claims: the extended model as an FMU describes itself, keeps the contract, and gains held out."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.signal import lfilter

from demonstrations.records import draw
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from fmus.kit.sensors import sensor_lag
from fmus.kit.units import format_value
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.candidate import catalogue
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.extended_model import (
    export,
    extended_component,
    fmu_paths,
    measure_gain,
)
from orchestration.fmu.check import check_fmu
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import catalogue as effects_of
from orchestration.fmu.model import find_model, load_class
from orchestration.fmu.simulation import simulate_instance
from tests.contract import checks, structure
from tests.contract.subjects import SUBJECTS
from tests.support.diagnosis import SHORT, as_measured, coloured

EXAMPLES = Path(__file__).parents[3] / "examples"
RECORD = "lab record.csv"
CASES = ("saturation", "lag", "stage")
SPRINGS = ("alpha", "k1", "b1", "k2", "b2", "kelvin_elongation_start", "maxwell_elongation_start")


def stage() -> tuple[Dataset, dict[str, np.ndarray]]:
    """Return a record of a stage with dry friction that sticks, and its velocity without noise.

    It is at 100 Hz; the equations are typed in once more.
    """
    mass, viscous, dry, drive, parts, step = 95.0, 203.0, 20.4, 35.15065, 20, 0.01
    random = np.random.default_rng(5)
    time = step * np.arange(4000)
    voltage = np.repeat(random.uniform(-3.0, 3.0, 100), 40)
    velocity, v = np.empty(time.size), 0.3
    for k, u in enumerate(voltage):
        velocity[k] = v
        for _ in range(parts):
            free = v + step / parts * (drive * u - viscous * v) / mass
            v = np.sign(free) * max(abs(free) - step / parts * dry / mass, 0.0)
    noise = 2e-3 * random.standard_normal(time.size)
    return Dataset(time, {"motor_voltage": voltage}, {"velocity": velocity + noise}), {
        "velocity": velocity
    }


def drawn(hidden: str | None, **options) -> tuple[Dataset, dict[str, np.ndarray]]:
    record = draw(hidden, 1, **options)
    return as_measured(record), record.truth.outputs


def case(name: str):
    """Return a model, its record with the truth, and a few effects, the hidden one first.

    Of the lag it is the voltage alone.
    """
    if name == "stage":
        cls = load_class(f"{EXAMPLES / 'positioning_stage.py'}:PositioningStage")
        data, truth = stage()
        return cls, data, truth, catalogue(cls, effects_of(cls), data.measured)
    other = EFFECTS["quadratic_strain"]
    if name == "saturation":
        return (
            PpyActuator,
            *drawn("strain_saturation", duration=300.0),
            [EFFECTS["strain_saturation"], other],
        )
    return (
        PpyActuator,
        *drawn("sensor_lag.voltage", outputs=("voltage",), **SHORT),
        [sensor_lag(PpyActuator, "voltage"), other],
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a function that diagnoses a case and builds both FMUs: ``made(name)``."""
    cases = {}

    def of(name):
        if name not in cases:
            cls, data, truth, effects = case(name)
            diagnosis = diagnose(cls, data, effects, held=SPRINGS if name == "lag" else ())
            model = extended_component(diagnosis, f"/somewhere/{RECORD}")
            paths = export(
                model, tmp_path_factory.mktemp(name) / "mended.fmu", platforms=[host_platform()]
            )
            cases[name] = SimpleNamespace(
                diagnosis=diagnosis,
                cls=model,
                truth=truth,
                hidden=effects[0],
                fmus=dict(zip(("native", "python"), paths, strict=True)),
                gain=measure_gain(diagnosis, paths[0]),
            )
        return cases[name]

    return of


@pytest.fixture(params=CASES)
def one(request, made):
    return made(request.param)


# --- what it is
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_defaults_are_what_was_fitted(one):
    assert one.diagnosis.selection.best.candidate.effects == (one.hidden,)
    for path in one.fmus.values():
        parameters = find_model(str(path)).parameters
        for name, estimate in one.diagnosis.estimates.items():
            assert parameters[name].start == estimate.value
            assert parameters[name].unit == estimate.unit
    assert {"charge_start", "velocity_start"} & set(one.diagnosis.estimates)


@pytest.mark.slow
def test_the_fmu_says_what_was_added_and_fitted(one):
    best, declared = one.diagnosis.selection.best, {p.name: p for p in one.cls.layout.parameters}
    expected = [
        f"Fitted to {RECORD}",
        f"Added to {one.diagnosis.selection.base.candidate.cls.name}: {one.hidden.id}",
    ]
    for name, e in one.diagnosis.estimates.items():
        low, high = (format_value(end, declared[name]) for end in e.interval)
        known = (
            f"95 % interval {low} … {high}"
            if name != "travel_start"
            else "not determined by the record"
        )
        expected.append(f"{name} = {format_value(e.value, declared[name])} ({known})")
    assert len(expected) == 2 + len(one.diagnosis.final.problem.names)
    for path in one.fmus.values():
        description = fmpy.read_model_description(str(path))
        with zipfile.ZipFile(path) as archive:
            page = archive.read("documentation/index.html").decode()
        for text in expected:
            assert text in description.description
            assert text in page
        assert "somewhere" not in description.description
        assert description.modelName == f"{best.candidate.cls.name}_fitted"


@pytest.mark.slow
def test_it_is_told_which_assumption_is_relaxed(made):
    assert (
        "the model assumes that elongation is proportional to charge, and the load does not change"
        " the voltage (assumption 5 of its documentation)"
    ) in made("saturation").cls.remark
    assert "the model assumes that the sensor follows at once" in made("lag").cls.remark
    assert "the model assumes that friction is viscous" in made("stage").cls.remark


@pytest.mark.slow
def test_only_parameters_are_told_of_where_nothing_was_added(tmp_path):
    data, _ = drawn(None, changed={"R1": 1.4}, spread=0.0, **SHORT)
    diagnosis = diagnose(PpyActuator, data, [])
    cls = extended_component(diagnosis, RECORD)
    assert diagnosis.verdict == "recalibrate"
    assert "Nothing was added to ppy_actuator: only its parameters were fitted" in cls.remark
    assert cls.name == "ppy_actuator_fitted"
    native, python = export(cls, tmp_path / "mended.fmu", platforms=[host_platform()])
    with zipfile.ZipFile(native) as archive:
        extra = [n for n in archive.namelist() if n.startswith("extra")]
        assert [n for n in extra if not n.endswith("/fmi-ls-manifest.xml")] == [], (
            "the reference result is of other defaults"
        )
    gain = measure_gain(diagnosis, python)
    assert gain.after == pytest.approx(diagnosis.after, rel=1e-6)
    assert gain.after == pytest.approx(gain.before, rel=1e-6)


@pytest.mark.slow
def test_doubts_are_told(made):
    diagnosis = made("saturation").diagnosis
    (step,) = diagnosis.selection.steps
    alternative = step.rejected[0][0] if step.rejected else step.chosen
    doubtful = replace(diagnosis.selection, steps=[replace(step, alternatives=[alternative])])
    assert "cannot be told apart from" not in made("saturation").cls.remark
    remark = extended_component(
        replace(diagnosis, verdict=Verdict.AMBIGUOUS, selection=doubtful), RECORD
    ).remark
    assert "On this record it cannot be told apart from quadratic_strain" in remark
    remark = extended_component(replace(diagnosis, verdict=Verdict.UNEXPLAINED), RECORD).remark
    assert "It does not account for all that the record shows" in remark


def test_nothing_is_made_of_a_record_that_does_not_move():
    data, _ = drawn(None, **SHORT)
    still = {name: np.full_like(values, values[0]) for name, values in data.inputs.items()}
    noise = {name: 1e-3 * coloured(0.0, 1, y.size) for name, y in data.measured.items()}
    with pytest.raises(UserError, match=r"lab record\.csv: no input moves"):
        extended_component(diagnose(PpyActuator, Dataset(data.time, still, noise), []), RECORD)


@pytest.mark.slow
def test_a_value_that_rounding_moved_out_of_its_range_is_at_its_end(made):
    diagnosis = made("saturation").diagnosis
    fit = diagnosis.final.fit
    beyond = replace(fit, values=fit.values | {"k2": np.nextafter(1e15, np.inf)})
    cls = extended_component(replace(diagnosis, final=replace(diagnosis.final, fit=beyond)), RECORD)
    assert cls().k2 == 1e15


OWN = """
from fmus.kit import Component, Input, Parameter, State
{imports}

class Tanks(Component):
    \"\"\"Tanks that drain.\"\"\"

    name = "tanks"
    count = Parameter(2, "1", type="integer", min=1, max=9, doc="number of tanks")
    open = Parameter(False, "1", type="boolean", doc="whether they drain")
    loss = Parameter(0.05, "1/s", min=0, max=9, doc="rate of draining")
    inflow = Input("m^3/s", doc="what flows in")
    level = State("m^3", rate="filling", output=True, doc="volume in each")

    def filling(self):
        return self.inflow / self.count - self.open * self.loss * self.level
"""


def tanks(folder, imports=""):
    """Diagnose a user's model of three open tanks: a pole of 0.2 per second, from 2 m^3."""
    (folder / "own.py").write_text(OWN.format(imports=imports), encoding="utf-8")
    step, inflow = 0.25, np.repeat(np.random.default_rng(2).uniform(0.0, 1.0, 60), 20)
    pole = np.exp(-0.2 * step)
    forced = lfilter([0.0, (1.0 - pole) / 0.2 / 3.0], [1.0, -pole], inflow)
    time = step * np.arange(inflow.size)
    level = (
        forced
        + 2.0 * np.exp(-0.2 * time)
        + 1e-3 * np.random.default_rng(3).standard_normal(time.size)
    )
    cls = load_class(f"{folder / 'own.py'}:Tanks")
    return diagnose(
        cls, Dataset(time, {"inflow": inflow}, {"level": level}), [], {"count": 3, "open": 1}
    )


@pytest.mark.slow
def test_what_the_user_gave_stays_given(tmp_path):
    diagnosis = tanks(tmp_path)
    cls = extended_component(diagnosis, RECORD)
    assert "count = 3 (given, not fitted)" in cls.remark
    assert "open = true (given, not fitted)" in cls.remark
    for path in export(cls, tmp_path / "mended.fmu", platforms=[host_platform()]):
        start = {v.name: v.start for v in fmpy.read_model_description(str(path)).modelVariables}
        assert (start["count"], start["open"]) == ("3", "true")
        assert float(start["loss"]) == pytest.approx(0.2, rel=1e-3)
        assert float(start["level_start"]) == pytest.approx(2.0, rel=1e-3)
        assert measure_gain(diagnosis, path).after == pytest.approx(diagnosis.after, rel=1e-6)


# --- the contract
# --------------------------------------------------------------------------------------------------


def fmpy_finds_no_problem(path):
    assert validate_fmu(str(path)) == []


def reset_is_a_fresh_start(path):
    checks.reset_then_run_is_a_fresh_run(path, SUBJECTS["ppy_actuator"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "check",
    [
        fmpy_finds_no_problem,
        structure.every_unknown_is_listed,
        checks.library_knows_the_guid_of_the_description,
        checks.no_time_and_no_order_of_this_machine,
        checks.going_on_from_a_saved_state_gives_the_same_bits,
        checks.a_state_may_be_restored_anywhere,
        reset_is_a_fresh_start,
        checks.every_bound_of_every_parameter_holds,
    ],
    ids=lambda check: check.__name__,
)
def test_it_keeps_the_contract(made, runtime, check):
    for name in ("saturation", "lag"):
        check(made(name).fmus[runtime])


@pytest.mark.slow
def test_its_dependencies_are_those_found_by_differences(made):
    structure.dependencies_are_those_found_by_differences(made("saturation").fmus["native"])


@pytest.mark.slow
def test_it_is_checked_without_a_complaint(one):
    for path in one.fmus.values():
        complaints = [finding for finding in check_fmu(path) if finding.severity != "note"]
        # a user's file does not tell who wrote it; that is said of the model itself, too
        messages = [finding.message for finding in complaints]
        assert [
            text
            for text in messages
            if "author" not in text and "license" not in text and "icon" not in text
        ] == []


@pytest.mark.slow
def test_the_same_record_gives_the_same_bytes(one):
    again = extended_component(one.diagnosis, RECORD)
    for runtime in RUNTIMES:
        assert build(again, runtime, [host_platform()]) == one.fmus[runtime].read_bytes()


@pytest.mark.slow
def test_both_builds_agree_over_the_record(one):
    python = measure_gain(one.diagnosis, one.fmus["python"])
    for output, native in one.gain.extended.items():
        assert np.abs(python.extended[output] - native).max() <= 1e-9 * np.abs(native).max()


@pytest.mark.slow
def test_the_python_build_reads_as_it_runs(made):
    with zipfile.ZipFile(made("lag").fmus["python"]) as archive:
        text = archive.read("resources/python/__init__.py").decode()
    assert (
        f"'voltage_lag_time': {made('lag').diagnosis.estimates['voltage_lag_time'].value!r}" in text
    )


# --- what it gains
# --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_fmus_gain_what_the_diagnosis_says(one):
    assert one.gain.before == pytest.approx(one.diagnosis.before, rel=1e-6)
    assert one.gain.after == pytest.approx(one.diagnosis.after, rel=1e-6)
    assert min(one.gain.after[o] / one.gain.before[o] for o in one.gain.after) < 0.5


@pytest.mark.slow
def test_it_leaves_little_more_than_the_truth_would(one):
    """Noise alone, by the emulator's own outputs; the issue asks for 1.2 times that."""
    data, first = one.diagnosis.validation.data, one.diagnosis.validation.first
    for output, y in data.measured.items():
        seen = y[first:]
        noise = np.linalg.norm(seen - one.truth[output][first:]) / np.linalg.norm(
            seen - seen.mean()
        )
        assert one.gain.after[output] < 1.2 * noise


@pytest.mark.slow
def test_what_is_left_is_white_or_said_not_to_be(made, tmp_path):
    diagnosis = made("stage").diagnosis
    assert made("stage").gain.whiteness["velocity"].is_white
    validation, data = diagnosis.validation, diagnosis.validation.data
    hum = {
        "velocity": data.measured["velocity"]
        + 0.01 * np.ptp(data.measured["velocity"]) * np.sin(3.0 * data.time)
    }
    disturbed = replace(diagnosis, validation=replace(validation, data=replace(data, measured=hum)))
    assert not measure_gain(disturbed, made("stage").fmus["native"]).whiteness["velocity"].is_white


@pytest.mark.slow
def test_a_record_of_its_own_starts_where_it_starts(tmp_path):
    """Hold out the end as a record of its own: its states at the start are estimated there."""
    _, data, _, effects = case("saturation")
    cut = round(0.6 * len(data.time))
    diagnosis = diagnose(
        PpyActuator, data.part(0, cut), effects[:1], holdout=data.part(cut, len(data.time))
    )
    native, _ = export(
        extended_component(diagnosis, RECORD), tmp_path / "mended.fmu", platforms=[host_platform()]
    )
    gain = measure_gain(diagnosis, native)
    assert gain.before == pytest.approx(diagnosis.before, rel=1e-6)
    assert gain.after == pytest.approx(diagnosis.after, rel=1e-6)
    data = diagnosis.validation.data
    with Fmu(native) as fmu:
        fmu.start(float(data.time[0]))
        from_elsewhere = simulate_instance(fmu, data.time, data.inputs, list(data.measured))
    assert (
        diagnosis.validation.nrmse(from_elsewhere)["displacement"]
        > 2.0 * gain.after["displacement"]
    )


# --- files
# --------------------------------------------------------------------------------------------------


def test_where_the_fmus_go(tmp_path):
    assert fmu_paths(tmp_path / "a.b.fmu", []) == {
        "native": tmp_path / "a.b.fmu",
        "python": tmp_path / "a.b.python.fmu",
    }


@pytest.mark.parametrize("name", ["mended.fmu", "mended.python.fmu"])
def test_a_record_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("time [s]")
    (tmp_path / "record.csv").symlink_to(tmp_path / name)
    with pytest.raises(
        UserError, match=rf"{name}.\): this is the record itself; it will not be overwritten"
    ):
        export(
            PpyActuator, tmp_path / "mended.fmu", [tmp_path / "other.csv", tmp_path / "record.csv"]
        )
    assert (tmp_path / name).read_text() == "time [s]"


def test_other_destinations_that_are_refused(tmp_path):
    with pytest.raises(UserError, match=r"fmu\(.*mended\.zip.\): the name of an FMU ends in \.fmu"):
        fmu_paths(tmp_path / "mended.zip", [])
    (tmp_path / "mended.python.fmu").mkdir()
    with pytest.raises(UserError, match=r"mended\.python\.fmu.\): this is a folder"):
        fmu_paths(tmp_path / "mended.fmu", [])


def test_nothing_is_written_where_one_build_fails(tmp_path):
    cls = extended_component(tanks(tmp_path, "import numpy"), RECORD)
    with pytest.raises(UserError, match="'import numpy' cannot go into a Python FMU"):
        export(cls, tmp_path / "mended.fmu", platforms=[host_platform()])
    assert not list(tmp_path.glob("*mended*"))
