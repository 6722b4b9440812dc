"""The masters agree with closed forms, and the harness tells failures apart."""

from __future__ import annotations

import os
import signal
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from tests.support import hosts

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the hosts of the tests run on Linux"
)

MASTERS = ["run_fmpy", "run_libcosim", "run_ecos", "run_c_host"]
TIMES = np.linspace(0.0, 2.0, 21)
INPUT = np.where(TIMES < 1.0, 1.5, -0.5)
TAU = 0.3


@pytest.fixture(scope="module")
def one_state(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return hosts.build_one_state_fmu(tmp_path_factory.mktemp("one_state"))


@pytest.fixture(scope="module")
def minimal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")
    return hosts.build_minimal_pythonfmu(tmp_path_factory.mktemp("minimal"))


def relaxation(times: np.ndarray) -> np.ndarray:
    """Closed form of tau dx/dt = u - x, x(0) = 0, for the input 1.5 until 1 s and -0.5 from there
    on.
    """
    rising = 1.5 * (1.0 - np.exp(-np.minimum(times, 1.0) / TAU))
    after = np.maximum(times - 1.0, 0.0)
    return np.where(times <= 1.0, rising, -0.5 + (rising + 0.5) * np.exp(-after / TAU))


def euler(times: np.ndarray, level: float) -> np.ndarray:
    """Closed form of explicit Euler with a constant step for dx/dt = level - x, x(0) = 0."""
    step = times[1] - times[0]
    return level * (1.0 - (1.0 - step) ** np.arange(len(times)))


# --- every master against closed forms
# ------------------------------------------------------------------------------


@pytest.mark.parametrize("master", MASTERS)
def test_one_state_follows_its_closed_form(one_state, master):
    found = getattr(hosts, master)(one_state, TIMES, {"u": INPUT}, ["x"], {"tau": TAU})["x"]
    if master == "run_libcosim":
        assert np.isnan(found[0])
        found[0] = 0.0
    # The input switches at a communication point; the step that begins there already has the new
    # value.
    assert found == pytest.approx(relaxation(TIMES), abs=1e-7)


@pytest.mark.parametrize("master", ["run_fmpy", "run_libcosim", "run_ecos"])
def test_minimal_pythonfmu_follows_the_closed_form_of_euler(minimal, master):
    if master == "run_fmpy":  # not in this process: stock pythonfmu may break it
        returncode, found = hosts.in_subprocess(
            master, minimal, TIMES, {"u": 2.0}, ["x"], clean_exit=False
        )
        assert returncode == 0, found
    else:
        found = getattr(hosts, master)(minimal, TIMES, {"u": 2.0}, ["x"], clean_exit=False)
    assert found["x"][1:] == pytest.approx(euler(TIMES, 2.0)[1:], rel=1e-12)


@pytest.mark.parametrize("master", ["run_libcosim", "run_ecos"])
def test_outputs_of_other_masters_are_those_of_fmpy_read_before_the_inputs(one_state, master):
    expected = hosts.run_fmpy(
        one_state, TIMES, {"u": INPUT}, ["x", "u"], {"tau": TAU}, feedthrough=False
    )
    found = getattr(hosts, master)(one_state, TIMES, {"u": INPUT}, ["x", "u"], {"tau": TAU})
    for name in expected:
        assert found[name][1:] == pytest.approx(expected[name][1:], abs=1e-7)


@pytest.mark.parametrize("master", ["run_fmpy", "run_c_host"])
def test_free_spacing_and_start_time(one_state, master):
    times = np.array([5.0, 5.1, 5.15, 6.0, 7.5])
    found = getattr(hosts, master)(one_state, times, {"u": 1.0}, ["x"], {"tau": TAU})["x"]
    assert found == pytest.approx(1.0 - np.exp(-(times - 5.0) / TAU), rel=1e-12)


def test_ecos_starts_at_any_time(one_state):
    found = hosts.run_ecos(one_state, TIMES + 3.0, {"u": 1.0}, ["x"], {"tau": TAU})["x"]
    assert found == pytest.approx(1.0 - np.exp(-TIMES / TAU), rel=1e-9)


def test_outputs_are_read_after_the_inputs_of_the_same_point(one_state):
    for master in ("run_fmpy", "run_c_host"):
        found = getattr(hosts, master)(one_state, TIMES, {"u": INPUT}, ["u"])["u"]
        assert found == pytest.approx(INPUT)


# --- the small FMUs
# -------------------------------------------------------------------------------------------------


def test_one_state_fmu_is_valid(one_state):
    assert validate_fmu(str(one_state)) == []


def test_one_state_saves_its_state_completely(one_state):
    with hosts.extracted(one_state) as folder:
        model = hosts.slave(folder)
        model.instantiate()
        model.setupExperiment()
        model.enterInitializationMode()
        model.exitInitializationMode()
        model.setReal([0], [1.0])
        model.doStep(0.0, 0.5)
        state = model.getFMUState()
        copy = model.deSerializeFMUstate(model.serializeFMUstate(state))
        results = []
        for saved in (state, copy):
            model.setFMUState(saved)
            model.doStep(0.5, 0.5)
            results.append(model.getReal([1])[0])
            model.freeFMUState(saved)
        model.terminate()
        model.freeInstance()
    assert results[0] == results[1] == pytest.approx(1.0 - np.exp(-1.0), rel=1e-12)


# --- failures
# --------------------------------------------------------------------------------------------------


def twice(number: int) -> int:
    print("counting")
    return 2 * number


def fail() -> None:
    raise ValueError("on purpose")


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


@pytest.mark.slow
def test_a_process_returns_a_result_or_a_return_code():
    assert hosts.in_subprocess(twice, 21) == (0, 42)
    assert "counting" in hosts.finish_in_subprocess("tests.interop.test_hosts:twice", 1).output
    returncode, output = hosts.in_subprocess(fail)
    assert returncode == 1
    assert "ValueError: on purpose" in output
    assert hosts.in_subprocess(crash)[0] == -signal.SIGSEGV


def test_bare_name_means_a_function_of_the_harness(one_state):
    returncode, found = hosts.in_subprocess(
        "run_fmpy", str(one_state), [0.0, 1.0], {"u": 1.0}, ["x"]
    )
    assert returncode == 0
    assert found["x"] == pytest.approx([0.0, 1.0 - np.exp(-1.0)])


@pytest.mark.parametrize("master", MASTERS)
def test_refused_initialization_is_an_error(one_state, master):
    with pytest.raises((hosts.HostError, FMICallException)):
        getattr(hosts, master)(one_state, TIMES, {"u": 1.0}, ["x"], {"tau": -1.0})


def test_ecos_itself_ignores_a_refused_initialization(one_state):
    # A fact about Ecos, pinned because it decides what agreement with Ecos is worth: it steps on
    # regardless.
    columns = {"u": np.ones_like(TIMES)}
    returncode, found = hosts.in_subprocess(
        "_ecos", str(one_state), TIMES, 0.1, columns, ["x"], {"tau": -1.0}
    )
    assert returncode == 0
    assert np.all(np.isfinite(found["x"]))


@pytest.mark.parametrize("master", ["run_libcosim", "run_ecos"])
def test_masters_with_a_fixed_step_refuse_others(one_state, master):
    with pytest.raises(ValueError, match="equally spaced"):
        getattr(hosts, master)(one_state, [0.0, 0.1, 0.3], {"u": 1.0}, ["x"])


def test_a_library_that_does_not_load_is_told_apart(tmp_path, one_state):
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(one_state) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            target.writestr(name, b"not a library" if name.endswith(".so") else source.read(name))
    with pytest.raises(hosts.HostError) as caught:
        hosts.run_c_host(broken, TIMES, {}, ["x"])
    assert caught.value.returncode == 2
    with pytest.raises(hosts.HostError):
        hosts.run_libcosim(broken, TIMES, {}, ["x"])
