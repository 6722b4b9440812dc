"""Claims: a simulation goes on from a state in a file. Oracles: closed forms, a run in one go."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu import find_model
from orchestration.fmu.simulation import RunFiles, simulate
from tests.support.command import refused, works
from tests.support.fmi3_fmus import changed, foreign, of_interface
from tests.support.recording import recorder

STEP = 0.05
TIME = STEP * np.arange(41)


@pytest.mark.parametrize(("interface", "error"), [("CoSimulation", 1e-12), ("ModelExchange", 1e-5)])
def test_a_run_goes_on_to_the_closed_form(interface, error, tmp_path):
    """x(0) = 0.25, 0.5 dx/dt = 2 u - x, with u of 1 until 1 s and of 3 after it."""
    model = find_model(str(of_interface(foreign("lag"), interface, tmp_path)))
    state = tmp_path / "folder" / "one.state"
    simulate(model, TIME[:21], {"u": np.full(21, 1.0)}, {}, files=RunFiles(state_out=state))
    assert RunFiles(state_in=state).start == 1.0
    found = simulate(model, TIME[20:], {"u": np.full(21, 3.0)}, {}, files=RunFiles(state_in=state))
    middle = 2.0 - 1.75 * np.exp(-2.0)
    expected = 6.0 + (middle - 6.0) * np.exp(-2.0 * (TIME[20:] - 1.0))
    np.testing.assert_allclose(found["y"], expected, rtol=error)


def test_the_command_goes_on_as_one_run_would(tmp_path):
    """The output of two runs, one after the other, is that of one."""
    grid = ("--step", "0.1s", "--set", "current=0.5")
    works("simulate", "ppy_actuator", "--stop", "2s", *grid, "--out", "all.csv", cwd=tmp_path)
    first = ("--stop", "1s", "--state-out", "s", "--log-calls", "calls.txt")
    works("simulate", "ppy_actuator", *first, *grid, cwd=tmp_path)
    rest = ("--state-in", "s", "--stop", "2s", "--out", "rest.csv")
    works("simulate", "ppy_actuator", *rest, *grid, cwd=tmp_path)
    whole, part = (
        np.loadtxt(tmp_path / name, delimiter=",", skiprows=1) for name in ("all.csv", "rest.csv")
    )
    np.testing.assert_allclose(part, whole[10:], rtol=1e-9, atol=1e-12)
    assert "fmi2DoStep(" in (tmp_path / "calls.txt").read_text()


def test_a_record_drives_the_rest_of_a_run(tmp_path):
    lines = "\n".join(f"{t:g},{3 if t >= 1 else 1}" for t in TIME)
    (tmp_path / "u.csv").write_text(f"time [s],u [A]\n{lines}\n")
    lag = foreign("lag")
    works("simulate", lag, "--stop", "1s", "--set", "u=1", "--state-out", "s", cwd=tmp_path)
    rest = ("--state-in", "s", "--input", "u.csv", "--out", "y.csv")
    works("simulate", lag, *rest, cwd=tmp_path)
    found = np.loadtxt(tmp_path / "y.csv", delimiter=",", skiprows=1)
    middle = 2.0 - 1.75 * np.exp(-2.0)
    expected = 6.0 + (middle - 6.0) * np.exp(-2.0 * (TIME[20:] - 1.0))
    np.testing.assert_allclose(found[:, 0], TIME[20:])
    np.testing.assert_allclose(found[:, 2], expected, rtol=1e-12)


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    path = tmp_path_factory.mktemp("state") / "lag.state"
    simulate(find_model(str(foreign("lag"))), TIME, {}, {}, files=RunFiles(state_out=path))
    return path


def test_the_state_of_another_fmu_is_refused(state, tmp_path):
    another = changed("lag", tmp_path, 'fmiVersion="3.0"', 'fmiVersion="3.0.2"')
    for other, message in (
        (foreign("arrays"), "its modelIdentifier is lag, that of arrays.fmu is arrays"),
        (another, "its fmiVersion is 3.0, that of changed.fmu is 3.0.2"),
    ):
        with pytest.raises(UserError, match=f"{state}: the state of another FMU: {message}"):
            simulate(find_model(str(other)), TIME + 2, {}, {}, files=RunFiles(state_in=state))


@pytest.mark.parametrize("contents", [b"", b"\x00\xff", b"{}", b'{"form": 1}\n', b"[1]\n"])
def test_what_is_no_state_is_refused(contents, tmp_path):
    path = tmp_path / "other"
    path.write_bytes(contents)
    with pytest.raises(UserError, match="other: no state of an FMU, as --state-out writes it"):
        assert RunFiles(state_in=path).start is None


def test_a_state_that_is_cut_is_refused_by_the_fmu(state, tmp_path):
    path = tmp_path / "cut"
    path.write_bytes(state.read_bytes()[:-1])
    with pytest.raises(UserError, match=r"lag.fmu: reading a state failed: another size"):
        simulate(find_model(str(foreign("lag"))), TIME + 2.0, {}, {}, files=RunFiles(state_in=path))


def test_an_fmu_that_cannot_is_refused_before_it_runs(tmp_path):
    with pytest.raises(UserError, match=r"recorder2.fmu: cannot write down its state \(canSer"):
        simulate(
            find_model(str(recorder(2))), TIME, {}, {}, files=RunFiles(state_out=tmp_path / "s")
        )
    assert not (tmp_path / "s").exists()


def test_what_a_state_has_cannot_be_set_beside_it(state, tmp_path):
    lag = foreign("lag")
    for arguments, message in (
        (("--set", "k=2"), "--set k: it is part of the state in"),
        (("--stop", "1s"), "cannot step from 2 s to 1 s"),
        (("--state-out", state), "this is the state to go on from itself"),
    ):
        refused(tmp_path, "simulate", lag, "--state-in", state, *arguments, parts=[message])
    (tmp_path / "u.csv").write_text("time [s],u [A]\n0,1\n1,1\n2,1\n")
    late = ("--state-in", state, "--input", "u.csv")
    refused(tmp_path, "simulate", lag, *late, parts=["is a state at 2 s, which is not within 0 s"])
    refused(tmp_path, "simulate", "work_loop", "--state-in", state, parts=["this is a system"])
