"""Claims: rows and segments are cut out of a table before anything is repaired; what no row has is
refused with what there is.
"""

import pytest

from fmus.kit import UserError
from orchestration.records import Source, read_record
from tests.support.record_forms import write

TEXT = "time [s],CYCLE,STEP,I [A]\n" + "".join(
    f"{k},{k // 10},{'rest' if k % 10 < 3 else 'load'},{k}\n" for k in range(40)
)


def currents(folder, **reading):
    source = Source.of(write(folder, TEXT), **reading)
    return read_record(source, {"I": "A"}).signals["I"].tolist()


def test_rows_are_cut_by_the_numbers_that_messages_have(tmp_path):
    assert currents(tmp_path, rows=(12, 21)) == [float(k) for k in range(10, 20)]


@pytest.mark.parametrize(("rate", "says"), [(4.0, "4 a second"), (1 / 3600, "one every 3600 s")])
def test_a_stated_rate_is_said_as_people_say_it(tmp_path, rate, says):
    record = read_record(Source.of(write(tmp_path, TEXT), rate=rate), {"I": "A"})
    assert f"time counts the rows, {says}, as stated" in [r.message for r in record.repairs]


def test_segments_are_cut_by_their_labels(tmp_path):
    assert currents(tmp_path, segment={"CYCLE": "3"}) == [float(k) for k in range(30, 40)]
    assert currents(tmp_path, segment={"CYCLE": "1,2", "STEP": "rest"}) == [10, 11, 12, 20, 21, 22]


@pytest.mark.parametrize(
    ("reading", "says"),
    [
        ({"rows": (50, 60)}, "rows='50..60': the rows are 2 to 41"),
        ({"segment": {"CYCLE": "7"}}, "no row has 7 (there are 0, 1, 2, 3)"),
        ({"segment": {"CICLE": "1"}}, "no column is called 'CICLE'"),
    ],
)
def test_what_no_row_has_is_refused(tmp_path, reading, says):
    with pytest.raises(UserError) as caught:
        currents(tmp_path, **reading)
    assert says in str(caught.value)
