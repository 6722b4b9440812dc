"""Claims: a file that ends its native parser, or takes its memory or time, is refused in a line; a
good one is as ever.

The parser is SciPy's, which some damaged MATLAB files of version 5 end by a signal.
"""

from __future__ import annotations

import atexit
import faulthandler
import io
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from fmus.kit import UserError
from orchestration.records.formats.registry import read_table
from orchestration.records.formats.subprocess_reader import in_subprocess
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table

TIME = 0.1 * np.arange(50)
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and limits are those of POSIX")


def contents():
    file = io.BytesIO()
    savemat(file, {"time": TIME, "voltage": np.sin(TIME), "units": {"time": "s", "voltage": "V"}})
    return bytearray(file.getvalue())


def ends(content):
    """Return True if SciPy ends a process that reads it here."""
    child = os.fork()
    if child == 0:
        faulthandler.disable()
        try:
            loadmat(io.BytesIO(bytes(content)))
        finally:
            os._exit(0)
    return os.waitpid(child, 0)[1] != 0


@pytest.fixture(scope="module")
def deadly():
    """Sizes of an array are at byte 177: some of them end the parser."""
    rng, good = np.random.default_rng(5), contents()
    for _ in range(300):
        bad = bytearray(good)
        bad[177] = int(rng.integers(256))
        for place in rng.integers(128, len(bad), 2):
            bad[place] = int(rng.integers(256))
        if ends(bad):
            return bytes(bad)
    pytest.skip("this SciPy reads them all")


def test_a_file_that_ends_its_parser_is_refused(deadly, tmp_path):
    path = tmp_path / "damaged.mat"
    path.write_bytes(deadly)
    told = []
    while not (told and "its reader ended" in told[-1]) and len(told) < 20:
        with pytest.raises(
            UserError
        ) as caught:  # what the parser makes of it depends on what is in its memory
            read_table(path)
        told.append(str(caught.value))
    assert all(
        re.match(rf"{re.escape(str(path))}: the (MATLAB )?file is damaged: ", each) for each in told
    )
    assert told[-1].startswith(f"{path}: the file is damaged: its reader ended, by SIG")


def test_a_good_file_is_read_as_ever(tmp_path):
    path = tmp_path / "good.mat"
    path.write_bytes(bytes(contents()))
    table = read_table(path)
    assert [(c.name, c.unit) for c in table.columns] == [("time", "s"), ("voltage", "V")]
    np.testing.assert_array_equal(table.columns[1].cells, np.sin(TIME))


def endless(path, content):
    while True:
        pass


def greedy(path, content):
    return np.ones(2**31)


def strict(path, content):
    raise refuse(path, "of no use, says the reader")


def chatty(path, content):
    """Prints as Python does and, past it, as a native library does."""
    print("reading", flush=True)
    print("still in a buffer")
    os.write(1, b"native code says so")
    return Table(path, [Column("time", "s", np.arange(3.0))], np.arange(3))


def test_what_a_reader_prints_is_no_part_of_the_table(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[4]))
    table = in_subprocess(chatty)(tmp_path / "some.mat", b"some")
    assert table.names() == ["time"]
    assert table.columns[0].cells.tolist() == [0.0, 1.0, 2.0]


def abrupt(path, content):
    """Leaves behind what ends the process when it is over, as threads of a native library may."""
    atexit.register(os.abort)
    return Table(path, [Column("time", "s", np.arange(3.0))], np.arange(3))


def test_a_process_that_is_ended_after_its_answer_damages_no_file(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[4]))
    assert in_subprocess(abrupt)(tmp_path / "some.mat", b"some").names() == ["time"]


def test_a_machine_that_is_slow_at_starting_damages_no_file(tmp_path, monkeypatch):
    """A minute at least, of which starting Python and importing a reader may take most."""
    granted = []

    def run(command, timeout, **others):
        granted.append(timeout)
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", run)
    with pytest.raises(UserError, match="takes longer than"):
        in_subprocess(chatty)(tmp_path / "some.mat", b"some")
    assert granted[0] >= 60.0


@pytest.mark.parametrize(
    ("reader", "said"),
    [
        (endless, "to read it takes longer than 1 s"),
        (greedy, "reading it takes more memory than its size explains"),
        (strict, "of no use, says the reader"),
    ],
)
def test_what_a_reader_does_is_told(reader, said, tmp_path, monkeypatch):
    monkeypatch.setenv(
        "PYTHONPATH", str(Path(__file__).parents[4])
    )  # where the process finds these readers
    monkeypatch.setattr(
        "orchestration.records.formats.subprocess_reader._SECONDS",
        1.0 if reader is endless else 20.0,
    )
    with pytest.raises(UserError) as caught:
        in_subprocess(reader)(tmp_path / "some.mat", b"some")
    assert str(caught.value).startswith(f"{tmp_path / 'some.mat'}: ")
    assert str(caught.value).endswith(said)
    assert "\n" not in str(caught.value)
