"""Claims: the stepping kernel gives the bits and failures of the loop in Python, hears Ctrl-C, and is not needed."""

from __future__ import annotations

import os
import signal
import threading
import time as clock
from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from fmus.kit.build import build, toolchain
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu import stepping
from orchestration.fmu.instance import Fmu
from orchestration.fmu.kernel import library, pulse
from orchestration.fmu.simulate import simulate_instance
from tests.support.hosts import build_minimal_pythonfmu, build_one_state_fmu, finish_in_subprocess
from tests.support.kernel import forget_kernel, in_a_bare_loop, one_foreign_fmu, without_compiler
from tests.support.kit_samples import Adder
from tests.support.master.samples import build_member
from tests.support.master.sleeper import build_sleeper

TIME = np.concatenate([[0.0], np.cumsum(np.random.default_rng(1).uniform(1e-3, 0.2, 300))])
CURRENT, FORCE = 0.9 * np.sin(TIME), np.where(TIME % 3.0 < 1.0, 2.0, 0.0)
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


@pytest.fixture(scope="module")
def member(tmp_path_factory):
    return build_member(tmp_path_factory.mktemp("member"))


def simulated(path, time, inputs, outputs=None, parameters=None, **options):
    """Results, or in what words it failed; how many warnings; progress."""
    told: list[int] = []
    with Fmu(path, parameters) as instance:
        instance.start(float(time[0]))
        try:
            found = simulate_instance(instance, time, inputs, outputs, told.append, **options)
        except UserError as error:
            return str(error), instance.warnings, instance.corrupted, told
        return (
            {k: v.tobytes() for k, v in found.items()},
            instance.warnings,
            instance.corrupted,
            told,
        )


def both_ways(*arguments, **options):
    """The same with the kernel and without."""
    assert library.stepper() is not None, "no kernel was compiled"
    found = simulated(*arguments, **options)
    with without_compiler():
        assert library.stepper() is None
        return found, simulated(*arguments, **options)


@pytest.mark.parametrize(
    "options", [{}, {"parts": 3}, {"linear": ["current"]}, {"linear": ["force"], "parts": 2}]
)
def test_the_bits_are_those_of_the_loop_in_python(fmu, runtime, options):
    inputs = {"force": FORCE, "current": CURRENT}
    with_kernel, without = both_ways(fmu("ppy_actuator", runtime), TIME, inputs, **options)
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
    monkeypatch.setattr(stepping, "stepped", lambda *arguments: pytest.fail("stepped in Python"))
    assert isinstance(simulated(fmu("ppy_actuator", "native"), TIME, {"current": CURRENT})[0], dict)


@pytest.mark.parametrize("options", [{}, {"linear": ["level"], "parts": 2}])
def test_integers_and_booleans_are_moved_too(tmp_path, runtime, options):
    """Wherever they stand among the reals."""
    path = tmp_path / "adder.fmu"
    path.write_bytes(build(Adder, runtime, [host_platform()]))
    k = np.arange(TIME.size)
    inputs = {"on": (k % 7 < 3) * 1.0, "level": CURRENT, "count": k % 5 - 2.0, "more": k % 3 + 1.0}
    with_kernel, without = both_ways(
        path, TIME, inputs, ["excess", "off", "total", "lacking"], **options
    )
    assert with_kernel == without
    assert np.frombuffer(with_kernel[0]["lacking"]).tolist() == (3.0 - inputs["count"]).tolist()
    excess = inputs["count"] - 5.0 * inputs["more"]
    assert np.frombuffer(with_kernel[0]["excess"]).tolist() == excess.tolist()
    assert np.frombuffer(with_kernel[0]["off"]).tolist() == (1.0 - inputs["on"]).tolist()
    for name, value, told in (
        ("on", 0.5, "0.5 is neither true (1) nor false (0)"),
        ("on", np.nan, "nan is neither true (1) nor false (0)"),
        ("count", 0.5, "0.5 is not a whole number"),
        ("count", 3e9, "3e+09 is not a whole number"),
        ("count", -np.inf, "-inf is not a whole number"),
    ):
        bad = inputs | {name: np.where(k == 20, value, inputs[name])}
        with_kernel, without = both_ways(path, TIME, bad, **options)
        assert f"{name}: {told}" in with_kernel[0]
        assert with_kernel == without


@pytest.mark.parametrize("options", [{}, {"linear": ["u"], "parts": 2}])
@pytest.mark.parametrize("status", [WARNING, DISCARD, ERROR, FATAL, PENDING])
def test_a_step_that_fails_is_named_as_in_python(member, status, options):
    time = 0.1 * np.arange(51)
    bad = {"status": float(status), "when": 3.0}
    with_kernel, without = both_ways(member, time, {"u": np.ones(51)}, parameters=bad, **options)
    assert with_kernel == without
    result, warnings, corrupted, _ = with_kernel
    assert corrupted == (status == FATAL)
    if status == WARNING:
        assert warnings == 20 * options.get("parts", 1)
    else:
        assert str(result).startswith("member.fmu: step from 3 s failed (")


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


# --- Ctrl-C ---------------------------------------------------------------------------------------------------------


def test_ctrl_c_is_heard_long_before_progress_is_told(tmp_path):
    """Progress is told every 2 s here; an interrupt waits for a pulse."""
    path = build_sleeper(tmp_path)
    told, pressed = [], []

    def press():
        pressed.append(clock.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    with Fmu(path, {"delay": 0.01, "until": 1e9}) as instance:
        instance.start()
        timer = threading.Timer(0.5, press)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            simulate_instance(instance, 0.01 * np.arange(40_000.0), {}, progress=told.append)
        waited = clock.perf_counter() - pressed[0]
    assert told == [0]
    assert (
        waited < 1.0
    )  # by far less than what is left of the 2 s; 0.1 s on a machine that has nothing else to do
    assert not any(thread.name == "kernel pulse" for thread in threading.enumerate())


def test_no_thread_is_left_behind_where_a_step_fails(member):
    simulated(member, 0.1 * np.arange(51), {}, parameters={"status": float(ERROR), "when": 1.0})
    assert not any(thread.name == "kernel pulse" for thread in threading.enumerate())


def test_pulses_change_nothing(fmu, monkeypatch):
    path = fmu("ppy_actuator", "native")
    expected = simulated(path, TIME, {"current": CURRENT})
    monkeypatch.setattr(pulse, "PERIOD", 1e-6)
    for _ in range(5):
        assert simulated(path, TIME, {"current": CURRENT}) == expected


# --- no kernel ------------------------------------------------------------------------------------------------------


def refused(*arguments, **options):
    raise UserError("zig failed")


@pytest.mark.parametrize("hindrance", ["compiler fails", "cache is a file", "no such platform"])
def test_what_hinders_compiling_hinders_nobody_from_simulating(
    fmu, tmp_path, monkeypatch, hindrance
):
    path = fmu("ppy_actuator", "native")
    expected = simulated(path, TIME, {"current": CURRENT})
    if hindrance == "no such platform":
        monkeypatch.setattr(toolchain, "host_platform", refused)
    else:
        Path(tmp_path, "file").touch()
        monkeypatch.setenv(
            "PPY_CACHE", str(tmp_path / "file" if hindrance == "cache is a file" else tmp_path)
        )
    if hindrance == "compiler fails":
        monkeypatch.setattr(toolchain, "compile_library", refused)
    forget_kernel()
    try:
        assert library.stepper() is None
        assert simulated(path, TIME, {"current": CURRENT}) == expected
    finally:
        forget_kernel()


def test_the_kernel_is_compiled_once_and_found_by_what_it_is_made_of(tmp_path, monkeypatch):
    monkeypatch.setenv("PPY_CACHE", str(tmp_path))
    for _ in range(2):
        forget_kernel()
        assert library.stepper() is not None
    assert len([path for path in tmp_path.iterdir() if path.suffix != ".sha256"]) == 1
    forget_kernel()
