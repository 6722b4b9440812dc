"""Claims: the release folder holds FMUs and systems that run where they are unpacked, and a
manifest of digests that a standard tool accepts and a changed byte breaks.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import zipfile
from hashlib import sha256

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from fmus.kit.build import available_platforms, host_platform
from studies.release import folder
from tests.support.command import works


@pytest.fixture(scope="module")
def release(tmp_path_factory):
    """A release of one component and one system for this machine."""
    out = tmp_path_factory.mktemp("release")
    folder.write(out, ["galvanostat"], ["dma_bench"], [host_platform()])
    return out


def entries(release):
    manifest = json.loads((release / "manifest.json").read_text(encoding="utf-8"))
    return {entry["path"]: entry for entry in manifest["files"]}


def test_every_file_is_in_the_manifest_with_its_digest(release):
    found = {
        path.relative_to(release).as_posix(): path
        for path in release.rglob("*")
        if path.suffix in (".fmu", ".ssp")
    }
    assert set(found) == {
        "fmu/fmi3-python/galvanostat.fmu",
        "fmu/fmi3/galvanostat.fmu",
        "fmu/native/galvanostat.fmu",
        "fmu/python/galvanostat.fmu",
        "ssp/dma_bench.ssp",
    }
    listed = entries(release)
    assert set(listed) == set(found)
    for name, path in found.items():
        assert listed[name]["sha256"] == sha256(path.read_bytes()).hexdigest()
        if path.suffix == ".fmu":
            assert validate_fmu(path) == []
            described = read_model_description(path)
            assert listed[name]["guid"] == described.guid
            assert listed[name]["fmi"] == described.fmiVersion


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum")
def test_the_digests_are_accepted_and_a_changed_byte_is_not(release, tmp_path):
    shutil.copytree(release, tmp_path / "copy")
    check = ["sha256sum", "--check", "--quiet", "SHA256SUMS"]
    assert subprocess.run(check, cwd=tmp_path / "copy").returncode == 0
    with (tmp_path / "copy" / "ssp" / "dma_bench.ssp").open("ab") as damaged:
        damaged.write(b" ")
    assert subprocess.run(check, cwd=tmp_path / "copy", capture_output=True).returncode == 1


def test_one_archive_holds_all_of_it(release):
    (path,) = release.glob("ppy-rig-*-fmus.zip")
    with zipfile.ZipFile(path) as packed:
        names = set(packed.namelist())
        assert names == set(entries(release)) | {"manifest.json", "SHA256SUMS"}
        assert all(packed.read(name) == (release / name).read_bytes() for name in names)


def test_what_was_released_runs(release, tmp_path):
    native = release / "fmu" / "native" / "galvanostat.fmu"
    works("check", native, cwd=tmp_path)
    works("check", release / "fmu" / "fmi3" / "galvanostat.fmu", cwd=tmp_path)
    works("simulate", release / "ssp" / "dma_bench.ssp", "--stop", "10ms", cwd=tmp_path)


@pytest.mark.slow
def test_for_all_platforms_it_is_twice_the_same(tmp_path):
    """`make dist` writes all of it."""
    for name in ("one", "two"):
        folder.write(tmp_path / name, ["galvanostat"], ["dma_bench"])
    sums = [(tmp_path / name / "SHA256SUMS").read_text() for name in ("one", "two")]
    assert sums[0] == sums[1]
    listed = entries(tmp_path / "one")
    assert len(listed) == 5
    native = [entry for path, entry in listed.items() if path.startswith("fmu/native")]
    for entry in native:
        assert set(entry["platforms"]) == set(available_platforms())
    with zipfile.ZipFile(tmp_path / "one" / "ssp" / "dma_bench.ssp") as system:
        (member,) = [n for n in system.namelist() if n.endswith("voice_coil_dma.fmu")]
        system.extract(member, tmp_path)
    with zipfile.ZipFile(tmp_path / member) as fmu:
        binaries = {n.split("/")[1] for n in fmu.namelist() if n.startswith("binaries/")}
    assert binaries == set(available_platforms())
