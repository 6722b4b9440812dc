"""Claims: an array on disk has its room from the start, and is opened only as what it is."""

import errno
import os
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.journal import opened, reserve


def test_an_array_is_opened_as_it_was_made(tmp_path):
    made = np.lib.format.open_memmap(tmp_path / "a.npy", "w+", np.dtype("f8"), (4, 2))
    reserve(tmp_path / "a.npy")
    made[2] = (1.0, 2.0)
    made.flush()
    assert opened(tmp_path / "a.npy", "r", (4, 2), "f8")[2].tolist() == [1.0, 2.0]
    for shape, kind in (((4, 3), "f8"), ((4, 2), "f4")):
        with pytest.raises(ValueError, match="is of another shape"):
            opened(tmp_path / "a.npy", "r", shape, kind)
    with pytest.raises(ValueError, match=r"b\.npy is missing"):
        opened(tmp_path / "b.npy", "r", (4, 2), "f8")


@pytest.mark.parametrize("mode", ["r", "r+"])
def test_an_array_that_was_cut_short_is_not_filled_with_zeros(mode, tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.ones((4, 2)))
    cut = path.read_bytes()[:-8]
    path.write_bytes(cut)
    with pytest.raises(ValueError, match="file size"):
        opened(path, mode, (4, 2), "f8")
    assert path.read_bytes() == cut


@pytest.mark.parametrize(("missing", "fits"), [(0, True), (1, False)])
def test_where_no_room_can_be_allocated_the_disk_must_have_as_much_free(
    monkeypatch, tmp_path, missing, fits
):
    path = tmp_path / "a.npy"
    path.write_bytes(bytes(100))
    free = {tmp_path: SimpleNamespace(free=100 - missing)}
    monkeypatch.delattr(os, "posix_fallocate", raising=False)
    monkeypatch.setattr(shutil, "disk_usage", free.__getitem__)
    if fits:
        reserve(path)
    else:
        with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as refused:
            reserve(path)
        assert refused.value.errno == errno.ENOSPC
    assert path.read_bytes() == bytes(100)
