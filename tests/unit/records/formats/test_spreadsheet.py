"""Claims: a sheet that another library wrote is read with its numbers, dates and units; of several
the user names one; a damaged file is refused.
"""

from datetime import datetime, timedelta

import pytest

from orchestration.records import Source, read_record
from tests.support.record_forms import CURRENT, DISPLACEMENT, SIGNALS, TIME, check, refusal

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("python_calamine")
START = datetime(2026, 1, 31, 23, 59, 59)
CLOCKS = {
    "time [s]": TIME.tolist(),
    "Datum": [START + timedelta(seconds=float(t)) for t in TIME],
}


def workbook(folder, header="time [s]", sheets=("Daten",)):
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name in sheets:
        sheet = book.create_sheet(name)
        sheet.append(["Test of the cell"])
        sheet.append([header, "current", "displacement"])
        sheet.append([None, "mA", "mm"])
        clock = CLOCKS[header]
        for k, time in enumerate(clock):
            sheet.append([time, CURRENT[k] * 1e3, DISPLACEMENT[k] * 1e3])
    path = folder / "r.xlsx"
    book.save(path)
    return path


def test_numbers_units_and_dates_of_a_sheet(tmp_path):
    check(read_record(workbook(tmp_path), SIGNALS))
    check(read_record(workbook(tmp_path, "Datum"), SIGNALS))


def test_of_several_sheets_one_is_named(tmp_path):
    path = workbook(tmp_path, sheets=("first", "second"))
    assert "there are 2 tables: 1 (first); 2 (second); name one: table='1'" in refusal(path)
    check(read_record(Source.of(path, table="second"), SIGNALS))


def test_a_damaged_file_is_refused(tmp_path):
    path = workbook(tmp_path)
    path.write_bytes(path.read_bytes()[:2000])
    assert "damaged" in refusal(path)
