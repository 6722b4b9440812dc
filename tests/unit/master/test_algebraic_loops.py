"""Claims: algebraic loops are solved to rounding, linear or not, and one without solution is
named.
"""

from __future__ import annotations

from math import cos

import numpy as np
import pytest
from scipy.optimize import brentq

from fmus.kit import Component, Input, Output, State
from fmus.kit.build.building import build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.fmu.archive import for_model_exchange
from orchestration.master import run
from orchestration.master.algebraic_loops import FixedPoint
from orchestration.system import Member, System, connect
from tests.support.master.circle import DECAY, TIME, lag
from tests.support.master.samples import ring


def test_a_loop_with_a_known_solution(member):
    """a_y = a_x + a_u / 2, b_y = 2 b_u + b_x, a_u = -b_y: three times around the loop it would
    grow.
    """
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
    """Setting the input of b changes its state; at each point it was set once, however long the
    search.
    """
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


@pytest.mark.parametrize(
    ("g", "solution"),
    [
        (lambda v: np.cos(v), [0.7390851332151607]),
        (lambda v: 4.0 - 3.0 * v, [1.0]),
        (lambda v: np.array([[0.0, 5.0], [-7.0, 2.0]]) @ v + 1.0, [2 / 17, -3 / 17]),
        (lambda v: 2.0 + 1e6 * (1.0 - v), [(2 + 1e6) / (1 + 1e6)]),
        (lambda v: 0.5 - np.where(v > 0.5, 3.0, 0.5) * (v - 0.5), [0.5]),  # a kink at the solution
    ],
)
def test_fixed_points(g, solution):
    point = FixedPoint(g, np.ones(len(solution)))
    assert point.solve(np.full(len(solution), 0.3)) == pytest.approx(solution, rel=1e-8)
    spent = point.evaluations
    assert spent < 40
    assert point.solve(np.array(solution)) == pytest.approx(solution, rel=1e-8)
    assert point.evaluations <= spent + 2


def test_values_that_are_not_continuous_are_passed_around():
    asked = []

    def g(v):
        asked.append(v.copy())
        return np.array([min(v[0] + 1.0, 4.0)])

    assert FixedPoint(g, np.ones(1), continuous=False).solve(np.zeros(1)).tolist() == [4.0]
    assert np.ravel(asked).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    "g",
    [np.exp, lambda v: v + 1.0, lambda v: v * np.nan, lambda v: np.where(v == 0.3, 1.0, np.nan)],
)
def test_no_fixed_point(g):
    with pytest.raises(UserError, match=r"no solution found in|is no number"):
        FixedPoint(g, np.ones(1)).solve(np.full(1, 0.3))


def test_an_updated_jacobian_explains_the_step_and_nothing_else():
    """The secant equation, and no change across the step (Broyden, Math. Comp. 19, 1965)."""
    rng = np.random.default_rng(4)
    loop = FixedPoint(np.cos, np.ones(3))
    loop._jacobian = before = rng.normal(size=(3, 3))
    step, change = rng.normal(size=(2, 3))
    loop._update_jacobian(step, change)
    across = np.cross(step, [1.0, 2.0, 3.0])
    assert loop._jacobian @ step == pytest.approx(change)
    assert loop._jacobian @ across == pytest.approx(before @ across)


class Decay(Component):
    """A state that decays, and a feedthrough."""

    name = "decay"

    u = Input("1", doc="of which one half passes through")
    x = State("1", rate="rate", start=1.0, doc="decays")

    def rate(self):
        return -self.x

    @Output("1")
    def y(self):
        """The state and half of the input."""
        return 0.5 * self.u + self.x


def test_a_loop_through_members_for_model_exchange_alone(tmp_path):
    """y_a = y_b / 2 + x_a and y_b = y_a / 2 + x_b, with states of exp(-t) and 3 exp(-t)."""
    path = tmp_path / "decay.fmu"
    path.write_bytes(build(Decay, "native", [host_platform()]))
    alone = for_model_exchange(path)
    members = (Member("a", alone), Member("b", alone, {"x_start": 3.0}))
    system = System("loop", members, connect("a.y -> b.u", "b.y -> a.u"))
    time = 0.1 * np.arange(11)
    found = run(system, time).signals
    states = np.exp(-time) * np.array([[1.0], [3.0]])
    expected = np.linalg.solve([[1.0, -0.5], [-0.5, 1.0]], states)
    np.testing.assert_allclose([found["a.y"], found["b.y"]], expected, rtol=1e-5)
