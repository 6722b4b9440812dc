"""Claims: members step with linear inputs, in parts, and at rates of their own as computed on
paper.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.master import run
from tests.support.master.circle import BOTH, CIRCLE, DECAY, TAU, TIME, H, lag, ramp
from tests.support.master.samples import ring


@pytest.mark.parametrize("interpolates", [True, False])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_linear_inputs(members, method, interpolates):
    """The slope of the last step, or to the value that is there already; or else the value in the
    middle.
    """
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
