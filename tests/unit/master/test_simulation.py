"""The master's algorithms against recurrences and solutions on paper."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.master import run
from orchestration.system import library
from tests.support.hosts import finish_in_subprocess
from tests.support.master.chain import chain_error, two_masses
from tests.support.master.circle import BOTH, CIRCLE, DECAY, TAU, TIME, H, lag, recurrence
from tests.support.master.samples import ring


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_two_members_in_a_circle(member, method):
    result = run(ring(member, BOTH, CIRCLE), TIME, method=method)
    a, b = recurrence(method == "gauss-seidel")
    assert result.signals["a.x"] == pytest.approx(a, abs=1e-14)
    assert result.signals["b.x"] == pytest.approx(b, abs=1e-14)
    assert (result.complete, result.message, result.notes) == (True, "", ())
    assert result.time.tolist() == TIME.tolist()
    assert list(result.signals) == ["a.x", "a.y", "b.x", "b.y"]
    assert result.guids == {"a": "member", "b": "member"}


def test_steps_of_any_size(member):
    rng = np.random.default_rng(1)
    time = 5.0 + np.cumsum(rng.uniform(0.01, 0.4, 40))
    result = run(ring(member, BOTH, CIRCLE), time, method="jacobi")
    a, b = 0.3, 0.0
    for k, h in enumerate(np.diff(time)):
        a, b = lag(a, 1 - 2 * b, exp(-h / TAU["a"])), lag(b, a, exp(-h / TAU["b"]))
        assert (result.signals["a.x"][k + 1], result.signals["b.x"][k + 1]) == pytest.approx(
            (a, b), abs=1e-12
        )


# --- extrapolation
# --------------------------------------------------------------------------------------------------


# --- rates
# --------------------------------------------------------------------------------------------------


# --- order of convergence
# -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("extrapolation", "order"), [(0, 1), (1, 2)])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_order_of_convergence(chain, method, extrapolation, order):
    errors = [
        chain_error(chain, n, method=method, extrapolation=extrapolation) for n in (160, 320, 640)
    ]
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize(("rates", "order"), [({"b": 4}, 2), ({"s": 1 / 2}, 1)])
def test_order_where_a_member_has_a_rate_of_its_own(chain, method, rates, order):
    """Outputs of a slow member are held in between, whatever is extrapolated."""
    errors = [
        chain_error(chain, n, method=method, extrapolation=1, rates=rates) for n in (320, 640, 1280)
    ]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_order_where_no_fmu_can_interpolate(tmp_path, method):
    """Values in the middle of the step; outputs that others wait for are read with those at its
    end.
    """
    system = two_masses(tmp_path, "python")
    coarse, fine = (chain_error(system, n, method=method, extrapolation=1) for n in (80, 160))
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.3)


def test_one_after_another_is_better_than_all_at_once(chain):
    for steps in (160, 640):
        assert chain_error(chain, steps, method="gauss-seidel") < 0.8 * chain_error(
            chain, steps, method="jacobi"
        )


# --- disturbances
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_a_disturbance_is_added_to_what_is_connected(member, method):
    """The source rests at 0.5, so that the input is 2 times that, and 1, and what is added, held
    over each step.
    """
    disturbance = np.random.default_rng(0).standard_normal(TIME.size)
    parameters = {"a": {"start": 0.5, "u": 0.5}, "b": {"start": 1.0, "tau": TAU["b"]}}
    system = ring(member, parameters, "a.x -> 2 b.u + 1")
    found = run(
        system, TIME, disturbances={"b.u": disturbance}, record=["b.x", "b.u"], method=method
    ).signals
    wanted = [1.0]
    for added in disturbance[:-1]:
        wanted.append(lag(wanted[-1], 2.0 + added, DECAY["b"]))
    assert found["b.u"] == pytest.approx(2.0 + disturbance, abs=1e-14)
    assert found["b.x"] == pytest.approx(np.array(wanted), abs=1e-14)


def test_a_disturbance_is_what_a_voltmeter_adds():
    watch = library.system("degradation_watch")
    time = 0.1 * np.arange(300)
    inputs = {"current_command": np.where(time % 5.0 < 2.5, 1.3, -1.3)}
    noise, record = (
        0.02 * np.random.default_rng(1).standard_normal(time.size),
        ["actuator.voltage", "estimator.R2"],
    )
    measured = library.with_voltmeter(watch, "actuator.voltage")
    one = run(
        measured, time, inputs | {"voltage_error": noise}, record=record, method="jacobi"
    ).signals
    both = {"galvanostat.voltage": noise, "estimator.voltage": noise}
    other = run(watch, time, inputs, disturbances=both, record=record, method="jacobi").signals
    for name, values in one.items():
        assert np.array_equal(other[name], values)


def test_a_disturbance_within_a_loop(member):
    """a_y = a_u / 2, b_y = 2 b_u, a_u = -b_y + d and b_u = a_y: a_u = d / 2."""
    parameters = {name: {"c": 0.0, "d": d, "e": 0.0} for name, d in (("a", 0.5), ("b", 2.0))}
    disturbance = np.linspace(-1.0, 2.0, TIME.size)
    system = ring(member, parameters, "a.y -> b.u; b.y -> -1 a.u")
    found = run(system, TIME, disturbances={"a.u": disturbance}, record=["a.u"]).signals
    assert found["a.u"] == pytest.approx(disturbance / 2.0, abs=1e-9)


# --- algebraic loops
# ------------------------------------------------------------------------------------------------


def test_a_loop_whose_member_cannot_go_back_is_refused(member, members):
    fmus = {"a": member, "b": members(canGetAndSetFMUstate=False)}
    parameters = {"a": {"d": 0.5}, "b": {"d": 0.5, "start": 1.0}}
    system = ring(fmus, parameters, "a.y -> b.u; b.y -> a.u")
    with pytest.raises(
        UserError, match=r"^algebraic loop of a\.u, a\.y, b\.u, b\.y: b cannot restore its state"
    ) as e:
        run(system, TIME)
    assert "\n" not in str(e.value)
    assert run(system, TIME, feedthrough=False).complete


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_what_an_fmu_does_not_say_is_assumed_and_told(members, method):
    """Without a list of dependencies a circle might be a loop; as x does not depend on u, it is the
    same recurrence.
    """
    mute = members(dependencies=None, canGetAndSetFMUstate=False)
    result = run(ring(mute, BOTH, CIRCLE), TIME, method=method, record=["a.x", "b.x"])
    assert result.signals["b.x"] == pytest.approx(
        recurrence(method == "gauss-seidel")[1], abs=1e-14
    )
    assert [note.split(":")[0] for note in result.notes] == ["a.x", "b.x"]
    assert "at the end of a step" in result.notes[0]
    can_go_back = run(ring(members(dependencies=None), BOTH, CIRCLE), TIME, method="jacobi")
    assert can_go_back.signals["b.x"] == pytest.approx(recurrence(False)[1], abs=1e-9)
    assert can_go_back.notes[0].startswith("algebraic loop of a.u, a.x, b.u, b.x: solved")


# --- adaptive steps
# -------------------------------------------------------------------------------------------------


# --- FMUs of others
# -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_fmus_of_stock_pythonfmu_in_a_circle(tmp_path):
    """They save no states and list no dependencies. In a process of its own, which their clean-up
    may crash.
    """
    finished = finish_in_subprocess(
        "tests.support.master.stock:circle", str(tmp_path), clean_exit=False
    )
    assert finished.returncode == 0, finished.output
    signals, notes, told, ends = finished.result
    assert ends == [TIME[30], TIME[30], TIME[30]]
    x = y = 0.0
    for k in range(TIME.size):
        assert (signals["a.x"][k], signals["b.x"][k]) == pytest.approx((x, y), abs=1e-13)
        x, y = x + H * (1.0 - y - x), y + H * (x - y)
    assert [note.split(":")[0] for note in notes] == ["a.x", "b.x"]
    assert "c: " in told["discard"]
    assert "from 3 s to 3.1 s failed (discard" in told["discard"]
    assert "from 3 s to 3.1 s failed (fatal" in told["fatal"]
    assert "its output x is nan at 3.1 s" in told["nan"]
