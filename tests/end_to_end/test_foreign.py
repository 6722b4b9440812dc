"""Claims: an FMU without equations gets a name, a curve and a gain from outside, and a system.

The oracle is what was done to a lag whose closed form is known; SciPy's filter makes the records.
"""

from __future__ import annotations

import csv
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from fmus.kit import UserError
from orchestration.system.ssp.reading import read as read_ssp
from tests.support.archive import edited
from tests.support.command import ppy as ppy_command
from tests.support.command import refused, works
from tests.support.hosts import ONE_STATE_DESCRIPTION, build_one_state_fmu

STEP, TAU = 0.1, 0.8
TIME = STEP * np.arange(2000)
U = 2.0 * np.sin(0.3 * TIME) + 1.5 * np.sin(0.91 * TIME + 1.0) + np.sin(2.3 * TIME + 2.0)
pytestmark = pytest.mark.timeout(400)


def lagged(u, tau=TAU):
    """x of ``tau dx/dt = u - x`` with u held, exactly."""
    p = np.exp(-STEP / tau)
    return lfilter([0.0, 1.0 - p], [1.0, -p], u)


def levelled(u):
    return u / np.sqrt(1.0 + 0.15 * u**2)


def written(folder, y, name="r.csv", seed=1):
    noisy = y + np.random.default_rng(seed).normal(0.0, 0.02, len(y))
    np.savetxt(
        folder / name,
        np.column_stack([TIME, U, noisy]),
        delimiter=",",
        header="time,u,x",
        comments="",
    )
    return folder / name


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign")
    build_one_state_fmu(folder)
    return folder


@pytest.fixture(scope="module")
def lag(folder):
    return ppy.find_model(str(folder / "one_state.fmu"))


@pytest.fixture(scope="module")
def bent(folder, lag):
    x = lagged(U)
    return ppy.diagnose(written(folder, x - 0.02 * x**3), lag, fit=["tau"], time=np.inf)


@pytest.mark.slow
def test_an_output_that_bends_is_told_with_its_curve(bent):
    best = bent.law_map[0]
    assert (best["law"], best["signal"], best["memory"]) == ("x", "simulated_x", "")
    assert best["confirmed"]
    # a gain beside it, of the sensor or of the curve itself, leaves the shape
    x, y = (np.array(best["curve"][axis]) for axis in "xy")
    whole, truth = (x * (1.0 + y) if best["kind"] == "multiply" else x + y), x - 0.02 * x**3
    assert whole * (truth @ whole) / (whole @ whole) == pytest.approx(truth, abs=0.02)
    assert bent.gain.after["x"] < 0.15 * bent.gain.before["x"]


@pytest.mark.slow
def test_the_system_follows_a_record_that_nobody_has_seen(bent, tmp_path):
    """The original FMU with its correction, in our master, beside the closed form."""
    system = read_ssp(bent.system(tmp_path / "s.ssp"), tmp_path / "parts")
    assert {member.name for member in system.members} == {"fmu", "correction"}
    u = np.roll(U, 700)
    result = ppy.run(system, TIME, {"u": u})
    x = lagged(u)
    truth = x - 0.02 * x**3
    late = slice(100, None)
    plain = np.sqrt(np.mean((x - truth)[late] ** 2))
    assert np.sqrt(np.mean((result.signals["correction.x"] - truth)[late] ** 2)) < 0.1 * plain


def test_a_right_fmu_is_consistent(folder, lag):
    found = ppy.diagnose(written(folder, lagged(U), "right.csv"), lag, fit=["tau"])
    assert found.verdict == "consistent"
    assert not found.law_map


def test_a_wrong_parameter_is_no_cause(folder, lag):
    """The FMU starts at 1 s; the record was made with 0.8 s."""
    found = ppy.diagnose(written(folder, lagged(U), "other.csv", seed=2), lag, fit=["tau"])
    assert not found.causes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "change", "value"),
    [
        ("sensor_gain(x)", lambda x: 1.2 * x, ("x_gain", 1.2, 0.01)),
        pytest.param(
            "sensor_offset(x)", lambda x: x + 0.3, ("x_offset", 0.3, 0.01), marks=pytest.mark.slow
        ),
        pytest.param(
            "transport_delay(x)",
            lambda x: np.concatenate([np.zeros(5), x[:-5]]),
            ("x_delay", 0.5, 0.03),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_a_sensor_does_is_named(folder, lag, effect, change, value):
    found = ppy.diagnose(
        written(folder, change(lagged(U)), "sensor.csv"), lag, settings={"tau": TAU}, time=np.inf
    )
    assert found.causes == [effect]
    name, expected, close = value
    assert found.parameters[name].value == pytest.approx(expected, abs=close)


@pytest.mark.slow
def test_a_parameter_that_moves_far_beside_a_cause_is_as_it_is(folder, lag, tmp_path):
    """Fit a parameter with a gain beside it, far from where the FMU is linear."""
    y = 1.3 * lagged(U, 1.95)
    found = ppy.diagnose(written(folder, y, "moved.csv"), lag, fit=["tau"], time=np.inf, laws=False)
    assert found.causes == ["sensor_gain(x)"]
    for name, true in (("tau", 1.95), ("x_gain", 1.3)):
        low, high = found.parameters[name].interval
        assert low <= true <= high
        assert found.parameters[name].value == pytest.approx(true, rel=0.01)
    assert found.parameters["tau"].unit == "s"
    system = read_ssp(found.system(tmp_path / "s.ssp"), tmp_path / "parts")
    assert system.member("fmu").parameters["tau"] == pytest.approx(1.95, rel=0.01)


@pytest.mark.slow
def test_what_hangs_on_an_input_is_told_over_it(folder, lag):
    """Something of the input reaches the output beside the lag."""
    found = ppy.diagnose(
        written(folder, lagged(U) + 0.05 * U * np.abs(U), "past.csv"), lag, fit=["tau"], time=np.inf
    )
    assert found.law_map[0]["signal"] == "u"
    assert found.law_map[0]["confirmed"]


@pytest.fixture(scope="module")
def starved(folder, lag):
    """Diagnose a lag whose input levels off: never more than 2.6."""
    record = written(folder, lagged(levelled(U)), "level.csv")
    asked = ["input_saturation(u)", "sensor_gain"]
    return ppy.diagnose(record, lag, settings={"tau": TAU}, effects=asked, time=np.inf)


@pytest.mark.slow
def test_what_is_wrong_ahead_of_the_dynamics_is_named_there_where_it_is_asked_for(starved):
    assert starved.causes == ["input_saturation(u)"]
    assert starved.parameters["u_saturation"].value == pytest.approx(0.15, rel=0.03)


@pytest.mark.slow
def test_its_system_has_a_member_ahead(starved, tmp_path):
    system = read_ssp(starved.system(tmp_path / "s.ssp"), tmp_path / "parts")
    assert {member.name for member in system.members} == {"fmu", "correction", "feed"}
    u = np.roll(U, 700)
    found = ppy.run(system, TIME, {"u": u}).signals["correction.x"]
    truth, plain = lagged(levelled(u)), lagged(u)
    late = slice(100, None)
    assert np.sqrt(np.mean((found - truth)[late] ** 2)) < 0.1 * np.sqrt(
        np.mean((plain - truth)[late] ** 2)
    )


@pytest.mark.slow
def test_a_curve_of_an_input_is_told(folder, lag):
    found = ppy.diagnose(
        written(folder, lagged(U + 0.04 * U * np.abs(U)), "more.csv"),
        lag,
        fit=["tau"],
        effects=[],
        time=np.inf,
    )
    best = found.law_map[0]
    assert (best["law"], best["signal"]) == ("u_in_fmu", "u")
    assert best["confirmed"]


@pytest.mark.slow
def test_the_command_writes_page_figures_and_system(folder, bent):
    call = ["diagnose", "r.csv", "--model", "one_state.fmu", "--fit", "tau", "--time", "inf"]
    said = works(*call, "--report", "r.html", "--json", "r.json", "--ssp", "r.ssp", cwd=folder)
    assert "simulated_x" in said
    assert (folder / "r.ssp").exists()
    assert (folder / "r.html").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--fit", "taw"], ["no parameter named 'taw' (did you mean tau"]),
        (
            ["--compare", "right.csv"],
            ["one_state.fmu is an FMU without equations", "each record by itself"],
        ),
        (["--ssp", "a.fmu"], [".ssp"]),
        (["--effects", "diffusion"], ["no effect named 'diffusion'"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_what_cannot_be_is_refused_in_a_line(folder, arguments, parts):
    for name in ("asked.csv", "right.csv"):
        written(folder, lagged(U), name, seed=3)
    refused(folder, "diagnose", "asked.csv", "--model", "one_state.fmu", *arguments, parts=parts)


def test_who_asks_for_its_laws_is_sent_to_diagnose(folder):
    written(folder, lagged(U), "right.csv")
    line = "one_state.fmu is an FMU without equations, which has no laws to search"
    parts = [line, "diagnose corrects its inputs and outputs", "--effects none"]
    refused(folder, "laws", "right.csv", "--model", "one_state.fmu", parts=parts)


@pytest.mark.slow
def test_what_its_output_lacks_is_asked_though_nothing_is_fitted(folder):
    """A gain of 1.2 is a fifth of what the FMU simulates more."""
    found = ppy.diagnose(
        written(folder, 1.2 * lagged(U), "gained.csv"),
        str(folder / "one_state.fmu"),
        settings={"tau": TAU},
        effects=[],
        time=np.inf,
    )
    assert found.causes == ["x(simulated_x)"]
    assert found.gain.after["x"] < 0.15 * found.gain.before["x"]


def test_a_fit_of_what_has_equations_is_refused(folder):
    with pytest.raises(UserError, match="has equations, and all its parameters are fitted"):
        ppy.diagnose(
            written(folder, lagged(U), "right.csv"),
            "ppy_actuator",
            fit=["R1"],
            mapping={"x": "voltage"},
            engine="old",
        )


def hostile(folder):
    """An FMU and its record whose names and descriptions would run a command if they were code."""
    run = f"__import__('pathlib').Path({str(folder / 'ran')!r}).touch()"
    names = {"u": f'u"); {run}; ("', "x": f"'say \"{run}\"'", "tau": f'{{{run}}}"""\n{run}\n\\'}
    root = ElementTree.fromstring(ONE_STATE_DESCRIPTION)
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        variable.set("name", names[variable.get("name")])
        variable.set("description", f'"""\n    {run}\n    """')
    description = ElementTree.tostring(root)
    model = edited(
        build_one_state_fmu(folder),
        folder / f"'; {run.replace('/', '')}; '.fmu",
        lambda name, contents: (name, description if name.endswith(".xml") else contents),
    )
    record = folder / "r.csv"
    with record.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", names["u"], names["x"]])
        rows.writerows(np.column_stack([TIME, U, 1.2 * lagged(U)])[:300].tolist())
    return model, record, names


@pytest.mark.slow  # a diagnosis in a process of its own
def test_no_name_of_an_fmu_is_run_as_code(tmp_path):
    model, record, names = hostile(tmp_path)
    fit = ("--fit", names["tau"], "--effects", "none", "--no-laws")
    done = ppy_command("diagnose", record, "--model", model, *fit, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "ran").exists()
