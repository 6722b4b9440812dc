"""An archiver writes what the rings hold, goes on where another one was, and tells of its disk."""

from __future__ import annotations

import errno
import math

import numpy as np
import pytest

from orchestration.rig.archive import Archive, ArchiveWriter
from orchestration.rig.server.archiver import Archiver
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    RUN,
    Command,
    Event,
    Sample,
    SharedMemory,
    new_memory,
    pack,
)
from tests.support.rig.archived import ABOUT


@pytest.fixture
def shared():
    return SharedMemory(new_memory())


def sample(number, clock, taken=None):
    values = map(pack, ([0.5], [math.nan], [2.5], [clock - 0.25 if taken is None else taken]))
    return Sample(number, clock, 7, *values)


def archiver(folder, shared):
    return Archiver(ServerSettings("emulator", archive=folder), shared, ABOUT)


def test_rows_have_the_values_and_ages_of_the_samples_and_the_orders(tmp_path, shared):
    shared.samples.write(sample(1, 10.0))
    shared.samples.write(sample(2, 11.0, taken=0.0))
    shared.commands.write(Command(RUN, 0, 9.0, pack([0.75]), 1))
    shared.events.write(Event(b"state", b"running"))
    archiver(tmp_path, shared).write()
    archive = Archive(tmp_path)
    rows = archive.rows("samples", -math.inf, math.inf).to_pylist()
    assert [(row["number"], row["time"], row["missed"]) for row in rows] == [(1, 10, 7), (2, 11, 7)]
    assert [row["current"] for row in rows] == [0.5, 0.5]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    np.testing.assert_array_equal(columns["current_read_back"], [math.nan, math.nan])
    # of the second nothing was measured yet
    np.testing.assert_array_equal(columns["voltage"], [2.5, math.nan])
    np.testing.assert_array_equal(columns["voltage_age"], [0.25, math.nan])
    (order,) = archive.rows("commands", -math.inf, math.inf).to_pylist()
    assert (order["order"], order["current"]) == ("run", 0.75)
    assert [event[1:] for event in archive.events()] == [("state", "running")]


def test_another_archiver_goes_on_after_the_last_row(tmp_path, shared):
    for k in range(1, 6):
        shared.samples.write(sample(k, 0.01 * k))
    archiver(tmp_path, shared).write()
    shared.samples.write(sample(1, 0.06))  # of another device, whose numbers begin again
    archiver(tmp_path, shared).write()
    archive = Archive(tmp_path)
    rows = archive.rows("samples", -math.inf, math.inf)
    assert rows["number"].to_pylist() == [1, 2, 3, 4, 5, 6]
    assert archive.spans()[0].samples == 6, "none is written twice"
    assert archive.gaps() == []


def test_a_full_disk_is_told_once_and_so_is_its_end(tmp_path, shared, monkeypatch, capsys):
    made = archiver(tmp_path, shared)
    shared.samples.write(sample(1, 1.0))

    def fail(self, kind, rows, ahead):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(ArchiveWriter, "add", fail)
        made.write()
        made.write()
    made.write()
    made.write()
    told = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[1].split(";")[0] for line in told] == [
        "No space left on device",
        "is written again",
    ]
    assert Archive(tmp_path).rows("samples", -math.inf, math.inf).num_rows == 1
