"""A record about a free course. Oracle: a cost written out, minimised within bounds by a general
method of SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from orchestration.discrepancy.laws.evidence import Basis, Curve, RegressorColumns
from orchestration.discrepancy.laws.linear.linearised import LinearisedRecord
from orchestration.discrepancy.laws.linear.powers import LEAST, MOST, reach
from orchestration.discrepancy.laws.linear.unknown_input import UnknownInput
from orchestration.identify.noise.model import white_noise

SAMPLES = 200
TIME = np.linspace(0.0, 1.0, SAMPLES)
X = np.sin(7.0 * TIME)
BASIS = Basis(np.linspace(-1.0, 1.0, 5))
HATS = 50.0 * BASIS(X)
PRIOR = np.array([0.3, 0.3, 0.0])


def record(own, step):
    """One output in noise of unit size, with a curve and a step of three parameters in it, the last
    without a prior.
    """
    noise = np.random.default_rng(1).normal(size=SAMPLES)
    residual = {"y": HATS @ np.array([0.4, -0.1, 0.0, 0.2, 0.9]) - own @ step + noise}
    left = {"y": np.random.default_rng(2).normal(size=SAMPLES)}
    course = UnknownInput("law", residual, left, {"y": own}, [], {})
    made = LinearisedRecord(
        course, PRIOR, {"y": np.ones(SAMPLES, dtype=bool)}, white_noise(left), reach(np.ones(3))
    )
    return made, made({"y": residual["y"]}), made({"y": own}), made({"y": HATS})


def best(made, columns):
    free, own = made.free(columns), made.own(columns)
    products = RegressorColumns(BASIS, free.T @ free, free.T @ free + own.T @ own, made.samples)
    return products.best(free.T @ made.residual)


def within_reach(made, curve, columns):
    """Of one curve alone."""
    ((found, step),) = made.within_reach([curve], columns.T[None])
    return found, step


OWN = 30.0 * np.column_stack([np.cos(3.0 * TIME), X + 0.2 * TIME, TIME])


@pytest.mark.parametrize("step", [[0.5, -0.3, 0.2], [12.0, 6.0, -50.0]])
def test_what_is_within_reach_stays_as_it_is(step):
    made, whole, own, columns = record(OWN, np.array(step))
    curve = best(made, columns)
    found, moved = within_reach(made, curve, columns)
    assert found.values == pytest.approx(curve.values)
    assert found.gain == pytest.approx(curve.gain, rel=1e-6)
    assert moved == pytest.approx(step, abs=1.5), "as far as the curve does not do the same"
    assert np.mean((whole - columns @ found.values + own @ moved) ** 2) < 1.2


@pytest.mark.parametrize("step", [[-4.0, 0.1, 0.2], [40.0, -3.0, 1.0]])
def test_what_is_out_of_reach_is_the_least_that_bounds_allow(step):
    made, whole, own, columns = record(OWN, np.array(step))
    curve = best(made, columns)
    found, moved = within_reach(made, curve, columns)
    strength, axes = np.linalg.eigh(curve.prior)
    kept = strength > 1e-12 * strength.max()
    root = axes[:, kept] * np.sqrt(strength[kept])

    def cost(z):
        left = whole - columns @ (root @ z[3:]) + own @ z[:3]
        return left @ left + PRIOR @ z[:3] ** 2 + z[3:] @ z[3:]

    def slope(z):
        left = whole - columns @ (root @ z[3:]) + own @ z[:3]
        return 2.0 * np.concatenate(
            [own.T @ left + PRIOR * z[:3], -root.T @ columns.T @ left + z[3:]]
        )

    free = (None, None)
    bounds = [(LEAST, MOST), (LEAST, MOST), free, *[free] * root.shape[1]]
    least = minimize(
        cost,
        np.zeros(3 + root.shape[1]),
        jac=slope,
        bounds=bounds,
        method="L-BFGS-B",
        options={"maxiter": 20000, "maxfun": 40000, "ftol": 1e-15, "gtol": 1e-9},
    )
    mine = np.concatenate([moved, np.linalg.lstsq(root, found.values, rcond=None)[0]])
    assert cost(mine) <= least.fun * (1.0 + 1e-6)
    assert (moved[:2] >= LEAST - 1e-9).all()
    assert (moved[:2] <= MOST + 1e-9).all()
    assert min(moved[:2] - LEAST) < 1e-6 or min(MOST - moved[:2]) < 1e-6
    assert found.gain < curve.gain


def test_of_two_levels_what_bends_is_nothing_and_the_rest_has_its_bounds():
    """The prior of a curve through two knots has no bending part: a direction in which nothing can
    move.
    """
    made, whole, own, _ = record(OWN, np.array([-4.0, 0.1, 0.2]))
    levels = Basis(np.array([-1.0, 1.0]))
    columns = made({"y": 50.0 * levels(np.sign(X))})
    straight = np.outer(levels.knots, levels.knots)
    curve = Curve(1e4, 0.5 * levels.knots, 0.01 * straight, straight, 1.0)
    found, moved = within_reach(made, curve, columns)
    slope = columns @ levels.knots
    left = whole + own @ moved
    assert found.values == pytest.approx(
        levels.knots * (slope @ left) / (slope @ slope + 1.0), rel=1e-6
    )
    assert moved[0] == pytest.approx(LEAST)
