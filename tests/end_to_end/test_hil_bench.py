"""Claims: ``ppy run hil_bench`` closes the loop through a rig, in lockstep and in real time, and
keeps what it did.

The rig is a small server of the tests' own behind real sockets. Its actuator is a spring, so where
the loop settles is known in closed form: the tension is what is wanted, the length that over the
stiffness.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from orchestration.experiment import results
from tests.support.command import posix, ppy
from tests.support.processes import busy
from tests.support.rig.process import Server
from tests.support.rig.small_rig import SmallRig

STIFFNESS, RESISTANCE = 6300.0, 0.5  # N/m, ohm
INPUTS = {"current": "A", "length_change": "m"}
OUTPUTS = {
    "voltage": "V",
    "electrochemical_displacement": "m",
    "mechanical_displacement": "m",
    "charge": "C",
    "tension": "N",
}
STRONGEST = 4.9  # N, that the voice coil bears (thesis section 2.2.2)
NOT_HELD = re.compile("this machine does not hold .*")
AGES = [f"proxy.{name}_age" for name in OUTPUTS]


def spring(inputs: Mapping[str, float], now: float) -> dict[str, float]:
    tension = max(0.0, STIFFNESS * inputs["length_change"])
    return dict.fromkeys(OUTPUTS, 0.0) | {
        "voltage": RESISTANCE * inputs["current"],
        "tension": tension,
    }


@pytest.fixture
def rig(request) -> Iterator[SmallRig]:
    with SmallRig(
        plant=spring, inputs=INPUTS, outputs=OUTPUTS, limits={}, period=1e-3, mode=request.param
    ) as rig:
        yield rig


def run(rig: SmallRig, folder: Path, *arguments: str, duration: float):
    settings = [
        f"proxy.endpoint={rig.endpoint}",
        f"duration={duration}",
        "inputs.current.initial=0.4",
    ]
    chosen = [part for setting in settings for part in ("--set", setting)]
    return ppy(
        "run",
        "hil_bench",
        "--runtime",
        "python",
        "--out",
        "run.nc",
        *chosen,
        *arguments,
        cwd=folder,
    )


def settled(data, name: str) -> float:
    """Mean of the last tenth of a second."""
    return float(data[name].values[data.time.values > data.time.values[-1] - 0.1].mean())


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["lockstep"], indirect=True)
def test_in_lockstep_it_needs_no_clock(rig, tmp_path):
    done = run(rig, tmp_path, duration=2.0)
    assert done.returncode == 0, done.stderr
    data = results.read(tmp_path / "run.nc")
    assert settled(data, "proxy.tension") == pytest.approx(1.0, rel=5e-3)
    assert settled(data, "bench.position") == pytest.approx(1.0 / STIFFNESS, rel=5e-3)
    assert settled(data, "proxy.voltage") == pytest.approx(0.4 * RESISTANCE, rel=1e-12)
    steps = [message["step"] for message in rig.of_type("exchange")]
    assert steps == pytest.approx(np.full(2000, 1e-3))


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("rig", ["real-time"], indirect=True)
def test_in_real_time_it_keeps_pace_and_records_the_link(rig, tmp_path):
    """A busy machine may miss any number of deadlines; that it is told, and that the loop settles,
    is what is held.
    """
    done = run(
        rig,
        tmp_path,
        "--real-time",
        "--lag",
        "20",
        "--set",
        "step=10ms",
        "--set",
        "master.rates.bench=100",
        duration=1.5,
    )
    if refusal := NOT_HELD.search(done.stderr):
        pytest.skip(refusal[0])
    assert done.returncode == 0, done.stderr
    assert re.search(r"noted: this machine holds 100 Hz with the rig at .*p99\.9 ", done.stderr)
    data = results.read(tmp_path / "run.nc")
    assert data.attrs["deadlines"] == data.time.size - 1
    assert data.attrs["wall_time"] >= 1.5
    assert set(AGES) | {
        "proxy.link_state",
        "proxy.round_trip_time",
        "proxy.missed_deadlines",
    } <= set(data)
    assert settled(data, "proxy.voltage") == pytest.approx(0.4 * RESISTANCE, rel=1e-12)
    assert float(data["proxy.round_trip_time"].min()) > 0.0
    assert len(rig.of_type("exchange")) >= data.time.size - 1


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("rig", ["real-time"], indirect=True)
def test_a_rig_that_falls_silent_ends_the_run_and_not_the_record(rig, tmp_path):
    def fall_silent() -> None:
        while len(rig.of_type("exchange")) < 50:
            time.sleep(0.01)
        rig.answers = False

    waiting = threading.Thread(target=fall_silent, daemon=True)
    waiting.start()
    limits = [
        "proxy.on_stale=fail",
        "proxy.communication_timeout=0.3",
        "proxy.deadline=0.05",
        "step=10ms",
    ]
    chosen = [part for setting in limits for part in ("--set", setting)]
    done = run(rig, tmp_path, "--real-time", "--lag", "20", *chosen, duration=60.0)
    if refusal := NOT_HELD.search(done.stderr):
        pytest.skip(refusal[0])
    assert done.returncode == 1, done.stdout
    assert re.search(r"error: proxy: .*no answer", done.stderr.splitlines()[-1])
    data = results.read(tmp_path / "run.nc")
    assert data.attrs["complete"] == 0
    assert "no answer" in data.attrs["failure"]
    assert 10 < data.time.size < 6000


def chosen(rig: SmallRig, **settings: object) -> list[str]:
    """Arguments of a run of the bench in real time, in a process that a test may hold up."""
    given = {"proxy.endpoint": rig.endpoint, "inputs.current.initial": 0.4, **settings}
    pairs = [part for name, value in given.items() for part in ("--set", f"{name}={value}")]
    command = [sys.executable, "-m", "orchestration.cli", "run", "hil_bench", "--real-time"]
    return [*command, "--runtime", "native", "--out", "run.nc", *pairs]


def held_up(rig: SmallRig, folder: Path, pauses: Sequence[float], beside: int, **settings: object):
    """Run the bench, make the machine busy as soon as it asks the rig, and stop the process for
    some times, s, once it commands.
    """
    with subprocess.Popen(
        chosen(rig, **settings),
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        while process.poll() is None and not rig.heard:
            time.sleep(0.01)
        with busy(beside, 30.0):
            while process.poll() is None and not rig.of_type("exchange"):
                time.sleep(0.01)
            for pause in pauses:
                time.sleep(0.3)
                process.send_signal(signal.SIGSTOP)
                time.sleep(pause)
                process.send_signal(signal.SIGCONT)
            out, errors = process.communicate(timeout=120.0)
    return subprocess.CompletedProcess(process.args, process.returncode, out, errors)


@posix
@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("rig", ["real-time"], indirect=True)
def test_on_a_busy_machine_the_run_is_refused_or_keeps_its_plant_within_limits(rig, tmp_path):
    """With the step that the bench needs; it is held up on top of that, if it begins at all."""
    done = held_up(rig, tmp_path, [0.03] * 6, 4, step="1ms", duration=3.0)
    lengths = [inputs["length_change"] for _, inputs in rig.applied]
    assert STIFFNESS * max(lengths) <= STRONGEST
    if NOT_HELD.search(done.stderr):
        assert done.returncode == 2
        assert re.search(r"it holds (\d+ Hz|no rate)\. Take a longer step", done.stderr)
        assert rig.of_type("connect") == []
        assert not (tmp_path / "run.nc").exists()
        return
    assert done.returncode in (0, 1)
    data = results.read(tmp_path / "run.nc")
    assert float(data["proxy.tension"].max()) <= STRONGEST


@posix
@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("rig", ["real-time"], indirect=True)
def test_a_pause_longer_than_promised_opens_the_loop_and_keeps_the_record(rig, tmp_path):
    """Before the rig's own watchdog, which would latch it: the promise is half of it."""
    done = held_up(rig, tmp_path, [0.7], 0, step="20ms", duration=30.0)
    if refusal := NOT_HELD.search(done.stderr):
        pytest.skip(refusal[0])
    assert done.returncode == 1, done.stderr
    assert re.search(r"a pause of more than 0\.5 s ends the run", done.stderr)
    assert re.search(r"error: not in real time: .*the lag may be 0\.5 s", done.stderr)
    data = results.read(tmp_path / "run.nc")
    assert data.attrs["complete"] == 0
    assert "not in real time" in data.attrs["failure"]
    assert rig.state == "idle"
    assert set(rig.applied[-1][1].values()) == {0.0}


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["lockstep"], indirect=True)
def test_a_rig_that_refuses_in_lockstep_ends_the_result_there(rig, tmp_path):
    """Models that go on without their actuator have no result."""
    rig.limits = {"length_change": {"min": -1e-5, "max": 1e-5, "rate": None}}
    done = run(rig, tmp_path, duration=1.0)
    assert done.returncode == 2, done.stderr  # as whenever a run without a clock fails
    last = done.stderr.splitlines()[-1]
    assert re.search(r"error: proxy\.link_state at .* s: the rig refuses a command", last)
    data = results.read(tmp_path / "run.nc")
    assert data.attrs["complete"] == 0
    assert 0.5 < data.time.values[-1] < 1.0  # the ramp begins at 0.5 s
    assert float(data["proxy.tension"].max()) <= 1.01e-5 * STIFFNESS


@pytest.mark.slow
@pytest.mark.parametrize(("step", "rate", "ends"), [("1ms", 10, 3.0), ("10ms", 100, None)])
def test_the_loop_over_the_emulated_actuator_is_stable_at_a_millisecond_alone(
    tmp_path, step, rate, ends
):
    """The delay of a step does it: in lockstep nothing is ever late."""
    settings = (f"step={step}", f"master.rates.bench={rate}", "duration=3s")
    with Server(tmp_path, "emulator", "--lockstep", options={"signals": "length-driven"}) as server:
        chosen = (f"proxy.endpoint={server.wait_ready()}", *settings)
        pairs = [part for setting in chosen for part in ("--set", setting)]
        done = ppy("run", "hil_bench", *pairs, "--out", "run.nc", cwd=tmp_path)
    data = results.read(tmp_path / "run.nc")
    if ends is None:
        assert "the rig refuses a command" in done.stderr.splitlines()[-1]
        assert data.time.values[-1] < 3.0
    else:
        assert done.returncode == 0, done.stderr
        assert data.time.values[-1] == pytest.approx(ends)
        assert settled(data, "proxy.tension") == pytest.approx(1.0, rel=0.02)


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("rig", ["real-time"], indirect=True)
def test_a_rig_that_refuses_opens_the_loop(rig, tmp_path):
    """The bench would go on without its actuator."""
    rig.limits = {"length_change": {"min": -1e-5, "max": 1e-5, "rate": None}}
    done = run(rig, tmp_path, "--real-time", "--set", "step=20ms", duration=30.0)
    if refusal := NOT_HELD.search(done.stderr):
        pytest.skip(refusal[0])
    assert done.returncode == 1, done.stderr
    last = done.stderr.splitlines()[-1]
    assert re.search(r"error: proxy\.link_state at .* s: the rig refuses a command", last)
    data = results.read(tmp_path / "run.nc")
    assert float(data["proxy.tension"].max()) <= 1.01e-5 * STIFFNESS
    assert rig.state == "idle"
