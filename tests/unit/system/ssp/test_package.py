"""Claims: no file leads out of the package or grows without bound, and what is damaged is named."""

from __future__ import annotations

import io
import stat
import zipfile

import pytest

from orchestration.fmu.archive import bounded
from orchestration.system import ssp
from orchestration.system.ssp import package
from tests.support.system.archive import DESCRIPTION, repacked
from tests.support.system.ssp_files import refused


def link(name):
    """An entry that is a symbolic link."""
    entry = zipfile.ZipInfo(name)
    entry.create_system, entry.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    return entry


@pytest.mark.parametrize(
    ("entry", "part"),
    [
        ("../outside.txt", "'../outside.txt' leads out of the archive"),
        ("resources/../../outside.txt", "leads out"),
        ("/outside.txt", "leads out"),
        ("C:/outside.txt", "leads out"),
        ("..\\outside.txt", "leads out"),
        (link("resources/link"), "'resources/link' is a symbolic link"),
    ],
)
def test_members_that_escape(archive, tmp_path, entry, part):
    refused(repacked(archive, None, [(entry, "x")]), tmp_path / "u", part)
    assert not (tmp_path / "u").exists()


def test_an_fmu_whose_members_escape(archive, tmp_path):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as bad:
        bad.writestr("../outside.txt", "x")
    extra = [("resources/bad.fmu", buffer.getvalue())]
    other = repacked(
        archive, lambda text: text.replace("resources/drive.fmu", "resources/bad.fmu"), extra
    )
    refused(other, tmp_path / "u", "member drive", "resources/bad.fmu: '../outside.txt' leads out")


def test_a_bomb(archive, tmp_path, monkeypatch):
    other = repacked(archive, None, [("resources/zeros", bytes(10**6))])
    assert other.stat().st_size < 10**5
    monkeypatch.setattr(bounded, "UNPACKED", 10**6)
    refused(other, tmp_path / "u", "unpacks to", "at most 1e+06 are unpacked")
    assert not (tmp_path / "u").exists()


def test_a_description_without_end(archive, tmp_path, monkeypatch):
    monkeypatch.setattr(package, "TEXT", 1000)
    refused(archive, tmp_path / "u", "SystemStructure.ssd has", "at most 1000 are read")


def test_entities_do_not_grow(archive, tmp_path):
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><x>&b;</x>'
    refused(repacked(archive, lambda text: bomb), tmp_path / "u", "document type declaration")


@pytest.mark.parametrize(
    ("data", "part"),
    [
        (b"", "not a zip archive"),
        (b"PK\x03\x04 and no more", "not a zip archive"),
        (None, "a folder, not a system"),
    ],
)
def test_files_that_are_no_systems(tmp_path, data, part):
    path = tmp_path / "bad.ssp"
    path.mkdir() if data is None else path.write_bytes(data)
    refused(path, tmp_path / "u", part)


def test_a_zip_without_a_description(tmp_path):
    with zipfile.ZipFile(tmp_path / "bad.ssp", "w") as bad:
        bad.writestr("letter.txt", "Dear reader")
    refused(tmp_path / "bad.ssp", tmp_path / "u", "no SSP", DESCRIPTION)


def test_a_damaged_description(archive, tmp_path):
    data = bytearray(archive.read_bytes())
    start = data.index(DESCRIPTION.encode()) + len(DESCRIPTION)
    data[start + 20] ^= 0xFF
    (tmp_path / "bad.ssp").write_bytes(data)
    refused(tmp_path / "bad.ssp", tmp_path / "u", DESCRIPTION, "cannot be read")


def test_a_bare_description_cannot_lead_out(system, tmp_path):
    (tmp_path / "bare").mkdir()
    bare = tmp_path / "bare" / "sample.ssd"
    ssp.write(system, bare)
    (tmp_path / "bare" / "resources" / "drive.fmu").rename(tmp_path / "drive.fmu")
    refused(bare, tmp_path / "u", "member drive", "resources/drive.fmu is missing")
    bare.write_text(
        bare.read_text(encoding="utf-8").replace("resources/drive.fmu", "../drive.fmu"),
        encoding="utf-8",
    )
    refused(bare, tmp_path / "u", "member drive", "'../drive.fmu' leads out")


@pytest.mark.parametrize("name", ["drive.fmu", "drive.ssv"])
def test_a_name_that_no_file_can_have(system, tmp_path, name):
    ssp.write(system, tmp_path / "sample.ssd")
    text = (tmp_path / "sample.ssd").read_text(encoding="utf-8")
    assert name in text
    (tmp_path / "sample.ssd").write_text(text.replace(name, 300 * "d"), encoding="utf-8")
    refused(tmp_path / "sample.ssd", tmp_path / "u", f"{300 * 'd'} ")
