"""Claims: an extended model becomes two FMUs, or none, and overwrites no record."""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from fmus.kit.build.toolchain import host_platform
from fmus.ppy_actuator.model import PpyActuator
from orchestration.api import builds
from orchestration.api.builds import export, fmu_paths


def test_where_the_fmus_go(tmp_path):
    assert fmu_paths(tmp_path / "a.b.fmu", []) == {
        "native": tmp_path / "a.b.fmu",
        "python": tmp_path / "a.b.python.fmu",
    }


@pytest.mark.parametrize("name", ["mended.fmu", "mended.python.fmu"])
def test_a_record_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("time [s]")
    (tmp_path / "record.csv").symlink_to(tmp_path / name)
    records = [tmp_path / "other.csv", tmp_path / "record.csv"]
    with pytest.raises(UserError, match=rf"{name}.\): this is the record itself; it will not be"):
        export(PpyActuator, tmp_path / "mended.fmu", records)
    assert (tmp_path / name).read_text() == "time [s]"


def test_other_destinations_that_are_refused(tmp_path):
    with pytest.raises(UserError, match=r"fmu\(.*mended\.zip.\): the name of an FMU ends in \.fmu"):
        fmu_paths(tmp_path / "mended.zip", [])
    (tmp_path / "mended.python.fmu").mkdir()
    with pytest.raises(UserError, match=r"mended\.python\.fmu.\): this is a folder"):
        fmu_paths(tmp_path / "mended.fmu", [])


def test_nothing_is_written_where_one_build_fails(tmp_path, monkeypatch):
    def build(cls, runtime, platforms, progress):
        if runtime == "python":
            raise UserError("'import numpy' cannot go into a Python FMU")
        return b"native"

    monkeypatch.setattr(builds, "build", build)
    with pytest.raises(UserError, match="'import numpy'"):
        export(PpyActuator, tmp_path / "mended.fmu", platforms=[host_platform()])
    assert not list(tmp_path.glob("*mended*"))
