"""The master's algorithms against recurrences and solutions on paper."""

from __future__ import annotations

from math import cos, exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fmus.kit.build import build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulate import simulate_instance
from orchestration.master import Stopped, run
from orchestration.system import library
from orchestration.system.model import Member, Port, System, connect
from tests.contract.models import Sampler
from tests.support.hosts import finish_in_subprocess
from tests.support.master.models import Mass, Spring
from tests.support.master.samples import build_member, ring

H = 0.1
TIME = H * np.arange(31)
TAU = {"a": 0.7, "b": 0.4}
DECAY = {name: exp(-H / tau) for name, tau in TAU.items()}
CIRCLE = "a.x -> b.u; b.x -> -2 a.u + 1"  # a_u = 1 - 2 b_x
BOTH = {"a": {"tau": TAU["a"], "start": 0.3}, "b": {"tau": TAU["b"]}}


@pytest.fixture(scope="module")
def members(tmp_path_factory):
    """FMUs by what they can do: ``members(dependencies=None, canInterpolateInputs=True, ...)``."""

    def path(**abilities):
        return build_member(tmp_path_factory.mktemp("member"), **abilities)

    return path


@pytest.fixture(scope="module")
def member(members):
    return members()


def lag(x, u, decay):
    """Exact step of tau dx/dt = u - x with a held input."""
    return u + (x - u) * decay


def recurrence(sequential, decay=DECAY, steps=TIME.size - 1):
    a, b = 0.3, 0.0
    rows = [(a, b)]
    for _ in range(steps):
        new = lag(a, 1 - 2 * b, decay["a"])
        b = lag(b, new if sequential else a, decay["b"])
        a = new
        rows.append((a, b))
    return np.array(rows).T


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


def test_who_feeds_steps_first(member):
    """A chain that is written down backwards: every member sees the newest."""
    parameters = {name: {"tau": TAU["a"]} for name in "cba"}
    result = run(
        ring(member, parameters, "a.x -> b.u; b.x -> c.u", u="a.u"), TIME, {"u": np.ones(TIME.size)}
    )
    x = np.zeros(3)
    for k in range(TIME.size):
        assert [result.signals[f"{name}.x"][k] for name in "abc"] == pytest.approx(x, abs=1e-14)
        for i in range(3):
            x[i] = lag(x[i], x[i - 1] if i else 1.0, DECAY["a"])


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


def test_outputs_show_the_inputs_of_the_same_point(member):
    """Through two members at once: y = d u, and the next one's y too; the first point included."""
    system = ring(
        member, {"b": {"c": 0.0, "d": 3.0}, "a": {"c": 0.0, "d": 2.0}}, "a.y -> b.u + 1", u="a.u"
    )
    u = np.sin(TIME) + 0.5
    result = run(system, TIME, {"u": u}, record=["b.y", "a.u", "b.u"])
    assert result.signals["b.y"] == pytest.approx(3 * (2 * u + 1), abs=1e-14)
    assert result.signals["a.u"].tolist() == u.tolist()
    assert result.signals["b.u"] == pytest.approx(2 * u + 1, abs=1e-14)


def test_without_feedthrough_an_output_is_a_step_late(member):
    system = ring(
        member, {"a": {"c": 0.0, "d": 2.0}, "b": {"c": 0.0, "d": 3.0}}, "a.y -> b.u", u="a.u"
    )
    u = np.sin(TIME) + 0.5
    result = run(system, TIME, {"u": u}, method="jacobi", feedthrough=False)
    assert result.signals["a.y"][1:] == pytest.approx(2 * u[:-1], abs=1e-14)
    assert result.signals["b.y"][2:] == pytest.approx(6 * u[:-2], abs=1e-14)


# --- extrapolation --------------------------------------------------------------------------------------------------


def ramp(x, u, slope, h, tau):
    """Exact step for the input u + slope t."""
    return u + slope * (h - tau) + (x - u + slope * tau) * exp(-h / tau)


@pytest.mark.parametrize("interpolates", [True, False])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_linear_inputs(members, method, interpolates):
    """The slope of the last step, or to the value that is there already; or else the value in the middle."""
    fmu = members(canInterpolateInputs=interpolates)
    result = run(ring(fmu, BOTH, CIRCLE), TIME, method=method, extrapolation=1)
    x = {"a": 0.3, "b": 0.0}
    slope = {"a": 0.0, "b": 0.0}
    for k in range(TIME.size):
        assert result.signals["a.x"][k] == pytest.approx(x["a"], abs=1e-13)
        assert result.signals["b.x"][k] == pytest.approx(x["b"], abs=1e-13)
        u, new = {"a": 1 - 2 * x["b"], "b": x["a"]}, {}
        for name in "ab":
            if method == "gauss-seidel" and name == "b":
                slope["b"] = (new["a"] - u["b"]) / H
            if interpolates:
                new[name] = ramp(x[name], u[name], slope[name], H, TAU[name])
            else:
                new[name] = lag(x[name], u[name] + slope[name] * H / 2, DECAY[name])
        x = new
        slope = {"a": (1 - 2 * x["b"] - u["a"]) / H, "b": (x["a"] - u["b"]) / H}


def test_a_jump_from_outside_is_not_extrapolated(member):
    """The gain a passes the jump on at once; b must not see its slope go on."""
    system = ring(member, {"a": {"c": 0.0, "d": 2.0}, "b": {"tau": 0.4}}, "a.y -> b.u", u="a.u")
    u = np.where(TIME < 1.0 - H / 2, 0.0, 1.0)
    result = run(system, TIME, {"u": u}, extrapolation=1, method="jacobi")
    after = np.maximum(TIME - 1.0, 0.0)
    assert result.signals["b.x"] == pytest.approx(2.0 * -np.expm1(-after / 0.4), abs=1e-12)


# --- rates ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extrapolation", [0, 1])
def test_a_member_with_several_steps_in_one(member, extrapolation):
    parameters = {name: own | {"euler": 1} for name, own in BOTH.items()}
    system = ring(member, parameters, CIRCLE)
    result = run(system, TIME, method="jacobi", extrapolation=extrapolation, rates={"b": 4})
    a, b, slope = 0.3, 0.0, {"a": 0.0, "b": 0.0}
    for k in range(TIME.size):
        assert (result.signals["a.x"][k], result.signals["b.x"][k]) == pytest.approx(
            (a, b), abs=1e-13
        )
        u = {"a": 1 - 2 * b, "b": a}
        a += H / TAU["a"] * (u["a"] + slope["a"] * H / 2 - a)
        for part in range(4):
            b += H / 4 / TAU["b"] * (u["b"] + slope["b"] * H * (part + 0.5) / 4 - b)
        if extrapolation:
            slope = {"a": (1 - 2 * b - u["a"]) / H, "b": (a - u["b"]) / H}
    assert {name: spent.steps for name, spent in result.statistics.components.items()} == {
        "a": 30,
        "b": 120,
    }


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_a_slow_member_keeps_its_outputs_between_its_steps(member, method):
    """Every fourth step, and a shorter one at the end, for 30 is no multiple of 4."""
    result = run(ring(member, BOTH, CIRCLE), TIME, method=method, rates={"b": 0.25})
    a, b, u, since = 0.3, 0.0, 0.3, 0
    for k in range(1, TIME.size):
        a = lag(a, 1 - 2 * b, DECAY["a"])
        if k % 4 == 0 or k == TIME.size - 1:
            b = lag(b, a if method == "gauss-seidel" else u, DECAY["b"] ** (k - since))
            u, since = a, k
        assert (result.signals["a.x"][k], result.signals["b.x"][k]) == pytest.approx(
            (a, b), abs=1e-13
        )
    assert result.statistics.components["b"].steps == 8


def test_a_slow_member_with_linear_inputs(members):
    """Its slope is that over its own, longer, step."""
    system = ring(members(canInterpolateInputs=True), BOTH, CIRCLE)
    result = run(system, TIME, method="jacobi", extrapolation=1, rates={"b": 0.5})
    a, b, slope_a, u_b, slope_b = 0.3, 0.0, 0.0, 0.3, 0.0
    for k in range(1, TIME.size):
        u_a = 1 - 2 * b
        a = ramp(a, u_a, slope_a, H, TAU["a"])
        if k % 2 == 0:
            b = ramp(b, u_b, slope_b, 2 * H, TAU["b"])
            u_b, slope_b = a, (a - u_b) / (2 * H)
        slope_a = (1 - 2 * b - u_a) / H
        assert (result.signals["a.x"][k], result.signals["b.x"][k]) == pytest.approx(
            (a, b), abs=1e-12
        )


# --- order of convergence -------------------------------------------------------------------------------------------


def two_masses(folder, runtime):
    """Two masses, each on a spring of its own, with a third spring between them that has no state."""
    paths = {}
    for cls in (Mass, Spring):
        paths[cls] = folder / f"{cls.name}.fmu"
        paths[cls].write_bytes(build(cls, runtime, [host_platform()]))
    members = (
        Member("a", paths[Mass], {"position_start": 1.0, "left": 0.0}),
        Member("s", paths[Spring]),
        Member("b", paths[Mass], {"m": 0.5, "right": 0.0}),
    )
    wires = connect(
        "a.position -> s.one", "b.position -> s.other", "s.force -> a.right", "s.force -> b.left"
    )
    return System("chain", members, wires)


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    return two_masses(tmp_path_factory.mktemp("chain"), "native")


def exact_chain(stop):
    def rates(t, z):
        force = 2.0 * (z[2] - z[0])
        return [z[1], force - z[0], z[3], (-force - z[2]) / 0.5]

    return solve_ivp(rates, (0.0, stop), [1.0, 0.0, 0.0, 0.0], rtol=1e-12, atol=1e-13).y[[0, 2], -1]


def chain_error(chain, steps, **options):
    result = run(chain, np.linspace(0.0, 4.0, steps + 1), **options)
    return np.abs(
        [result.signals["a.position"][-1], result.signals["b.position"][-1]] - exact_chain(4.0)
    ).max()


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
    """Values in the middle of the step; outputs that others wait for are read with those at its end."""
    system = two_masses(tmp_path, "python")
    coarse, fine = (chain_error(system, n, method=method, extrapolation=1) for n in (80, 160))
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.3)


def test_one_after_another_is_better_than_all_at_once(chain):
    for steps in (160, 640):
        assert chain_error(chain, steps, method="gauss-seidel") < 0.8 * chain_error(
            chain, steps, method="jacobi"
        )


# --- disturbances -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_a_disturbance_is_added_to_what_is_connected(member, method):
    """The source rests at 0.5, so that the input is 2 times that, and 1, and what is added, held over each step."""
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


def test_disturbances_that_cannot_be_added_are_refused(member):
    system, zeros = ring(member, {"a": {}, "b": {}}, "a.x -> b.u", drive="a.u"), np.zeros(TIME.size)
    for disturbances, options, message in (
        ({"a.u": zeros}, {}, r"disturbance a\.u: is no connected input"),
        ({"b.u": zeros[1:]}, {}, r"disturbance b\.u: shape \(\d+,\) for \d+ communication points"),
        ({"b.u": zeros}, {"extrapolation": 1}, "do not go with extrapolation 1"),
    ):
        with pytest.raises(UserError, match=message):
            run(system, TIME, disturbances=disturbances, **options)


# --- algebraic loops ------------------------------------------------------------------------------------------------


def test_a_loop_with_a_known_solution(member):
    """a_y = a_x + a_u / 2, b_y = 2 b_u + b_x, a_u = -b_y: three times around the loop it would grow."""
    parameters = {"a": {"d": 0.5, "tau": 0.7, "start": 0.3}, "b": {"d": 4.0, "tau": 0.4}}
    result = run(ring(member, parameters, "a.y -> b.u; b.y -> -1 a.u"), TIME, method="jacobi")
    a, b = 0.3, 0.0
    for k in range(TIME.size):
        y = np.linalg.solve(
            [[1.0, 0.5], [-4.0, 1.0]], [a, b]
        )  # a_y + b_y / 2 = a;  -4 a_y + b_y = b
        assert [result.signals[f"{name}.y"][k] for name in "ab"] == pytest.approx(
            y.tolist(), abs=1e-9
        )
        assert [result.signals[f"{name}.x"][k] for name in "ab"] == pytest.approx([a, b], abs=1e-9)
        a, b = lag(a, -y[1], DECAY["a"]), lag(b, y[0], DECAY["b"])
    assert result.notes[0].startswith("algebraic loop of a.u, a.y, b.u, b.y: solved with ")
    assert result.statistics.evaluations <= 4 * TIME.size


@pytest.mark.parametrize(("e", "gain"), [(1.0, 1.0), (5.0, -1.0)])
def test_a_loop_that_is_not_linear(member, e, gain):
    """u = gain e cos(u); with slope 5 sin(u) > 1 passing it around diverges."""
    parameters = {"a": {"c": 0.0, "e": e}, "b": {"c": 0.0, "d": gain}}
    result = run(
        ring(member, parameters, "a.y -> b.u; b.y -> a.u"), TIME[:5], record=["a.u", "b.y"]
    )
    u = result.signals["a.u"]
    assert u == pytest.approx(gain * e * np.cos(u), abs=1e-9)
    if e == 1.0:
        assert u == pytest.approx(brentq(lambda u: u - cos(u), 0, 1), abs=1e-9)


def test_trials_leave_no_trace(member):
    """Setting the input of b changes its state; at each point it was set once, however long the search."""
    parameters = {
        "a": {"start": 2.0, "e": 0.9},
        "b": {"c": 0.0, "d": -1.0, "tau": 1e15, "trace": 1e-3},
    }
    result = run(ring(member, parameters, "a.y -> b.u; b.y -> a.u"), TIME, method="jacobi")
    assert result.statistics.evaluations > 2 * TIME.size
    assert result.signals["b.x"] == pytest.approx(1e-3 * np.arange(TIME.size), abs=1e-12)


def test_a_loop_beside_what_it_does_not_touch(member):
    """Ports, not members, make a loop: a.x is known before, and c waits for the solution."""
    parameters = {"c": {"c": 0.0, "d": 1.0}, "a": {"d": 0.5, "start": 1.0}, "b": {"d": -1.0}}
    result = run(ring(member, parameters, "a.y -> b.u; b.y -> a.u; b.y -> c.u"), TIME[:2])
    assert result.signals["c.y"][0] == pytest.approx(-2 / 3, rel=1e-9)  # y = 1 + u/2, u = -y
    assert "c." not in result.notes[0].split(":")[0]


def test_a_loop_without_solution_is_named(member):
    parameters = {"a": {"c": 0.0, "d": 1.0}, "b": {"d": 1.0, "start": 1.0}}
    with pytest.raises(
        UserError, match=r"^algebraic loop of a\.u, a\.y, b\.u, b\.y, at 0 s: no solution found in "
    ):
        run(ring(member, parameters, "a.y -> b.u; b.y -> a.u"), TIME)


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
    """Without a list of dependencies a circle might be a loop; as x does not depend on u, it is the same recurrence."""
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


def test_a_loop_in_adaptive_steps(member):
    """Solved by hand the loop leaves an ordinary differential equation."""
    parameters = {"a": {"d": 0.5, "tau": 0.7, "start": 0.3}, "b": {"d": 4.0, "tau": 0.4}}
    time = np.linspace(0.0, 2.0, 5)
    result = run(
        ring(member, parameters, "a.y -> b.u; b.y -> -1 a.u"), time, tolerance=1e-5, extrapolation=1
    )

    def rates(t, x):
        y = np.linalg.solve([[1.0, 0.5], [-4.0, 1.0]], x)
        return [(-y[1] - x[0]) / 0.7, (y[0] - x[1]) / 0.4]

    exact = solve_ivp(rates, (0.0, 2.0), [0.3, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    for name, values in zip("ab", exact, strict=True):
        assert result.signals[f"{name}.x"] == pytest.approx(values, abs=1e-3)


# --- adaptive steps -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extrapolation", [0, 1])
def test_a_smaller_tolerance_gives_a_smaller_error(chain, extrapolation):
    time = np.linspace(0.0, 4.0, 9)
    exact = exact_chain(4.0)
    order = 1 + extrapolation
    errors, steps = [], []
    for tolerance in (1e-3, 1e-4, 1e-5):
        result = run(chain, time, tolerance=tolerance, extrapolation=extrapolation)
        ends = [result.signals["a.position"][-1], result.signals["b.position"][-1]]
        errors.append(np.abs(ends - exact).max())
        steps.append(result.statistics.steps)
        assert result.time.tolist() == time.tolist()
        # a step's error h^(p + 1) is the tolerance, so h^p, that of the end, is its power p / (p + 1)
        assert errors[-1] < 4 * tolerance ** (order / (order + 1))
    assert steps == sorted(steps)
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_steps_are_short_where_something_happens_and_long_where_nothing_does(member):
    """A jump from outside at 5 s; in between everything settles."""
    time = np.array([0.0, 5.0, 10.0])
    system = ring(member, {"a": {}, "b": {}}, "a.x -> b.u", u="a.u")
    result = run(system, time, {"u": np.array([1.0, -1.0, -1.0])}, tolerance=1e-4)
    response = 1.0 - 6.0 * exp(-5.0)  # of two lags of 1 s in a row, after 5 s
    assert result.signals["b.x"][1] == pytest.approx(response, abs=5e-3)
    assert result.signals["b.x"][2] == pytest.approx(
        1.0 - 11.0 * exp(-10.0) - 2.0 * response, abs=5e-3
    )
    assert 0 < result.statistics.rollbacks < result.statistics.steps < 1000


def test_a_tolerance_is_relative_to_nominal_values(members):
    """The same system in micrometres: only the nominal value tells."""
    steps = []
    for scale, nominal in ((1.0, 1.0), (1e-6, 1e-6), (1e-6, 1.0)):
        parameters = {"a": {"tau": 0.7, "start": scale}, "b": {"tau": 0.4}}
        fmu = members(nominal=nominal)
        result = run(
            ring(fmu, parameters, "a.x -> b.u; b.x -> -2 a.u"), TIME[[0, 30]], tolerance=1e-4
        )
        steps.append(result.statistics.steps)
    assert steps[0] == steps[1] > 10 * steps[2]


@pytest.mark.parametrize(
    ("abilities", "options", "told"),
    [
        ({"canGetAndSetFMUstate": False}, {"tolerance": 1e-3}, "a: cannot restore its state"),
        (
            {"canHandleVariableCommunicationStepSize": False},
            {"tolerance": 1e-3},
            "a: its steps must all be of one size",
        ),
        (
            {"canHandleVariableCommunicationStepSize": False},
            {"rates": {"a": 0.25}},
            "a: its steps must all be of one",
        ),
        (
            {},
            {"tolerance": 1e-3, "rates": {"a": 0.25}},
            "a: a rate below 1 does not go with a tolerance",
        ),
        (
            {},
            {"rates": {"a": 1.5}},
            "rate 1.5 of a: steps per step of the system must be 1, 2, 3, ... or 1/2, 1/3",
        ),
        ({}, {"rates": {"z": 2}}, "no member named 'z'"),
        ({}, {"method": "newton"}, "method 'newton'; there are: gauss-seidel, jacobi"),
        ({}, {"extrapolation": 2}, "extrapolation 2: 0 "),
        ({}, {"tolerance": -1.0}, "tolerance -1.0: must be a number between 0 and 1"),
        ({}, {"tolerance": "1e-3"}, "tolerance '1e-3': must be a number between 0 and 1"),
        (
            {},
            {"rates": {"a": "2"}},
            "rate '2' of a: steps per step of the system must be 1, 2, 3, ",
        ),
        (
            {},
            {"rates": {"a": None}},
            "rate None of a: steps per step of the system must be 1, 2, 3, ",
        ),
        ({}, {"inputs": {"v": TIME}}, "no input named 'v'"),
        ({}, {"inputs": {"a.u": TIME}}, "input a.u: a.u is fed by b.x already"),
        ({}, {"inputs": {"u": TIME[1:]}}, r"input u: shape \(30,\) for 31 communication points"),
        ({}, {"inputs": {"u": TIME * np.nan}}, "input u: nan at point 0 is no finite number"),
        ({}, {"record": ["a.z"]}, "a: no variable named 'z'"),
        (
            {},
            {"time": np.array([0.0, 1.0, 1.0])},
            "communication points must be at least two finite numbers",
        ),
    ],
)
def test_what_cannot_be_done_is_told_at_once(members, abilities, options, told):
    system = ring(members(**abilities), {"a": {}, "b": {}, "c": {}}, CIRCLE, u="c.u")
    arguments = {"time": TIME} | options
    with pytest.raises(UserError, match=told) as caught:
        run(system, **arguments)
    assert "\n" not in str(caught.value)
    assert not isinstance(caught.value, Stopped)


# --- FMUs of others -------------------------------------------------------------------------------------------------


def test_fmus_of_stock_pythonfmu_in_a_circle(tmp_path):
    """They save no states and list no dependencies. In a process of its own, which their clean-up may crash."""
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


def test_integers_and_booleans(tmp_path):
    """In a chain each member is as if it ran alone, with what the one before delivers."""
    path = tmp_path / "sampler.fmu"
    path.write_bytes(build(Sampler, "native", [host_platform()]))
    members = (Member("a", path, {"enabled": 1.0}), Member("b", path))
    inputs = {"a": (Port("a", "u"),), "b": (Port("b", "u"),)}
    system = System("samplers", members, connect("a.high -> b.enabled"), inputs)
    u = {"a": np.sin(3.0 * TIME), "b": np.cos(TIME)}
    for record in (None, ["b.count", "b.total", "a.high"]):
        result = run(system, TIME, u, method="jacobi", record=record)
        with Fmu(path, {"enabled": 1.0}) as fmu:
            fmu.start()
            first = simulate_instance(fmu, TIME, {"u": u["a"]})
        with Fmu(path) as fmu:
            fmu.start()
            second = simulate_instance(fmu, TIME, {"u": u["b"], "enabled": first["high"]})
        assert {0.0, 1.0} == set(first["high"])
        for name, values in result.signals.items():
            expected = {"a": first, "b": second}[name[0]][name[2:]]
            assert values.tolist() == expected.tolist(), name
    assert list(result.signals) == ["b.count", "b.total", "a.high"]
    assert (result.units["b.count"], result.units["a.high"]) == ("1", "1")
