"""Work loops: figures of cycles in closed form, and experiments that go round one."""

import json
import re

import numpy as np
import pytest
import xarray

from fmus.kit import UserError
from orchestration.experiment.execution import run
from orchestration.experiment.model import WorkLoopTable
from orchestration.experiment.page import cycles, experiment_page
from orchestration.experiment.picture import draw_loops
from orchestration.experiment.reading import read
from orchestration.experiment.work_loop import (
    TrackedLoop,
    WorkLoop,
    figures,
    overtaken,
    tracked_loops,
    works_of_charge,
)

ANGLE = 0.002 * np.pi * np.arange(1000)
FORCE = 0.5 + 0.4 * np.cos(ANGLE)
LOOP = WorkLoop(FORCE, FORCE / 6300.0 - 7e-5 * np.sin(ANGLE))


def errors(tracked):
    """Error of each cycle."""
    return np.array([cycle.error for cycle in tracked.cycles()])


def test_figures_of_an_ellipse_are_those_of_its_formula():
    """Area pi F x, energy of a resistor, and the error of a loop that is too small."""
    time = np.linspace(0.0, 20.0, 4001)
    angle = 0.2 * np.pi * time
    length = (0.5 + 0.4 * np.cos(angle)) / 6300.0 - 5e-5 * np.sin(angle)
    current = 0.3 * np.sin(angle)
    cycles = TrackedLoop(LOOP, time, length, current, 2.0 * current).cycles()
    assert len(cycles) == 2
    for cycle in cycles:
        assert cycle.work == pytest.approx(-np.pi * 0.4 * 5e-5, rel=1e-4)
        assert cycle.error == pytest.approx(2e-5 * np.sqrt(0.5), rel=1e-3)
        assert cycle.electrical_energy == pytest.approx(2.0 * 0.09 / 2.0 * 10.0, rel=1e-5)
        assert (cycle.largest_current, cycle.largest_voltage) == pytest.approx((0.3, 0.6), rel=1e-5)


def test_a_length_that_creeps_has_no_error_about_its_rest_length():
    time = np.linspace(0.0, 20.0, 4001)
    length = LOOP.length_at(time) + 3e-5 * (time > 10.0)
    first, second = TrackedLoop(LOOP, time, length, 0.0 * time, 0.0 * time).cycles()
    assert first.error_about_rest == pytest.approx(0.0, abs=1e-6)
    assert second.error == pytest.approx(3e-5, rel=1e-3)
    assert second.error_about_rest == pytest.approx(0.0, abs=1e-6)


def test_a_mode_that_is_overtaken_is_told_with_the_cycle():
    time = np.linspace(0.0, 40.0, 4001)
    reference = LOOP.length_at(time)
    cycle = np.minimum(time // 10.0, 3.0)
    errors = {"feedback": 2e-5, "learning": 0.9e-5 * cycle, "bare": 9e-5}
    loops = {
        mode: TrackedLoop(LOOP, time, reference - error, 0.0 * time, 0.0 * time)
        for mode, error in errors.items()
    }
    lines = [line for line in overtaken(loops) if ": error no" in line]
    assert lines == ["learning: error no longer smaller than that of feedback from cycle 4 on"]


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_current_pays_for_the_work_of_the_charge_by_the_voltage_that_the_load_makes(share):
    """Area pi F x of an ellipse, x = alpha Q; a voltage of -alpha F pays for all of it."""
    time = np.linspace(0.0, 20.0, 4001)
    angle = 0.2 * np.pi * time
    charge = -2.0 * np.sin(angle)
    force = 0.5 + 0.4 * np.cos(angle)
    signals = {
        "F": ("N", force),
        "Q": ("C", charge),
        "x": ("mm", 0.03 * charge),
    }
    variables = {
        name: ("time", values, {"units": unit}) for name, (unit, values) in signals.items()
    }
    data = xarray.Dataset(variables, {"time": time})
    coupling = {"charge_length": "x", "charge": "Q"}
    coupling |= dict.fromkeys(("reaction", "reciprocal", "alpha"), "s")
    others = dict.fromkeys(("reference", "length", "current", "voltage"), "x")
    table = WorkLoopTable(period=10.0, force="F", **others, coupling=coupling)
    work = np.pi * 0.4 * 6e-5
    found = works_of_charge(data, table, -3e-5 * share)
    assert found == pytest.approx((work, share * work), rel=1e-5, abs=1e-15)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("reciprocal=false", r"in the last cycle; (\d+\.?\d*) uJ of it are paid for by no current"),
        ("reciprocal=true", None),
        ("voltage_per_force=-0.1mV/N", r"cycle; the current pays (\d+\.?\d*) uJ more than that"),
    ],
)
@pytest.mark.slow
def test_a_run_remarks_on_the_work_that_no_current_pays_for(setting, told):
    """About pi 0.4 N 0.07 mm a cycle; none of it with the reciprocal coupling of linear films, and
    as much too much with twice its reaction.
    """
    films = ["lag_time=0", "strain_saturation_coefficient=0", "alpha=5e-5", setting]
    notes = []
    experiment = read("work_loop", ["feedforward.alpha=5e-5", *(f"actuator.{s}" for s in films)])
    run(experiment, note=notes.append)
    remarks = [line for line in notes if "the charge does" in line]
    if told is None:
        assert not remarks
        return
    remark = next(line for line in remarks if line.startswith("recentred: "))
    assert float(re.search(told, remark)[1]) == pytest.approx(1e6 * np.pi * 0.4 * 7e-5, rel=0.05)


def test_any_loop_goes_on_round_after_its_last_phase():
    loop = WorkLoop(np.array([0.0, 1.0, 0.0, -1.0]), np.array([0.0, 2.0, 4.0, 2.0]), period=4.0)
    time = np.array([0.0, 0.5, 3.5, 4.0, 5.0])
    np.testing.assert_allclose(loop.force_at(time), [0.0, 0.5, -0.5, 0.0, 1.0])
    np.testing.assert_allclose(loop.length_at(time), [0.0, 1.0, 1.0, 0.0, 2.0])


def test_figures_are_json_and_the_picture_has_units(made):
    tracked = tracked_loops(made, read("work_loop").work_loop)
    told = json.loads(json.dumps(figures(tracked)))
    assert list(told) == ["bare", "feedback", "feedforward", "both", "learning", "recentred"]
    assert told["bare"][0]["error"] == tracked["bare"].cycles()[0].error
    labels = {axis.get_ylabel().replace("\n", " ") for axis in draw_loops(tracked).axes}
    of_cycles = {
        "error, rms [µm]",
        "work taken up [µJ]",
        "electrical energy [J]",
    }
    assert labels == {"force [N]", "tension [N]", *of_cycles}


def test_errors_of_users_are_a_line():
    with pytest.raises(UserError, match=r"force has the shape \(2,\), length \(3,\): a value"):
        WorkLoop(np.zeros(2), np.zeros(3))
    with pytest.raises(UserError, match=r"period = 0 s: must be above 0"):
        WorkLoop(np.zeros(2), np.zeros(2), 0.0)
    for values in ([], [0.0, np.nan]):
        with pytest.raises(UserError, match="force and length: finite values are needed"):
            WorkLoop(np.array(values), np.array(values))
    with pytest.raises(UserError, match="period = inf s: must be above 0, and finite"):
        WorkLoop(np.zeros(2), np.zeros(2), np.inf)


def test_a_loop_may_be_a_list():
    assert WorkLoop([1.0, 3.0], [0.0, 1.0], 2.0).force_at(np.array([0.5])) == pytest.approx(2.0)


# --- as an experiment
# --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made():
    """Three cycles of the experiment ``work_loop``."""
    return run(read("work_loop", ["duration=30s"]))


def test_the_bare_loop_of_the_experiment_is_the_creep_under_a_cosine(made):
    """Its length by hand: k1, the Maxwell dashpot, and the Kelvin element from rest (eq. 3.5)."""
    t = made.time.values
    w, T = 0.2 * np.pi, 2.0e6 / 1.0e4
    flow = (0.5 * t + 0.4 * np.sin(w * t) / w) / 1.7e6
    mean = 0.5 * (1.0 - np.exp(-t / T))
    swing = 0.4 * (np.cos(w * t) + w * T * np.sin(w * t) - np.exp(-t / T)) / (1.0 + (w * T) ** 2)
    length = made.force.values / 6300.0 + flow + (mean + swing) / 1.0e4
    # the load is held from point to point
    held = 0.4 * w * 0.01 * (1.0 / 6300.0)
    np.testing.assert_allclose(made["bare.actuator.displacement"].values, length, atol=held)


def test_the_page_of_the_experiment_has_its_cycles_and_loops(made):
    page = experiment_page(made).html()
    assert "Last cycle of each run" in page
    assert "the first 16 of" not in page
    assert page.index("<h2>Cycles") < page.index("<h2>Signals")
    assert [row[:2] for row in cycles(made)][:4] == [
        ("bare", "1"),
        ("bare", "2"),
        ("bare", "3"),
        ("feedback", "1"),
    ]
    loop, thesis = made.plot().axes[:2]
    assert (loop.get_xlabel(), thesis.get_xlabel()) == ("length [mm]", "length change [mm]")
    assert {line.get_label() for line in thesis.lines} == {
        "fig. 5-9, with current",
        "fig. 5-9, without",
    }


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "length='actuator.nothing'",
            "work_loop.length: no output recorded named 'actuator.nothing'",
        ),
        (
            "force='fource'",
            r"work_loop.force: no input driven named 'fource' \(did you mean force\?",
        ),
        (
            "coupling.reaction='actuator.s'",
            "work_loop.coupling.reaction: no parameter named 'actuator.s'",
        ),
        ("coupling.charge='Q'", "work_loop.charge: no output recorded named 'Q'"),
        ("period='7 s'", "work_loop.period = 7 s: force is not the same again after that time"),
        ("period='1 ms'", "work_loop.period = 0.001 s: must be at least 3 steps of 0.01 s"),
        ("force='reference'", "work_loop.force: reference: unit 'm' cannot be converted to 'N'"),
        (
            "current='actuator.voltage'",
            "work_loop.current: actuator.voltage: unit 'V' cannot be converted to 'A'",
        ),
    ],
)
def test_a_table_that_does_not_fit_is_refused_before_the_run(setting, message):
    with pytest.raises(UserError, match=message):
        run(read("work_loop", [f"work_loop.{setting}"]))


def test_a_length_that_is_the_reference_has_no_error_where_the_period_is_no_multiple_of_the_step():
    """In millimetres, to be read in metres; straight lines between samples leave 1e-4."""
    time = 0.07 * np.arange(429)
    reference = np.sin(2.0 * np.pi * time / 10.0)  # mm
    held = {"force": ("N", reference), "reference": ("mm", reference), "length": ("mm", reference)}
    held |= {"current": ("A", 0.0 * time), "voltage": ("V", 0.0 * time)}
    variables = {name: ("time", values, {"units": unit}) for name, (unit, values) in held.items()}
    data = xarray.Dataset(variables, {"time": time}, {"step": 0.07})
    table = WorkLoopTable(period=10.0, **{name: name for name in held})
    assert errors(tracked_loops(data, table)["run"]) == pytest.approx(0.0, abs=4e-7)


def test_many_cycles_are_marked_as_far_as_they_can_be_read():
    many = TrackedLoop(LOOP, np.arange(0.0, 1001.0, 0.5), *np.ones((3, 2002)))
    axes = {axis.get_ylabel(): axis for axis in draw_loops({"$\\bad{$": many}).axes}
    ticks = axes["electrical energy\n[J]"].get_xticks()
    assert len(ticks) < 15
    assert np.array_equal(ticks, np.round(ticks))
    assert "log" in axes["error, rms\n[µm]"].get_yscale()


def test_part_of_a_cycle_is_no_loop():
    with pytest.raises(UserError, match=r"duration = 9 s: a work loop needs a period of 10 s or"):
        read("work_loop", ["duration=9s"])
