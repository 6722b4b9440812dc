"""Claims: the ground never makes energy nor pulls, returns what Hunt and Crossley say, and rubs as
Coulomb says.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fmus.foot.ground import Ground

K, D0, MASS = 2e4, 1e-3, 0.3
LANDINGS = 10_000


def landed(ground, fall, mass=MASS):
    """Velocity at which a mass without weight leaves the ground, and how deep it was."""

    def slope(_, x):
        return [x[1], -ground.ground_pressure(x[0], x[1]) / mass]

    def leaves(_, x):
        return x[0]

    def turns(_, x):
        return x[1]

    leaves.terminal, leaves.direction = True, -1
    found = solve_ivp(
        slope, (0.0, 1.0), [0.0, fall], "DOP853", rtol=1e-11, atol=1e-14, events=(leaves, turns)
    )
    return -found.y[1, -1], found.y_events[1][0][0]


@pytest.mark.parametrize("fall", [1e-3, 0.1, 0.7, 2.0])
@pytest.mark.parametrize("loss", [0.0, 0.3, 1.0])
def test_restitution_is_that_of_the_separated_equation(fall, loss):
    """m v dv = -k d^(3/2) (1 + c v) dd has the same depth on both ways, c = 3/2 alpha: integrals of
    v / (1 + c v) over both are equal.
    """
    c = 1.5 * loss
    out, deepest = landed(Ground(restitution_loss=loss), fall)

    def spent(v):
        return v / c - np.log1p(c * v) / c**2 if c * abs(v) > 1e-3 else v**2 / 2 - c * v**3 / 3

    exact = (
        fall
        if loss == 0.0
        else brentq(lambda v: spent(-v) - spent(fall), 0.0, min(fall, 0.999999 / c))
    )
    assert out == pytest.approx(exact, rel=1e-6)
    assert 2.0 / 5.0 * K * deepest**2.5 / D0**0.5 == pytest.approx(MASS * spent(fall), rel=1e-6)
    if fall == 1e-3 and loss:
        assert 1.0 - out / fall == pytest.approx(loss * fall, rel=0.01), "alpha, of slow impacts"


def test_ground_pushes_up_only_and_only_where_there_is_depth():
    random = np.random.default_rng(1)
    depth, rate = random.normal(0.0, 1e-3, 100_000), random.normal(0.0, 2.0, 100_000)
    push = Ground().ground_pressure(depth, rate)
    assert (push >= 0.0).all()
    assert (push[depth <= 0.0] == 0.0).all()
    assert (push[(depth > 0.0) & (rate > -0.5)] > 0.0).all()
    assert np.isfinite(Ground().ground_pressure(np.array([-1e300, 1e100]), np.zeros(2))).all()


def test_friction_is_coulombs_where_it_slips_and_takes_energy_everywhere():
    random = np.random.default_rng(2)
    push, slip = random.uniform(0.0, 50.0, 10_000), random.normal(0.0, 0.3, 10_000)
    drag = Ground().ground_drag(push, slip)
    assert (drag * slip <= 0.0).all()
    assert (np.abs(drag) <= 0.6 * push).all()
    slips = np.abs(slip) > 0.2
    assert np.abs(drag[slips]) == pytest.approx(0.6 * push[slips], rel=1e-6)


@pytest.mark.slow
def test_10000_random_landings_get_no_energy_from_the_ground():
    """A point falls anyhow on any ground and is pushed about meanwhile; Runge and Kutta's method
    for all at once, the work of the ground being one of the states. It never exceeds 0 but for what
    the method loses, which is seen at half the step.
    """
    random = np.random.default_rng(3)
    ground = Ground(
        ground_stiffness=10.0 ** random.uniform(2.0, 5.0, LANDINGS),
        restitution_loss=random.uniform(0.0, 3.0, LANDINGS) * random.integers(0, 2, LANDINGS),
        ground_friction=random.uniform(0.0, 2.0, LANDINGS),
        slip_velocity=10.0 ** random.uniform(-2.0, -1.0, LANDINGS),
    )
    mass = 10.0 ** random.uniform(-1.0, 1.0, LANDINGS)
    fall, along = random.uniform(0.0, 2.0, LANDINGS), random.normal(0.0, 1.0, LANDINGS)
    weight, pull, beat = (random.normal(0.0, 20.0, LANDINGS) for _ in range(3))

    def slope(t, x):
        depth, rate, slip, _ = x
        push = ground.ground_pressure(depth, rate)
        drag = ground.ground_drag(push, slip)
        more = weight * np.cos(beat * t)
        return np.array(
            [rate, (more - push) / mass, (pull + drag) / mass, drag * slip - push * rate]
        )

    def worst(steps, stop=0.05):
        x, h = np.array([np.zeros(LANDINGS), fall, along, np.zeros(LANDINGS)]), stop / steps
        most = np.zeros(LANDINGS)
        for k in range(steps):
            t = k * h
            a = slope(t, x)
            b = slope(t + h / 2, x + h / 2 * a)
            c = slope(t + h / 2, x + h / 2 * b)
            d = slope(t + h, x + h * c)
            x = x + h / 6 * (a + 2 * b + 2 * c + d)
            most = np.maximum(most, x[3])
        scale = 0.5 * mass * (fall**2 + along**2)
        return most / scale, x[3] / scale, x[0]

    (coarse, *_), (fine, work, depth) = worst(1000), worst(2000)
    assert fine.max() < 1e-6
    assert fine.max() <= coarse.max() + 1e-12
    assert (work[depth < 0.0] < 1e-6).all()
    assert np.median(work) < -0.05, "the ground takes a good part"
    assert np.count_nonzero(depth < 0.0) > LANDINGS / 4, "many have left it again"
