"""Claims: a log has every call of an FMU, with its arguments and status. Oracle: FMUs that write
down their calls themselves.
"""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.kit import UserError
from fmus.kit.build import toolchain
from fmus.kit.storage import scratch
from orchestration.fmu import find_model, unpack
from orchestration.fmu.isolation import Limits
from orchestration.fmu.simulation import RunFiles, simulate
from orchestration.fmu.wrapping import calls
from tests.support import misbehaving
from tests.support.fmi3_fmus import foreign, pack
from tests.support.recording import INTERFACES, recorded, recorder

TIME = 0.25 * np.arange(-4, 5)
OF_FMI_3 = {
    "GetFloat64": "GetReal",
    "SetFloat64": "SetReal",
    "UpdateDiscreteStates": "NewDiscreteStates",
    "GetContinuousStateDerivatives": "GetDerivatives",
    "InstantiateCoSimulation": "Instantiate",
    "InstantiateModelExchange": "Instantiate",
}


def logged(path, inputs, settings, log):
    return simulate(find_model(str(path)), TIME, inputs, settings, files=RunFiles(calls=log))


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
def test_a_log_has_the_calls_that_an_fmu_notes(version, interface, tmp_path):
    path = recorder(version, (interface,))
    given = ({"u": np.where(TIME < 0.0, 2.0, 3.0)}, {"k": 1.7})
    log = tmp_path / "calls.txt"
    found, noted = recorded(lambda: logged(path, *given, log))
    lines = [
        re.fullmatch(r"fmi\d(\w+)\((.*)\) -> OK", line) for line in log.read_text().split("\n")
    ]
    names = [OF_FMI_3.get(line[1], line[1]) for line in lines[:-1]]
    known = {call.function for call in noted}
    assert [name for name in names if name in known] == [call.function for call in noted]
    steps = [re.findall(r"=([^,]*)", line[2])[:2] for line in lines[:-1] if line[1] == "DoStep"]
    noted_steps = [call.arguments for call in noted if call.function == "DoStep"]
    assert np.array(steps, float).tolist() == np.array(noted_steps, float).tolist()
    plain = simulate(find_model(str(path)), TIME, *given)
    assert found["y"].tobytes() == plain["y"].tobytes()


def test_arguments_results_and_statuses_are_in_it(tmp_path):
    log = tmp_path / "calls.txt"
    settings = {"word": 'a "b"', "blob": "0102", "u8_in": 200, "whole[2,1]": 9.0, "bits[2]": 1.0}
    logged(foreign("types"), {}, settings, log)
    text = log.read_text()
    for line in (
        "fmi3SetUInt8(valueReferences=[7], values=[200]) -> OK",
        'fmi3SetString(valueReferences=[25], values=["a "b""]) -> OK',
        "fmi3SetBinary(valueReferences=[99], valueSizes=[2]) -> OK",
        "fmi3SetInt32(valueReferences=[28], values=[1, 2, 3, 9, 5, 6]) -> OK",
        "fmi3SetBoolean(valueReferences=[30], values=[false, true, false]) -> OK",
        "fmi3DoStep(currentCommunicationPoint=-1, communicationStepSize=0.25,"
        " noSetFMUStatePriorToCurrentPoint=true, eventHandlingNeeded=false,"
        " terminateSimulation=false, earlyReturn=false, lastSuccessfulTime=-0.75) -> OK",
    ):
        assert f"\n{line}\n" in text


def test_a_call_that_fails_is_in_it_with_its_status(tmp_path):
    log = tmp_path / "calls.txt"
    with pytest.raises(UserError, match="failed"):
        logged(recorder(2), {}, {"fails": 0.0}, log)
    last = [line for line in log.read_text().split("\n") if "DoStep" in line][-1]
    assert last.endswith("noSetFMUStatePriorToCurrentPoint=true) -> Error")


@pytest.mark.skipif(sys.platform == "win32", reason="the FMU is written for POSIX")
def test_the_last_line_of_one_that_crashes_is_the_call(tmp_path):
    model = find_model(str(misbehaving.build("writes_to_nothing", tmp_path)))
    files = RunFiles(calls=tmp_path / "calls.txt")
    with pytest.raises(UserError, match="SIGSEGV"):
        simulate(model, TIME + 1.0, {}, {}, files=files, isolation=Limits())
    *_, last = files.calls.read_text().split("\n")
    assert re.match(r"fmi2DoStep\(currentCommunicationPoint=[\d.]+, communicationStep.*true$", last)


def test_a_library_that_the_fmu_needs_beside_its_own_stays(tmp_path):
    folder = Path(unpack(recorder(2), tmp_path / "calls.txt"))
    (library,) = (path for path in folder.rglob("recorder_logged.*"))
    scratch.remove(folder)
    with zipfile.ZipFile(recorder(2)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    other = f"binaries/{library.parent.name}/other{library.suffix}"
    path = pack(tmp_path / "recorder.fmu", {**files, other: b"needed"})
    folder = Path(unpack(path, tmp_path / "calls.txt"))
    assert (folder / other).read_bytes() == b"needed"
    scratch.remove(folder)


def test_a_log_begins_empty_and_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(calls, "_MOST_LINES", 8)
    log = tmp_path / "calls.txt"
    for _ in range(2):
        logged(recorder(2), {}, {}, log)
    text = log.read_text()
    assert text.count("fmi2Instantiate(") == 1
    assert text.count(" -> OK\n") == 8
    assert text.endswith(" -> OK\n(no more than 8 calls are logged)\n")


def test_without_a_compiler_it_says_what_is_needed(tmp_path, monkeypatch):
    def none_here(target):
        raise UserError("no compiler")

    monkeypatch.setattr(toolchain, "find_compiler", none_here)
    with pytest.raises(UserError, match=r"a log of calls needs a C compiler here: no compiler"):
        logged(recorder(2), {}, {}, tmp_path / "calls.txt")


def test_a_log_that_cannot_be_written_is_a_line(tmp_path):
    with pytest.raises(UserError, match=r"cannot write .*: Is a directory"):
        logged(recorder(2), {}, {}, tmp_path)
