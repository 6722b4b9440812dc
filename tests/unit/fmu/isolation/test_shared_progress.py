"""Claims: whoever watches a process is not stopped by damage to what it leaves."""

from __future__ import annotations

from orchestration.fmu.isolation.shared_progress import SharedProgress


def test_a_box_whose_files_are_gone_or_damaged_does_not_stop_whoever_watches(tmp_path):
    """A call is still seen to last, so that it can be ended; what nobody computed is not taken for
    computed.
    """
    watched, writer = SharedProgress(tmp_path), SharedProgress(tmp_path)
    writer.allocate_rows((3, 1))
    writer.begin_run(writer.allocate_run([("x.fmu: step", True)]))
    assert watched.state().doing == "x.fmu: step"
    (tmp_path / "legend0").unlink()
    assert watched.state().doing
    (tmp_path / "progress").write_bytes(b"A" * 64)  # the memory that both have
    assert not watched.state().in_kernel
    assert watched.read_rows(watched.state().point) is None
    assert watched.read_rows(2).shape == (2, 1)
    (tmp_path / "rows").write_bytes(b"A" * 200)
    (tmp_path / "description").write_bytes(b"A" * 200)
    assert watched.read_rows(2) is None
    assert watched.rows_description() is None
