"""Claims: Parquet and MATLAB files, written by others' libraries, give the same record."""

import numpy as np
import pytest

from orchestration.records import read_record
from tests.support.record_forms import CURRENT, DISPLACEMENT, SIGNALS, TIME, check, refusal


def test_parquet(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    fields = [
        arrow.field("time [ms]", arrow.float64()),
        arrow.field("current", arrow.float64(), metadata={"unit": "mA"}),
        arrow.field("displacement [m]", arrow.float64()),
        arrow.field("remark", arrow.string()),
    ]
    columns = [TIME * 1e3, CURRENT * 1e3, DISPLACEMENT, ["a", "b", "c", "d"]]
    parquet.write_table(arrow.table(columns, schema=arrow.schema(fields)), tmp_path / "r.parquet")
    record = read_record(tmp_path / "r.parquet", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["ignored columns"]


def test_parquet_null_is_missing_and_instants_become_seconds(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    instants = np.datetime64("2020-01-01T00:00:00") + (TIME * 1000).astype("timedelta64[ms]")
    table = arrow.table(
        {"time": instants, "displacement [m]": arrow.array([1e-3, None, 4e-3, 3e-3])}
    )
    parquet.write_table(table, tmp_path / "r.parquet")
    record = read_record(tmp_path / "r.parquet", SIGNALS)
    np.testing.assert_allclose(record.time, TIME)
    assert np.flatnonzero(np.isnan(record.signals["displacement"])).tolist() == [1]
    assert [(r.kind, r.rows) for r in record.repairs] == [("masked", (2,))]


@pytest.mark.parametrize(
    "units",
    [
        {"current": "mA", "time": "s", "displacement": "m"},
        np.array(["current [mA]", "time [s]", "displacement [m]"], dtype=object),
    ],
)
def test_mat(tmp_path, units):
    from scipy.io import savemat

    content = {
        "displacement": DISPLACEMENT[:, None],
        "current": CURRENT * 1e3,
        "time": TIME,
        "units": units,
    }
    savemat(tmp_path / "r.mat", {**content, "rig": "left", "matrix": np.eye(3)})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["ignored columns"]
    assert "matrix" in record.repairs[0].message


def test_mat_without_units_is_taken_in_si_and_says_so(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"time": TIME, "current": CURRENT, "displacement": DISPLACEMENT})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert [r.kind for r in record.repairs] == ["unit assumed"] * 3


def test_channels_of_unequal_length_are_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"time": TIME, "current": CURRENT[:3]})
    assert "'current' has 3 values, 'time' has 4" in refusal(tmp_path / "r.mat")
