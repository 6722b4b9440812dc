"""Claims: any co-simulation FMU runs, its failures are one readable line, and nothing is left behind."""

import gc
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException

from fmus.kit import UserError
from fmus.kit.build import build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.units import shown, shown_difference
from orchestration.fmu.archive import read_description
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import find_model
from orchestration.fmu.simulate import simulate_instance
from tests.support.archive import edited
from tests.support.kit_samples import Thermostat

TIME = np.linspace(0.0, 30.0, 61)


def test_outputs_follow_the_solution_on_paper(fmu, runtime):
    current = 0.9
    with Fmu(fmu("ppy_actuator", runtime), {"R1": 0.6, "charge_start": 0.5}) as instance:
        instance.start()
        result = simulate_instance(
            instance, TIME, {"current": np.full(TIME.size, current)}, ["charge", "voltage"]
        )
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
        result = simulate_instance(
            instance, np.array([0.0, 1e-6, 2e-6]), {"current": current}, ["voltage"]
        )
    assert result["voltage"] == pytest.approx(current * 0.43 * 2.35 / 2.78, abs=1e-5)


def test_linear_inputs_go_from_point_to_point(fmu, runtime):
    """Charge of a ramp of current on paper: exact where the FMU interpolates, else of second order in the parts."""
    time, constant = np.linspace(0.0, 12.0, 5), (0.43 + 2.35) * 2.7
    charge = 2.35 * 2.7 * 0.1 * (time - constant * (1.0 - np.exp(-time / constant)))
    errors = []
    for parts in (1, 2, 4):
        with Fmu(fmu("ppy_actuator", runtime)) as instance:
            instance.start()
            current = {"current": 0.1 * time, "force": np.zeros(time.size)}
            found = simulate_instance(
                instance, time, current, ["charge", "voltage"], linear=["current"], parts=parts
            )
        errors.append(np.abs(found["charge"] - charge).max())
        assert found["voltage"][-1] == pytest.approx(
            2.35 / 2.78 * (found["charge"][-1] / 2.7 + 0.43 * 0.1 * time[-1]), rel=1e-9
        )
    if runtime == "native":
        assert max(errors) < 1e-7
    else:
        assert [one / other for one, other in pairwise(errors)] == pytest.approx(
            [4.0, 4.0], rel=0.05
        )


def test_a_start_time_other_than_zero(fmu, runtime):
    results = []
    for start in (0.0, -7.25):
        with Fmu(fmu("ppy_actuator", runtime)) as instance:
            instance.start(start)
            results.append(
                simulate_instance(instance, TIME + start, {"force": np.full(TIME.size, 2.0)})
            )
    for output, values in results[0].items():
        assert results[1][output] == pytest.approx(values, rel=1e-9, abs=1e-15)


def test_progress_reaches_the_end(fmu):
    told: list[int] = []
    with Fmu(fmu("ppy_actuator", "native")) as instance:
        instance.start()
        simulate_instance(instance, np.linspace(0.0, 1.0, 1001), {}, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1001
    assert len(told) > 100


@pytest.mark.parametrize("fails", [False, True])
def test_the_unzipped_folder_is_removed(fmu, scratch, fails):
    try:
        with Fmu(fmu("ppy_actuator", "native"), {"C": 0.0} if fails else {}) as instance:
            assert len([path for path in scratch.iterdir() if path.is_dir()]) == 1
            instance.start()
    except UserError:
        assert fails
    assert list(scratch.iterdir()) == []


def test_a_refused_parameter_is_told_in_the_words_of_the_fmu(fmu, runtime):
    with (
        Fmu(fmu("ppy_actuator", runtime), {"C": 0.0}) as instance,
        pytest.raises(UserError) as caught,
    ):
        instance.start()
    assert str(caught.value).startswith("ppy_actuator.fmu: initialization failed: ")
    for part in ("'C'", "0 F", "outside its range [1e-09, 1"):
        assert part in str(caught.value)


def test_a_failing_step_is_told_with_its_time(fmu, runtime):
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        with pytest.raises(
            UserError, match=r"ppy_actuator\.fmu: (step from 2 s returned|setting current failed)"
        ):
            simulate_instance(
                instance, np.arange(5.0), {"current": np.array([0.0, 1.0, np.nan, 0.0, 0.0])}
            )


def test_names_that_do_not_fit_are_told(fmu):
    path = fmu("ppy_actuator", "native")
    with Fmu(path) as instance:
        instance.start()
        with pytest.raises(
            UserError, match=r"no variable named 'curent' \(did you mean current\?\)"
        ):
            simulate_instance(instance, TIME, {"curent": TIME})
        with pytest.raises(UserError, match="voltage is not an input; inputs are current, force"):
            simulate_instance(instance, TIME, {"voltage": TIME})
    with (
        Fmu(path, {"voltage": 1.0}) as instance,
        pytest.raises(UserError, match="voltage is output, only parameters"),
    ):
        instance.start()


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (
            lambda n, c: None if n == "modelDescription.xml" else (n, c),
            "a zip archive but not an FMU",
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="3.0"')),
            "FMI version 3.0; this program knows",
        ),
        (
            lambda n, c: (n, c.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')),
            "FMI version 1.0; this program knows",
        ),
        (lambda n, c: (n, c.replace(b"CoSimulation", b"ModelExchange")), "for model exchange only"),
        (
            lambda n, c: (
                n,
                c.replace(b"CoSimulation", b"Other").replace(b"ModelExchange", b"Other"),
            ),
            "has neither an element CoSimulation nor ModelExchange$",
        ),
        (
            lambda n, c: (n, c.replace(b"ModelVariables", b"Variables")),
            r"Description\.xml has no element ModelVariables$",
        ),
        (lambda n, c: (n, c[:500]), r"modelDescription\.xml cannot be read: "),
    ],
)
def test_descriptions_that_cannot_be_run_are_refused(fmu, tmp_path, edit, message):
    path = edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)
    with pytest.raises(UserError, match=message) as caught:
        read_description(path)
    assert str(caught.value).startswith(str(path))


def test_a_start_value_that_is_none_is_refused(fmu, tmp_path):
    path = edited(
        fmu("ppy_actuator", "native"),
        tmp_path / "other.fmu",
        lambda n, c: (n, c.replace(b'"0.43"', b'"0x1"')),
    )
    with pytest.raises(UserError) as caught:
        find_model(str(path))
    assert str(caught.value) == f"{path}: modelDescription.xml: R1: start '0x1' is no number"


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda n, c: (n.replace(host_platform(), "win32"), c), r"no binary for \w+; it has win32"),
        (
            lambda n, c: None if n.startswith("binaries") else (n, c),
            r"no binary for \w+; it has none",
        ),
        (
            lambda n, c: (n, b"no library" if n.startswith("binaries") else c),
            r"cannot be loaded \(",
        ),
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
    assert (alpha.unit, alpha.display, alpha.start, alpha.min, alpha.max) == (
        "m/C",
        "mm/C",
        6.8e-5,
        -1.0,
        1.0,
    )
    assert shown(6.8e-5, alpha) == "0.068 mm/C"
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
        assert "'R1' = -1" in first.complaints
        assert "R1" not in second.complaints
        assert "'C' = -2" in second.complaints
    del first, second, instance
    gc.collect()
    with pytest.raises(FMICallException):
        simulate_fmu(str(path), stop_time=1.0, start_values={"R2": -3.0})
    assert "'R2' = -3" in capfd.readouterr().out


@pytest.fixture
def thermostat(tmp_path, runtime):
    """An FMU with parameters, inputs and outputs of every type."""
    path = tmp_path / "thermostat.fmu"
    path.write_bytes(build(Thermostat, runtime, [host_platform()]))
    return path


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("stages=2.7", "2.7 is not a whole number from -2147483647 to 2147483647"),
        ("stages=3e9", "3e+09 is not a whole number"),
        ("stages=6", "6 is out of range; allowed is 1 … 5"),
        ("enabled=0.5", "0.5 is neither true (1) nor false (0)"),
        ("boost=2", "2 is neither true (1) nor false (0)"),
        ("boost=maybe", "'maybe' is not a number with an optional unit (nor true or false)"),
        ("heater=true", "'true' is not a number with an optional unit"),
    ],
)
def test_settings_that_their_type_cannot_hold_are_refused(thermostat, setting, told):
    with pytest.raises(UserError) as caught:
        find_model(str(thermostat)).settings([setting])
    assert str(caught.value).startswith(f"--set {setting}: {told}")


def test_settings_of_integers_and_booleans_arrive(thermostat):
    """With n heaters of p on, the power is n p, and one more with the boost."""
    model = find_model(str(thermostat))
    values = model.settings(
        ["stages=3", "enabled=false", "on_start=true", "heater=0.05kW", "boost=1"]
    )
    assert values == {"stages": 3.0, "enabled": 0.0, "on_start": 1.0, "heater": 50.0, "boost": 1.0}
    assert shown(values["enabled"], model.parameters["enabled"]) == "false"
    assert shown(values["stages"], model.parameters["stages"]) == "3"
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


def test_values_that_their_type_cannot_hold_never_reach_the_fmu(thermostat):
    with (
        Fmu(thermostat, {"stages": 2.5}) as instance,
        pytest.raises(UserError, match=r"stages: 2\.5 is not a whole"),
    ):
        instance.start()
    with Fmu(thermostat) as instance:
        instance.start()
        boost = np.array([0.0, 1.0, 0.5, 0.0])
        with pytest.raises(
            UserError, match=r"boost: 0.5 is neither true \(1\) nor false \(0\) \(at 2 s\)"
        ):
            simulate_instance(instance, np.arange(4.0), {"boost": boost})


def test_differences_are_shown_without_the_offset_of_a_unit(thermostat):
    temperature = find_model(str(thermostat)).outputs["temperature"]
    assert shown(290.0, temperature) == "16.85 degC"
    assert shown_difference(2.0, temperature) == "2 K"


def test_a_saved_state_is_returned_to(fmu, runtime):
    """The same three steps, twice, give the same bits; in between the instance went elsewhere."""
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        write, read = (
            instance.writer(["current", "force"]),
            instance.reader(["voltage", "displacement"]),
        )

        def advance(current):
            write(np.array([current, 1.0]))
            for k in range(3):
                instance.step(1.0 + 0.5 * k, 0.5)
            row = np.empty(2)
            read(row)
            return row.tolist()

        write(np.array([0.3, 2.0]))
        instance.step(0.0, 1.0)
        state = instance.save()
        first = advance(0.9)
        instance.restore(state)
        elsewhere = advance(-0.9)
        instance.restore(state)
        assert advance(0.9) == first != elsewhere
        instance.release(state)


def test_an_fmu_that_cannot_save_its_state_says_so(fmu, tmp_path):
    def edit(name, contents):
        return name, contents.replace(
            b'canGetAndSetFMUstate="true"', b'canGetAndSetFMUstate="false"'
        )

    with Fmu(edited(fmu("ppy_actuator", "native"), tmp_path / "other.fmu", edit)) as instance:
        instance.start()
        with pytest.raises(UserError, match=r"other\.fmu: cannot save its state"):
            instance.save()


def test_a_working_folder_that_is_gone_is_one_readable_line(fmu, tmp_path, scratch, monkeypatch):
    path, gone = fmu("ppy_actuator", "native"), tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    try:
        with pytest.raises(UserError, match="cannot be loaded"), Fmu(path):
            pass
    finally:
        monkeypatch.chdir(tmp_path)
    assert list(scratch.iterdir()) == []
