"""Claims: ``ppy run hil_bench`` closes the loop through a rig, in lockstep and in real time, and
keeps what it did.

The rig is a small server of the tests' own behind real sockets. Its actuator is a spring, so where
the loop settles is known in closed form: the tension is what is wanted, the length that over the
stiffness.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from orchestration.experiment import results
from tests.support.command import ppy
from tests.support.rig.small_rig import SmallRig

pytestmark = pytest.mark.real_time

STIFFNESS, RESISTANCE = 6300.0, 0.5  # N/m, ohm
INPUTS = {"current": "A", "length_change": "m"}
OUTPUTS = {
    "voltage": "V",
    "electrochemical_displacement": "m",
    "mechanical_displacement": "m",
    "charge": "C",
    "tension": "N",
}
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
    assert done.returncode == 0, done.stderr
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
    assert done.returncode == 2, done.stdout
    assert re.search(r"error: proxy: .*no answer", done.stderr.splitlines()[-1])
    data = results.read(tmp_path / "run.nc")
    assert data.attrs["complete"] == 0
    assert "no answer" in data.attrs["failure"]
    assert 10 < data.time.size < 6000
