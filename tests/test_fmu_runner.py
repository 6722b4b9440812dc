"""Claims: any co-simulation FMU runs, its failures are one readable line, and nothing is left behind."""

import gc
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException

from fmus.kit import UserError
from fmus.kit.toolchain import host_platform
from orchestration.fmu import Fmu, read_description
from orchestration.models import find_model

TIME = np.linspace(0.0, 30.0, 61)


@pytest.fixture
def scratch(tmp_path, monkeypatch):
    """The folder for temporary files, for this test alone."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def edited(source, target, edit=lambda name, contents: (name, contents)):
    """A copy of an archive with other names or contents; None leaves a file out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            changed = edit(name, old.read(name))
            if changed is not None:
                new.writestr(*changed)
    return target


def test_outputs_follow_the_solution_on_paper(fmu, runtime):
    current = 0.9
    with Fmu(fmu("ppy_actuator", runtime), {"R1": 0.6, "charge_start": 0.5}) as instance:
        instance.start()
        result = instance.run(TIME, {"current": np.full(TIME.size, current)}, ["charge", "voltage"])
    settled = 2.35 * 2.7 * current
    charge = settled + (0.5 - settled) * np.exp(-TIME / ((0.6 + 2.35) * 2.7))
    assert result["charge"] == pytest.approx(charge, abs=1e-7)
    voltage = 0.6 * (2.35 * current - charge / 2.7) / 2.95 + charge / 2.7
    assert result["voltage"] == pytest.approx(voltage, abs=1e-7)


def test_outputs_are_read_after_the_inputs_of_the_same_point(fmu, runtime):
    """A step of current shows in the voltage at once, through R1 parallel to R2."""
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        current = np.array([0.0, 0.9, 0.0])
        result = instance.run(np.array([0.0, 1e-6, 2e-6]), {"current": current}, ["voltage"])
    assert result["voltage"] == pytest.approx(current * 0.43 * 2.35 / 2.78, abs=1e-5)


def test_a_start_time_other_than_zero(fmu, runtime):
    results = []
    for start in (0.0, -7.25):
        with Fmu(fmu("ppy_actuator", runtime)) as instance:
            instance.start(start)
            results.append(instance.run(TIME + start, {"force": np.full(TIME.size, 2.0)}))
    for output, values in results[0].items():
        assert results[1][output] == pytest.approx(values, rel=1e-9, abs=1e-15)


def test_progress_reaches_the_end(fmu):
    told: list[int] = []
    with Fmu(fmu("ppy_actuator", "native")) as instance:
        instance.start()
        instance.run(np.linspace(0.0, 1.0, 1001), {}, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1001
    assert len(told) > 100


@pytest.mark.parametrize("fails", [False, True])
def test_the_unzipped_folder_is_removed(fmu, scratch, fails):
    try:
        with Fmu(fmu("ppy_actuator", "native"), {"C": 0.0} if fails else {}) as instance:
            assert len(list(scratch.iterdir())) == 1
            instance.start()
    except UserError:
        assert fails
    assert list(scratch.iterdir()) == []


def test_a_refused_parameter_is_told_in_the_words_of_the_fmu(fmu, runtime):
    with Fmu(fmu("ppy_actuator", runtime), {"C": 0.0}) as instance, pytest.raises(UserError) as caught:
        instance.start()
    assert str(caught.value).startswith("ppy_actuator.fmu: initialization failed: ")
    for part in ("'C'", "0 F", "outside its range [1e-09, 1"):
        assert part in str(caught.value)


def test_a_failing_step_is_told_with_its_time(fmu, runtime):
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        with pytest.raises(UserError, match=r"ppy_actuator\.fmu: (step from 2 s returned|setting inputs failed)"):
            instance.run(np.arange(5.0), {"current": np.array([0.0, 1.0, np.nan, 0.0, 0.0])})


def test_names_that_do_not_fit_are_told(fmu):
    path = fmu("ppy_actuator", "native")
    with Fmu(path) as instance:
        instance.start()
        with pytest.raises(UserError, match="no variable named 'curent'; did you mean current"):
            instance.run(TIME, {"curent": TIME})
        with pytest.raises(UserError, match="voltage is not an input; inputs are current, force"):
            instance.run(TIME, {"voltage": TIME})
    with Fmu(path, {"voltage": 1.0}) as instance, pytest.raises(UserError, match="voltage is output, only parameters"):
        instance.start()


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda n, c: None if n == "modelDescription.xml" else (n, c), "a zip archive but not an FMU"),
        (lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="3.0"')), "FMI version 3.0; this program runs"),
        (lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')), "FMI version 1.0; this program runs"),
        (lambda n, c: (n, c.replace(b"CoSimulation", b"ModelExchange")), "for model exchange only"),
        (lambda n, c: (n, c[:500]), r"modelDescription\.xml cannot be read \("),
    ],
)
def test_descriptions_that_cannot_be_run_are_refused(fmu, tmp_path, edit, message):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)
    with pytest.raises(UserError, match=message) as caught:
        read_description(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda n, c: (n.replace(host_platform(), "win32"), c), r"no binary for \w+; it has win32"),
        (lambda n, c: None if n.startswith("binaries") else (n, c), r"no binary for \w+; it has none"),
        (lambda n, c: (n, b"no library" if n.startswith("binaries") else c), r"cannot be loaded \("),
        (lambda n, c: (n, c.replace(b'guid="{', b'guid="{0')), r"GUID|guid"),
    ],
)
def test_binaries_that_cannot_be_run_are_refused(fmu, tmp_path, scratch, edit, message):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)
    here = Path.cwd()
    with pytest.raises(UserError, match=message) as caught, Fmu(path):
        pass
    assert Path.cwd() == here
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert list(scratch.iterdir()) == []


def test_a_model_knows_its_signals_from_the_description_alone(fmu):
    path = fmu("ppy_actuator", "native")
    model = find_model(str(path))
    assert (model.name, model.cls, model.path) == ("ppy_actuator.fmu", None, Path(path))
    alpha = model.parameters["alpha"]
    assert (alpha.unit, alpha.display, alpha.start, alpha.low, alpha.high) == ("m/C", "mm/C", 6.8e-5, -1.0, 1.0)
    assert alpha.shown(6.8e-5) == "0.068 mm/C"
    assert list(model.inputs) == ["current", "force"]
    assert "displacement" in model.outputs


def test_settings_are_read_with_their_units(fmu):
    model = find_model(str(fmu("ppy_actuator", "native")))
    texts = ["R1=610mohm", "k1 = 6.3[N/mm]", "b1=1.5e6", "alpha=-0.05 mm/C", "current=.5"]
    assert model.settings(texts) == pytest.approx(
        {"R1": 0.61, "k1": 6300.0, "b1": 1.5e6, "alpha": -5e-5, "current": 0.5}
    )
    with pytest.raises(UserError, match="no preset named 'five_layer'; there are: none"):
        model.settings([], "five_layer")
    own = find_model("ppy_actuator")
    values = own.settings(["R1=2"], "five_layer")  # a setting goes over the preset
    assert (values["R1"], values["C"]) == (2.0, 0.46)


def test_every_instance_hears_its_own_messages_and_fmpy_still_hears_its_own(fmu, capfd):
    path = fmu("ppy_actuator", "native")
    with Fmu(path, {"R1": -1.0}) as first, Fmu(path, {"C": -2.0}) as second:
        for instance in (second, first):
            with pytest.raises(UserError, match="initialization failed"):
                instance.start()
        assert ["'R1' = -1" in m for m in first.messages] == [True]
        assert ["'C' = -2" in m for m in second.messages] == [True]
    del first, second, instance
    gc.collect()
    with pytest.raises(FMICallException):
        simulate_fmu(str(path), stop_time=1.0, start_values={"R2": -3.0})
    assert "'R2' = -3" in capfd.readouterr().out
