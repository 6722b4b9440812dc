"""Claims: FMUs of FMI 3.0 of anybody go through every command, alone and beside those of 2.0.

The oracles are closed forms of small foreign FMUs written in C.
"""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.linalg import expm
from scipy.signal import lfilter

from fmus import component
from fmus.kit.build import build_cached
from orchestration import master
from orchestration.system import Member, Port, System, connect, ssp
from tests.support.archive import contents
from tests.support.command import refused, works
from tests.support.fmi3_fmus import LAG, build, changed, foreign, of_interface
from tests.support.hosts import build_one_state_fmu

STEP = 0.05
TIME = STEP * np.arange(801)
U = 2.0 * np.sin(0.9 * TIME) + np.sin(2.3 * TIME + 1.0) + np.sign(np.sin(0.37 * TIME))
pytestmark = pytest.mark.timeout(400)


def lagged(gain: float, tau: float, u: np.ndarray = U) -> np.ndarray:
    """y of ``tau dx/dt = gain u - x``, x(0) = 0.25, with u held, exactly."""
    keep = np.exp(-STEP / tau)
    forced, _ = lfilter([0.0, gain * (1.0 - keep)], [1.0, -keep], u, zi=[0.25])
    return forced


def write(path, y):
    table = pd.DataFrame({"time": TIME, "u": U, "y": y})
    table.to_csv(path, index=False)
    return path


def test_simulate_gives_the_closed_form(tmp_path):
    record = write(tmp_path / "in.csv", 0.0 * U)
    works(
        *("simulate", foreign("lag"), "--input", record, "--set", "tau=0.2s", "--set", "k=3"),
        *("--out", "out.csv"),
        cwd=tmp_path,
    )
    found = pd.read_csv(tmp_path / "out.csv")
    y = next(column for column in found if column.split("[")[0].split()[0] == "y")
    scale = 1e-3 if "mA" in y else 1.0
    np.testing.assert_allclose(scale * found[y], lagged(3.0, 0.2), rtol=0, atol=1e-12)


def test_elements_of_arrays_go_through_files(tmp_path):
    given = ("--set", "u[1]=2", "--set", "A[1,2]=0.25", "--stop", "1s", "--step", "0.5s")
    works("simulate", foreign("arrays"), *given, "--out", "a.csv", cwd=tmp_path)
    again = ("--input", "a.csv", "--set", "A[1,2]=0.25", "--out", "b.csv")
    works("simulate", foreign("arrays"), *again, cwd=tmp_path)
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
    assert list(pd.read_csv(tmp_path / "a.csv"))[1:3] == ["u[1] [1]", "y[1] [1]"]


def test_a_sweep_runs_every_case(tmp_path):
    works(
        *("sweep", foreign("arrays"), "--over", "A[2,2]=-4,-1", "--over", "u[2]=1,2,5"),
        *("--stop", "1s", "--step", "0.1s", "--keep", "last", "--out", "s.nc"),
        cwd=tmp_path,
    )
    with xr.open_dataset(tmp_path / "s.nc") as found:
        for rate in (-4.0, -1.0):
            for level in (1.0, 2.0, 5.0):
                a = np.array([[-1.0, 0.5, 0.0], [0.0, rate, 0.5], [0.0, 0.0, -3.0]])
                forced = np.linalg.solve(a, [0.0, level, 0.0])
                x = expm(a) @ (np.array([0.1, 0.2, 0.3]) + forced) - forced
                case = found.sel({"A[2,2]": rate, "u[2]": level})
                np.testing.assert_allclose(case["y[1]_last"], x[0] + x[2], rtol=1e-12)
                np.testing.assert_allclose(case["y[2]_last"], x[1], rtol=1e-12)


@pytest.mark.slow
def test_parameters_are_identified(tmp_path):
    random = np.random.default_rng(3)
    record = write(tmp_path / "r.csv", lagged(1.7, 0.35) + random.normal(0.0, 0.01, TIME.size))
    works(
        *("identify", record, "--model", foreign("lag"), "--fit", "k,tau", "--json", "fit.json"),
        cwd=tmp_path,
    )
    fit = json.loads((tmp_path / "fit.json").read_text())
    for name, true in (("k", 1.7), ("tau", 0.35)):
        found = fit["fitted"]["parameters"][name]
        assert found["value"] == pytest.approx(true, rel=0.01)


@pytest.mark.slow
def test_what_a_sensor_does_is_named(tmp_path):
    random = np.random.default_rng(4)
    record = write(tmp_path / "r.csv", 0.3 + lagged(2.0, 0.5) + random.normal(0.0, 0.01, TIME.size))
    works(
        *("diagnose", record, "--model", foreign("lag"), "--json", "d.json", "--time", "60s"),
        cwd=tmp_path,
    )
    found = json.loads((tmp_path / "d.json").read_text())
    (cause,) = found["causes"]
    assert (cause["effect"], cause["law"]) == ("sensor_offset(y)", "y")
    assert cause["parameters"]["y_offset"]["value"] == pytest.approx(0.3, abs=0.005)


def mixed(folder, interface=None):
    """Of 2.0 one lag, which drives one of 3.0, which drives an element of an array."""
    without_unit = LAG.replace(' unit="A" displayUnit="mA"', "").replace(' displayUnit="kA"', "")
    new = build("lag", folder, body=without_unit)
    if interface:
        new = of_interface(new, interface, folder)
    members = (
        Member("old", build_one_state_fmu(folder), {"tau": 0.3}),
        Member("new", new, {"k": 1.5}),
        Member("rows", foreign("arrays"), {"u[2]": 0.5}),
    )
    links = connect("old.x -> new.u", "new.y -> rows.u[1]")
    system = System("mixed", members, links, {"drive": (Port("old", "u"),)}, step=STEP, stop=2.0)
    ssp.write(system, folder / "mixed.ssp")
    return system


def by_hand() -> np.ndarray:
    """Outputs of the three members, each stepped with the newest output of the one before it."""
    a = np.array([[-1.0, 0.5, 0.0], [0.0, -2.0, 0.5], [0.0, 0.0, -3.0]])
    b = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    whole = expm(STEP * np.block([[a, b], [np.zeros((2, 5))]]))
    old, new, x = 0.0, 0.25, np.array([0.1, 0.2, 0.3])
    rows = []
    for _ in range(41):
        rows.append([old, new, x[0] + x[2], x[1]])
        old = 2.0 + (old - 2.0) * np.exp(-STEP / 0.3)
        new = 1.5 * old + (new - 1.5 * old) * np.exp(-STEP / 0.5)
        x = whole[:3, :3] @ x + whole[:3, 3:] @ [new, 0.5]
    return np.array(rows)


@pytest.mark.parametrize("isolate", ["--isolate", "--no-isolate"])
def test_members_of_both_versions_make_a_system(tmp_path, isolate):
    mixed(tmp_path)
    works(
        *("run", "mixed.ssp", "--set", "inputs.drive=2", "--out", "r.nc", isolate),
        cwd=tmp_path,
    )
    with xr.open_dataset(tmp_path / "r.nc") as found:
        names = ("old.x", "new.y", "rows.y[1]", "rows.y[2]")
        columns = np.column_stack([found[name] for name in names])
    np.testing.assert_allclose(columns, by_hand(), rtol=0, atol=1e-12)


def test_a_member_for_model_exchange_alone_runs_in_a_system(tmp_path):
    system = mixed(tmp_path, "ModelExchange")
    assert (
        'implementation="ModelExchange"'
        in contents(tmp_path / "mixed.ssp")["SystemStructure.ssd"].decode()
    )
    system = ssp.read(tmp_path / "mixed.ssp", tmp_path / "unpacked")
    found = master.run(system, STEP * np.arange(41), {"drive": np.full(41, 2.0)}).signals
    names = ("old.x", "new.y", "rows.y[1]", "rows.y[2]")
    columns = np.column_stack([found[name] for name in names])
    np.testing.assert_allclose(columns, by_hand(), rtol=0, atol=2e-5)


def test_a_written_system_of_both_versions_runs_to_the_same_bits(tmp_path):
    system = mixed(tmp_path)
    read = ssp.read(tmp_path / "mixed.ssp", tmp_path / "unpacked")
    drive = {"drive": np.full(41, 2.0)}
    runs = [master.run(each, STEP * np.arange(41), drive) for each in (system, read)]
    assert runs[0].signals.keys() == runs[1].signals.keys()
    for name, values in runs[0].signals.items():
        np.testing.assert_array_equal(values, runs[1].signals[name])


@pytest.mark.parametrize("solver", [(), ("--model-exchange",)])
def test_clocks_of_ours_show_how_often_they_sampled(tmp_path, solver):
    """At k periods of 0.01 s, and before what is read there."""
    path = build_cached(component("pid"), "native", 3, clocks=True)
    assert "clock[1]   1     active every sample_period, when" in works("info", path, cwd=tmp_path)
    assert "no errors, 0 warnings" in works("check", path, cwd=tmp_path)
    given = ("--step", "0.003s", "--set", "measured=1", *solver)
    works("simulate", path, "--stop", "0.3s", *given, "--out", "whole.csv", cwd=tmp_path)
    works("simulate", path, "--stop", "0.15s", *given, "--state-out", "half", cwd=tmp_path)
    more = ("--state-in", "half", "--stop", "0.3s", "--out", "rest.csv")
    works("simulate", path, *given, *more, cwd=tmp_path)
    whole, rest = (pd.read_csv(tmp_path / name) for name in ("whole.csv", "rest.csv"))
    time = whole["time [s]"].to_numpy()
    np.testing.assert_array_equal(whole["clock[1] [1]"], np.floor(time / 0.01 + 1e-6) + 1)
    np.testing.assert_allclose(rest, whole[time > 0.149], rtol=0, atol=1e-12)


def test_it_is_linearised_as_an_fmu_of_2_is(tmp_path):
    works("linearise", foreign("arrays"), "--json", "l.json", cwd=tmp_path)
    found = json.loads((tmp_path / "l.json").read_text())
    np.testing.assert_allclose(found["A"], [[-1, 0.5, 0], [0, -2, 0.5], [0, 0, -3]], rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('fmiVersion="3.0"', 'fmiVersion="4.0"', "FMI version 4.0; this program knows FMI 2.0 and"),
        ('fmiVersion="3.0"', 'fmiVersion="1.0"', "FMI version 1.0; this program knows FMI 2.0 and"),
        (
            "</ModelVariables>",
            '<Clock name="c" valueReference="50" causality="input" intervalVariability="constant"/>'
            "</ModelVariables>",
            "c: is a clock of a constant interval, which is not given",
        ),
        ('instantiationToken="lag"', 'instantiationToken="gal"', "instantiation token is another"),
    ],
)
def test_what_cannot_be_run_is_refused_in_a_line(tmp_path, old, new, message):
    path = changed("lag", tmp_path, old, new)
    refused(tmp_path, "simulate", path, "--stop", "1s", parts=[message])


@pytest.mark.parametrize("share", [0.2, 0.6, 0.97])
def test_a_damaged_archive_is_refused_in_a_line(tmp_path, share):
    whole = foreign("lag").read_bytes()
    path = tmp_path / "cut.fmu"
    path.write_bytes(whole[: int(share * len(whole))])
    for command in ("simulate", "check", "info"):
        refused(tmp_path, command, path, parts=["cut off"])


@pytest.mark.slow
def test_arrays_of_our_components_have_the_same_names_in_both_versions(tmp_path):
    """With a command that was learnt: it comes 40 samples later, the others being zero."""
    started = ("--set", "learnt_start[40]=0.1", "--set", "smoothing=0")
    works("build", "learning_controller", "--runtime", "native", "--out", "fmus", cwd=tmp_path)
    works("build", "learning_controller", *started, "--fmi", "3", "--out", "fmus", cwd=tmp_path)
    of_3 = "fmus/fmi3/learning_controller_set.fmu"
    assert "no errors" in works("check", of_3, cwd=tmp_path)
    assert "learnt_start[40]" in works("info", of_3, cwd=tmp_path)
    course = ("--stop", "10s", "--step", "0.25s")
    of_2 = "fmus/native/learning_controller.fmu"
    works("simulate", of_2, *started, *course, "--out", "2.csv", cwd=tmp_path)
    works("simulate", of_3, *course, "--out", "3.csv", cwd=tmp_path)
    assert (tmp_path / "2.csv").read_text() == (tmp_path / "3.csv").read_text()
    command = pd.read_csv(tmp_path / "3.csv")["command [A]"]
    assert command.tolist() == [0.1 if k == 1 else 0.0 for k in range(41)]
    compared = ("compare", "2.csv", "--model", of_3, "--require", "99%")
    works(*compared, cwd=tmp_path)
    line = refused(tmp_path, "simulate", of_3, "--set", "learnt_start[42]=1", *course)
    assert "learnt_start[42]" in line
