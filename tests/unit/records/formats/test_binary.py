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


@pytest.mark.parametrize(("turn", "name"), [(np.transpose, "ID(:,{})"), (np.copy, "ID({},:)")])
def test_vectors_along_the_longer_side_of_a_matrix_have_the_names_of_matlab(tmp_path, turn, name):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"ID": turn(np.array([DISPLACEMENT, CURRENT, TIME]))})
    mapping = {name.format(1): "displacement", name.format(2): "current", name.format(3): "time"}
    check(read_record(tmp_path / "r.mat", SIGNALS, mapping=mapping))


def test_fields_of_an_object_of_matlab_are_not_read(tmp_path):
    from scipy.io import savemat
    from scipy.io.matlab import MatlabObject

    field = np.array([[(np.arange(6.0),)]], dtype=[("Utility", object)])
    content = {"time": TIME, "current": CURRENT, "displacement": DISPLACEMENT}
    savemat(tmp_path / "r.mat", {**content, "data": MatlabObject(field, "iddata")})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert "so not read: data" in record.repairs[0].message


def test_a_matrix_as_long_as_the_vectors_is_read_beside_them(tmp_path):
    from scipy.io import savemat

    y = np.column_stack([DISPLACEMENT, CURRENT]), np.eye(3)
    savemat(tmp_path / "r.mat", {"time": TIME, "y": y[0], "K": y[1]})
    record = read_record(
        tmp_path / "r.mat", SIGNALS, mapping={"y(:,1)": "displacement", "y(:,2)": "current"}
    )
    check(record)
    assert "so not read: K" in record.repairs[0].message


def test_channels_of_unequal_length_are_refused(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "r.mat", {"time": TIME, "current": CURRENT[:3]})
    assert "'current' has 3 values, 'time' has 4" in refusal(tmp_path / "r.mat")


def test_feather(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    feather = pytest.importorskip("pyarrow.feather")
    columns = {"time [ms]": TIME * 1e3, "current [mA]": CURRENT * 1e3}
    table = arrow.table({**columns, "displacement [m]": DISPLACEMENT})
    feather.write_feather(table, tmp_path / "r.feather")
    check(read_record(tmp_path / "r.feather", SIGNALS))


def test_mat_structs_are_read_and_a_step_is_the_clock(tmp_path):
    from scipy.io import savemat

    units = {"current": "mA", "displacement": "m"}
    run = {"current": CURRENT * 1e3, "displacement": DISPLACEMENT, "Ts": 0.5}
    savemat(tmp_path / "r.mat", {"run": run, "units": units})
    record = read_record(tmp_path / "r.mat", SIGNALS)
    check(record)
    assert "time is k × 0.5 s, from Ts" in [r.message for r in record.repairs]


def test_a_structure_with_time_of_simulink(tmp_path):
    from scipy.io import savemat

    signals = np.empty((1, 2), dtype=[("label", object), ("values", object)])
    signals[0, 0] = ("current", CURRENT[:, None])
    signals[0, 1] = ("displacement", DISPLACEMENT[:, None])
    savemat(tmp_path / "r.mat", {"out": {"time": TIME, "signals": signals}})
    check(read_record(tmp_path / "r.mat", SIGNALS))


def test_netcdf_with_missing_values_and_times_since(tmp_path):
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "r.nc", "w") as file:
        file.createDimension("time", 4)
        for name, values, unit in (
            ("time", TIME, "seconds since 2026-01-01"),
            ("current", np.where(CURRENT < 0.0, -9e5, CURRENT), "A"),
            ("displacement", DISPLACEMENT, "m"),
        ):
            variable = file.createVariable(name, "d", ("time",))
            variable[:] = values
            variable.units = unit
        file.variables["current"].missing_value = -9e5
    record = read_record(tmp_path / "r.nc", SIGNALS)
    np.testing.assert_array_equal(record.time, TIME)
    assert np.flatnonzero(np.isnan(record.signals["current"])).tolist() == [1]


def test_netcdf_rows_are_along_the_dimension_that_most_vectors_have(tmp_path):
    """Though it is not the first in the file; what is along another is told."""
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "r.nc", "w") as file:
        file.createDimension("length", 3)
        file.createDimension("channel", 2)
        file.createDimension("time", 4)
        file.createVariable("names", "c", ("channel", "length"))[:] = (
            np.array([b"one", b"two"]).view("S1").reshape(2, 3)
        )
        for name, values in (("time", TIME), ("current", CURRENT)):
            file.createVariable(name, "d", ("time",))[:] = values
        file.createVariable("mode", "c", ("time", "length"))[:] = (
            np.array([b"off", b"off", b"on", b"off"], dtype="S3").view("S1").reshape(4, 3)
        )
    signals, words = {"current": "A", "mode": "1"}, {"mode": {"off": 0.0, "on": 1.0}}
    record = read_record(tmp_path / "r.nc", signals, words=words)
    assert record.time.tolist() == TIME.tolist()
    assert record.signals["mode"].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert "not along dimension 'time': names" in [r.message for r in record.repairs]


def test_texts_in_netcdf_are_columns_of_texts(tmp_path):
    from scipy.io import netcdf_file

    words = ["off", "Heating", "off", "Heizen ½"]
    size = max(len(word.encode()) for word in words)
    with netcdf_file(tmp_path / "r.nc", "w") as file:
        file.createDimension("time", 4)
        file.createDimension("length", size)
        file.createVariable("time", "d", ("time",))[:] = TIME
        file.createVariable("current", "d", ("time",))[:] = CURRENT
        texts = np.array([word.encode() for word in words], dtype=f"S{size}")
        characters = texts.view("S1").reshape(4, size)
        file.createVariable("mode", "c", ("time", "length"))[:] = characters
        file.createVariable("flag", "c", ("time",))[:] = characters[:, 0]
    items = {"off": 1.0, "Heating": 3.0, "Heizen ½": 4.0}
    flags = {"o": 0.0, "H": 1.0}
    signals = {"current": "A", "mode": "1", "flag": "1"}
    record = read_record(tmp_path / "r.nc", signals, words={"mode": items, "flag": flags})
    assert record.signals["mode"].tolist() == [1.0, 3.0, 1.0, 4.0]
    assert record.signals["flag"].tolist() == [0.0, 1.0, 0.0, 1.0]
    message = refusal(tmp_path / "r.nc", signals={"mode": "1"})
    assert "row 1, column 'mode': 'off' is not a number" in message
