"""The check finds nothing wrong with our FMUs, what is wrong with others, and reads binaries as
binutils do.
"""

from __future__ import annotations

import re
import shutil
import struct
import uuid
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.check import Finding, check_fmu
from tests.support import hosts
from tests.support.archive import LINUX_BINARY, contents, on_linux

Change = Callable[[dict[str, bytes]], None]


def lines(findings: list[Finding], *severities: str) -> list[str]:
    return [f"{f.line} {f.severity}: {f.message}" for f in findings if f.severity in severities]


def packed(folder: Path, files: dict[str, bytes]) -> Path:
    path = folder / "changed.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data)
    return path


# --- ours and stock
# -------------------------------------------------------------------------------------------------


def test_our_fmus_have_neither_errors_nor_warnings(fmu, name, runtime):
    assert lines(check_fmu(fmu(name, runtime)), "error", "warning") == []


def test_notes_on_ours_are_about_what_is_optional(fmu, name, runtime):
    allowed = r"no range|no icon|no binary for win64, darwin64|needs libdl\.so\.2 besides"
    for note in lines(check_fmu(fmu(name, runtime)), "note"):
        assert re.search(allowed, note), note


def test_our_fmu_needs_no_note_on_reference_or_state(fmu, name, runtime):
    assert not [f for f in check_fmu(fmu(name, runtime)) if f.line in (1, 3, 5, 6, 8, 11)]


def test_check_leaves_the_file_alone(fmu):
    path = fmu("ppy_actuator", "native")
    before = path.read_bytes(), path.stat().st_mtime_ns
    check_fmu(path)
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before


@pytest.fixture(scope="module")
def stock(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    pytest.importorskip("pythonfmu", reason="pythonfmu is not installed")
    path = hosts.build_minimal_pythonfmu(tmp_path_factory.mktemp("stock"))
    return lines(check_fmu(path), "error", "warning", "note")


@pytest.mark.parametrize(
    "expected",
    [
        r"1 error: .*InitialUnknowns",
        r"1 warning: ModelStructure/Outputs: no dependencies.* x$",
        r"2 warning: there are no UnitDefinitions",
        r"2 warning: no unit for u, x$",
        r"2 warning: no description for u, x$",
        r"3 warning: the GUID .* from the clock",
        r"3 warning: generationDateAndTime",
        r"5 warning: canGetAndSetFMUstate is false",
        r"10 warning: no documentation",
        r"10 warning: no licence",
        r"10 warning: needsExecutionTool is true, but",
        r"4 warning: binaries/linux64/Minimal.so needs \d+ symbols .*Py",
        r"10 warning: binaries/win64/Minimal.dll needs libraries .*python3\.dll",
    ],
)
def test_stock_pythonfmu_is_found_wanting(stock, expected):
    assert any(re.match(expected, line) for line in stock), "\n".join(stock)


def test_errors_come_first(stock):
    severities = [line.split()[1].rstrip(":") for line in stock]
    assert severities == sorted(severities, key=["error", "warning", "note"].index)


# --- files that are no FMU
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not an FMU"),
        (b"time,current\n0,1\n", "not an FMU"),
        (b"PK\x05\x06" + bytes(18), "modelDescription.xml is not in it"),
    ],
)
def test_what_is_no_zip_is_refused(tmp_path, data, message):
    path = tmp_path / "some.fmu"
    path.write_bytes(data)
    with pytest.raises(UserError, match=message) as caught:
        check_fmu(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_missing_file_and_folder_are_refused(tmp_path):
    for path in (tmp_path / "absent.fmu", tmp_path):
        with pytest.raises(UserError, match=r"no such file|a folder, not an FMU"):
            check_fmu(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_cut_off_archive_is_refused(fmu, tmp_path, share):
    whole = fmu("ppy_actuator", "native").read_bytes()
    path = tmp_path / "cut.fmu"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(UserError, match="cut off"):
        check_fmu(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"<fmiModelDescription", "cannot be read"),
        (b"\xff\xfe\x00", "cannot be read"),
        (b'<?xml version="1.0" encoding="nonsense"?><a/>', "cannot be read"),
        (b"<SystemStructure/>", "'SystemStructure', expected 'fmiModelDescription'"),
        (b'<fmiModelDescription fmiVersion="3.0"/>', "FMI version 3.0"),
        (b"<fmiModelDescription/>", "FMI version not stated"),
    ],
)
def test_description_that_is_none_is_refused(tmp_path, text, message):
    with pytest.raises(UserError, match=message) as caught:
        check_fmu(packed(tmp_path, {"modelDescription.xml": text}))
    assert "\n" not in str(caught.value)


def test_damaged_description_is_refused(fmu, tmp_path):
    path = tmp_path / "damaged.fmu"
    path.write_bytes(flipped(fmu("ppy_actuator", "native"), "modelDescription.xml"))
    with pytest.raises(UserError, match=r"modelDescription\.xml cannot be read"):
        check_fmu(path)


def flipped(path: Path, member: str) -> bytes:
    """The archive with one byte of a member's compressed data inverted."""
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        entry = archive.getinfo(member)
    data[entry.header_offset + 30 + len(member) + entry.compress_size // 2] ^= 0xFF
    return bytes(data)


# --- FMUs with one fault
# --------------------------------------------------------------------------------------------


def text(old: str, new: str) -> Change:
    """Replace text, which must be there, in the model description."""

    def change(files: dict[str, bytes]) -> None:
        before = files["modelDescription.xml"].decode()
        assert old in before
        files["modelDescription.xml"] = before.replace(old, new, 1).encode()

    return change


def pattern(old: str, new: str) -> Change:
    def change(files: dict[str, bytes]) -> None:
        after, count = re.subn(old, new, files["modelDescription.xml"].decode(), flags=re.S)
        assert count
        files["modelDescription.xml"] = after.encode()

    return change


def put(name: str, data: bytes) -> Change:
    return lambda files: files.update({name: data})


def drop(prefix: str) -> Change:
    def change(files: dict[str, bytes]) -> None:
        doomed = [name for name in files if name.startswith(prefix)]
        assert doomed
        for name in doomed:
            del files[name]

    return change


def cut_binary(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = files[LINUX_BINARY][:900]


def hide_function(files: dict[str, bytes]) -> None:
    assert b"fmi2DoStep\0" in files[LINUX_BINARY]
    files[LINUX_BINARY] = files[LINUX_BINARY].replace(b"fmi2DoStep\0", b"fmi2DxStep\0")


def other_machine(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = (
        files[LINUX_BINARY][:18] + struct.pack("<H", 0xB7) + files[LINUX_BINARY][20:]
    )


def no_library(files: dict[str, bytes]) -> None:
    files[LINUX_BINARY] = files[LINUX_BINARY][:16] + struct.pack("<H", 2) + files[LINUX_BINARY][18:]


def other_needs(files: dict[str, bytes]) -> None:
    assert b"libm.so.6\0" in files[LINUX_BINARY]
    files[LINUX_BINARY] = files[LINUX_BINARY].replace(b"libm.so.6\0", b"libx.so.6\0")


FAULTS: dict[str, tuple[Change, str]] = {
    "undefined unit": (
        pattern(r'(name="R1".*?) unit="Ohm"', r'\1 unit="B"'),
        r'1 error: .*unit "B"',
    ),
    "schema": (text("<LogCategories>", "<LogCats/><LogCategories>"), r"1 error: .*LogCats"),
    "initial unknowns": (
        pattern(r"<InitialUnknowns>.*</InitialUnknowns>", ""),
        r"1 error: .*InitialUnknowns",
    ),
    "no dependencies": (
        pattern(r"(<Outputs>.*?<Unknown index=\"\d+\") dependencies=\"[^\"]*\"", r"\1"),
        r"1 warning: ModelStructure/Outputs: no dependencies.*charge",
    ),
    "bad index": (text('<Unknown index="', '<Unknown index="99'), r"1 error: "),
    "no co-simulation": (
        pattern(r"<CoSimulation .*</CoSimulation>", ""),
        r"1 error: not for co-simulation",
    ),
    "identifier": (
        pattern('modelIdentifier="ppy_actuator"', 'modelIdentifier="ppy actuator"'),
        r"1 error: modelIdentifier 'ppy actuator' is no identifier",
    ),
    "unit without base": (text('<BaseUnit A="1" />', ""), r"2 warning: unit 'A' has no BaseUnit"),
    "fractional exponent": (
        text('<BaseUnit A="1" />', '<BaseUnit A="0.5" />'),
        r"2 error: unit 'A': exponent A='0.5'",
    ),
    "factor zero": (
        text('<BaseUnit A="1" />', '<BaseUnit A="1" factor="0" />'),
        r"2 error: unit 'A': factor='0'",
    ),
    "display factor": (
        text('factor="1000"', 'factor="thousand"'),
        r"2 error: display unit 'mm' of 'm': factor=",
    ),
    "no unit": (pattern(r' unit="Ohm"', ""), r"2 warning: no unit for R1, R2"),
    "no description": (
        pattern(r'(name="R1"[^>]*?) description="[^"]*"', r"\1"),
        r"2 warning: no description for R1$",
    ),
    "min above max": (
        pattern(r'min="0" max="1000000"', 'min="2" max="1"'),
        r"2 error: R1: min = 2 is above max = 1",
    ),
    "start outside": (
        text('start="0.43"', 'start="-1"'),
        r"2 error: R1: start = -1 is outside .* 0 to 1e\+06",
    ),
    "start not finite": (
        text('start="0.43"', 'start="NaN"'),
        r"2 error: R1: start = nan is not finite",
    ),
    "nominal": (
        text('nominal="0.0001"', 'nominal="0"'),
        r"2 error: \w+: nominal = 0, expected a positive",
    ),
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
    "no state": (
        pattern('canGetAndSetFMUstate="true"', ""),
        r"5 warning: canGetAndSetFMUstate is false",
    ),
    "once": (
        text("<CoSimulation", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'),
        r"6 warning: .*Once",
    ),
    "fixed step": (
        text('canHandleVariableCommunicationStepSize="true"', ""),
        r"8 warning: canHandleVariable",
    ),
    "no derivative": (
        pattern('providesDirectionalDerivative="true"', ""),
        r"11 note: providesDirectional",
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
    "only sources": (drop("binaries/"), r"10 warning: no binaries, only sources"),
    "path leads out": (put("../evil.txt", b"x"), r"10 error: '\.\./evil\.txt' leads out"),
    "drive": (put("C:/evil.txt", b"x"), r"10 error: 'C:/evil\.txt' leads out"),
    "backslash": (put("a\\b.txt", b"x"), r"1 error: .*backslash"),
    "misnamed binary": (
        lambda files: files.update({"binaries/linux64/x.so": files.pop(LINUX_BINARY)}),
        r"10 error: binaries/linux64/ppy_actuator\.so is missing; .*'ppy_actuator'",
    ),
    "unknown platform": (
        put("binaries/x86_64-linux/ppy_actuator.so", b"x"),
        r"10 note: binaries/x86_64-linux is no",
    ),
    "text binary": (
        put(LINUX_BINARY, b"#!/bin/sh\n"),
        r"10 error: .*\.so: neither ELF nor PE nor Mach-O",
    ),
    "empty binary": (put(LINUX_BINARY, b""), r"10 error: .*neither ELF"),
    "cut binary": (cut_binary, r"10 error: .*damaged"),
    "program": (no_library, r"10 error: .*an ELF file, but not a shared library"),
    "wrong format": (
        lambda files: files.update({"binaries/win64/ppy_actuator.dll": files[LINUX_BINARY]}),
        r"10 error: binaries/win64/ppy_actuator\.dll is ELF, expected PE",
    ),
    "wrong machine": (other_machine, r"10 error: .* is for arm64, expected x86_64"),
    "missing function": (hide_function, r"4 error: .* lacks 1 functions of FMI 2.0: fmi2DoStep"),
    "unusual library": (other_needs, r"10 warning: .* not part of the system: libx\.so\.6"),
}


@on_linux
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(fmu, tmp_path, fault):
    files = contents(fmu("ppy_actuator", "native"))
    change, expected = FAULTS[fault]
    change(files)
    found = lines(check_fmu(packed(tmp_path, files)), "error", "warning", "note")
    assert any(re.match(expected, line) for line in found), "\n".join(found)
    assert not any("\n" in line for line in found)


def test_only_the_fault_is_found(fmu, tmp_path):
    files = contents(fmu("ppy_actuator", "native"))
    assert lines(check_fmu(packed(tmp_path, files)), "error", "warning") == []
    files["modelDescription.xml"] = files["modelDescription.xml"].replace(
        b'start="0.43"', b'start="-1"'
    )
    assert len(lines(check_fmu(packed(tmp_path, files)), "error", "warning")) == 1


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


# --- reading shared libraries
# ---------------------------------------------------------------------------------------
