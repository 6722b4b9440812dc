"""Claims: missing values are filled, masked or refused with their rows; poor sensors are said, and
steps of inputs found.
"""

import numpy as np
import pytest

from orchestration.records import read_record
from orchestration.records.sampling import input_steps
from tests.support.record_rows import read, refusal, varied_rows, write_rows


@pytest.mark.parametrize(
    "cell", ["", "NaN", "n/a", "null", "1.#QNAN", "inf", "-Infinity", "1.#INF", "1e999"]
)
def test_a_missing_output_is_masked_and_its_row_kept(tmp_path, cell):
    rows = varied_rows(20)
    rows[4][2] = cell
    record, kinds = read(write_rows(tmp_path, rows))
    assert np.flatnonzero(np.isnan(record.signals["y"])).tolist() == [4]
    assert kinds["masked"].rows == (6,)
    assert ("infinite" in kinds) == ("inf" in cell.lower() or "999" in cell)


def test_a_short_hole_in_an_input_is_interpolated_in_time(tmp_path):
    rows = varied_rows(20)
    rows[6][0] = 6.5
    rows[5][1], rows[6][1], rows[4][1], rows[7][1] = "", "", 1.0, 4.0
    record, kinds = read(write_rows(tmp_path, rows))
    np.testing.assert_allclose(record.signals["u"][4:8], [1.0, 2.0, 3.5, 4.0])
    assert kinds["filled hole"].rows == (7, 8)


@pytest.mark.parametrize(
    ("hole", "says"),
    [
        (range(5, 11), "rows 7 to 12: 6 samples"),
        (range(2), "rows 2 to 3, at the start"),
        ([19], "row 21, at the end"),
    ],
)
def test_a_long_or_outer_hole_in_an_input_is_refused(tmp_path, hole, says):
    rows = varied_rows(20)
    for index in hole:
        rows[index][1] = ""
    assert says in refusal(write_rows(tmp_path, rows))


def test_a_short_stay_at_an_extreme_is_clipped_only_in_a_short_record(tmp_path):
    for count, kinds_of_it in ((400, {"clipped"}), (600, set())):
        rows = varied_rows(count)
        for row in rows[100:105]:
            row[2] = 9.0
        assert set(read(write_rows(tmp_path, rows))[1]) == kinds_of_it


def test_quantisation_gives_the_least_step(tmp_path):
    rows = [[t, u, round(y / 0.25) * 0.25] for t, u, y in varied_rows(400)]
    _, kinds = read(write_rows(tmp_path, rows))
    assert set(kinds) == {"quantised"}
    assert "y: quantised" in kinds["quantised"].message
    assert "least step 0.25 m" in kinds["quantised"].message
    path = write_rows(tmp_path, rows)
    path.write_text(path.read_text(encoding="utf-8").replace("y [m]", "y [1]"), encoding="utf-8")
    record = read_record(path, {"u": "V", "y": "1"})
    assert record.repairs[0].message.endswith("least step 0.25")


def test_clipping_gives_the_level(tmp_path):
    rows = [[t, u, min(np.sin(0.05 * t), 0.8)] for t, u, _ in varied_rows(400)]
    _, kinds = read(write_rows(tmp_path, rows))
    assert set(kinds) == {"clipped"}
    assert "maximum 0.8 m" in kinds["clipped"].message
    assert len(kinds["clipped"].rows) == sum(row[2] == 0.8 for row in rows)


def test_a_dead_channel_is_said(tmp_path):
    _, kinds = read(write_rows(tmp_path, [[t, u, 3.5] for t, u, _ in varied_rows(50)]))
    assert "y: constant at 3.5 m" in kinds["constant"].message


def test_an_empty_column_counts_as_absent(tmp_path):
    path = write_rows(tmp_path, [[t, u, ""] for t, u, _ in varied_rows(50)])
    record, kinds = read(path)
    assert list(record.signals) == ["u"]
    assert "treated as absent" in kinds["empty column"].message
    assert "'y' is required" in refusal(path, required=["y"])


def test_an_input_steps_where_it_changes_far_more_than_it_usually_does():
    """A sine of 100 samples a period changes by up to 3 % of its range, usually by 2.2 %."""
    phase = 2.0 * np.pi * np.arange(300) / 100
    stepping = np.repeat([0.0, 1.0, 0.995], 100)  # the second change is below 1 % of the range
    both = {"sine": np.sin(phase), "levels": stepping, "dead": np.zeros(300)}
    assert np.flatnonzero(input_steps(both, 300)).tolist() == [100]
    assert not input_steps({"dead": np.zeros(3)}, 3).any()
    assert input_steps({}, 3).tolist() == [False] * 3
