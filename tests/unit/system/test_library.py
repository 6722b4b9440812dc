"""Claims: the systems ship in both builds, and run at their step in a master that is not
ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.master import run as run_master
from orchestration.system import Port, library, ssp
from orchestration.system.checking import check, interface, warnings
from tests.support.system.hosts import run_libcosim_ssp


@pytest.fixture
def run(tmp_path):
    """Run a system in libcosim for some seconds, at its step divided by a number."""

    def run(name, seconds, inputs, signals, part=1, runtime="native"):
        system, path = library.system(name, runtime), tmp_path / f"{name}.ssp"
        if not path.exists():
            ssp.write(system, path)
        step = system.step / part
        return run_libcosim_ssp(path, step, round(seconds / step), inputs, signals)

    return run


def test_eight_ship_and_another_name_is_refused():
    assert library.NAMES == (
        "dma_bench",
        "isotonic_stand",
        "work_loop",
        "degradation_watch",
        "potentiostat_watch",
        "protected_bench",
        "foot_gait",
        "hil_bench",
    )
    with pytest.raises(UserError, match=r"no system named 'dma_bnch' \(did you mean dma_bench\?\)"):
        library.system("dma_bnch")


@pytest.mark.parametrize("name", library.NAMES)
def test_each_makes_sense_in_both_builds(name, runtime):
    system = library.system(name, runtime)
    check(system)
    assert warnings(system) == []
    assert system.doc == library.SUMMARIES[name]
    assert all(
        member.cls is not None and member.fmu.stem == member.cls.name for member in system.members
    )


def test_commands_of_a_work_loop_are_added_before_they_are_limited():
    wires = {(str(c.source), str(c.target)) for c in library.system("work_loop").connections}
    measured = {
        (f"actuator.{signal}", f"{member}.{signal}")
        for signal, member in (
            ("displacement", "feedback"),
            ("displacement", "learning"),
            ("voltage", "feedback"),
            ("voltage", "galvanostat"),
        )
    }
    assert wires - measured == {
        ("feedforward.command", "learning.feedback_command"),
        ("learning.command", "feedback.command_beside"),
        ("feedback.command", "galvanostat.current_command"),
        ("galvanostat.current", "actuator.current"),
        ("galvanostat.current", "feedback.current"),
    }
    assert measured <= wires


@pytest.mark.slow
def test_what_is_connected_with_what():
    """As section 6 of the design has it."""
    found = {
        n: {str(c.source): str(c.target) for c in library.system(n).connections}
        for n in library.NAMES
        if n != "work_loop"  # whose actuator is heard by several
    }
    assert found["dma_bench"] == {
        "bench.position": "actuator.length_change",
        "actuator.tension": "bench.tension",
    }
    assert found["hil_bench"] == {
        "bench.position": "proxy.length_change",
        "proxy.tension": "bench.tension",
    }
    assert found["isotonic_stand"] == {
        "galvanostat.current": "actuator.current",
        "actuator.voltage": "galvanostat.voltage",
        "stand.tension": "actuator.force",
        "actuator.displacement": "stand.displacement",
    }
    feet = {f"foot.{a}_length_change": f"{a}.length_change" for a in ("an", "po", "do", "pl")}
    assert found["foot_gait"] == feet | {
        f"{a}.tension": f"foot.{a}_tension" for a in ("an", "po", "do", "pl")
    }
    assert found["protected_bench"] == found["dma_bench"] | {
        "galvanostat.current": "actuator.current",
        "actuator.voltage": "galvanostat.voltage",
        "galvanostat.recovering": "bench.hold",
    }
    watch, potentiostat = (
        {(str(c.source), str(c.target)) for c in library.system(name).connections}
        for name in ("degradation_watch", "potentiostat_watch")
    )
    assert watch == potentiostat
    assert watch == {
        ("galvanostat.current", "actuator.current"),
        ("galvanostat.current", "estimator.current"),
        ("actuator.voltage", "estimator.voltage"),
        ("actuator.voltage", "galvanostat.voltage"),
        ("estimator.voltage_limit", "galvanostat.voltage_limit"),
    }


def test_the_bench_settles_at_its_reference_at_any_step(run):
    inputs = {"bench.force_reference": 1.0, "actuator.current": 0.5}
    force = "bench.force_measured"
    coarse, fine = (run("dma_bench", 0.5, inputs, [force], part)[force] for part in (1, 2))
    assert coarse[-1] == pytest.approx(1.0, rel=0.005)
    assert coarse == pytest.approx(
        fine[1::2], abs=0.03
    )  # of 1 N; the largest difference is in the first oscillation


def test_an_actuator_takes_the_place_of_the_proxy_and_the_bench_does_not_notice():
    usual, time = library.system("dma_bench"), 1e-4 * np.arange(1001)
    held = {"force_reference": np.full(time.size, 2.0), "current": np.full(time.size, 0.5)}
    actuator, proxied = usual.member("actuator").fmu, library.system("hil_bench", "python")
    assert {**proxied.inputs} == {**usual.inputs, "current": (Port("proxy", "current"),)}
    members = (usual.member("bench"), replace(proxied.member("proxy"), fmu=actuator))
    other = run_master(replace(proxied, members=members), time, held).signals
    for name, values in run_master(usual, time, held).signals.items():
        assert np.array_equal(values, other[name.replace("actuator.", "proxy.")])


def test_the_proxy_has_every_signal_of_the_actuator():
    """Not the other way round: it tells of its link, too."""
    models = [
        interface(m)
        for m in (
            library.system("dma_bench").member("actuator"),
            library.system("hil_bench", "python").member("proxy"),
        )
    ]
    for group in ("inputs", "outputs"):
        actuator, proxy = (getattr(model, group) for model in models)
        # no rig tells what is left to a limit
        actuator = {name: s for name, s in actuator.items() if not name.endswith("_margin")}
        assert {name: (s.type, s.unit) for name, s in actuator.items()} == {
            name: (proxy[name].type, proxy[name].unit) for name in actuator
        }


@pytest.mark.slow
def test_the_foot_rests_under_tension_and_stays_taut(run):
    """The largest current, driven for the two seconds of the experiment, slackens nobody; without
    it nothing moves.
    """
    tensions = [f"{a}.tension" for a in library.FEET]
    still = run("foot_gait", 0.5, {}, ["foot.ankle_angle", "foot.mtp_angle", *tensions], 0.5)
    assert np.abs(still["foot.ankle_angle"]).max() < 1e-9
    assert np.abs(still["foot.mtp_angle"]).max() < 1e-9
    driven = run(
        "foot_gait",
        2.0,
        {"po.current": 1.3, "do.current": 1.3},
        ["foot.ankle_angle", *tensions],
        0.5,
    )
    assert driven["foot.ankle_angle"][-1] > 1e-3  # the longer one at the heel lets the foot rise
    for name in tensions:
        assert driven[name].min() > 3.0
        assert still[name][0] == pytest.approx(driven[name][0], rel=1e-3)


@pytest.mark.parametrize(
    ("creeps", "seconds", "tolerance"), [(False, 1.0, 1e-3), (True, 1.6, 0.02)]
)
def test_the_toe_of_the_gait_yields_as_its_compliance_says(creeps, seconds, tolerance):
    """A force of 0.1 N moves it by the mean of the compliances before and after; of the actuators
    that ship, 1 % is creep.
    """
    system, axes = library.system("foot_gait"), ("x", "y")
    quiet = {name: {"b1": 1e18, "b2": 1e18} for name in library.FEET} | {
        "foot": {"ankle_damping": 0.1}
    }
    members = tuple(
        m if creeps else replace(m, parameters={**m.parameters, **quiet[m.name]})
        for m in system.members
    )
    time = 1e-4 * np.arange(round(seconds / 1e-4) + 1)
    free, pushed = (
        run_master(
            replace(system, members=members), time, {"toe_force_x": np.full(time.size, f)}
        ).signals
        for f in (0.0, -0.1)
    )
    said = [
        0.5 * (free[name][-1] + pushed[name][-1])
        for name in ("foot.toe_compliance_xx", "foot.toe_compliance_xy")
    ]
    moved = [(pushed[f"foot.toe_{a}"][-1] - free[f"foot.toe_{a}"][-1]) / -0.1 for a in axes]
    assert moved == pytest.approx(said, rel=tolerance)
    if creeps:
        assert moved[0] == pytest.approx(2.897e-3, rel=1e-3)


def test_the_watch_sees_its_actuator(run):
    """The current is what was wanted, the limit that of the start, and the actuator charges."""
    wanted = {"galvanostat.current_command": 1.0}
    found = run(
        "degradation_watch",
        5.0,
        wanted,
        ["galvanostat.current", "actuator.voltage", "estimator.voltage_limit"],
    )
    assert set(found["galvanostat.current"]) == {1.0}
    assert set(found["estimator.voltage_limit"]) == {library.ESTIMATOR["initial_voltage_limit"]}
    assert np.all(np.diff(found["actuator.voltage"]) > 0.0)


# --- pictures
# --------------------------------------------------------------------------------------------------
