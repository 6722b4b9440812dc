"""Claims: vectors and tables of a file that h5py wrote are read with units, scales and missing
values; of several groups the user names one.
"""

import numpy as np
import pytest

from orchestration.records import Source, read_record
from tests.support.record_forms import CURRENT, DISPLACEMENT, SIGNALS, TIME, check, refusal

h5py = pytest.importorskip("h5py")


def fill(group, prefix=""):
    for name, values, unit in (("time", TIME, "s"), ("current", CURRENT * 1e3, "mA")):
        group.create_dataset(name, data=values).attrs["units"] = unit
    scaled = group.create_dataset("displacement", data=DISPLACEMENT * 1e6 + 5.0)
    scaled.attrs.update({"units": "m", "scale_factor": 1e-6, "add_offset": -5e-6})


def test_a_group_of_vectors(tmp_path):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        fill(file.create_group("run"))
        file["title"] = "a cell"
    record = read_record(tmp_path / "r.h5", SIGNALS)
    np.testing.assert_allclose(record.signals["displacement"], DISPLACEMENT, rtol=1e-9)
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_allclose(record.signals["current"], CURRENT, rtol=1e-14)


def test_a_table_of_fields(tmp_path):
    table = np.rec.fromarrays([TIME, CURRENT, DISPLACEMENT], names="time,current,displacement")
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["data"] = table
    check(read_record(tmp_path / "r.h5", SIGNALS))


def test_of_several_groups_one_is_named(tmp_path):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        fill(file.create_group("one"))
        fill(file.create_group("two"))
    assert "there are 2 tables: 1 (one); 2 (two)" in refusal(tmp_path / "r.h5")
    record = read_record(Source.of(tmp_path / "r.h5", table="two"), SIGNALS)
    np.testing.assert_array_equal(record.time, TIME)


def test_a_fill_value_is_missing_and_a_damaged_file_refused(tmp_path):
    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        fill(file)
        file["displacement"].attrs["_FillValue"] = file["displacement"][2]
    assert np.isnan(read_record(path, SIGNALS).signals["displacement"][2])
    path.write_bytes(path.read_bytes()[:600])
    assert "the HDF5 file is damaged" in refusal(path)
