"""Claims: a finding is accepted for the code, the variable, the FMU and the time that an entry
names, and no other one is.
"""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import pytest

from fmus.kit import UserError
from orchestration.cli.acceptance import judge, read_acceptances
from orchestration.fmu.check import Finding

TODAY = date(2026, 11, 30)
FMU = Path("models/plant.fmu")
UNITS = Finding("no-unit", "no unit for u, y", ("u", "y"))


def entries(folder, text):
    path = folder / "findings.toml"
    path.write_text(text, encoding="utf-8")
    return read_acceptances(path)


def accepted(folder, text, finding=UNITS, fmu=FMU, today=TODAY):
    ((judged, why),) = judge([finding], entries(folder, text), fmu, today)
    return judged.message, why


def table(*lines):
    return "\n".join(["[[accept]]", 'code = "no-unit"', 'why = "a number"', *lines, ""])


def test_an_entry_of_the_code_accepts_all_of_it(tmp_path):
    assert accepted(tmp_path, table()) == (UNITS.message, "a number")
    other = Finding("no-description", "no description for u", ("u",))
    assert accepted(tmp_path, table(), other) == (other.message, "")


def test_an_entry_of_a_variable_leaves_the_others(tmp_path):
    one = table('variable = "u"')
    assert accepted(tmp_path, one) == ("no unit for u, y; not accepted for y", "")
    assert accepted(tmp_path, one + table('variable = "y"'))[1] == "a number"
    assert accepted(tmp_path, table('variable = "x"')) == (UNITS.message, "")


def test_an_entry_of_an_fmu_leaves_the_others(tmp_path):
    assert accepted(tmp_path, table('fmu = "plant.fmu"'))[1] == "a number"
    assert accepted(tmp_path, table('fmu = "other.fmu"'))[1] == ""


def test_an_entry_holds_on_its_last_day_and_no_longer(tmp_path):
    text = table(f"until = {TODAY}")
    assert accepted(tmp_path, text)[1] == "a number"
    late = accepted(tmp_path, text, today=TODAY + timedelta(days=1))
    assert late == ("no unit for u, y; accepted until 2026-11-30 only", "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[accept]]\ncode = "no-unit"\n', r"accept.*why is missing"),
        ('[[accept]]\ncode = "no-unit"\nwhy = ""\n', "why"),
        (table().replace("no-unit", "no-units"), "'no-units' .did you mean no-unit"),
        (table('until = "soon"'), "until"),
        (table("reason = 1"), "unknown key 'reason'"),
        ("accept = 3", "accept"),
        ("[accept", "findings.toml: "),
        ("", "accept is missing"),
    ],
)
def test_a_file_that_means_nothing_is_refused_in_a_line(tmp_path, text, message):
    with pytest.raises(UserError, match=message) as caught:
        entries(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert "findings.toml" in str(caught.value)
