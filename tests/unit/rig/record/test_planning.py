"""Plans of records: an experiment that does not fit the rig is refused before anything moves."""

from __future__ import annotations

import pytest

from orchestration.experiment.model import parse
from orchestration.rig.record.planning import plan_recording
from tests.support.command import recording, refused
from tests.support.rig.small_rig import LEVELS, LIMITS, STATUS, SmallRig, free_port

pytestmark = pytest.mark.real_time


BAD = {
    "lacks an input": ("force = 1", "", ["input force [N]", "--set inputs.force=0"]),
    "unknown input": ("force = 1\nforse = 1", "", ["inputs.forse", "did you mean force"]),
    "another quantity": ('force = "1 V"', "", ["inputs.force"]),
    "above": ("force = 3.5", "", ["goes up to 3.5 N", "limit is 3 N"]),
    "below": ("force = -0.1", "", ["goes down to -0.1 N", "limit is 0 N"]),
}


@pytest.mark.parametrize("what", BAD)
def test_what_does_not_fit_the_rig(tmp_path, experiment, what):
    line, _, parts = BAD[what]
    path = experiment(
        text=LEVELS.replace('force = "1 N"', line if what != "lacks an input" else "")
    )
    with SmallRig() as rig:
        refused(tmp_path, *recording(rig.endpoint, path), parts=[str(path), *parts])
        assert {message["type"] for message in rig.heard} <= {"status"}


def test_more_than_the_rig_allows(tmp_path, experiment):
    slow = {**LIMITS, "current": {"min": -1.3, "max": 1.3, "rate": 10.0}}
    for kinds, parts in (
        ({"limits": slow}, ["inputs.current", "limit is 10 A/s"]),
        ({"inputs": {"current": "mA", "force": "N"}}, ["current is in A", "mA on the rig"]),
        ({"outputs": {"voltage": "mV", "displacement": "m"}}, ["voltage is in V", "mV on the rig"]),
        ({"period": 0.1}, ["20 rows a second", "samples 10 times", "--rate 10"]),
        ({"mode": "lockstep"}, ["lockstep"]),
        ({"watchdog": 0.0}, ["watchdog of 0 s"]),
        ({"outputs": {}}, ["nothing to measure"]),
    ):
        with SmallRig(**kinds) as rig:
            refused(tmp_path, *recording(rig.endpoint, experiment()), parts=parts)
            assert {message["type"] for message in rig.heard} <= {"status"}


def test_a_rig_that_is_not_to_be_had(tmp_path, experiment):
    path = experiment()
    with SmallRig(watchdog=1e9) as rig:  # nobody commands it while it is running
        arguments = recording(rig.endpoint, path)
        rig.safe("no command for 0.2 s")
        refused(
            tmp_path,
            *arguments,
            parts=["safe state", "no command for 0.2 s", "ppy rig acknowledge"],
        )
        rig.state, rig.client = "running", "somebody"
        refused(tmp_path, *arguments, parts=["a client already", "somebody"])
    nobody = f"tcp://127.0.0.1:{free_port()}"
    refused(tmp_path, *recording(nobody, path), parts=["no answer", "ppy rig serve"])


def test_options_that_make_no_sense(tmp_path, experiment):
    endpoint = "tcp://127.0.0.1:5999"
    path = experiment()
    refused(tmp_path, *recording(endpoint, path, out="run.txt"), parts=["--out", ".nc"])
    refused(tmp_path, *recording(endpoint, path, "--rate", "0"), parts=["--rate"])
    refused(tmp_path, *recording(endpoint, path, "--max-age", "-1s"), parts=["--max-age"])
    refused(tmp_path, *recording(endpoint, path, "--max-age", "1 V"), parts=["1 V"])
    refused(tmp_path, *recording(endpoint, "none.toml"), parts=["none.toml"])


def test_limits_are_inclusive_and_rates_are_of_commands():
    """Against the numbers by hand: the step to 0.5 A is made in one command, every 0.05 s."""
    given = {
        "component": "ppy_actuator",
        "duration": 1.0,
        "step": 0.05,
        "inputs": {"force": 3.0, "current": {"kind": "steps", "times": [0.5], "levels": [0.5]}},
    }
    wanted = parse(given, "here")
    for rate, fits in ((10.0, True), (9.99, False), (None, True)):
        limits = {"force": LIMITS["force"], "current": {"min": 0.0, "max": 0.5, "rate": rate}}
        rig = {**STATUS, "limits": limits}
        if fits:
            assert plan_recording(wanted, rig, "here").values[:, 0].max() == 0.5
        else:
            with pytest.raises(ValueError, match=r"\+0\.5 A at once \(row 11"):
                plan_recording(wanted, rig, "here")
