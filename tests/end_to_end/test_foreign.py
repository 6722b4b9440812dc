"""Claims: an FMU without equations gets a cause by name and a gain from outside, and a system.

The oracle is what was done to a lag whose closed form is known; SciPy's filter makes the records.
"""

from __future__ import annotations

import csv
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import orchestration as ppy
from orchestration.system.ssp.reading import read as read_ssp
from tests.support.archive import edited
from tests.support.command import ppy as ppy_command
from tests.support.command import refused, works
from tests.support.hosts import ONE_STATE_DESCRIPTION, build_one_state_fmu
from tests.support.lag import STEP, TAU, TIME, U, lagged, write_lag

pytestmark = pytest.mark.timeout(600)


def levelled(u):
    return u / np.sqrt(1.0 + 0.15 * u**2)


def dragged(u):
    """x of ``tau dx/dt = u - 0.15 x |x| - x`` with u held, by SciPy."""
    x = [0.0]
    for held in u[:-1]:

        def rate(time, state, held=held):
            return (held - 0.15 * state * np.abs(state) - state) / TAU

        step = solve_ivp(rate, (0.0, STEP), [x[-1]], rtol=1e-9, atol=1e-9)
        x.append(step.y[0, -1])
    return np.array(x)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreign")
    build_one_state_fmu(folder)
    return folder


@pytest.fixture(scope="module")
def lag(folder):
    return ppy.find_model(str(folder / "one_state.fmu"))


def error_of_system(result, path, truth):
    """Return the error that a corrected system leaves of a record nobody has seen, and the FMU's.

    The record is the closed form over another course of the input.
    """
    system = read_ssp(result.system(path), path.with_suffix(""))
    u = np.roll(U, 700)
    found = ppy.run(system, TIME, {"u": u}).signals["correction.x"]
    late = slice(100, None)
    errors = (found - truth(u))[late], (lagged(u) - truth(u))[late]
    left, plain = (float(np.sqrt(np.mean(error**2))) for error in errors)
    return system, left, plain


@pytest.fixture(scope="module")
def bent(folder, lag):
    x = lagged(U)
    return ppy.diagnose(write_lag(folder / "r.csv", x - 0.02 * x**3), lag, fit=["tau"])


@pytest.mark.slow
def test_an_output_that_bends_is_a_cause_over_what_the_fmu_simulates(bent):
    assert bent.verdict == "cause"
    assert bent.causes == ["x(x_simulated)"]
    low, high = bent.parameters["tau"].interval
    assert low <= TAU <= high
    assert bent.gain.after["x"] < 0.15 * bent.gain.before["x"]


@pytest.mark.slow
def test_the_system_follows_a_record_that_nobody_has_seen(bent, tmp_path):
    """The original FMU with its correction, in our master, beside the closed form."""
    system, left, plain = error_of_system(
        bent, tmp_path / "s.ssp", lambda u: lagged(u) - 0.02 * lagged(u) ** 3
    )
    assert {member.name for member in system.members} == {"fmu", "correction"}
    assert left < 0.1 * plain


@pytest.mark.slow
def test_a_right_fmu_is_consistent(folder, lag):
    right = write_lag(folder / "right.csv", lagged(U))
    assert ppy.diagnose(right, lag, settings={"tau": TAU}).verdict == "consistent"


@pytest.mark.slow
def test_a_wrong_parameter_is_no_cause(folder, lag):
    """The FMU starts at 1 s; the record was made with 0.8 s."""
    other = write_lag(folder / "other.csv", lagged(U), seed=2)
    found = ppy.diagnose(other, lag, fit=["tau"])
    assert (found.verdict, found.changed, found.causes) == ("recalibrate", ["tau"], [])
    low, high = found.parameters["tau"].interval
    assert low <= TAU <= high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "change", "value"),
    [
        ("sensor_gain(x)", lambda x: 1.2 * x, ("x_of_x", 0.2, 0.01)),
        ("sensor_offset(x)", lambda x: x + 0.3, ("x_offset", 0.3, 0.01)),
        (
            "transport_delay(x)",
            lambda x: np.concatenate([np.zeros(5), x[:-5]]),
            ("x_delay", 0.5, 0.03),
        ),
    ],
)
def test_what_a_sensor_does_is_named(folder, lag, effect, change, value):
    record = write_lag(folder / "sensor.csv", change(lagged(U)))
    found = ppy.diagnose(record, lag, settings={"tau": TAU})
    assert found.causes == [effect]
    name, expected, close = value
    assert found.parameters[name].value == pytest.approx(expected, abs=close)


@pytest.mark.slow
def test_a_parameter_that_moves_far_beside_a_cause_is_as_it_is(folder, lag, tmp_path):
    """Fit a parameter with a gain beside it, far from where the FMU was linearised first."""
    y = 1.3 * lagged(U, 1.95)
    found = ppy.diagnose(write_lag(folder / "moved.csv", y), lag, fit=["tau"])
    assert found.causes == ["sensor_gain(x)"]
    for name, true in (("tau", 1.95), ("x_of_x", 0.3)):
        low, high = found.parameters[name].interval
        assert low <= true <= high
        assert found.parameters[name].value == pytest.approx(true, rel=0.01)
    assert found.parameters["tau"].unit == "s"
    system = read_ssp(found.system(tmp_path / "s.ssp"), tmp_path / "parts")
    assert system.member("fmu").parameters["tau"] == pytest.approx(1.95, rel=0.01)


@pytest.mark.slow
def test_what_depends_on_an_input_is_said_to(folder, lag):
    """Something of the input reaches the output beside the lag."""
    record = write_lag(folder / "past.csv", lagged(U) + 0.05 * U * np.abs(U))
    assert ppy.diagnose(record, lag, fit=["tau"]).causes == ["x(u)"]


@pytest.mark.slow
def test_a_law_inside_is_what_the_fmu_gets_over_what_it_gives(folder, lag, tmp_path):
    """A drag that the FMU lacks is a loop from its output to its input, and so is the system."""
    found = ppy.diagnose(write_lag(folder / "drag.csv", dragged(U)), lag, fit=["tau"])
    assert found.causes == ["u_in_fmu(x_simulated)"]
    assert found.parameters["tau"].value == pytest.approx(TAU, rel=0.01)
    assert found.parameters["u_in_fmu_of_x_simulated"].value == pytest.approx(-0.15, rel=0.03)
    _, left, plain = error_of_system(found, tmp_path / "s.ssp", dragged)
    assert left < 0.1 * plain


@pytest.fixture(scope="module")
def starved(folder, lag):
    """Diagnose a lag whose input levels off: never more than 2.6."""
    record = write_lag(folder / "level.csv", lagged(levelled(U)))
    return ppy.diagnose(record, lag, settings={"tau": TAU}, effects=["input_saturation(u)"])


@pytest.mark.slow
def test_what_is_wrong_ahead_of_the_dynamics_is_named_there_where_it_is_asked_for(starved):
    assert starved.causes == ["input_saturation(u)"]
    assert starved.parameters["u_saturation"].value == pytest.approx(0.15, rel=0.03)


@pytest.mark.slow
def test_its_system_has_a_member_ahead(starved, tmp_path):
    system, left, plain = error_of_system(
        starved, tmp_path / "s.ssp", lambda u: lagged(levelled(u))
    )
    assert {member.name for member in system.members} == {"fmu", "correction", "feed"}
    assert left < 0.1 * plain


@pytest.mark.slow
def test_an_input_with_the_opposite_sign_is_simulated_anew(folder, lag):
    record = write_lag(folder / "sign.csv", lagged(-U))
    found = ppy.diagnose(record, lag, settings={"tau": TAU})
    assert max(found.probabilities, key=found.probabilities.get) == "reading_sign(u)"


@pytest.mark.slow
def test_the_command_writes_page_figures_and_system(folder, bent):
    call = ["diagnose", "r.csv", "--model", "one_state.fmu", "--fit", "tau"]
    said = works(*call, "--report", "r.html", "--json", "r.json", "--ssp", "r.ssp", cwd=folder)
    assert "x over simulated x" in said
    assert "--ssp extended.ssp" not in said, "it was just done"
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
        write_lag(folder / name, lagged(U), seed=3)
    refused(folder, "diagnose", "asked.csv", "--model", "one_state.fmu", *arguments, parts=parts)


def test_who_asks_for_its_laws_is_sent_to_diagnose(folder):
    write_lag(folder / "right.csv", lagged(U))
    line = "one_state.fmu is an FMU without equations, which has no laws to search"
    parts = [line, "diagnose corrects its inputs and outputs", "--effects none"]
    refused(folder, "laws", "right.csv", "--model", "one_state.fmu", parts=parts)


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
