"""Claims: a system stepped by the kernel delivers the bits, the failures and the counts of the loop
in Python.
"""

from __future__ import annotations

import os
import signal
import threading
import time as clock

import numpy as np
import pytest

from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.kernel import library
from orchestration.master import Stopped, run
from orchestration.master.executor import Executor
from orchestration.system import library as systems
from orchestration.system.model import Member, Port, System, connect
from tests.support.kernel import without_compiler
from tests.support.kit_samples import Adder
from tests.support.master.samples import build_member, ring
from tests.support.master.sleeper import build_sleeper

TIME = 0.1 * np.arange(401)
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


def done(*arguments, **options):
    """All that a run delivers but seconds."""
    told: list[int] = []
    try:
        found = run(*arguments, progress=told.append, **options)
    except Stopped as error:
        found = error.run
    signals = {name: values.tobytes() for name, values in found.signals.items()}
    counted = {name: spent.steps for name, spent in found.statistics.components.items()}
    steps = found.statistics.steps, found.statistics.evaluations
    return {
        "signals": signals,
        "time": found.time.tobytes(),
        "message": found.message,
        "notes": found.notes,
        "counted": counted,
        "steps": steps,
        "told": told,
    }


def both_ways(*arguments, **options):
    assert library.load_stepper() is not None, "no kernel was compiled"
    with_kernel = done(*arguments, **options)
    with without_compiler():
        assert done(*arguments, **options) == with_kernel
    return with_kernel


@pytest.fixture
def steps_in_python(monkeypatch):
    """Steps that the executor makes itself."""
    made, plain = [], Executor.step
    monkeypatch.setattr(
        Executor, "step", lambda *arguments: made.append(arguments) or plain(*arguments)
    )
    return made


@pytest.mark.parametrize("options", [{}, {"method": "jacobi"}, {"feedthrough": False}])
def test_a_system_of_native_fmus(options, steps_in_python):
    rng = np.random.default_rng(1)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(1e-4, 2e-3, 400))])
    inputs = {"force_reference": np.sin(20.0 * time), "current": 0.5 * np.sin(3.0 * time)}
    system = systems.system("dma_bench")
    wire = str(system.connections[0].target)
    run(system, time, inputs, **options)
    assert steps_in_python == []
    found = both_ways(
        system, time, inputs, {wire: 1e-6 * rng.standard_normal(time.size)}, **options
    )
    assert found["message"] == ""


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(
    ("wires", "options"),
    [
        ("a.y -> b.u; b.x -> -0.5 a.u + 0.25", {}),  # factor and offset
        ("a.y -> b.u; b.y -> -0.5 a.u + 0.25", {}),  # a loop, which Python solves
        ("a.x -> b.u; b.x -> a.u", {"rates": {"b": 3}}),  # parts of steps, which Python makes
        ("a.x -> b.u; b.x -> a.u", {"record": ["b.y"]}),
        ("a.x -> b.u; b.x -> a.u", {"rates": {"b": 0.25}}),
        ("a.x -> b.u; b.x -> a.u", {"extrapolation": 1}),
        ("a.x -> b.u; b.x -> a.u", {"tolerance": 1e-4}),
    ],
)
def test_systems_of_all_kinds(member, wires, options, method):
    system = ring(member, {"a": {"d": 0.5, "start": 1.0}, "b": {"d": 0.5, "e": 0.1}}, wires)
    disturbed = {} if "extrapolation" in options else {"b.u": 0.01 * np.cos(TIME)}
    assert both_ways(system, TIME, None, disturbed, method=method, **options)["message"] == ""


def test_a_loop_is_the_only_thing_that_is_done_in_python(member, steps_in_python):
    system = ring(
        member,
        {"a": {"d": 0.5, "start": 1.0}, "b": {"d": 0.5}},
        "a.y -> b.u; b.y -> -0.5 a.u + 0.25",
    )
    assert run(system, TIME).statistics.evaluations > TIME.size
    assert steps_in_python == []


def test_integers_and_booleans_pass_from_member_to_member(tmp_path, runtime, steps_in_python):
    path = tmp_path / "adder.fmu"
    path.write_bytes(build(Adder, runtime, [host_platform()]))
    wires = ["one.lacking -> two.count", "one.off -> two.on", "one.total -> two.level"]
    wires += ["two.lacking -> one.count", "two.excess -> one.more"]
    members = Member("one", path, {"level": 0.1}), Member("two", path, {"more": 3.0})
    system = System("pair", members, connect(*wires), {"on": (Port("one", "on"),)})
    on = (np.arange(TIME.size) % 7 < 3).astype(float)
    jacobi = {"method": "jacobi", "feedthrough": False}
    run(system, TIME, {"on": on}, **jacobi)
    assert steps_in_python == []
    found = both_ways(system, TIME, {"on": on}, **jacobi)
    assert found["message"] == ""
    assert (
        np.frombuffer(found["signals"]["two.off"])[2:].tolist() == on[:-2].tolist()
    )  # two steps later
    on[100] = 0.5
    assert (
        "one.on: 0.5 is neither true (1) nor false (0)"
        in both_ways(system, TIME, {"on": on}, **jacobi)["message"]
    )


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
@pytest.mark.parametrize(
    ("bad", "told"),
    [
        ({"status": WARNING}, ""),
        (
            {"status": DISCARD},
            "bad: member.fmu: step from 30 s to 30.1 s failed (discard, it reached 30 s, ",
        ),
        ({"status": ERROR}, "bad: member.fmu: step from 30 s to 30.1 s failed (error)"),
        ({"status": FATAL}, "bad: member.fmu: step from 30 s to 30.1 s failed (fatal)"),
        ({"status": PENDING}, "bad: member.fmu: step from 30 s to 30.1 s failed (pending)"),
        ({"nan": 1.0}, "bad: its output y is nan at "),
        ({"nan": 1.0, "scaled": True}, "bad: its output y is nan at "),
    ],
)
def test_failures_are_named_as_in_python(member, bad, told, method):
    factor = "2 " if "scaled" in bad else ""
    own = {"when": 30.0} | {name: float(value) for name, value in bad.items() if name != "scaled"}
    system = ring(member, {"bad": own, "good": {}}, f"bad.y -> {factor}good.u; good.x -> bad.u")
    found = both_ways(system, TIME, method=method)
    assert found["message"].startswith(told)
    assert bool(found["message"]) == bool(told)
    if not told:
        assert found["notes"][0].startswith(
            "bad: 100 calls ended with a warning (I have had enough"
        )


def test_a_step_that_is_pending_is_waited_for_in_python(tmp_path):
    waits = build_member(tmp_path, canRunAsynchronuously=True)
    system = ring(
        waits,
        {"a": {"start": 1.0, "status": float(PENDING), "when": 0.0}, "b": {}},
        "a.x -> b.u; b.x -> a.u",
    )
    assert both_ways(system, TIME[:11])["message"] == ""


def test_seconds_are_those_of_who_spent_them(tmp_path, member):
    """One sleeps 1 ms in every step, the other does next to nothing."""
    path = build_sleeper(tmp_path)
    members = (
        Member("slow", path, {"delay": 1e-3, "until": 1e9}),
        Member("quick", member, {"u": 1.0}),
    )
    system = System("pair", members, ())
    statistics = run(system, 1e-3 * np.arange(201)).statistics
    slow, fast = (statistics.components[name].seconds for name in ("slow", "quick"))
    assert 0.2 <= slow <= statistics.wall
    assert 0.0 < fast < 0.2 * slow


@pytest.mark.real_time
def test_ctrl_c_is_heard_long_before_progress_is_told(tmp_path):
    """Progress is told every 2 s here; an interrupt waits for a pulse, and what was computed
    stays.
    """
    system = System(
        "alone", (Member("slow", build_sleeper(tmp_path), {"delay": 0.01, "until": 1e9}),), ()
    )
    told, pressed = [], []

    def press():
        pressed.append(clock.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.5, press).start()
    found = run(system, 0.01 * np.arange(40_000.0), progress=told.append)
    waited = clock.perf_counter() - pressed[0]
    assert told == []
    assert (
        waited < 1.0
    )  # by far less than what is left of the 2 s; 0.1 s on a machine that has nothing else to do
    assert not found.complete
    assert found.message == f"interrupted at {found.time[-1]:.10g} s of 399.99 s"
    assert found.signals["slow.voltage_age"].size == found.time.size > 10
    assert found.signals["slow.voltage_age"] == pytest.approx(found.time, abs=1e-9)
