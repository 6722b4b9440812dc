"""Claims: time comes from the comment's ticks, or from the column of ticks; a domain that makes no
time is refused.
"""

import pytest

from orchestration.records import read_record
from tests.support.record_forms import SIGNALS, refusal, write

ABOUT = "# domain;unit=seconds;resolution=1/1000;delta=250;origin=1970-01-01T00:00:00;"
ROWS = '"current (mA)"\n1000\n2000\n3000\n'


def test_rows_are_counted_in_steps_of_the_comment(tmp_path):
    record = read_record(write(tmp_path, f"{ABOUT}\n{ROWS}"), SIGNALS)
    assert record.time.tolist() == [0.0, 0.25, 0.5]
    assert record.signals["current"].tolist() == [1.0, 2.0, 3.0]


def test_a_column_of_ticks_is_the_time(tmp_path):
    text = f'{ABOUT}\nDomain,"current (A)"\n817,1\n1067,2\n1817,3\n'
    assert read_record(write(tmp_path, text), SIGNALS).time.tolist() == [0.0, 0.25, 1.0]


@pytest.mark.parametrize(
    ("old", "new"),
    [("delta=250", "delta=0"), ("1/1000", "1/0"), ("resolution", "r"), ("seconds", "m")],
)
def test_a_domain_that_makes_no_time_is_refused(tmp_path, old, new):
    assert "row 1" in refusal(write(tmp_path, f"{ABOUT.replace(old, new)}\n{ROWS}"))


def test_a_comment_alone_is_refused(tmp_path):
    assert "no header follows" in refusal(write(tmp_path, ABOUT))
