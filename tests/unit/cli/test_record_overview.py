"""Claims: ``ppy info`` of a record shows what is in it, and the command that it prints works."""

import shlex

import pytest

from tests.support.command import answered, refused, works
from tests.support.vendors import catman, course

CELL = '''"""A cell."""

from fmus.kit import Component, Input, Output, Parameter, State


class Cell(Component):
    """A cell: a resistance and a capacitance in series."""

    name = "plain_cell"
    experiment = (100.0, 0.1)

    R0 = Parameter(0.003, "ohm", min=1e-6, max=1e3, doc="series resistance")
    C = Parameter(1000.0, "F", min=1e-3, max=1e9, doc="capacitance")
    current = Input("A", doc="current into the cell")
    stored = State("V", start=3.7, rate="stored_rate", doc="voltage of the capacitance")

    def stored_rate(self):
        """Charging of the capacitance."""
        return self.current / self.C

    @Output("V")
    def voltage(self):
        """Voltage of the cell."""
        return self.stored + self.R0 * self.current
'''


@pytest.fixture
def folder(tmp_path):
    file = catman()
    (tmp_path / "messung.asc").write_bytes(file.content())
    (tmp_path / "cell.py").write_text(CELL)
    return tmp_path


def test_columns_units_rate_and_notes_are_shown(folder):
    shown = works("info", "messung.asc", cwd=folder)
    for part in ("29.5 s from 0 s", "60 samples every 0.5 s (2 Hz)", "Oberflächentemperatur", "°C"):
        assert part in shown
    assert "dd.mm.yyyy" in shown


def test_the_command_that_is_printed_works_word_for_word(folder):
    shown = works("info", "messung.asc", "--model", "cell.py:Cell", cwd=folder)
    line = next(line for line in shown.splitlines() if line.startswith("next: ppy "))
    words = shlex.split(line.removeprefix("next: ppy "))
    assert "Spannung Zelle 1=voltage" in words
    assert f"{len(course())} samples" in works(*words, "--runtime", "python", cwd=folder)


def test_of_several_columns_for_an_input_the_command_takes_one_and_says_so(folder):
    rows = "\n".join(f"{0.1 * k:.1f},{k % 3},{k % 5},{3.7 + 0.01 * (k % 3)}" for k in range(60))
    (folder / "two.csv").write_text(f"time [s],one [A],two [A],voltage [V]\n{rows}\n")
    shown = works("info", "two.csv", "--model", "cell.py:Cell", cwd=folder)
    (line,) = (line for line in shown.splitlines() if line.startswith("next"))
    condition, command = line.split(": ppy ")
    assert condition == "next, if current is 'one'"
    assert shlex.split(command)[-2:] == ["--map", "one=current"]
    assert "60 samples" in works(*shlex.split(command), "--runtime", "python", cwd=folder)


def test_its_json_has_the_map(folder):
    answer = answered("info", "messung.asc", "--model", "cell.py:Cell", cwd=folder)
    assert answer["map"] == {"Strom": "current", "Spannung Zelle 1": "voltage"}
    assert answer["time"]["step"] == 0.5
    assert [column["unit"] for column in answer["columns"]] == ["", "V", "A", "°C"]


def test_what_is_no_record_is_refused(folder):
    (folder / "empty.csv").write_text("")
    refused(folder, "info", "empty.csv", parts=["empty.csv", "empty"])
    refused(folder, "info", "absent.csv", parts=["absent.csv", "cannot be read"])
    refused(folder, "info", "ppy_actuator", "--model", "galvanostat", parts=["is no record"])
    refused(folder, "info", "messung.asc", "--model", "nothing", parts=["nothing"])
    refused(folder, "info", "messung.asc", "--with", "lag", parts=["--model"])
