"""Event log: lines have wall time, floods are thinned out, and a stuck stream holds nobody up."""

from __future__ import annotations

import os
import re
import time

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server.log import EventLog
from orchestration.rig.server.log_chain import verify
from tests.support.command import posix

pytestmark = pytest.mark.real_time


def test_lines_go_to_both_places_with_wall_time(tmp_path, capsys):
    file = tmp_path / "rig.log"
    file.write_text("before\n")
    log = EventLog(file)
    log.tell("ready:\n  somewhere")
    log.close()
    lines = file.read_text().splitlines()
    assert lines[0] == "before", "lines are added"
    line, _, _ = lines[2].rpartition(" #")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} ready: somewhere", line)
    assert capsys.readouterr().out == line + "\n"


@posix
def test_a_file_is_for_its_owner_alone_and_its_rotation_is_followed(tmp_path):
    file = tmp_path / "rig.log"
    log = EventLog(file)
    log.tell("one")
    deadline = time.monotonic() + 10.0
    while " one #" not in file.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.001)
    file.rename(tmp_path / "rig.log.1")
    log.tell("two")
    log.close()
    again = EventLog(file)
    again.tell("three")
    again.close()
    assert " two #" not in (tmp_path / "rig.log.1").read_text()
    assert " two #" in file.read_text()
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
    assert verify([tmp_path / "rig.log.1", file]) == 6
    assert verify([file]) == 4


def test_lines_that_are_lost_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("orchestration.rig.server.log._LONGEST_QUEUE", 5)
    log = EventLog(tmp_path / "rig.log")
    for number in range(1000):
        log.tell(f"line {number}")
    log.close()
    text = (tmp_path / "rig.log").read_text()
    written = text.count(" line ")
    lost = sum(map(int, re.findall(r" (\d+) lines were lost here", text)))
    assert written + lost == 1000
    assert lost > 0


def test_what_a_stranger_calls_itself_cannot_steer_a_terminal_nor_end_the_log(tmp_path, capsys):
    log = EventLog(tmp_path / "rig.log")
    log.tell("client \x1b[2J\ud800 \u202e refused " + "x" * 5000)
    log.tell("next")
    log.close()
    sealed = (tmp_path / "rig.log").read_text(encoding="utf-8").splitlines()
    _, first, second = (line.rpartition(" #")[0] for line in sealed)
    assert r" client \x1b[2J\ud800 \u202e refused xxx" in first
    assert len(first) < 1100
    assert second.endswith(" next")
    assert capsys.readouterr().out.splitlines() == [first, second]


def test_of_a_kind_there_is_one_line_a_second_and_the_others_are_counted(capsys):
    now = 5.0
    log = EventLog(clock=lambda: now)
    for k in range(1000):
        log.tell(f"dropped {k}", "malformed")
        log.tell(f"event {k}") if k < 3 else None
        now += 0.0021
    log.close()
    lines = [line.split(" ", 2)[2] for line in capsys.readouterr().out.splitlines()]
    assert [line for line in lines if line.startswith("event")] == ["event 0", "event 1", "event 2"]
    dropped = [line for line in lines if line.startswith("dropped")]
    assert dropped == [
        "dropped 0",
        "dropped 477 (and 476 like it before)",
        "dropped 954 (and 476 like it before)",
    ]
    assert lines[-1] == "malformed: 45 more"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_full_disk_is_told_at_the_terminal(capsys):
    from pathlib import Path

    log = EventLog(Path("/dev/full"))
    log.tell("one")
    time.sleep(0.1)
    log.tell("two")
    log.close()
    out = capsys.readouterr().out
    assert "one" in out
    assert "two" in out
    assert "--log /dev/full is not written any more: " in out


def test_a_place_that_takes_nothing_holds_nobody_up(monkeypatch):
    read, write = os.pipe()
    with os.fdopen(write, "w") as stream:
        monkeypatch.setattr("sys.stdout", stream)
        log = EventLog()
        begun = time.monotonic()
        for k in range(20_000):
            log.tell(f"line {k} " + "x" * 50)
        log.close()
        took = time.monotonic() - begun
        monkeypatch.undo()
        os.set_blocking(read, False)
        while log._destinations[0]._writer.is_alive():  # let the thread go before the pipe does
            try:
                os.read(read, 1 << 20)
            except BlockingIOError:
                time.sleep(0.001)
            assert time.monotonic() < begun + 30.0
    os.close(read)
    assert took < 10.0


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"--log .*: "):
        EventLog(tmp_path / "missing" / "rig.log")


@posix
def test_a_pipe_that_nobody_reads_is_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(UserError, match=r"--log .*pipe: "):
        EventLog(pipe)
