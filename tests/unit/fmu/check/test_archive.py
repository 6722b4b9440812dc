"""Claims: a fault of the archive is found: paths, damage, identity, documents, sources."""

from __future__ import annotations

import shutil
import uuid
import zipfile

import pytest

from orchestration.fmu.check import check_fmu
from tests.support.archive import flipped, on_linux
from tests.support.fmu_faults import (
    Change,
    check_that_fault_is_found,
    drop,
    lines,
    pattern,
    put,
    text,
)

FAULTS: dict[str, tuple[Change, str]] = {
    "no guid": (pattern(r'guid="[^"]*"', 'guid=""'), r"3 error: the GUID is empty"),
    "random guid": (
        pattern(r'guid="[^"]*"', f'guid="{uuid.UUID(int=5, version=4)}"'),
        r"3 warning: .* at random",
    ),
    "other guid": (
        pattern(r'guid="[^"]*"', 'guid="mine"'),
        r"3 note: the GUID 'mine' has not the form",
    ),
    "dated": (
        pattern(
            r'generationDateAndTime="[^"]*"', 'generationDateAndTime="1980-01-02T10:11:12+14:00"'
        ),
        (
            r"3 warning: generationDateAndTime is 1980-01-02T10:11:12\+14:00, when the archive was"
            r" packed"
        ),
    ),
    "no documentation": (drop("documentation/index.html"), r"10 warning: no documentation"),
    "no licence": (drop("documentation/licenses/"), r"10 warning: no licence"),
    "no reference": (drop("extra/"), r"10 note: no reference result"),
    "undocumented tool": (
        text('needsExecutionTool="false"', 'needsExecutionTool="true"'),
        r"10 warning: needsExecutionTool is true, but",
    ),
    "tool without need": (
        put("documentation/externalDependencies.txt", b"x"),
        r"10 warning: needsExecutionTool is false, but",
    ),
    "source missing": (
        drop("sources/all.c"),
        r"10 error: CoSimulation: source files listed .* all\.c",
    ),
    "sources not listed": (
        pattern("<SourceFiles>.*?</SourceFiles>", ""),
        r"10 warning: there are sources/, but",
    ),
    "path leads out": (put("../evil.txt", b"x"), r"10 error: '\.\./evil\.txt' leads out"),
    "drive": (put("C:/evil.txt", b"x"), r"10 error: 'C:/evil\.txt' leads out"),
}


@on_linux
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(fmu, tmp_path, fault):
    check_that_fault_is_found(fmu("ppy_actuator", "native"), tmp_path, *FAULTS[fault])


def test_damaged_member_is_named(fmu, tmp_path):
    path = tmp_path / "damaged.fmu"
    path.write_bytes(flipped(fmu("ppy_actuator", "native"), "documentation/index.html"))
    found = lines(check_fmu(path), "error")
    assert found == [
        "10 error: 'documentation/index.html' is damaged, encrypted or cannot be unpacked"
    ]


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_member_that_is_there_twice_is_named(fmu, tmp_path):
    path = tmp_path / "twice.fmu"
    shutil.copy(fmu("ppy_actuator", "native"), path)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(zipfile.ZipInfo("model.txt"), "1")
        archive.writestr(zipfile.ZipInfo("model.txt"), "2")
    assert any("'model.txt' is twice" in line for line in lines(check_fmu(path), "error"))


def test_different_times_of_files_are_found(fmu, tmp_path):
    path = tmp_path / "times.fmu"
    shutil.copy(fmu("ppy_actuator", "native"), path)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(zipfile.ZipInfo("model.txt", (2024, 5, 6, 7, 8, 10)), "1")
    expected = "3 warning: files carry times from 1980-01-01 00:00:00 to 2024-05-06 07:08:10"
    assert any(line.startswith(expected) for line in lines(check_fmu(path), "warning"))
