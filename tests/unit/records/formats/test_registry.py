"""Claims: every file form gives the same record; what is no record is refused in one line that says
what and where.
"""

import builtins
import os
from pathlib import Path

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.record_forms import PLAIN, SIGNALS, check, refusal, write


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("\n \n", "empty"),
        ("# only a comment\n", "comments"),
        ("time [s],current [A]\n", "row 1"),
        ("time [s],current [A]\n1,2\n", "one instant (row 2)"),
        ("0,1\n1,2\n", "row 1: numbers where the header should be"),
        ("# volts and amps\n0,1\n1,2\n", "row 2: numbers where the header should be"),
        (
            "Dear all, the rig is down.\nSee you.\nBye\n",
            "there is a header (row 1) but no complete row of data below it",
        ),
        ("hello\nworld\n", "not a header"),
        (b"\x00\x01\x02\xff\xfe" * 40, "not a text file"),
        (bytes(np.random.default_rng(0).integers(0, 256, 4000, dtype=np.uint8)), "not a text file"),
        (b"PK\x03\x04aaaa", "damaged"),
        (b"PAR1 and then nothing", "damaged"),
        (b"TDSm and then nothing of the kind at all", "TDMS file holds no complete row"),
        (
            "time [s],current [A]\n0,1\n1,abc\n2,3\n",
            "row 3, column 'current': 'abc' is not a number",
        ),
        ("time [s],current [A]\n0,1\n1,1_0\n2,3\n", "row 3, column 'current': '1_0'"),
        ("time [s],current [A]\n0,1\nnoon,2\n2,3\n", "row 3, column 'time': 'noon'"),
        ("time [s],current [A]\n0,1\n1\n2,3\n", "row 3: 1 cells where the header has 2"),
        ("time [s],current [A]\n0,1,5\n1,2\n", "row 2: 3 cells where the header has 2"),
        ('time [s],current [A]\n0,"1\n1,2\n', "row 2: the quotes"),
        ("time [s];current [A]\n0.5;1,5\n1;2\n", "decimal comma or decimal point"),
        ("time [s],current [V]\n0,1\n1,2\n", "column 'current' is in V, but current is in A"),
        ("time [s],current [blorg]\n0,1\n1,2\n", "unknown unit 'blorg'"),
        ("sample [1],current [A]\n0,1\n1,2\n", "mapping={'sample': 'time[s]'}"),
        ("current [A],displacement [m]\n0,1\n1,2\n", "no time column"),
        ("a [A]\n0\n1\n2\n", "rate='100Hz' mapping={'a': 'current[A]'}"),
        ("time,current\n0\n1\n2\n", "rows of one column need its name and their rate: columns="),
        ("time [s],time [s],current [A]\n0,0,1\n1,1,2\n", "2 columns are called time"),
        ("time [s],current [A],current [A]\n0,0,1\n1,1,2\n", "2 columns are called 'current'"),
        ("time [s],curent [A]\n0,1\n1,2\n", "none of the columns time, curent"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path, text, says):
    assert says in refusal(write(tmp_path, text))


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    assert "cannot be read" in refusal(tmp_path / "absent.csv")
    assert "cannot be read" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["r.xls", "r.parquet", "r.lvm"])
def test_the_name_of_a_file_is_not_believed(tmp_path, name):
    check(read_record(write(tmp_path, PLAIN.replace(",", "\t"), name), SIGNALS))
    assert "not a text file" in refusal(write(tmp_path, bytes(600), name))
    assert "HDF5" in refusal(write(tmp_path, b"\x89HDF\r\n\x1a\n" + bytes(600), "r.mat"))


@pytest.mark.parametrize(("name", "module"), [("r.parquet", "pyarrow"), ("r.tdms", "nptdms")])
def test_an_absent_library_is_named_with_the_command_that_installs_it(
    tmp_path, monkeypatch, name, module
):
    original = builtins.__import__

    def without(target, *arguments, **options):
        if target.split(".")[0] == module:
            raise ModuleNotFoundError(target, name=target.partition(".")[0])
        return original(target, *arguments, **options)

    path = write(tmp_path, b"PAR1" if module == "pyarrow" else b"TDSm", name)
    monkeypatch.setattr(builtins, "__import__", without)
    absent = f"raise ModuleNotFoundError(name={module!r})"  # for a process that reads
    (tmp_path / f"{module}.py").write_text(absent)
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(tmp_path), str(Path(__file__).parents[4])])
    )
    assert 'pip install "ppy-rig[records]"' in refusal(path)
