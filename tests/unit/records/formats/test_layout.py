"""Claims: the header is the line above the data that names their columns, whatever is above it; a
row of units is told from one of names; what is damaged does not move the header.
"""

import pytest

from fmus.kit import UserError
from orchestration.records import read_record
from orchestration.records.formats.layout import find_layout, is_value
from orchestration.records.source import Source
from tests.support.record_forms import PLAIN, SIGNALS, check, write

HEADER, *ROWS = PLAIN.splitlines()


@pytest.mark.parametrize(
    "above",
    [
        ["Sample rate,50,"],
        ["Model,X,Y"] * 40,
        ["a line without any delimiter"],
        ["Range,10,V", "", ",,", "Date,1/2/2026,"],
        ["x;y;z", "1\t2\t3"],
        [f"setting {k},{k}" for k in range(500)],
    ],
)
def test_a_preamble_of_any_length_is_passed_over_and_said(tmp_path, above):
    record = read_record(write(tmp_path, "\n".join([*above, PLAIN])), SIGNALS)
    check(record)
    preamble = next(r for r in record.repairs if r.kind == "preamble")
    assert f"row {len(above) + 1}" in preamble.message


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(["time,current,displacement", "s,A,m", *ROWS]),
        "\n".join(["time,current,displacement", ",A,m", *ROWS]).replace("time", "time [s]"),
        "\n".join(["time,current,displacement", "[s],Amps,m", *ROWS]).replace("[s]", "sec"),
        "# " + PLAIN,
        "\n".join(["#Model,X,", "#" + HEADER, *ROWS]),
    ],
)
def test_units_in_a_row_of_their_own_and_a_header_behind_a_comment_are_read(tmp_path, text):
    record = read_record(write(tmp_path, text), SIGNALS)
    check(record)
    assert "unit assumed" not in {r.kind for r in record.repairs}


def test_columns_that_are_called_like_units_keep_their_names():
    assert find_layout(["V,A", "1,2", "3,4"]).header == ["V", "A"]


@pytest.mark.parametrize(
    ("units", "header"),
    [
        ("s DEG/S DEG/S PROZENT", "T Q R N1"),
        ("s Q R N1", "s Q R N1"),
        ("x y x z", "x y x z"),
    ],
)
def test_words_that_recur_below_names_are_units_if_one_is_known(units, header):
    layout = find_layout(["44 variables plus time", "T Q R N1", units, "0 1 2 3", "1 2 3 4"])
    assert layout.header == header.split()
    assert layout.units == ([] if units == header else units.split())


@pytest.mark.parametrize("damaged", ["0,1", "0,1,2,3", "0,x,y", '0,"1,2'])
def test_a_damaged_first_row_does_not_move_the_header(damaged):
    lines = ["Model,X,Y", HEADER, damaged, *ROWS]
    assert find_layout(lines).names == 1
    assert find_layout(lines).first == 2


def test_a_second_header_in_the_data_is_not_taken_for_the_first():
    assert find_layout([HEADER, *ROWS, HEADER, *ROWS]).names == 0


def test_no_header_is_found_where_there_is_none():
    assert find_layout(["0,1", "1,2"]) is None
    assert find_layout(["time,current"]) is None
    assert find_layout([]) is None


@pytest.mark.parametrize(
    "cell", ["1", "-.5", "1,5", "1.234,5", "1'000", "3e-4", "2026-01-02", "23:59:59,5"]
)
def test_numbers_in_any_notation_and_dates_are_values(cell):
    assert is_value(cell)


@pytest.mark.parametrize("cell", ["", "CH1", "V", "nan", "OVERLOAD", "10 V", "..........."])
def test_words_and_nothing_are_no_values(cell):
    assert not is_value(cell)


ONE_COLUMN = "\n".join(f"{k}.5" for k in range(12))


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        (f"deflection [deg]\n{ONE_COLUMN}\nDone\n", ()),
        (f"start, rate, duration\n90, 100, 5\n{ONE_COLUMN}\n", ("deflection=deg",)),
        (f"{ONE_COLUMN}\n", ("deflection=deg",)),
    ],
)
def test_lines_of_one_value_are_a_column_of_a_stated_rate(tmp_path, text, columns):
    path = write(tmp_path, text)
    source = Source.of(path, columns=columns, rate=100.0)
    record = read_record(source, {"deflection": "deg"})
    assert record.signals["deflection"].tolist() == [k + 0.5 for k in range(12)]
    assert record.time == pytest.approx([0.01 * k for k in range(12)])


@pytest.mark.parametrize("line", ["0.5, 1.5, 2.5, 3.5", "0.5;1.5;2.5;3.5;\n"])
def test_one_line_of_numbers_is_a_column(tmp_path, line):
    path = tmp_path / "row.csv"
    path.write_text(line, encoding="utf-8")
    record = read_record(Source.of(path, columns=("current=A",), rate=100.0), SIGNALS)
    assert record.signals["current"].tolist() == [0.5, 1.5, 2.5, 3.5]
    assert "one line of 4 numbers" in record.repairs[0].message


def test_rows_of_one_value_below_names_of_several_columns_are_refused(tmp_path):
    path = write(tmp_path, f"time [s],current [A]\n{ONE_COLUMN}\n")
    with pytest.raises(UserError, match="row 2: 1 cells where the header has 2"):
        read_record(path, SIGNALS)


@pytest.mark.parametrize(("above", "skipped"), [("", []), ("# x\nrun 7\n", ["row 2"])])
def test_what_is_skipped_above_data_without_a_header_is_said(tmp_path, above, skipped):
    path = write(tmp_path, above + "0,1\n1,2\n2,4\n")
    source = Source.of(path, columns=("time=s", "current=A"))
    record = read_record(source, {"current": "A"})
    said = [r.message.rpartition(": ")[2] for r in record.repairs if r.kind == "preamble"]
    assert said == skipped
