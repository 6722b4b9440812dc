"""Claims: every dialect of text gives the same record; torn ends are dropped and said, and rows are
those of an editor.
"""

import numpy as np
import pytest

from orchestration.records import read_record
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
