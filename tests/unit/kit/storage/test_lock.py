"""Claims: a lock is held by one descriptor at a time, and its file goes with it."""

import pytest

from fmus.kit.storage import lock


def test_a_file_is_locked_once_and_removed_with_its_lock(tmp_path):
    path = tmp_path / "x.lock"
    descriptor = lock.take(path)
    assert descriptor is not None
    assert path.exists()
    assert lock.take(path) is None
    lock.release(path, descriptor)
    assert not path.exists()
    again = lock.take(path)
    assert again is not None
    lock.release(path, again)


def test_a_place_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(OSError, match="No such file"):
        lock.take(tmp_path / "none" / "x.lock")
