"""Claims: effects are laid over a model by name, a file has models, an FMU gives back its class."""

import json
import shutil
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.hidden_coupling import SaturatingStrain
from demonstrations.emulator.physics import RigParameters
from orchestration.cli import models
from orchestration.fmu.archive import Archive
from orchestration.fmu.model import find_model
from orchestration.fmu.simulation import simulate
from orchestration.records import Record, Repair, read_record
from tests.support.archive import anonymous, edited
from tests.support.command import UNITS, here, measure, refused

EXAMPLES = Path(__file__).parents[3] / "examples"
SATURATED = "ppy_actuator_with_strain_saturation_set"
VALUES = {"R1": 0.61, "strain_saturation_coefficient": 0.8, "charge_start": 0.25}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Build an actuator that saturates, with values of its own; and record a rig that does."""
    folder = tmp_path_factory.mktemp("models")
    rig = EmulatedRig(
        RigParameters(R1=0.6), seed=1, hidden=partial(SaturatingStrain, saturation=1.0)
    )
    measure(folder / "record.csv", rig, 400)
    settings = [part for name, value in VALUES.items() for part in ("--set", f"{name}={value}")]
    done = here(
        "build",
        "ppy_actuator",
        "--with",
        "strain_saturation",
        *settings,
        "--out",
        "made",
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    for runtime in ("native", "python"):
        shutil.copy(folder / "made" / runtime / f"{SATURATED}.fmu", folder / f"{runtime}.fmu")
    shutil.copy(EXAMPLES / "creep.py", folder / "own.py")
    return folder


def works(*arguments, cwd):
    done = here(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


# --- effects by name
# --------------------------------------------------------------------------------------------------


def test_a_model_is_simulated_with_effects(folder, tmp_path):
    plain, stacked = (tmp_path / name for name in ("plain.csv", "stacked.csv"))
    arguments = [
        "simulate",
        "ppy_actuator",
        "--set",
        "current=0.9",
        "--set",
        "force=1",
        "--stop",
        "20s",
    ]
    works(*arguments, "--out", plain, cwd=folder)
    effects = ["--with", "strain_saturation, sensor_gain(voltage)"]
    printed = works(
        *arguments,
        *effects,
        "--set",
        "strain_saturation_coefficient=0.8",
        "--set",
        "voltage_gain=2",
        "--out",
        stacked,
        cwd=folder,
    )
    assert "ppy_actuator with strain_saturation, sensor_gain(voltage): 201 points" in printed
    names = {**UNITS, "charge": "C", "electrochemical_displacement": "m"}
    before, after = (read_record(path, names).signals for path in (plain, stacked))
    assert after["voltage"] == pytest.approx(2.0 * before["voltage"], rel=1e-12)
    saturation = 1.0 / np.sqrt(0.8)  # the law of the effect, by hand
    expected = 0.068e-3 * saturation * np.tanh(before["charge"] / saturation)
    assert after["electrochemical_displacement"] == pytest.approx(expected, abs=1e-12)


def test_an_effect_is_fitted(folder):
    arguments = ["compare", "record.csv", "--with", "strain_saturation", "--fit"]
    answer = json.loads(
        works(*arguments, "R1,alpha,strain_saturation_coefficient", "--json", "-", cwd=folder)
    )
    assert answer["with"] == ["strain_saturation"]
    told = here(*arguments, "strain_saturation_coefficient", cwd=folder).stderr
    assert (
        "noted: a fit starts from strain_saturation_coefficient = 0, without strain_saturation"
        in told
    )
    told = here(*arguments, "R1", "--set", "strain_saturation_coefficient=1", cwd=folder).stderr
    assert "a fit starts" not in told
    low, high = answer["fitted"]["parameters"]["strain_saturation_coefficient"]["ci95"]
    assert 0.0 < low < high
    without = json.loads(
        works("compare", "record.csv", "--fit", "R1,alpha", "--json", "-", cwd=folder)
    )
    rms = [a["fitted"]["outputs"]["displacement"]["rms"] for a in (answer, without)]
    assert rms[0] < 0.5 * rms[1]


@pytest.mark.slow
def test_what_was_laid_over_is_no_candidate_any_more(folder):
    arguments = ["diagnose", "record.csv", "--effects", "quadratic_strain,sensor_lag(voltage)"]
    done = here(
        "diagnose",
        "record.csv",
        "--effects",
        f"strain_saturation,{arguments[-1]}",
        "--json",
        "-",
        cwd=folder,
    )
    assert json.loads(done.stdout)["verdict"] == "cause"
    started = ["--with", "strain_saturation", "--set", "strain_saturation_coefficient=1"]
    done = here(*arguments, *started, "--json", "-", cwd=folder)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["verdict"] in ("consistent", "recalibrate")
    assert "strain_saturation_coefficient" in json.dumps(answer)
    laid = ["--with", "double_layer", "--effects", "double_layer"]  # which has one shape
    refused(folder, "diagnose", "record.csv", *laid, parts=["'double_layer'"])


def test_info_tells_the_effects_and_what_switches_them(folder):
    text = works("info", "ppy_actuator", cwd=folder)
    row = next(line for line in text.splitlines() if line.startswith("strain_saturation "))
    assert "levels off" in row
    for part in (
        "sensor_lag(OUTPUT)",
        "OUTPUT_lag_time",
        "strain_saturation_coefficient",
        "OUTPUT is one of voltage, ",
    ):
        assert part in text
    about = json.loads(
        works("info", "ppy_actuator", "--with", "strain_saturation", "--json", "-", cwd=folder)
    )
    assert about["with"] == ["strain_saturation"]
    assert "strain_saturation_coefficient" in [p["name"] for p in about["parameters"]]
    assert "strain_saturation" not in [e["name"] for e in about["effects"]]


@pytest.mark.parametrize(
    "command",
    [
        ["info", "ppy_actuator"],
        ["simulate", "ppy_actuator"],
        ["build", "ppy_actuator"],
        ["compare", "record.csv"],
        ["diagnose", "record.csv"],
    ],
    ids=lambda value: value[0],
)
def test_a_wrong_effect_is_answered_with_the_nearest_and_what_lists_them(folder, command):
    listing = "; ppy info ppy_actuator lists them"
    refused(
        folder,
        *command,
        "--with",
        "strain_saturatio",
        parts=[
            "ppy_actuator: no effect named 'strain_saturatio' (did you mean strain_saturation?)"
            + listing
        ],
    )
    refused(
        folder,
        *command,
        "--with",
        "slack,sensor_lag",
        parts=["'sensor_lag' (did you mean sensor_lag(voltage)?)" + listing],
    )
    refused(
        folder,
        *command,
        "--with",
        "slack,slack",
        parts=["--with 'slack,slack': slack is named twice"],
    )


@pytest.mark.parametrize(
    "command",
    [["info"], ["simulate"], ["build"], ["compare", "record.csv", "--model"]],
    ids=lambda value: value[0],
)
def test_a_wrong_component_is_answered_with_those_there_are(folder, command):
    refused(
        folder,
        *command,
        "galvanostate",
        parts=[
            "no component named 'galvanostate'",
            "did you mean galvanostat?",
            "ppy_actuator, ",
            "foot_dynamic",
            "file.py:Class",
        ],
    )


def test_an_empty_name_is_no_folder(folder):
    refused(folder, "info", "", parts=["no component named ''"])


def test_effects_need_a_model(folder):
    refused(folder, "build", "--with", "slack", parts=["--with and --set are about one model"])
    refused(
        folder, "diagnose", "record.csv", "--system", "s.ssp", "--with", "slack", parts=["--with"]
    )


# --- a class in a file
# ------------------------------------------------------------------------------------------------


def test_a_class_of_a_file_is_a_model_like_ours(folder, tmp_path):
    text = works("info", "own.py:Creep", cwd=folder)
    for part in (
        "own.py:Creep  Burgers' chain",
        "retardation_time",
        "second_kelvin",
        "sensor_lag(OUTPUT)",
    ):
        assert part in text
    printed = works(
        "build", "own.py:Creep", "--with", "second_kelvin", "--out", tmp_path, cwd=folder
    )
    assert [Path(line).name for line in printed.split()] == ["creep_with_second_kelvin.fmu"] * 2
    printed = works(
        "simulate",
        "own.py:Creep",
        "--with",
        "second_kelvin",
        "--set",
        "stress=10",
        "--stop",
        "1min",
        cwd=folder,
    )
    assert "own.py:Creep with second_kelvin: 61 points" in printed
    refused(folder, "info", "own.py:Crep", parts=["no class 'Crep'", "did you mean Creep?"])
    refused(
        folder,
        "build",
        "own.py:Creep",
        "--with",
        "fifth_kelvin",
        parts=[
            "no effect named 'fifth_kelvin' (did you mean fourth_kelvin?)",
            "ppy info own.py:Creep lists them",
        ],
    )


# --- an FMU that we made
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_an_fmu_gives_back_the_model_it_was_made_from(folder, runtime, tmp_path):
    """By its outputs, held against the component with the same effect and values."""
    model = find_model(str(folder / f"{runtime}.fmu"))
    assert model.notes == ()
    assert {n: model.parameters[n].start for n in VALUES} == VALUES
    defaults = {p.name: p.start for p in model.cls.layout.parameters}
    assert {n: s.start for n, s in model.parameters.items()} == defaults
    original = find_model("ppy_actuator", effects=["strain_saturation"])
    time = np.linspace(0.0, 20.0, 201)
    inputs = {"current": 0.9 * np.sin(time), "force": np.full(time.size, 1.0)}
    expected = simulate(original, time, inputs, VALUES)
    for again in (
        model,
        find_model(str(folder / f"{runtime}.fmu"), effects=["sensor_gain(voltage)"]),
    ):
        outputs = simulate(again, time, inputs, {})
        for name, values in expected.items():
            assert outputs[name] == pytest.approx(values, rel=1e-9, abs=1e-12), name


def test_info_of_an_fmu_tells_what_it_was_made_from(folder):
    text = works("info", "native.fmu", cwd=folder)
    assert "made from ppy_actuator with strain_saturation" in text
    assert "0.61 ohm" in next(line for line in text.splitlines() if line.startswith("R1 "))
    assert "second_kelvin" in text
    about = json.loads(works("info", "native.fmu", "--json", "-", cwd=folder))
    assert (about["made_from"], about["with"]) == ("ppy_actuator", ["strain_saturation"])


def test_info_of_anybodys_fmu_tells_its_variables(folder, fmu):
    path = edited(fmu("ppy_actuator", "native"), folder / "anybodys.fmu", anonymous)
    text = works("info", path, cwd=folder)
    assert "0.43 ohm" in next(line for line in text.splitlines() if line.startswith("R1 "))
    assert "made from" not in text
    assert "effects" not in text


@pytest.mark.slow
def test_a_fit_and_a_diagnosis_work_on_an_fmu(folder):
    arguments = ["record.csv", "--model", "native.fmu"]
    answer = json.loads(
        works(
            "compare",
            *arguments,
            "--fit",
            "R1,strain_saturation_coefficient",
            "--json",
            "-",
            cwd=folder,
        )
    )
    fitted = answer["fitted"]["parameters"]
    assert fitted["R1"]["nominal"] == 0.61
    assert fitted["R1"]["value"] == pytest.approx(0.6, rel=0.05)
    answer = json.loads(
        works("diagnose", *arguments, "--effects", "second_kelvin", "--json", "-", cwd=folder)
    )
    assert answer["verdict"] in ("consistent", "recalibrate")


@pytest.mark.parametrize("runtime", ["python", "native"])
@pytest.mark.parametrize(
    "command",
    [
        ["simulate", "native.fmu"],
        ["sweep", "native.fmu", "--over", "R1=0.5,0.6"],
        ["compare", "record.csv", "--model", "native.fmu"],
    ],
    ids=lambda command: command[0],
)
def test_an_fmu_has_no_other_build_to_choose(folder, command, runtime):
    told = f"--runtime {runtime}: native.fmu is taken as it is; only components are built"
    refused(folder, *command, "--runtime", runtime, parts=[told])


def test_a_component_that_an_fmu_gives_back_is_built_as_chosen(folder):
    effects = ("--with", "sensor_gain(voltage)", "--runtime", "python")
    done = here("simulate", "native.fmu", *effects, "--stop", "1s", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "building native.fmu with sensor_gain(voltage) (python)" in done.stderr


def test_an_fmu_is_built_again_to_the_byte(folder, tmp_path):
    """Also by its own name: an FMU for another platform starts from one for this."""
    works("build", "native.fmu", "--out", tmp_path, cwd=folder)
    for runtime in ("native", "python"):
        again = (tmp_path / runtime / f"{SATURATED}.fmu").read_bytes()
        assert again == (folder / f"{runtime}.fmu").read_bytes()
    place = f"made/native/{SATURATED}.fmu"
    refused(folder, "build", place, "--out", "made", parts=[place, "will not be overwritten"])


@pytest.mark.slow
def test_what_a_diagnosis_made_goes_on(folder, tmp_path):
    """Its FMU is diagnosed in turn, and tells what was said of it."""
    arguments = [
        "diagnose",
        folder / "record.csv",
        "--effects",
        "strain_saturation",
        "--fmu",
        "better.fmu",
    ]
    done = here(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    text = works("info", "better.fmu", cwd=tmp_path)
    assert "made from ppy_actuator with strain_saturation" in text
    assert "Fitted to record.csv" in text
    done = here(
        "diagnose",
        folder / "record.csv",
        "--model",
        "better.fmu",
        "--effects",
        "none",
        "--json",
        "-",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "consistent"


# --- an FMU whose class is not there any more
# -------------------------------------------------------------------------


@pytest.fixture
def creep(folder, tmp_path, monkeypatch):
    """Build an FMU of a user's class, its file beside it."""
    shutil.copy(EXAMPLES / "creep.py", tmp_path / "own.py")
    monkeypatch.chdir(tmp_path)
    works("build", "own.py:Creep", "--with", "second_kelvin", "--runtime", "native", cwd=tmp_path)
    shutil.copy(tmp_path / "fmu/native/creep_with_second_kelvin.fmu", tmp_path / "creep.fmu")
    return tmp_path


def test_the_file_is_told_as_seen_from_here(creep):
    with Archive(creep / "creep.fmu") as archive:
        (made_from,) = archive.description.iterfind("VendorAnnotations/Tool/MadeFrom")
    assert made_from.get("file") == "own.py"
    assert find_model("creep.fmu").cls is not None


def without_a_file(folder):
    (folder / "own.py").unlink()
    return "there is no file own.py here"


def with_another_content(folder):
    with (folder / "own.py").open("a", encoding="utf-8") as file:
        file.write("\nraise SystemExit('it was run')\n")
    return "own.py has changed since"


def with_annotation(old, new):
    def change(folder):
        edited(
            folder / "creep.fmu",
            folder / "new.fmu",
            lambda name, text: (name, text.replace(old, new)),
        )
        (folder / "new.fmu").replace(folder / "creep.fmu")
        return ""

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (without_a_file, "there is no file own.py here"),
        (with_another_content, "own.py has changed since"),
        (
            with_annotation(b'name="second_kelvin"', b'name="tenth_kelvin"'),
            "no effect named 'tenth_kelvin'",
        ),
        (with_annotation(b'class="Creep"', b'class="Other"'), "there is no class 'Other' in it"),
        (
            with_annotation(b'file="own.py" class="Creep"', b'component="creep"'),
            "there is no component 'creep' here",
        ),
        (
            with_annotation(b'file="own.py" class="Creep"', b'component="foot"'),
            "no effect named 'second_kelvin'",
        ),
        (
            with_annotation(b'file="own.py"', b'file="/etc/hostname"'),
            "there is no file /etc/hostname here",
        ),
        (with_annotation(b'<Effect name="second_kelvin" />', b""), "has other parameters now"),
    ],
    ids=[
        "gone",
        "changed",
        "effect",
        "class",
        "component",
        "another component",
        "no Python",
        "parameters",
    ],
)
def test_an_fmu_without_its_class_is_still_an_fmu(creep, change, reason):
    change(creep)
    done = here("simulate", "creep.fmu", "--set", "stress=10", "--stop", "5s", cwd=creep)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("noted: ")]
    assert line.startswith("noted: creep.fmu was made from ")
    assert reason in line
    assert line.endswith("it serves as an FMU without equations")
    assert len(line) < 300
    assert "retardation_time" in works("info", "creep.fmu", cwd=creep)
    refused(creep, "build", "creep.fmu", parts=[reason])
    refused(creep, "simulate", "creep.fmu", "--with", "third_kelvin", parts=[reason])


def test_nothing_in_an_fmu_is_run_for_its_class(creep):
    """A file of the same name inside the FMU is not looked at."""
    shutil.copy(creep / "creep.fmu", creep / "evil.fmu")
    with zipfile.ZipFile(creep / "evil.fmu", "a") as archive:
        for name in ("own.py", "resources/own.py"):
            archive.writestr(name, "raise SystemExit('it was run')")
    (creep / "own.py").unlink()
    assert "there is no file own.py here" in here("info", "evil.fmu", cwd=creep).stderr


# --- a record is read before a model is built
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("compare", "r.csv"),
        ("identify", "r.csv", "--fit", "R1"),
        ("diagnose", "r.csv"),
        ("laws", "r.csv"),
        ("simulate", "ppy_actuator", "--input", "r.csv"),
        ("black-box", "r.csv", "--output", "voltage"),
        ("frequency", "r.csv", "--model", "ppy_actuator"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_record_is_refused_before_anything_is_built(tmp_path, monkeypatch, arguments):
    def build(*_, **__):
        raise AssertionError("built")

    monkeypatch.setattr("fmus.kit.build.build_cached", build)
    text = "time [s],current [A],voltage [V]\n0,1,0\n1,jammed,1\n2,3,2\n"
    (tmp_path / "r.csv").write_text(text)
    refused(tmp_path, *arguments, parts=["r.csv", "row 3, column 'current': 'jammed'"])


def test_repairs_alike_are_told_once_with_the_names_of_their_records(capsys):
    def record(name, label, *repairs):
        return Record(np.zeros(0), {}, {}, Path("folder", name), [*repairs], label)

    utf, gap = Repair("encoding", "not UTF-8"), Repair("gap", "a gap", (3,))
    dead = Repair("constant", "constant at 1 N")
    records = [record("a.csv", "", utf, dead), record("b.csv", "2", utf, gap)]
    models.tell_repairs_of(records)
    assert capsys.readouterr().err.splitlines() == [
        "noted: all 2 records: not UTF-8",
        "noted: a.csv: constant at 1 N",
        "noted: b.csv, run 2: a gap",
    ]
    models.tell_repairs_of(records[:1], unsaid=("constant",))
    assert capsys.readouterr().err.splitlines() == ["noted: not UTF-8"]
