"""Claims: each flaw of a measured record is repaired and said, or refused with its row; never used
silently.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.records import read_record

SIGNALS = {"u": "V", "y": "m"}
PUBLIC = Path(os.environ.get("PPY_PUBLIC_DATA", Path(__file__).parents[4] / "shared" / "data"))


def make(folder, rows, header="time [s],u [V],y [m]", end="\n"):
    path = folder / "record.csv"
    path.write_text(
        "\n".join([header, *(",".join(str(cell) for cell in row) for row in rows)]) + end,
        encoding="utf-8",
    )
    return path


def varied(count):
    """Rows whose channels are neither constant, quantised nor clipped."""
    rng = np.random.default_rng(1)
    return [[k, float(u), float(y)] for k, (u, y) in enumerate(rng.normal(size=(count, 2)))]


def read(path, **options):
    record = read_record(path, SIGNALS, inputs=["u"], **options)
    return record, {repair.kind: repair for repair in record.repairs}


def refusal(path, **options):
    with pytest.raises(UserError) as caught:
        read(path, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_clean_record_has_no_lines(tmp_path):
    record, kinds = read(make(tmp_path, varied(200)))
    assert kinds == {}
    assert record.time.size == 200


def test_repeated_times_are_averaged_and_counted(tmp_path):
    record, kinds = read(make(tmp_path, [[0, 1, 2], [1, 1, 2], [1, 3, ""], [1, 5, 4], [2, 0, 1]]))
    assert record.time.tolist() == [0, 1, 2]
    assert record.signals["u"].tolist() == [1, 3, 0]
    assert record.signals["y"].tolist() == [2, 3, 1]
    assert set(kinds) == {"duplicates"}
    assert kinds["duplicates"].rows == (4, 5)
    assert "5 rows became 3" in kinds["duplicates"].message


def test_rows_that_repeat_exactly_keep_their_exact_value(tmp_path):
    record, kinds = read(
        make(tmp_path, [[0, 0.1, 0.3], [1, 0.7, 0.1], [1, 0.7, 0.1], [1, 0.7, 0.1], [2, 0.2, 0.3]])
    )
    assert record.signals["u"].tolist() == [0.1, 0.7, 0.2]
    assert "identical values" in kinds["duplicates"].message


def test_a_few_late_rows_are_sorted(tmp_path):
    rows = varied(100)
    rows[50], rows[53] = rows[53], rows[50]
    record, kinds = read(make(tmp_path, rows))
    assert np.all(np.diff(record.time) > 0)
    assert kinds["order"].rows == (53, 54, 55)
    expected = np.array(sorted(rows))
    np.testing.assert_array_equal(record.signals["y"], expected[:, 2])


def test_a_late_packet_that_fits_a_hole_is_sorted(tmp_path):
    rows = varied(100)
    record, kinds = read(make(tmp_path, rows[:40] + rows[60:80] + rows[40:60] + rows[80:]))
    np.testing.assert_array_equal(record.time, np.arange(100))
    assert len(kinds["order"].rows) == 20


@pytest.mark.parametrize("tail", [1, 3, 100])
def test_a_restarted_clock_is_refused_with_the_row_to_split_at(tmp_path, tail):
    message = refusal(make(tmp_path, varied(100) + varied(tail)))
    assert "the clock restarts" in message
    assert "split the file before row 102" in message


def test_a_clock_set_back_is_refused(tmp_path):
    rows = varied(100)
    message = refusal(make(tmp_path, rows + [[t - 30, u, y] for t, u, y in rows[80:]]))
    assert "the clock jumps back: row 101 is at 99 s, row 102 at 50 s" in message


def test_a_shuffled_or_reversed_record_is_refused(tmp_path):
    rows = varied(100)
    assert "jumps back" in refusal(make(tmp_path, rows[::-1]))
    swapped = [row for pair in zip(rows[1::2], rows[::2], strict=True) for row in pair]
    assert "do not order" in refusal(make(tmp_path, swapped))


def test_gaps_are_kept_and_said(tmp_path):
    rows = varied(100)
    record, kinds = read(make(tmp_path, rows[:30] + rows[60:]))
    assert record.time.size == 70
    assert kinds["gap"].rows == (32,)
    assert "31 s before row 32" in kinds["gap"].message


def test_logarithmic_sampling_is_uneven_and_not_full_of_gaps(tmp_path):
    rows = varied(100)
    _, kinds = read(make(tmp_path, [[1e-3 * 1.15**k, u, y] for k, u, y in rows]))
    assert set(kinds) == {"uneven sampling"}


@pytest.mark.parametrize(
    "cell", ["", "NaN", "n/a", "null", "1.#QNAN", "inf", "-Infinity", "1.#INF", "1e999"]
)
def test_a_missing_output_is_masked_and_its_row_kept(tmp_path, cell):
    rows = varied(20)
    rows[4][2] = cell
    record, kinds = read(make(tmp_path, rows))
    assert np.flatnonzero(np.isnan(record.signals["y"])).tolist() == [4]
    assert kinds["masked"].rows == (6,)
    assert ("infinite" in kinds) == ("inf" in cell.lower() or "999" in cell)


def test_a_short_hole_in_an_input_is_interpolated_in_time(tmp_path):
    rows = varied(20)
    rows[6][0] = 6.5
    rows[5][1], rows[6][1], rows[4][1], rows[7][1] = "", "", 1.0, 4.0
    record, kinds = read(make(tmp_path, rows))
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
    rows = varied(20)
    for index in hole:
        rows[index][1] = ""
    assert says in refusal(make(tmp_path, rows))


def test_a_row_without_time_is_dropped_and_said(tmp_path):
    rows = varied(20)
    rows[3][0], rows[7][0] = "", "inf"
    record, kinds = read(make(tmp_path, rows))
    assert record.time.size == 18
    assert kinds["missing time"].rows == (5, 9)


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
    path = make(tmp_path, varied(20))
    path.write_text(path.read_text(encoding="utf-8") + torn, encoding="utf-8")
    record, kinds = read(path)
    assert record.time.size == 20
    assert kinds["partial line"].rows == (22,)


def test_a_whole_last_line_without_line_end_is_kept_and_said(tmp_path):
    record, kinds = read(make(tmp_path, varied(20), end=""))
    assert record.time.size == 20
    assert set(kinds) == {"no line end"}


def test_quantisation_gives_the_least_step(tmp_path):
    rows = [[t, u, round(y / 0.25) * 0.25] for t, u, y in varied(400)]
    _, kinds = read(make(tmp_path, rows))
    assert set(kinds) == {"quantised"}
    assert "y: quantised" in kinds["quantised"].message
    assert "least step 0.25 m" in kinds["quantised"].message


def test_clipping_gives_the_level(tmp_path):
    rows = [[t, u, min(np.sin(0.05 * t), 0.8)] for t, u, _ in varied(400)]
    _, kinds = read(make(tmp_path, rows))
    assert set(kinds) == {"clipped"}
    assert "maximum 0.8 m" in kinds["clipped"].message
    assert len(kinds["clipped"].rows) == sum(row[2] == 0.8 for row in rows)


def test_a_dead_channel_is_said(tmp_path):
    _, kinds = read(make(tmp_path, [[t, u, 3.5] for t, u, _ in varied(50)]))
    assert "y: constant at 3.5 m" in kinds["constant"].message


def test_an_empty_column_counts_as_absent(tmp_path):
    path = make(tmp_path, [[t, u, ""] for t, u, _ in varied(50)])
    record, kinds = read(path)
    assert list(record.signals) == ["u"]
    assert "treated as absent" in kinds["empty column"].message
    assert "'y' is required" in refusal(path, required=["y"])


def test_values_at_the_edge_of_the_doubles_do_no_harm(tmp_path):
    record, _ = read(
        make(tmp_path, [[k, (-1) ** k * 1.7e308, y] for k, _, y in varied(100)] + [[1.7e308, 0, 0]])
    )
    assert record.signals["u"][:2].tolist() == [1.7e308, -1.7e308]


@pytest.mark.parametrize(
    ("name", "signals", "mapping", "size", "kinds"),
    [
        (
            "creep_polyethylene_cm3.csv",
            {"force": "N", "displacement": "m"},
            {"stress": "force[N]", "strain": "displacement[m]"},
            279,
            {"unit replaced", "duplicates", "uneven sampling", "constant"},
        ),
        (
            "emps_positioning_stage.csv",
            {"position": "m", "motor_voltage": "V"},
            {},
            24841,
            {"ignored columns"},
        ),
        ("silverbox_snls80mV.csv", {"input": "V", "output": "V"}, {}, 131072, set()),
        (
            "supercapacitor_before_ageing_5mV_per_s.csv",
            {"voltage": "V", "current": "A"},
            {},
            24373,
            set(),
        ),
        (
            "supercapacitor_after_ageing_5mV_per_s.csv",
            {"voltage": "V", "current": "A"},
            {},
            24364,
            set(),
        ),
        (
            "two_layer_wall.csv",
            {"internal_temperature": "K", "external_temperature": "K", "heat_flux": "1"},
            {"sample": "time[s]"},
            1680,
            {"unit replaced"},
        ),
    ],
)
def test_public_records_agree_with_a_plain_reading(name, signals, mapping, size, kinds):
    path = PUBLIC / name
    if not path.exists():
        pytest.skip(f"public record {name} is not in {PUBLIC} (set PPY_PUBLIC_DATA)")
    record = read_record(path, signals, mapping=mapping, required=list(signals))
    assert record.time.size == size
    assert {repair.kind for repair in record.repairs} == kinds
    raw = np.genfromtxt(path, delimiter=",", names=True)
    plain = raw[raw.dtype.names[0]]
    np.testing.assert_array_equal(record.time, np.unique(plain))
    if "current" in signals:
        np.testing.assert_allclose(record.signals["current"], raw["current_mA"] / 1000, rtol=1e-14)
    if "displacement" in signals:
        means = [raw["strain_1"][plain == instant].mean() for instant in record.time]
        np.testing.assert_allclose(record.signals["displacement"], means, rtol=1e-9, atol=1e-18)
    if "heat_flux" in signals:
        np.testing.assert_allclose(
            record.signals["internal_temperature"], raw["internal_temperature_degC"] + 273.15
        )
