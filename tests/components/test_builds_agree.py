"""Two builds, one behaviour: with each other, with linear theory, in every master, and compiled by
somebody else.
"""

from __future__ import annotations

import ctypes.util
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import control
import numpy as np
import pytest
from scipy.linalg import expm

from fmus import COMPONENTS, component
from fmus.kit.build.building import RUNTIMES
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.contract.subjects import SUBJECTS, TELLING_NAMES, actuators_only, each_front_end
from tests.support import hosts
from tests.support.pace import FREE_FEET, slow_but

linux = pytest.mark.skipif(sys.platform != "linux", reason="the hosts of the tests run on Linux")
QUICK = slow_but(
    COMPONENTS, *(name for name in COMPONENTS if name not in ("foot_dynamic", *FREE_FEET))
)  # whose laws in Python take long
OPTIONS = ("-std=c99 -O2", "-O0", "-O3")
FORCED, LENGTH_DRIVEN = "ppy_actuator", "ppy_actuator_length_driven"
SECOND_INPUT = {FORCED: "force", LENGTH_DRIVEN: "length_change"}
MARGINS = ("compression_margin", "displacement_margin", "force_margin", "voltage_margin")
OUTPUTS = {
    FORCED: (
        "voltage",
        "charge",
        "electrochemical_displacement",
        "mechanical_displacement",
        "displacement",
        *MARGINS,
    ),
    LENGTH_DRIVEN: (
        "voltage",
        "charge",
        "electrochemical_displacement",
        "mechanical_displacement",
        "tension",
        *MARGINS,
    ),
}
# Thesis table 3-1 (mean of the 12-layer sets) and fig. 3-9, typed in here once more: no number is
# taken from the model.
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6

Signals = dict[str, np.ndarray]


def run(path: Path, time: np.ndarray, inputs: Signals, **parameters: float) -> Signals:
    with Fmu(path, parameters) as instance:
        instance.start(float(time[0]), float(time[-1]))
        return simulate_instance(instance, time, inputs)


def deviation(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference relative to the largest value."""
    return float(np.max(np.abs(found - expected)) / (np.max(np.abs(expected)) or 1.0))


def points(steps: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(steps)])


def stimulus(name: str, n: int, seed: int, slack: bool = True) -> Signals:
    """Random held inputs; the current changes with every tenth sample, the load with every
    sample.
    """
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(-1.3, 1.3, n // 10 + 1), 10)[:n]
    limits = (0.0, 3.0) if name == FORCED else (-3e-4 if slack else 4e-4, 8e-4)
    return {"current": current, SECOND_INPUT[name]: random.uniform(*limits, n)}


def moves(name: str, n: int, seed: int) -> tuple[np.ndarray, Signals]:
    """Times, steps being mixed around the one the component proposes, and held inputs around their
    typical values.
    """
    random = np.random.default_rng(seed)
    steps = component(name).experiment[1] * 10.0 ** random.uniform(-2.0, 0.5, n - 1)
    return points(steps), {
        signal: value * random.uniform(-1.0, 1.5, n)
        for signal, value in SUBJECTS[name].inputs.items()
    }


def reals(name: str) -> list[str]:
    """Outputs that are numbers."""
    return [v.name for v in component(name).layout.measurable if v.type == "real"]


def creep(time: np.ndarray, load: float) -> np.ndarray:
    """Length the dashpot gains under a load: added to an imposed length, it keeps up about that
    tension.
    """
    return load / B1 * time


# --- with each other
# ------------------------------------------------------------------------------------------------

SIZES = 10.0 ** np.linspace(-3.0, 1.0, 41)  # seconds


each_count = pytest.mark.parametrize("count", slow_but([20_000, 100_000], 20_000))


@pytest.fixture(scope="module")
def long_runs(fmu) -> Callable[[str, int], tuple[np.ndarray, Signals, dict[str, Signals]]]:
    """Steps, inputs and results of both builds over a number of steps of mixed sizes."""
    done: dict[tuple[str, int], tuple[np.ndarray, Signals, dict[str, Signals]]] = {}

    def get(name: str, count: int) -> tuple[np.ndarray, Signals, dict[str, Signals]]:
        if (name, count) not in done:
            steps = np.random.default_rng(7).choice(SIZES, count)
            inputs = stimulus(name, count + 1, seed=8)
            if name == LENGTH_DRIVEN:
                inputs["length_change"] += creep(points(steps), 2.0)
            results = {
                runtime: run(fmu(name, runtime), points(steps), inputs) for runtime in RUNTIMES
            }
            done[name, count] = steps, inputs, results
        return done[name, count]

    return get


@pytest.mark.slow
@actuators_only
@each_count
def test_builds_agree_over_many_steps_of_mixed_sizes(long_runs, name, count):
    _, _, results = long_runs(name, count)
    assert set(results["native"]) == set(OUTPUTS[name])
    for output, expected in results["native"].items():
        assert np.ptp(expected) > 0.0, f"{output} does not move: nothing is compared"
        # of each value; the second bound is for those near zero
        close = np.abs(results["python"][output] - expected) <= 1e-9 * np.maximum(
            np.abs(expected), 1e-6 * np.max(np.abs(expected))
        )
        assert close.all(), f"{output} differs first at step {np.argmin(close)}"


@each_count
def test_length_driven_run_was_taut_and_slack(long_runs, count):
    _, _, results = long_runs(LENGTH_DRIVEN, count)
    slack = np.mean(results["native"]["tension"] == 0.0)
    assert 0.1 < slack < 0.9


@actuators_only
def test_builds_agree_away_from_the_defaults(fmu, name):
    parameters = {
        "R1": 1.32,
        "C": 0.46,
        "alpha": -2e-4,
        "b2": 1e3,
        "k2": 4e3,
        "charge_start": 0.3,
        "kelvin_elongation_start": 1e-4,
    }
    steps = 10.0 ** np.random.default_rng(5).uniform(-4.0, 2.0, 3000)
    inputs = stimulus(name, 3001, seed=6)
    results = [run(fmu(name, runtime), points(steps), inputs, **parameters) for runtime in RUNTIMES]
    for output in OUTPUTS[name]:
        assert deviation(results[0][output], results[1][output]) < 1e-9, output


@pytest.mark.parametrize("changed", [False, True], ids=["defaults", "changed"])
@pytest.mark.parametrize("name", QUICK)
def test_builds_of_every_component_agree(fmu, name, changed):
    parameters = dict(SUBJECTS[name].parameters) if changed else {}
    time, inputs = moves(name, 200, seed=7)
    results = [
        hosts.run_fmpy(
            fmu(name, runtime),
            time,
            inputs,
            reals(name),
            parameters,
            tolerance=SUBJECTS[name].tolerance,
        )
        for runtime in RUNTIMES
    ]
    assert any(np.ptp(results[0][output]) > 0.0 for output in reals(name)), "nothing is compared"
    for output in reals(name):
        assert deviation(results[0][output], results[1][output]) < 1e-9, output


# --- with linear theory
# ---------------------------------------------------------------------------------------------


def system(name: str) -> tuple[np.ndarray, np.ndarray]:
    """State and input matrices of eq. 3.5: charge, Kelvin and Maxwell elongation; current and load
    or length.
    """
    a, b = np.zeros((3, 3)), np.zeros((3, 2))
    a[0, 0], b[0, 0] = -1.0 / (C * (R1 + R2)), R2 / (R1 + R2)
    if name == FORCED:
        a[1, 1], b[1, 1], b[2, 1] = -K2 / B2, 1.0 / B2, 1.0 / B1
        return a, b
    force = K1 * np.array([-ALPHA, -1.0, -1.0])  # of the spring, per state; K1 per length
    a[1], b[1, 1] = force / B2 - [0.0, K2 / B2, 0.0], K1 / B2
    a[2], b[2, 1] = force / B1, K1 / B1
    return a, b


def with_margins(found: Signals, load: np.ndarray, elongation: np.ndarray) -> Signals:
    """Add what is left to 3 N, to slack, to 7 mm and to 1.5 V."""
    return found | {
        "force_margin": 3.0 - load,
        "compression_margin": load,
        "displacement_margin": 7e-3 - np.abs(elongation),
        "voltage_margin": 1.5 - np.abs(found["voltage"]),
    }


def outputs_of(name: str, states: np.ndarray, inputs: Signals) -> Signals:
    charge, kelvin, maxwell = states.T
    current, second = inputs["current"], inputs[SECOND_INPUT[name]]
    # Kirchhoff: v = R2 (i - j), j through R1 and C with v = R1 j + Q / C
    through = (R2 * current - charge / C) / (R1 + R2)
    found = {
        "charge": charge,
        "voltage": R2 * (current - through),
        "electrochemical_displacement": ALPHA * charge,
    }
    if name == FORCED:
        found["mechanical_displacement"] = kelvin + maxwell + second / K1
        found["displacement"] = ALPHA * charge + kelvin + maxwell + second / K1
        return with_margins(found, second, found["displacement"])
    found["tension"] = K1 * (second - ALPHA * charge - kelvin - maxwell)
    found["mechanical_displacement"] = second - ALPHA * charge
    return with_margins(found, found["tension"], second)


def exact(name: str, steps: np.ndarray, inputs: Signals) -> Signals:
    """Solution by matrix exponential, one for each size of step."""
    a, b = system(name)
    augmented = np.zeros((5, 5))
    augmented[:3] = np.column_stack([a, b])
    # in units of the states, or the exponential loses digits between newtons per metre and metres
    scale = np.array([1.0, 1e-4, 1e-4, 1.0, 1.0 if name == FORCED else 1e-4])
    augmented = augmented * scale / scale[:, None]
    sizes, which = np.unique(steps, return_inverse=True)
    transitions = expm(augmented * sizes[:, None, None])[:, :3]
    fed = np.column_stack([inputs["current"], inputs[SECOND_INPUT[name]]]) / scale[3:]
    states = np.zeros((len(steps) + 1, 3))
    for k, choice in enumerate(which):
        states[k + 1] = transitions[choice] @ np.concatenate([states[k], fed[k]])
    return outputs_of(name, states * scale[:3], inputs)


@each_count
def test_force_driven_follows_the_matrix_exponential(long_runs, runtime, count):
    steps, inputs, results = long_runs(FORCED, count)
    expected = exact(FORCED, steps, inputs)
    for output in OUTPUTS[FORCED]:
        assert deviation(results[runtime][output], expected[output]) < 1e-7, output


def test_length_driven_follows_the_matrix_exponential_while_taut(fmu, runtime):
    steps = np.random.default_rng(3).choice(SIZES, 3000)
    inputs = stimulus(LENGTH_DRIVEN, 3001, seed=4, slack=False)
    inputs["length_change"] += 1e-3 + creep(points(steps), 8.0)
    expected = exact(LENGTH_DRIVEN, steps, inputs)
    assert expected["tension"].min() > 0.0
    found = run(fmu(LENGTH_DRIVEN, runtime), points(steps), inputs)
    for output in OUTPUTS[LENGTH_DRIVEN]:
        assert deviation(found[output], expected[output]) < 1e-7, output


def sampled(transfer: control.TransferFunction, time: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Response to an input that is held between samples."""
    discrete = control.sample_system(transfer, time[1] - time[0], "zoh")
    return control.forced_response(discrete, time, held).outputs


def transfers() -> tuple[
    control.TransferFunction, control.TransferFunction, list[control.TransferFunction]
]:
    """Impedance (eq. 3.9), charge per current, and the parts of the compliance (eqs. 3.1-3.3), as
    printed.
    """
    denominator = [C * (R1 + R2), 1.0]
    impedance = control.tf([R1 * R2 * C, R2], denominator)
    charge = control.tf([R2 * C], denominator)
    compliance = [
        control.tf([1.0 / K1], [1.0]),
        control.tf([1.0 / B1], [1.0, 0.0]),
        control.tf([1.0], [B2, K2]),
    ]
    return impedance, charge, compliance


def test_force_driven_follows_its_transfer_functions(fmu, runtime):
    time = 0.1 * np.arange(4001)
    inputs = stimulus(FORCED, len(time), seed=11)
    found = run(fmu(FORCED, runtime), time, inputs)
    impedance, charge, compliance = transfers()
    expected: Signals = {
        "voltage": sampled(impedance, time, inputs["current"]),
        "charge": sampled(charge, time, inputs["current"]),
        "mechanical_displacement": np.sum(
            [sampled(part, time, inputs["force"]) for part in compliance], axis=0
        ),
    }
    expected["electrochemical_displacement"] = ALPHA * expected["charge"]
    expected["displacement"] = (
        expected["electrochemical_displacement"] + expected["mechanical_displacement"]
    )
    expected = with_margins(expected, inputs["force"], expected["displacement"])
    for output in OUTPUTS[FORCED]:
        assert deviation(found[output], expected[output]) < 1e-7, output


def test_length_driven_follows_its_transfer_functions_while_taut(fmu, runtime):
    time = 0.05 * np.arange(2001)
    inputs = stimulus(LENGTH_DRIVEN, len(time), seed=12, slack=False)
    inputs["length_change"] += 1e-3
    found = run(fmu(LENGTH_DRIVEN, runtime), time, inputs)
    impedance, charge, _ = transfers()
    # stiffness of the chain: 1 / (1/k1 + 1/(b1 s) + 1/(b2 s + k2)), cleared of fractions by hand
    stiffness = control.tf(
        [K1 * B1 * B2, K1 * B1 * K2, 0.0], [B1 * B2, B1 * K2 + K1 * (B1 + B2), K1 * K2]
    )
    expected: Signals = {
        "voltage": sampled(impedance, time, inputs["current"]),
        "charge": sampled(charge, time, inputs["current"]),
        "tension": sampled(stiffness, time, inputs["length_change"])
        - ALPHA * sampled(stiffness * charge, time, inputs["current"]),
    }
    expected["electrochemical_displacement"] = ALPHA * expected["charge"]
    expected["mechanical_displacement"] = (
        inputs["length_change"] - expected["electrochemical_displacement"]
    )
    expected = with_margins(expected, expected["tension"], inputs["length_change"])
    assert expected["tension"].min() > 0.0
    for output in OUTPUTS[LENGTH_DRIVEN]:
        assert deviation(found[output], expected[output]) < 1e-7, output


# --- in every master
# ------------------------------------------------------------------------------------------------


@linux
@each_front_end
@pytest.mark.parametrize(
    ("master", "fmi"),
    slow_but(
        [("run_libcosim", 2), ("run_ecos", 2), ("run_ecos", 3)],
        ("run_libcosim", 2),
        ("run_ecos", 3),
    ),
)
def test_both_builds_run_in_real_masters(fmu, name, runtime, master, fmi):
    # a binary fraction, and a whole number of nanoseconds: every master counts its multiples alike
    time = 2.0 ** np.ceil(np.log2(component(name).experiment[1])) * np.arange(81)
    _, inputs = moves(name, len(time), seed=21)
    # Ecos sets no element of an array
    given = {n: x for n, x in SUBJECTS[name].parameters.items() if fmi == 2 or "[" not in n}
    expected = hosts.run_fmpy(
        fmu(name, runtime), time, inputs, reals(name), given, feedthrough=False
    )
    found = getattr(hosts, master)(fmu(name, runtime, fmi), time, inputs, reals(name), given)
    for output in reals(name):
        assert deviation(found[output][1:], expected[output][1:]) < 1e-9, output


@linux
def test_native_build_runs_in_a_host_without_python(fmu, name):
    time, inputs = moves(name, 201, seed=23)
    environment = {"PPY_LIBPYTHON": "/nowhere/libpython3.so", "PYTHONHOME": "/nowhere"}
    found = hosts.run_c_host(
        fmu(name, "native"), time, inputs, reals(name), environment=environment
    )
    expected = run(fmu(name, "native"), time, inputs)
    for output in reals(name):
        assert np.array_equal(found[output], expected[output]), output


@linux
@pytest.mark.parametrize("name", slow_but(COMPONENTS, *TELLING_NAMES))
@pytest.mark.parametrize("fmi", [2, 3])
def test_python_build_brings_python_into_a_host_without(fmu, name, fmi):
    time, inputs = moves(name, 81, seed=24)
    environment = {"PPY_LIBPYTHON": hosts.python_library()}
    found = hosts.run_c_host(
        fmu(name, "python", fmi), time, inputs, reals(name), environment=environment
    )
    expected = run(fmu(name, "python"), time, inputs)
    for output in reals(name):
        assert np.array_equal(found[output], expected[output]), output


@linux
@pytest.mark.parametrize(
    ("library", "complaint"),
    [("/nowhere/libpython3.so", "cannot be loaded"), (ctypes.util.find_library("m"), "lacks")],
)
def test_python_build_without_python_says_what_to_do(fmu, library, complaint):
    with pytest.raises(hosts.HostError) as caught:
        hosts.run_c_host(
            fmu(FORCED, "python"),
            [0.0, 0.1],
            {},
            ["charge"],
            environment={"PPY_LIBPYTHON": library},
        )
    assert caught.value.returncode == 3, "no clean refusal by fmi2Instantiate"
    message = caught.value.output.splitlines()[0]
    assert "no Python: PPY_LIBPYTHON" in message
    assert library in message
    assert complaint in message


@linux
def test_python_build_left_alone_in_a_host_runs_or_refuses(fmu):
    # Which of the two depends on the machine: is there a libpython where the dynamic linker looks?
    output = ""
    try:
        hosts.run_c_host(
            fmu(FORCED, "python"), [0.0, 0.1], {}, ["charge"], environment={"PPY_LIBPYTHON": ""}
        )
        returncode = 0
    except hosts.HostError as error:
        returncode, output = error.returncode, error.output
    assert returncode in (0, 3), output
    assert returncode == 0 or "install libpython3 or set PPY_LIBPYTHON" in output


# --- compiled by somebody else
# --------------------------------------------------------------------------------------


@linux
@pytest.mark.parametrize(
    ("name", "options"),
    slow_but(
        [(name, options) for name in COMPONENTS for options in OPTIONS],
        *((name, "-O0") for name in TELLING_NAMES),
    ),
)
def test_sources_compile_alone_and_give_the_same_results(fmu, name, tmp_path, options):
    folder = tmp_path / "empty"
    folder.mkdir()
    with zipfile.ZipFile(fmu(name, "native")) as archive:
        for member in archive.namelist():
            if member.startswith("sources/"):
                (folder / member.removeprefix("sources/")).write_bytes(archive.read(member))
        description = ElementTree.fromstring(archive.read("modelDescription.xml"))
    files = [node.attrib["name"] for node in description.iterfind("CoSimulation/SourceFiles/File")]
    command = [
        hosts.compiler(),
        *options.split(),
        "-fPIC",
        "-shared",
        *files,
        "-o",
        "library.so",
        "-lm",
    ]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    time, inputs = moves(name, 1001, seed=32)
    again = tmp_path / "again.fmu"
    swap_binary(fmu(name, "native"), again, (folder / "library.so").read_bytes())
    found, expected = run(again, time, inputs), run(fmu(name, "native"), time, inputs)
    for output in reals(name):
        assert deviation(found[output], expected[output]) < 1e-12, output


def swap_binary(source: Path, target: Path, library: bytes) -> None:
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            new.writestr(
                entry, library if entry.filename.startswith("binaries/") else old.read(entry)
            )


def test_numbers_of_the_thesis_are_the_defaults():
    """The oracles above use numbers of their own; should a default change, this says so first."""
    cls = component(FORCED)
    defaults = {parameter.name: parameter.start for parameter in cls.layout.parameters}
    assert {n: defaults[n] for n in ("R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2")} == {
        "R1": R1,
        "R2": R2,
        "C": C,
        "alpha": ALPHA,
        "k1": K1,
        "b1": B1,
        "k2": K2,
        "b2": B2,
    }
