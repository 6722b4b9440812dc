"""Claims: every dialect of text gives the same record; torn ends are dropped and said, and rows are
those of an editor. Rows of numbers in the middle of a large file, which are read without being
split, come to the same.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.kit.errors import UserError
from orchestration.records import read_record
from orchestration.records.formats import text
from orchestration.records.formats.text import read_text
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Words, numbers
from tests.support.record_forms import PLAIN, SIGNALS, check, write
from tests.support.record_rows import read, refusal, varied_rows, write_rows


def test_row_numbers_are_those_of_an_editor(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(
        "# one\n\n# three\ntime [s],u [V],y [m]\n0,1,2\n\n1,2,\n2,3,x\n", encoding="utf-8"
    )
    assert "row 8, column 'y': 'x'" in refusal(path)
    path.write_text(path.read_text(encoding="utf-8").replace("x", "9"), encoding="utf-8")
    _, kinds = read(path)
    assert kinds["blank lines"].rows == (6,)
    assert kinds["masked"].rows == (7,)


@pytest.mark.parametrize(
    "torn", ["20", "20,", "20,1.5", "20,1.5,", "20,1.5,-", "20,1.5,3e-", '20,"1.5']
)
def test_a_torn_last_line_is_dropped_and_said(tmp_path, torn):
    path = write_rows(tmp_path, varied_rows(20))
    path.write_text(path.read_text(encoding="utf-8") + torn, encoding="utf-8")
    record, kinds = read(path)
    assert record.time.size == 20
    assert kinds["partial line"].rows == (22,)


def test_a_whole_last_line_without_line_end_is_kept_and_said(tmp_path):
    record, kinds = read(write_rows(tmp_path, varied_rows(20), end=""))
    assert record.time.size == 20
    assert set(kinds) == {"no line end"}


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        PLAIN.encode("utf-16"),
        "# made by hand\n\n# second comment, with a comma\n" + PLAIN,
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", ";").replace(".", ","),
        PLAIN.replace(",", "\t").replace(".", ","),
        (
            '"time [s]","current [A]","displacement'
            ' [m]"\n"0","0.1","1e-3"\n0.5,-0.2,2e-3\n1,0.3,4e-3\n1.5,0.4,3e-3\n'
        ),
        PLAIN.replace("\n", ",\n"),
        "time [ms],displacement [mm],current [mA]\n0,1,100\n500,2,-200\n1000,4,300\n1500,3,400\n",
        (
            "time [min],displacement [µm],current [kA]\n0,1000,1e-4\n"
            f"{0.5 / 60!r},2000,-2e-4\n{1 / 60!r},4000,3e-4\n{1.5 / 60!r},3000,4e-4\n"
        ),
        (
            "current [A],note,time [s],displacement"
            " [m]\n0.1,start,0,1e-3\n-0.2,,0.5,2e-3\n0.3,x,1,4e-3\n0.4,,1.5,3e-3\n"
        ),
        "duration [s],current [A],displacement [m]" + PLAIN[PLAIN.index("\n") :],
    ],
)
def test_dialects_of_text_give_the_same_record(tmp_path, text):
    check(read_record(write(tmp_path, text), SIGNALS))


def test_a_file_that_is_not_utf8_is_read_and_said_to_be(tmp_path):
    record = read_record(
        write(tmp_path, "time [s],T [°C]\n0,20\n1,21\n".encode("cp1252")), {"T": "K"}
    )
    np.testing.assert_allclose(record.signals["T"], [293.15, 294.15])
    assert [r.kind for r in record.repairs] == ["encoding"]


def table_of_numbers(count=1100, delimiter=","):
    """Return the lines of a table that is long enough to be folded."""
    rng = np.random.default_rng(2)
    rows = [f"{k / 100},{u:.6g},{y:.3e}" for k, (u, y) in enumerate(rng.normal(size=(count, 2)))]
    return [line.replace(",", delimiter) for line in ["time [s],u [V],y [m]", *rows]]


def content_of(lines):
    return ("\n".join(lines) + "\n").encode()


def outcome(content, reading=AS_IT_STANDS):
    """Everything that a file tells, or its refusal."""
    try:
        table = read_text(Path("r.csv"), content, reading)
        columns = [(c.name, c.unit, c.title, numbers(table, c).tobytes()) for c in table.columns]
    except UserError as error:
        return str(error)
    return columns, table.rows.tolist(), table.repairs


@pytest.fixture
def split_lines(monkeypatch):
    """The lines that were split into cells one by one."""
    split = []
    plain = text._add_line

    def add_line(*arguments):
        split.append(arguments[3])
        plain(*arguments)

    monkeypatch.setattr(text, "_add_line", add_line)
    monkeypatch.setattr(text, "_FOLDED", 1)
    return split


def both_ways(content, reading=AS_IT_STANDS):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "_FOLDED", 1)
        folded = outcome(content, reading)
        patch.setattr(text, "_FOLDED", len(content))
        return folded, outcome(content, reading)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_rows_of_numbers_are_not_split_one_by_one(split_lines, delimiter, end):
    lines = table_of_numbers(3000, delimiter)
    lines[0] = lines[0].replace(" [", "[")
    content = (end.join(lines) + end).encode()
    columns, rows, repairs = outcome(content)
    assert len(split_lines) < 1100
    cells = [[float(cell) for cell in line.split(delimiter)] for line in lines[1:]]
    assert [values for *_, values in columns] == [values.tobytes() for values in np.array(cells).T]
    assert rows == list(range(2, 3002))
    assert not repairs


@pytest.mark.parametrize(
    "below",
    [["# end"], ["", "3000,1,2", "end of the record"], ["30,1,2"] * 600 + ["time [s],u [V],y [m]"]],
)
def test_notes_below_folded_rows_have_the_rows_of_an_editor(split_lines, below):
    lines = [*table_of_numbers(2000), *below]
    _, rows, repairs = outcome(content_of(lines))
    assert len(split_lines) < 1700
    plain = [k for k, line in enumerate(lines, start=1) if line[:1].isdigit()]
    assert rows == plain
    noted = sorted(row for repair in repairs for row in repair.rows)
    assert noted == sorted({*range(2, len(lines) + 1)} - {*plain})


def test_cells_that_may_be_words_stay_text(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "_FOLDED", 1)
    rows = [f"{k},{k % 3:03d}" for k in range(1500)]
    path = write(tmp_path, content_of(["time [s],mode", *rows]))
    words = Words()
    record = read_record(path, {"mode": "1"}, words={"mode": words})
    assert words.texts(record.signals["mode"])[:4].tolist() == ["000", "001", "002", "000"]


def test_points_of_folded_rows_that_may_separate_thousands_are_refused():
    lines = [f"{k};{k % 7}" for k in range(1500)]
    lines[700] = "700;1.230"
    folded, whole = both_ways(content_of(["time [s];u [V]", *lines]))
    assert "row 702: is '1.230' 1.23 or 1230?" in folded
    assert folded == whole


ROWS = table_of_numbers()[1:]
TWO = [*table_of_numbers(200), "a,b,c", *ROWS]


@pytest.mark.parametrize(
    ("lines", "reading"),
    [
        (TWO, AS_IT_STANDS),
        (TWO, Reading(table="1")),
        (TWO, Reading(table="2")),
        (["note"] * 500 + ROWS[:600] + table_of_numbers(499), AS_IT_STANDS),
        ([*table_of_numbers(), *[""] * 600], AS_IT_STANDS),
        (["t,u", *['1,"2,5"'] * 499, *["1,2"] * 100, *['1,"2,5"'] * 500], AS_IT_STANDS),
        ([f"{line}," for line in table_of_numbers()], AS_IT_STANDS),
        (
            ["t;u", *["1;0.5"] * 600, "1; 0.5", *["1;0.5"] * 600],
            Reading(decimal="comma"),
        ),
        (ROWS, Reading(columns=("time=s", "u", "y"))),
        (ROWS, AS_IT_STANDS),
    ],
)
def test_forms_of_tables_are_the_same_with_folded_rows(lines, reading):
    folded, whole = both_ways(content_of(lines), reading)
    assert folded == whole


CELLS = [
    *("", "  ", " 1.5", "nan", "inf", "1e400", "OVERLOAD", "true", "1.230", "1,5", "1'000"),
    *("12 mA", "\u22125", "1D+02", "+7", "9.91E37", "-9999", '"3"', '"3,5"', '"3', "0x10", "1_0"),
    *("12:30", "x"),
]
LINES = [
    *("", "# comment", "time [s],u [V],y [m]", "s,V,m", "end of data"),
    *("1", "1,2,3,4", ",,", "a,b"),
]


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from([",", ";", "\t", " "]),
    st.lists(
        st.tuples(st.sampled_from([1, 400, 501, 550, 600, 800, 1100]), st.sampled_from(CELLS)),
        max_size=2,
    ),
    st.lists(
        st.tuples(st.sampled_from([0, 1, 300, 501, 580, 1000, 1100]), st.sampled_from(LINES)),
        max_size=1,
    ),
    st.sampled_from(["\n", "\r\n", "\r", ",\n"]),
    st.sampled_from(["utf-8", "utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    st.booleans(),
    st.sampled_from(["", "", "point", "comma"]),
)
def test_odd_tables_are_the_same_with_folded_rows(
    delimiter, cells, lines, end, encoding, is_ended, decimal
):
    table = [line.split(",") for line in table_of_numbers()]
    for row, cell in cells:
        table[row][1] = cell
    written = [delimiter.join(row) for row in table]
    for row, line in lines:
        written.insert(row, line.replace(",", delimiter))
    content = end.join(written) + (end if is_ended else "")
    encoded = content.replace("u [V]", "u [µV]").encode(encoding, errors="replace")
    folded, whole = both_ways(encoded, Reading(decimal=decimal))
    assert folded == whole
