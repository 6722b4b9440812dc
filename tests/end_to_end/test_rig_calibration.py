"""Claims: a sensor is adjusted at two known values on a rig that is served, by options or in a
dialog; an interrupt loses nothing; a record has the uncertainty.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time

import pytest

from orchestration.experiment import results
from orchestration.plugins.calibration import read_calibration
from tests.support.command import posix, ppy, recording
from tests.support.rig.backends import Calibrated
from tests.support.rig.bench import FILE, served

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120), pytest.mark.real_time]

EXPERIMENT = """
component = "ppy_actuator"
duration = "1 s"
step = "0.1 s"

[inputs]
force = "0 N"
current = "0 A"
"""
COMMAND = ("rig", "calibrate", "bench.toml", "load", "--by", "A. Volta", "--source", "masses")
COMMAND += ("--uncertainty", "0.001")


def settle(folder, volts):
    (folder / "new").write_text(str(volts))
    (folder / "new").replace(folder / "volts")  # the device may be reading it
    time.sleep(0.2)


def refused(folder, *arguments):
    done = ppy(*COMMAND, *arguments, cwd=folder)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    return done.stderr


def test_two_points_by_options_then_a_record_with_the_uncertainty(tmp_path):
    with served(tmp_path) as endpoint:
        where = ("--endpoint", endpoint, "--duration", 1)
        # what a run without a second point has measured is given to the next
        first = refused(tmp_path, *where, "--point", -1)
        assert (tmp_path / "bench.toml").read_text() == FILE
        point = re.search(r"--point (-1\.0=\S+)", first)[1]
        settle(tmp_path, 4.0)
        done = ppy(*COMMAND, *where, "--point", point, "--point", 8, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "until it is started again" in done.stderr
        stale = refused(tmp_path, *where, "--point", 0)
        assert "does not have the calibration of load that is in bench.toml" in stale
    load = read_calibration(str(tmp_path / "bench.toml")).outputs["load"]
    # 1 V is -1 kgf and 4 V is 8 kgf
    assert (load.gain, load.offset) == pytest.approx((3.0, -4.0), abs=0.01)
    noise = 3.0 * Calibrated.NOISE
    assert load.uncertainty == pytest.approx((0.001**2 + noise**2) ** 0.5, rel=0.15)
    (old,) = tmp_path.glob("bench_until_*.toml")
    assert old.read_text() == FILE
    (tmp_path / "rest.toml").write_text(EXPERIMENT)
    with served(tmp_path, 2.0) as endpoint:
        done = ppy(*recording(endpoint, "rest.toml"), cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    data = results.read(tmp_path / "run.nc")
    assert data["load"].attrs["standard_uncertainty"] == pytest.approx(9.80665 * load.uncertainty)
    assert data["load"].values == pytest.approx(2.0 * 9.80665, abs=0.1)


def test_what_cannot_be_adjusted_is_refused_in_a_line(tmp_path):
    with served(tmp_path, 100.0) as endpoint:  # beyond the range: there is no value
        where = ("--endpoint", endpoint, "--duration", "0.5")
        assert "0 values from" in refused(tmp_path, *where, "--point", 1)
        assert "'one'" in refused(tmp_path, *where, "--point", "one")
        assert "--point is missing: known value 1 in kgf" in refused(tmp_path, *where)
        same = ("--point", "1=2,0,9", "--point", "1=3,0,9")
        assert "both points are at 1" in refused(tmp_path, *where, *same)
    gone = refused(tmp_path, "--endpoint", "tcp://127.0.0.1:1", "--point", 1)
    assert "no answer within 2 s" in gone
    assert (tmp_path / "bench.toml").read_text() == FILE


class Dialog:
    """The command on a terminal, whose questions are answered."""

    def __init__(self, folder, endpoint):
        import pty

        self._ours, theirs = pty.openpty()
        arguments = (*COMMAND, "--endpoint", endpoint, "--duration", "0.5")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "orchestration.cli", *arguments],
            cwd=folder,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env={**os.environ, "COLUMNS": "400", "TERM": "dumb"},
            start_new_session=True,
        )
        os.close(theirs)
        self.shown = ""

    def answer(self, question, text):
        self.wait(question)
        os.write(self._ours, f"{text}\n".encode())

    def press(self, key):
        if key == b"\x03":  # this terminal is not the one that controls the process
            self.process.send_signal(signal.SIGINT)
        else:
            os.write(self._ours, key)

    def wait(self, part):
        seen = len(self.shown)
        while part not in self.shown[seen:]:
            self.shown += os.read(self._ours, 4096).decode()

    def end(self):
        while True:
            try:
                self.shown += os.read(self._ours, 4096).decode()
            except OSError:  # Linux: the other end is closed
                break
        os.close(self._ours)
        return self.process.wait(30)


@posix
def test_the_dialog_asks_for_what_is_missing(tmp_path):
    with served(tmp_path) as endpoint:
        dialog = Dialog(tmp_path, endpoint)
        dialog.answer("known value 1 in kgf", "-1")
        dialog.wait("known value 2 in kgf")
        settle(tmp_path, 4.0)
        os.write(dialog._ours, b"8\n")
        assert dialog.end() == 0, dialog.shown
    assert "gain 2 -> 3.0" in dialog.shown or "gain 2 -> 2.99" in dialog.shown
    load = read_calibration(str(tmp_path / "bench.toml")).outputs["load"]
    assert (load.gain, load.offset) == pytest.approx((3.0, -4.0), abs=0.01)
    assert load.source == "masses"


@posix
@pytest.mark.parametrize("key", [b"\x03", b"\x04"], ids=["Ctrl-C", "Ctrl-D"])
def test_an_interrupt_leaves_the_file_and_says_how_to_go_on(tmp_path, key):
    with served(tmp_path) as endpoint:
        dialog = Dialog(tmp_path, endpoint)
        dialog.answer("known value 1 in kgf", "-1")
        dialog.wait("known value 2 in kgf")
        dialog.press(key)
        assert dialog.end() == 130, dialog.shown
    assert "Traceback" not in dialog.shown
    assert re.search(r"to go on, give the same command --point -1.0=\S+", dialog.shown)
    assert sorted(path.suffix for path in tmp_path.glob("bench*")) == [".toml"]
    assert (tmp_path / "bench.toml").read_text() == FILE
