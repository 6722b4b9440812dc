"""Claims: an overview tells what is in a file, also in one that cannot be used, and why not."""

import numpy as np
import pytest

from orchestration.records import parse_mapping, read_overview, read_record
from tests.support import vendors
from tests.support.record_forms import write


@pytest.mark.parametrize("vendor", vendors.VENDORS, ids=lambda make: make.__name__)
def test_what_is_proposed_for_a_vendor_reads_the_truth(tmp_path, vendor):
    file = vendor()
    path = tmp_path / file.name
    path.write_bytes(file.content())
    overview = read_overview(path)
    assert overview.rows == overview.clock.samples == vendors.ROWS
    assert (overview.clock.step, overview.clock.duration) == (0.5, 29.5)
    found = overview.proposal(vendors.UNITS)
    if vendor is vendors.tektronix:  # channels have neither words nor units
        assert found.open == {"current": ["CH1", "CH2"], "voltage": ["CH1", "CH2"]}
        return
    mapping = parse_mapping([f"{column}={target}" for column, target in found.mapping.items()])
    record = read_record(path, vendors.UNITS, mapping=mapping, required=list(vendors.UNITS))
    for name in vendors.UNITS:
        truth = [float(getattr(sample, name)) for sample in vendors.course()]
        np.testing.assert_allclose(record.signals[name], truth, rtol=1e-14)


def test_columns_are_described(tmp_path):
    text = "t [s];I_mA;Volts;Datum;Wort;leer\n0;1;;2026-01-01;a;\n1;-3;2;2026-01-02;b;\n"
    overview = read_overview(write(tmp_path, text))
    columns = {column.name: column for column in overview.columns}
    assert [c.content for c in columns.values()] == [
        "numbers",
        "numbers",
        "numbers",
        "dates",
        "text",
        "nothing",
    ]
    assert [c.guess for c in columns.values()] == ["", "mA", "V", "", "", ""]
    assert (columns["I_mA"].smallest, columns["I_mA"].largest) == (-3.0, 1.0)
    assert columns["Volts"].missing == 1
    assert columns["Datum"].example == "2026-01-01"
    assert overview.clock.column == "t"


def test_gaps_and_an_uneven_clock_are_told(tmp_path):
    times = [*range(30), *range(100, 130)]
    text = "time [s],I [A]\n" + "".join(f"{t},{t % 7}\n" for t in times)
    overview = read_overview(write(tmp_path, text))
    assert any("a gap of 71 s before row 32, longer" in note for note in overview.notes)
    assert overview.clock.is_even
    text = "time [s],I [A]\n" + "".join(f"{t**3},{t % 7}\n" for t in range(60))
    assert not read_overview(write(tmp_path, text)).clock.is_even


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("n [1],I [A]\n0,1\n1,2\n", "no time column"),
        ("Datum,I [A]\n01/02/2026,1\n02/02/2026,2\n", "No date in the file decides"),
        (
            "time [s],I [A]\n" + "".join(f"{k % 30},{k}\n" for k in range(60)),
            "the clock restarts",
        ),
    ],
)
def test_a_clock_that_cannot_be_used_is_told_and_the_columns_all_the_same(tmp_path, text, says):
    overview = read_overview(write(tmp_path, text))
    assert overview.clock is None
    assert says in overview.notes[-1]
    assert overview.columns[1].unit == "A"
    assert overview.to_dict()["time"] is None


def test_its_dict_has_no_number_that_json_has_not(tmp_path):
    overview = read_overview(write(tmp_path, "t [s],Wort\n0,a\n1,b\n"))
    assert overview.to_dict()["columns"][1]["smallest"] is None
