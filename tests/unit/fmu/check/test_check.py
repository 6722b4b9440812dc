"""Claims: the check finds nothing wrong with our FMUs, and what is wrong with others."""

from __future__ import annotations

import re

import pytest

from fmus.kit.errors import UserError
from orchestration.fmu.check import check_fmu
from tests.support import hosts
from tests.support.archive import contents, flipped
from tests.support.fmi3_fmus import foreign
from tests.support.fmu_faults import (
    Change,
    check_that_fault_is_found,
    lines,
    packed,
    pattern,
    put,
    text,
)

# --- ours and stock
# -------------------------------------------------------------------------------------------------


def test_notes_on_ours_are_about_what_is_optional_and_there_is_nothing_worse(fmu, name, runtime):
    findings = check_fmu(fmu(name, runtime))
    assert lines(findings, "error", "warning") == []
    assert not [finding for finding in findings if finding.line in (1, 3, 5, 6, 8, 11)]
    allowed = r"no range|no icon|no binary for win64, darwin64|needs libdl\.so\.2 besides"
    for note in lines(findings, "note"):
        assert re.search(allowed, note), note


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
        (b'<fmiModelDescription fmiVersion="1.0"/>', "FMI version 1.0"),
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


# --- an FMU with one fault
# --------------------------------------------------------------------------------------------------


def test_only_the_fault_is_found(fmu, tmp_path):
    files = contents(fmu("ppy_actuator", "native"))
    assert lines(check_fmu(packed(tmp_path, files)), "error", "warning") == []
    files["modelDescription.xml"] = files["modelDescription.xml"].replace(
        b'start="0.43"', b'start="-1"'
    )
    assert len(lines(check_fmu(packed(tmp_path, files)), "error", "warning")) == 1


# --- FMI 3.0


@pytest.mark.parametrize("name", ["lag", "arrays", "sawtooth", "types"])
def test_good_fmus_of_fmi_3_have_no_errors(name):
    found = check_fmu(foreign(name))
    assert [finding.message for finding in found if finding.severity == "error"] == []
    assert any(finding.message.startswith("no binary for") for finding in found)


FAULTS_OF_FMI_3: dict[str, tuple[Change, str]] = {
    "schema": (text("<ModelStructure>", "<Odd/><ModelStructure>"), r"1 error: .*Odd"),
    "same reference": (
        text('valueReference="7"', 'valueReference="10"'),
        r'1 error: Variable "k" .* has the same value reference as variable "u"',
    ),
    "no start": (text(' start="0"', ""), r'1 error: Variable "u" .* has no start value'),
    "no initial unknown": (
        text('<InitialUnknown valueReference="13" dependencies="10 12"/>', ""),
        r"1 error: ModelStructure/InitialUnknowns",
    ),
    "no dependencies": (
        text(
            '<Output valueReference="11" dependencies="12" dependenciesKind="constant"/>',
            '<Output valueReference="11"/>',
        ),
        r"1 warning: ModelStructure/Output: no dependencies.* for y, also_y",
    ),
    "unknown reference": (
        text('dependencies="12" dependenciesKind="constant"', 'dependencies="77"'),
        r"1 error: ModelStructure: no variable has the value reference 77",
    ),
    "start values": (text('start="2"', 'start="2 3"'), r"1 error: .*k: has 2 start values"),
    "range": (text('start="2"', 'start="20"'), r"2 error: k: start = 20 is outside of its range"),
    "no unit": (text(' declaredType="Current"', ""), r"2 warning: no unit for u"),
    "no token": (text('Token="lag"', 'Token=""'), r"3 error: the instantiationToken is empty"),
    "no states": (
        pattern('canGetAndSetFMUState="true"', 'canGetAndSetFMUState="false"'),
        r"5 warning: canGetAndSetFMUState is false",
    ),
    "only scheduled": (
        pattern(
            r"<ModelExchange.*<CoSimulation[^>]*>", '<ScheduledExecution modelIdentifier="lag"/>'
        ),
        r"1 note: for scheduled execution alone",
    ),
    "clocks": (
        text(
            "</ModelVariables>",
            '<Clock name="tick" valueReference="99" causality="input"'
            ' intervalVariability="triggered"/></ModelVariables>',
        ),
        r"1 note: clocks that nothing triggers here never tick: tick",
    ),
    "function": (
        lambda files: files.update(
            {name: data.replace(b"fmi3DoStep\0", b"fmi3DxStep\0") for name, data in files.items()}
        ),
        r"4 error: binaries/.*/lag\.\w+ lacks 1 functions of FMI 3\.0: fmi3DoStep",
    ),
    "platform of FMI 2.0": (
        put("binaries/linux64/lag.so", b"x"),
        r"10 note: binaries/linux64 is no platform of FMI 3\.0",
    ),
    "other binary": (
        put("binaries/x86_64-windows/lag.dll", b"\x7fELF"),
        r"10 error: binaries/x86_64-windows/lag\.dll: damaged",
    ),
}


@pytest.mark.parametrize("fault", FAULTS_OF_FMI_3)
def test_fault_of_fmi_3_is_found(tmp_path, fault):
    check_that_fault_is_found(foreign("lag"), tmp_path, *FAULTS_OF_FMI_3[fault])
