"""The bench as an FMU in both builds: its reference result, sample instants, state, and what it refuses."""

import csv
import ctypes
import math
import sys
import zipfile
from pathlib import Path

import fmpy.validation
import numpy as np
import pytest

import fmus.voice_coil_dma
from tests import hosts
from tests.contract.raw import ERROR, OK, Instance, Library, doubles, instance, unzipped

NAME = "voice_coil_dma"
REFERENCE = Path(fmus.voice_coil_dma.__file__).parent / "reference"
SIGNALS = ("position", "velocity", "coil_current", "coil_voltage", "force_measured", "position_measured")
T = 1.0 / 30.0

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="an FMU in use cannot be removed there")


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


@pytest.fixture
def one(archive):
    with instance(archive) as created:
        yield created


def rows(suffix):
    with (REFERENCE / f"{NAME}_{suffix}.csv").open(encoding="utf-8") as file:
        header, *body = csv.reader(file)
    table = np.array(body, dtype=float)
    return header, table[np.append(np.diff(table[:, 0]) > 0.0, True)]


def drive(one, count, size, shift=0):
    """Outputs after each of some steps with inputs that move."""
    found = []
    for k in range(shift, shift + count):
        one.set({"force_reference": 1.0 + math.sin(0.7 * k), "tension": 1.0 + 0.5 * math.sin(0.31 * k)})
        one.step(size)
        found.append(one.get(*SIGNALS))
    return np.array(found)


def test_validates_and_brings_no_analysis_along(archive):
    assert fmpy.validation.validate_fmu(str(archive)) == []
    with zipfile.ZipFile(archive) as files:
        assert not [name for name in files.namelist() if "analysis" in name]


def test_reproduces_the_reference_result(archive):
    fed, stimuli = rows("in")
    wanted, expected = rows("ref")
    held = np.searchsorted(stimuli[:, 0], expected[:, 0] + 1e-9, side="right") - 1
    inputs = {signal: stimuli[held, i] for i, signal in enumerate(fed) if i}
    found = hosts.run_fmpy(archive, expected[:, 0], inputs, wanted[1:], feedthrough=False)
    for i, signal in enumerate(wanted[1:], start=1):
        assert np.abs(found[signal] - expected[:, i]).max() <= 1e-7 * np.abs(expected[:, i]).max(), signal


@pytest.mark.parametrize("values", [{}, {"converters_on": 1}, {"controller_on": 0}, {"anti_windup": 0}], ids=str)
def test_builds_agree(fmu, values):
    runs = []
    for runtime in ("python", "native"):
        with instance(fmu(NAME, runtime)) as one:
            one.initialize(values)
            runs.append(np.concatenate([drive(one, 60, 0.007), drive(one, 20, 0.1, 60), drive(one, 40, T / 3, 80)]))
    assert np.abs(runs[0] - runs[1]).max(axis=0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("size", [1e-3, 0.004, T, T / 7, 0.1])
@pytest.mark.parametrize("start", [0.0, 3600.0])
def test_samples_are_at_their_instants_whatever_the_step(one, size, start):
    """Open loop, the command being the number of the step: the output shows in which step it was sampled."""
    one.initialize({"controller_on": 0, "voltage_max": 100.0}, start=start)
    seen = []
    for k in range(60):
        one.set({"force_reference": float(k)})
        one.step(size)
        seen.append(one.get("coil_voltage")[0])
    # the latest instant before the end of step k; an instant at that end belongs to the next step
    latest = [math.ceil((k + 1) * size / T - 1e-6) - 1 for k in range(60)]
    sampled_in = [math.floor(n * T / size + 1e-6) for n in latest]
    assert seen == [float(n) for n in sampled_in]


def test_state_covers_command_error_and_sample_count(one):
    one.initialize()
    drive(one, 13, 0.021)
    saved, time = one.save(), one.time
    first = drive(one, 20, 0.021, 13)
    one.restore(saved)
    one.time = time
    for _ in range(2):
        again = drive(one, 20, 0.021, 13)
        assert again.tobytes() == first.tobytes()
        one.restore(one.deserialize(one.serialize(saved)))
        one.time = time
    one.forget(saved)


def test_reset_is_a_fresh_instance(one):
    first = drive(one.initialize(), 20, 0.021)
    one.do("fmi2Reset")
    assert drive(one.initialize(), 20, 0.021).tobytes() == first.tobytes()


def test_instances_do_not_see_each_other(archive):
    with unzipped(archive) as folder:
        library = Library(folder)
        with Instance(library) as a, Instance(library) as b:
            a.initialize()
            b.initialize({"sample_period": 0.01, "K": 5.0})
            found = []
            for k in range(20):
                found.append(drive(a, 1, 0.021, k)[0])
                drive(b, 1, 0.013, k)
        with Instance(library) as alone:
            assert drive(alone.initialize(), 20, 0.021).tobytes() == np.array(found).tobytes()


@pytest.mark.parametrize("name", ["force_reference", "tension"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308])
def test_input_that_is_no_number_ends_in_a_sentence_or_stays_finite(one, name, value):
    one.initialize()
    one.step(0.1)
    reference, cell = one.references([name]), doubles(value)
    status = one.call("fmi2SetReal", reference, 1, cell)
    if status == OK:
        status = one.call("fmi2DoStep", one.time, 0.1, 1)
    if status == OK:
        assert all(map(math.isfinite, one.get(*SIGNALS)))
    else:
        assert status == ERROR
        assert one.messages
        assert math.isfinite(value) or name in " ".join(one.messages) or "not finite" in " ".join(one.messages)


@pytest.mark.parametrize(
    ("name", "value"),
    [("R", 0.0), ("L", 0.0), ("m", -1.0), ("sample_period", 0.0), ("voltage_min", 1.0), ("voltage_max", -1.0)],
)
def test_parameters_out_of_range_are_refused_by_name(one, name, value):
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    one.set({name: value})
    assert one.call("fmi2ExitInitializationMode") == ERROR
    assert f"parameter '{name}' = {value:.10g}" in one.messages[0]


@pytest.mark.parametrize("side", ["low", "high"])
def test_every_bound_of_a_parameter_survives_a_step(archive, side):
    """At the end of its range a parameter may be beyond what can be integrated, but then it is said."""
    layout = fmus.component(NAME).layout
    with unzipped(archive) as folder:
        library = Library(folder)
        for p in layout.parameters:
            value = p.min if side == "low" else p.max
            if p.type == "boolean" or not math.isfinite(value):
                continue
            with Instance(library) as one:
                one.initialize({p.name: value, "force_reference": 1.0, "tension": 0.8})
                status = one.call("fmi2DoStep", 0.0, 0.01, 1)
                if status == OK:
                    assert all(map(math.isfinite, one.get(*SIGNALS))), p.name
                else:
                    assert status == ERROR, p.name
                    assert one.messages, p.name


def test_archive_brings_readme_icon_presets_and_reference(archive):
    with zipfile.ZipFile(archive) as files:
        page = files.read("documentation/index.html").decode()
        for heading in ("Voice-coil dynamic mechanical analyzer", "Assumptions", "Where the numbers come from"):
            assert heading in page
        icon = Path(fmus.voice_coil_dma.__file__).parent / "model.png"
        assert files.read("model.png") == icon.read_bytes()
        preset = files.read("resources/presets/as_described.ssv").decode()
        assert "force_cutoff" in preset
        assert "converters_on" in preset
        for suffix in ("in", "ref"):
            file = f"{NAME}_{suffix}.csv"
            assert files.read(f"extra/org.fmi-standard.fmi-ls-ref/{file}") == (REFERENCE / file).read_bytes()


def test_declared_dependencies_are_those_of_the_equations(archive):
    description = fmpy.read_model_description(str(archive), validate=True)

    def told(unknowns):
        return {u.variable.name: {k.name for k in u.dependencies} for u in unknowns}

    assert told(description.outputs) == {
        "coil_current": {"coil_current"}, "position": {"position"}, "velocity": {"velocity"}, "coil_voltage": set(),
        "force_measured": {"force_filtered"}, "position_measured": {"position_filtered"},
    }  # fmt: skip
    assert told(description.derivatives) == {
        "der(coil_current)": {"coil_current", "velocity"}, "der(position)": {"velocity"},
        "der(velocity)": {"coil_current", "velocity", "tension"}, "der(force_filtered)": {"force_filtered", "tension"},
        "der(position_filtered)": {"position", "position_filtered"},
    }  # fmt: skip


def test_directional_derivatives_are_the_matrices_of_the_equations(fmu):
    states = ["coil_current", "position", "velocity", "force_filtered", "position_filtered"]
    corner = 2 * np.pi * 100.0
    a = np.array([
        [-3000.0, 0, -3900.0, 0, 0], [0, 0, 1, 0, 0], [130.0, 0, -200.0, 0, 0], [0, 0, 0, -corner, 0],
        [0, corner, 0, 0, -corner],
    ])  # fmt: skip
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"force_reference": 1.0, "tension": 0.5})
        one.step(0.05)
        rates = [f"der({s})" for s in states]
        found = np.array([one.tangent(rates, [s], [1.0]) for s in states]).T
        np.testing.assert_allclose(found, a, rtol=1e-12)
        assert one.tangent(rates, ["tension"], [1.0]) == pytest.approx([0, 0, -1 / 0.03, corner, 0], rel=1e-12)
        assert one.tangent(rates, ["force_reference"], [1.0]) == [0.0] * 5


def test_a_tension_with_a_slope_is_followed(fmu):
    """Open loop at 0 V: the filter's answer to a ramp is the ramp less slope / corner, once settled."""
    corner, slope = 2 * np.pi * 100.0, 0.4
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"controller_on": 0})
        one.do("fmi2SetRealInputDerivatives", one.references(["tension"]), 1, (ctypes.c_int * 1)(1), doubles(slope))
        one.step(0.05)
        exact = slope * (0.05 - (1 - math.exp(-corner * 0.05)) / corner)
        assert one.get("force_measured") == [pytest.approx(exact, rel=1e-7)]
