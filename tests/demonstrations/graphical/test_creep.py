"""Claims: readings of a step load are the Burgers body of the closed form, or are refused."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from demonstrations.graphical.creep import read_creep
from fmus.kit.errors import UserError

K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6  # fig. 3-9, N/m and N s/m; b2/k2 = 200 s
PRINTED = {"k1": K1, "b1": B1, "k2": K2, "b2": B2}


def stepped(held, period=1.0, load=2.25, bias=0.0, before=5.0):
    """Time, force and elongation of the chain of fig. 3-1, its rates integrated by scipy.

    Creep under the bias before the step has ended, so that only the dashpot moves.
    """
    time = np.arange(0.0, before + held + 0.5 * period, period)
    loaded = time >= before - 1e-9
    since = np.maximum(time - before, 0.0)
    states = solve_ivp(
        lambda _, x: [(bias + load) / B1, (load - K2 * x[1]) / B2],
        (0.0, since[-1]),
        [0.0, 0.0],
        t_eval=np.unique(since),
        rtol=1e-10,
        atol=1e-15,
    ).y.sum(axis=0)
    x = np.where(loaded, load / K1 + np.interp(since, np.unique(since), states), 0.0)
    x += bias / B1 * np.minimum(time - before, 0.0)
    return time, np.where(loaded, bias + load, bias), x


def test_a_load_that_is_held_gives_the_chain():
    """To the curvature of the first hundredth, through which a straight line is drawn."""
    found = read_creep(*stepped(3000.0, 0.5))
    assert found.values == pytest.approx(PRINTED, rel=5e-3)
    assert found.time_constant == pytest.approx(200.0, rel=5e-3)
    assert (found.load, found.held, found.warnings) == (pytest.approx(2.25), 3000.0, ())


@pytest.mark.parametrize("bias", [0.4, 2.0, -0.6])
def test_the_flow_is_of_the_whole_load(bias):
    """The dashpot flows under the load before the step, too, which moves the level there."""
    found = read_creep(*stepped(3000.0, 0.5, bias=bias, before=30.0))
    assert found.values == pytest.approx(PRINTED, rel=5e-3)


def test_noise_an_offset_and_a_bias_load_leave_the_values_near():
    time, force, x = stepped(3000.0, 0.5, bias=0.5)
    x += 0.4e-3 + 3e-6 * np.random.default_rng(1).standard_normal(x.size)
    assert read_creep(time, force, x).values == pytest.approx(PRINTED, rel=0.03)


def test_taking_a_load_off_tells_the_same():
    time, force, x = stepped(3000.0, 0.5, bias=-3.0)
    assert read_creep(time, -force, 1e-3 - x).values == pytest.approx(PRINTED, rel=5e-3)


@pytest.mark.parametrize("held", [30.0, 100.0, 400.0])
def test_a_load_that_is_not_held_long_enough_is_told(held):
    """Warn where creep counts as flow.

    The Kelvin element still creeps at the middle of the last third, 5/6 of the time.
    """
    found = read_creep(*stepped(held, held / 600))
    flowing = 1 / (1 / B1 + np.exp(-held * 5 / 6 * K2 / B2) / B2)
    assert found.b1 == pytest.approx(flowing, rel=0.02)
    assert found.b1 < 0.95 * B1
    (warning,) = found.warnings
    assert "creep that would end counts as flow, and b1 is too small" in warning


TIME, FORCE, X = stepped(1200.0)
UNDER = "under the step of 2.25 N at 5 s; a Burgers body would"
LEVELS = "force: a level before and another after one step are needed; "


@pytest.mark.parametrize(
    ("time", "force", "x", "message"),
    [
        (
            TIME,
            FORCE,
            X[1:],
            "displacement has the shape (1205,): time and signals must be vectors of one length",
        ),
        (
            TIME,
            np.where(TIME == 3.0, np.inf, FORCE),
            X,
            "force: sample 3 is inf, and must be a finite number",
        ),
        (
            TIME,
            np.ones_like(TIME),
            X,
            LEVELS + "about sample 1 it changes by 0 N, and elsewhere by up to 0 N",
        ),
        (
            TIME,
            np.where(TIME > 600.0, 0.0, FORCE),
            X,
            LEVELS + "about sample 5 it changes by 1.12 N, and elsewhere by up to 2.25 N",
        ),
        (
            TIME,
            FORCE - 2.25,
            X,
            "force: 0 N after a step of 2.25 N: under no load nothing flows, so that b1 cannot be"
            " read",
        ),
        (TIME, FORCE, -X, f"displacement: does not elongate at once {UNDER}"),
        (TIME, FORCE, np.minimum(X, X[50]), f"displacement: does not flow in the end {UNDER}"),
        (
            TIME,
            FORCE,
            np.where(TIME < 5.0, 0.0, 1e-4 + 1e-9 * TIME**2),
            f"displacement: does not creep towards its flow {UNDER}",
        ),
        (
            TIME[:9],
            FORCE[:9],
            X[:9],
            "record of 4 samples under load: too few to tell creep from what is at once",
        ),
    ],
)
def test_what_is_no_creep_after_a_step_is_refused(time, force, x, message):
    with pytest.raises(UserError, match=f"^{re.escape(message)}$"):
        read_creep(time, force, x)
