"""Traces on disk: they are read back by any key, in pieces that fit into memory."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

from orchestration.sweeps.storage import traces


def test_pieces_are_all_there_is(monkeypatch):
    array = xarray.DataArray(np.arange(210.0).reshape(5, 6, 7))
    monkeypatch.setattr(traces, "_AT_ONCE", 8 * 10)
    parts = [*traces.iterate_pieces(array)]
    assert max(part.nbytes for part in parts) <= 80
    assert (
        np.concatenate([part.ravel() for part in parts]).tolist() == array.values.ravel().tolist()
    )


@pytest.mark.parametrize(
    "key",
    [
        (slice(None), slice(None), slice(None)),
        (1, slice(None), slice(3, 9, 2)),
        (slice(None, None, -1), 2, slice(None)),
        (slice(0, 2), slice(1, 3), 4),
        (0, 0, 0),
        (slice(0, 0), slice(None), slice(None)),
    ],
)
def test_traces_are_read_back_by_any_key(tmp_path, key):
    values = np.random.default_rng(1).normal(size=(6, 11, 2))  # cases, points, outputs
    file = traces.TraceFile(tmp_path / "traces.npy", "w+", (6, 2, 11))
    file.write([4, 0, 5], values[[4, 0, 5]])
    file.write([1, 2, 3], values[[1, 2, 3]])
    again = traces.TraceFile(tmp_path / "traces.npy", "r+", (6, 2, 11))
    for output in range(2):
        array = xarray.Variable(("a", "b", "time"), again.traces(output, (2, 3)))
        expected = values[:, :, output].reshape(2, 3, 11)[key]
        assert array[key].values.tolist() == expected.tolist()


def test_a_file_of_another_shape_is_refused(tmp_path):
    traces.TraceFile(tmp_path / "traces.npy", "w+", (6, 2, 11))
    with pytest.raises(ValueError, match=r"traces\.npy is of another shape"):
        traces.TraceFile(tmp_path / "traces.npy", "r+", (6, 2, 12))
    with pytest.raises(ValueError, match=r"none\.npy is missing"):
        traces.TraceFile(tmp_path / "none.npy", "r+", (6, 2, 11))
