"""Claims: the stepping kernel gives the bits and failures of the loop in Python, hears Ctrl-C, and
is not needed.
"""

from __future__ import annotations

import threading

import numpy as np
import pytest

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu import stepping
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.support.hosts import build_minimal_pythonfmu, build_one_state_fmu, finish_in_subprocess
from tests.support.kernel import (
    CURRENT,
    FORCE,
    TIME,
    both_ways,
    in_a_bare_loop,
    one_foreign_fmu,
    simulated,
)
from tests.support.kit_samples import Adder
from tests.support.master.samples import build_member

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


@pytest.fixture(scope="module")
def member(tmp_path_factory):
    return build_member(tmp_path_factory.mktemp("member"))


def test_the_bits_are_those_of_the_loop_in_python(fmu, runtime):
    inputs = {"force": FORCE, "current": CURRENT}
    with_kernel, without = both_ways(fmu("ppy_actuator", runtime), TIME, inputs)
    assert isinstance(with_kernel[0], dict)
    assert with_kernel == without


def test_the_bits_are_those_of_a_bare_loop_in_c(fmu):
    path = fmu("ppy_actuator", "native")
    with Fmu(path) as instance:
        instance.start()
        found = simulate_instance(instance, TIME, {"current": CURRENT}, ["voltage"])
    assert (
        found["voltage"].tobytes()
        == in_a_bare_loop(path, TIME, "current", CURRENT, "voltage").tobytes()
    )


def test_the_kernel_is_what_steps(fmu, monkeypatch):
    monkeypatch.setattr(
        stepping, "follow_course", lambda *arguments: pytest.fail("stepped in Python")
    )
    assert isinstance(simulated(fmu("ppy_actuator", "native"), TIME, {"current": CURRENT})[0], dict)


def test_integers_and_booleans_are_moved_too(tmp_path, runtime):
    """Wherever they stand among the reals."""
    path = tmp_path / "adder.fmu"
    path.write_bytes(build(Adder, runtime, [host_platform()]))
    k = np.arange(TIME.size)
    inputs = {"on": (k % 7 < 3) * 1.0, "level": CURRENT, "count": k % 5 - 2.0, "more": k % 3 + 1.0}
    with_kernel, without = both_ways(path, TIME, inputs, ["excess", "off", "total", "lacking"])
    assert with_kernel == without
    assert np.frombuffer(with_kernel[0]["lacking"]).tolist() == (3.0 - inputs["count"]).tolist()
    excess = inputs["count"] - 5.0 * inputs["more"]
    assert np.frombuffer(with_kernel[0]["excess"]).tolist() == excess.tolist()
    assert np.frombuffer(with_kernel[0]["off"]).tolist() == (1.0 - inputs["on"]).tolist()
    for name, value, told in (
        ("on", 0.5, "0.5 is neither true (1) nor false (0)"),
        ("on", np.nan, "nan is neither true (1) nor false (0)"),
        ("count", 0.5, "0.5 is not a whole number"),
        ("count", 3e9, "3000000000 is not a whole number"),
        ("count", -np.inf, "-inf is not a whole number"),
    ):
        bad = inputs | {name: np.where(k == 20, value, inputs[name])}
        with_kernel, without = both_ways(path, TIME, bad)
        assert f"{name}: {told}" in with_kernel[0]
        assert with_kernel == without


@pytest.mark.parametrize("status", [WARNING, DISCARD, ERROR, FATAL, PENDING])
def test_a_step_that_fails_is_named_as_in_python(member, status):
    time = 0.1 * np.arange(51)
    bad = {"status": float(status), "when": 3.0}
    with_kernel, without = both_ways(member, time, {"u": np.ones(51)}, parameters=bad)
    assert with_kernel == without
    result, warnings, corrupted, _ = with_kernel
    assert corrupted == (status == FATAL)
    if status == WARNING:
        assert warnings == 20
    else:
        ends = "asks to end the simulation in place of a step from 3 s: "
        told = ends if status == DISCARD else "step from 3 s failed ("
        assert str(result).startswith(f"member.fmu: {told}")


def test_inputs_that_are_refused_are_named_as_in_python(fmu, runtime):
    current = np.where(np.arange(TIME.size) == 20, np.nan, CURRENT)
    with_kernel, without = both_ways(fmu("ppy_actuator", runtime), TIME, {"current": current})
    assert isinstance(with_kernel[0], str)
    assert with_kernel == without


def test_an_output_that_is_no_number_is_delivered(member):
    time = 0.1 * np.arange(51)
    with_kernel, without = both_ways(
        member, time, {"u": np.ones(51)}, parameters={"nan": 1.0, "when": 3.0}
    )
    assert with_kernel == without
    assert np.isnan(np.frombuffer(with_kernel[0]["y"])).tolist() == (time > 3.0 - 1e-9).tolist()


@pytest.mark.slow
def test_fmus_of_other_people(tmp_path):
    built = build_one_state_fmu(tmp_path)
    with_kernel, without = both_ways(built, TIME, {"u": CURRENT}, ["x"])
    assert isinstance(with_kernel[0], dict)
    assert with_kernel == without
    stock = build_minimal_pythonfmu(tmp_path)
    found = finish_in_subprocess(one_foreign_fmu, str(stock), clean_exit=False)
    assert found.result is not None, found.output
    assert found.result[0] == found.result[1]


@pytest.mark.parametrize("points", [2, 199, 200, 1001])
def test_progress_is_told_as_in_python(fmu, points):
    with_kernel, without = both_ways(
        fmu("ppy_actuator", "native"), np.linspace(0.0, 1.0, points), {}
    )
    assert with_kernel == without
    assert with_kernel[3][-1] == points


# --- Ctrl-C
# --------------------------------------------------------------------------------------------------


def test_no_thread_is_left_behind_where_a_step_fails(member):
    simulated(member, 0.1 * np.arange(51), {}, parameters={"status": float(ERROR), "when": 1.0})
    assert not any(thread.name == "kernel pulse" for thread in threading.enumerate())


# --- no kernel
# --------------------------------------------------------------------------------------------------
