"""Claims: adaptive steps keep the coupling error below the tolerance, relative to nominal
values.
"""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestration.master import run
from tests.support.master.chain import exact_chain
from tests.support.master.circle import TIME
from tests.support.master.samples import ring


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
        # a step's error h^(p + 1) is the tolerance, so h^p, that of the end, is its power p / (p +
        # 1)
        assert errors[-1] < 4 * tolerance ** (order / (order + 1))
    assert steps == sorted(steps)
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


@pytest.mark.parametrize("extrapolation", [0, 1])
def test_what_is_kept_of_a_step_are_its_halves(chain, extrapolation):
    """If no error is too large, nothing of the whole step is kept, slopes included."""
    halves = np.linspace(0.0, 4.0, 17)
    fixed = run(chain, halves, extrapolation=extrapolation)
    adaptive = run(chain, halves[::2], tolerance=0.9, extrapolation=extrapolation)
    assert (adaptive.statistics.steps, adaptive.statistics.rollbacks) == (8, 0)
    for name in ("a.position", "b.position"):
        assert adaptive.signals[name] == pytest.approx(fixed.signals[name][::2], rel=1e-12)


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
