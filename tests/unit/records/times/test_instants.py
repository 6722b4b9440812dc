"""Claims: dates and times of day in every form become the seconds that the calendar says; what may
be two dates is refused with what settles it, and that settles it.
"""

import ast
import re
from datetime import datetime, timedelta

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.records import read_record
from orchestration.records.tables import Column, Table
from orchestration.records.times import instants
from tests.support.record_forms import write

START = datetime(2026, 12, 31, 23, 59, 59)
STEPS = [0.0, 0.5, 1.0, 1.5, 90.0, 3600.0]
WHOLE = [0.0, 1.0, 2.0, 90.0, 3600.0]
"""What forms without fractions can tell."""


def seconds(cells, form=""):
    rows = np.arange(2, 2 + len(cells))
    table = Table("r.csv", [Column("Zeit", None, cells)], rows)
    return instants.seconds(table, table.columns[0], form), [r.message for r in table.repairs]


def written(form, steps):
    moments = [START + timedelta(seconds=step) for step in steps]
    return [m.strftime(form.replace("MS", f"{m.microsecond // 1000:03d}")) for m in moments]


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%d %H:%M:%S.MS",
        "%Y-%m-%dT%H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.MSZ",
        "%Y-%m-%dT%H:%M:%S.MS+01:00",
        "%Y/%m/%d %H:%M:%S,MS",
        "%d.%m.%Y %H:%M:%S,MS",
        "%d.%m.%y %H:%M:%S.MS",
        "%m/%d/%Y %H:%M:%S:MS",
        "%m/%d/%Y %I:%M:%S.MS %p",
        "%d/%m/%Y %H:%M:%S.MS",
        "%d-%b-%Y %H:%M:%S.MS",
        "%d %B %Y, %H:%M:%S.MS",
        "%b %d, %Y %H:%M:%S.MS",
        " %d.%m.%Y  %H:%M:%S,MS ",
    ],
)
def test_dates_of_every_form_are_the_seconds_of_the_calendar(form):
    found, messages = seconds(written(form, STEPS))
    np.testing.assert_allclose(found, STEPS, atol=1e-6)
    assert "is 0 s" in messages[0]


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%H:%M:%S"])
def test_forms_without_fractions_and_times_of_day_go_on_over_midnight(form):
    whole = WHOLE if "%d" in form else WHOLE[:3]
    assert seconds(written(form, whole))[0].tolist() == whole


def test_german_months_are_known():
    assert seconds(["31. Oktober 2026 10:00", "1. Dezember 2026 10:00"])[0][1] == 31 * 86400.0
    assert seconds(["01-Mrz-2026 00:00:00", "01-Mai-2026 00:00:00"])[0][1] == 61 * 86400.0


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["0:00:00", "0:00:01.5", "26:10:00"], [0.0, 1.5, 94200.0]),
        (["0d 00:00:10.00", "1d 00:00:10.25"], [0.0, 86400.25]),
        (["00:10:00", "1.00:10:00"], [0.0, 86400.0]),
        (["59:58.5", "59:59.5", "00:00.5"], [0.0, 1.0, 2.0]),
        (["08:30", "08:31", "09:00"], [0.0, 60.0, 1800.0]),
        (["11:59:59 AM", "12:00:00 PM", "12:00:01 p.m."], [0.0, 1.0, 2.0]),
        (["", "10:00:00", "", "10:00:02"], [np.nan, 0.0, np.nan, 2.0]),
    ],
)
def test_times_of_day_and_durations_become_seconds(cells, values):
    np.testing.assert_array_equal(seconds(cells)[0], values)


def test_a_time_of_day_that_passes_midnight_says_so():
    found, messages = seconds(["23:59:58", "23:59:59", "00:00:00", "00:00:01"])
    assert found.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert "midnight before row 4" in messages[0]


def test_a_duration_that_starts_again_is_no_midnight():
    found, _ = seconds(["00:00:00", "05:00:00", "10:00:00", "00:00:00", "05:00:00"])
    assert found.tolist() == [0.0, 18000.0, 36000.0, 0.0, 18000.0]


def test_a_form_without_seconds_is_said_and_can_be_stated():
    said = "read as hh:mm (if it is mm:ss: mapping={'Zeit': 'time[mm:ss]'})"
    assert said in seconds(["01:30"])[1][0]
    assert seconds(["01:30", "01:31"], "mm:ss")[0].tolist() == [0.0, 1.0]


def test_day_and_month_are_told_apart_by_any_row_that_tells():
    cells = ["01/02/2026", "02/02/2026", "13/02/2026"]
    assert seconds(cells)[0].tolist() == [0.0, 86400.0, 12 * 86400.0]
    cells = ["01/02/2026", "01/03/2026", "01/13/2026"]
    assert seconds(cells)[0].tolist() == [0.0, 86400.0, 11 * 86400.0]


def test_an_ambiguous_date_does_not_matter_on_one_day():
    found, messages = seconds(["01/02/2026 10:00:00", "01/02/2026 10:00:01"])
    assert found.tolist() == [0.0, 1.0]
    assert "one day throughout" in messages[0]


def test_an_ambiguous_date_is_refused_and_either_advice_works_when_followed(tmp_path):
    path = write(tmp_path, "Datum,I [A]\n01/02/2026,1\n02/02/2026,2\n")
    with pytest.raises(UserError, match=r"row 2, column 'Datum': is '01/02/2026' in Feb") as caught:
        read_record(path, {"I": "A"})
    advised = re.findall(r"mapping=({.*?})", str(caught.value))
    times = [
        read_record(path, {"I": "A"}, mapping=ast.literal_eval(text)).time[1] for text in advised
    ]
    assert times == [86400.0, 31 * 86400.0]


@pytest.mark.parametrize(
    ("cells", "says"),
    [
        (["30.01.2026", "31.02.2026"], "row 3.*'31.02.2026' is no date of the calendar"),
        (["13/01/2026", "01/13/2026"], "row 2.*row 3.*not dates of one form"),
        (["10:00:00", "noon"], "row 3, column 'Zeit': 'noon' is not a date or time"),
        (["10:00:00", "2026-01-01 10:00:00"], "row 3.*is not a date or time as"),
        (["2026-01-01 10:00:00", "2026-01-01 10:61:00"], "row 3"),
        (["01-Foo-2026", "02-Foo-2026"], "row 2.*is no date of the calendar"),
    ],
)
def test_what_is_no_date_is_refused_with_its_row(cells, says):
    with pytest.raises(UserError, match=says):
        seconds(cells)


def test_a_unit_of_a_column_of_dates_is_refused_with_what_works(tmp_path):
    path = write(tmp_path, "Datum,I [A]\n2026-01-01,1\n2026-01-02,2\n")
    with pytest.raises(UserError, match=r"mapping=\{'Datum': 'time'\} reads them"):
        read_record(path, {"I": "A"}, mapping={"Datum": "time[h]"})
    assert read_record(path, {"I": "A"}, mapping={"Datum": "time"}).time[1] == 86400.0


@pytest.mark.parametrize("cell", ["1.5", "1,234.5", "-12", "abc", "", "12", "1.2.3", "1/2"])
def test_numbers_and_words_are_no_instants(cell):
    assert not instants.is_instant(cell)


@pytest.mark.parametrize(
    ("cell", "date", "clock"),
    [("2026-01-01", True, False), ("10:00:00", False, True), ("1.2.26 10:00", False, False)],
)
def test_halves_of_an_instant_are_known(cell, date, clock):
    assert instants.is_date(cell) is date
    assert instants.is_time_of_day(cell) is clock
