"""Claims: commands of a work loop are added before they are limited; each loop does its task."""

import numpy as np
import pytest

import ppy_rig as ppy
from fmus import component
from orchestration.system import library


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


def test_the_actuator_neither_lags_nor_saturates_by_default():
    lagging = library.system("work_loop").member("actuator").cls()
    nominal = component("ppy_actuator")()
    for one in (lagging, nominal):
        one.charge = 1.5
    assert lagging.displacement() == nominal.displacement()


def test_the_displacement_is_wanted_again_after_a_step_and_a_load():
    for name in ("displacement_loop", "state_feedback_loop"):
        run = ppy.run(name)
        settled = np.searchsorted(run["time"], [5.9, 11.9])
        displacement = np.asarray(run["actuator.displacement"])
        np.testing.assert_allclose(displacement[settled], [5e-5, 1e-4], rtol=2e-3)
        # the load makes 0.2 N / 6300 N/m at once, and creep of 0.2 N / 1.7e6 N s/m and more
        assert displacement.max() == pytest.approx(1e-4 + 0.2 / 6300.0, rel=1e-3)
        assert abs(displacement[-1] - 1e-4) < 0.5e-6
        assert np.abs(run["actuator.voltage"]).max() <= 1.0
        assert np.abs(run["galvanostat.current"]).max() <= 1.3


def test_the_gain_adapts_to_films_that_move_further():
    run = ppy.run("adaptive_loop")
    assert float(run["controller.gain"][-1]) == pytest.approx(1.0 / 1.6, rel=1e-3)
    apart = run["actuator.displacement"] - run["controller.model_displacement"]
    error = np.abs(np.asarray(apart)[::2])  # at the samples
    assert error[-500:].max() < 1e-3 * error[:500].max()


def test_the_tension_is_wanted_again_after_each_step():
    run = ppy.run("tension_loop")
    tension = np.asarray(run["actuator.tension"])
    settled = np.searchsorted(run["time"], 9.9)
    assert tension[settled] == pytest.approx(1.3, rel=0.005)
    assert tension[-1] == pytest.approx(1.5, rel=0.005)


@pytest.mark.slow
def test_coil_and_films_meet_where_both_springs_have_one_force():
    """F = F0 + K x of the coil, F = k1 (x - alpha q - k - m) of the films."""
    run = ppy.run("impedance_bench")
    position, tension = np.asarray(run["bench.position"]), np.asarray(run["actuator.tension"])
    settled = np.searchsorted(run["time"], [1.9, 5.9])
    np.testing.assert_allclose(tension[settled], 0.5 + 1e3 * position[settled], rtol=5e-3)
    assert position[settled[0]] == pytest.approx(0.5 / (6300.0 - 1e3), rel=0.02)
