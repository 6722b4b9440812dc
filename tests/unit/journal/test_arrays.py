"""Claims: an array on disk has its room from the start, and is opened only as what it is."""

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
