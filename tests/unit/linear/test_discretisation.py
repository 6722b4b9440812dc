"""Claims: one model over the period of all clocks is what scipy comes to between the samples.

Oracle: an event loop over the same matrices, whose integrator is scipy's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import UserError
from orchestration.linear.blocks import LinearBlocks, SampledUpdate
from orchestration.linear.discretisation import assemble, hyper_period

PERIODS, SHIFTS = (0.2, 0.3), (0.05, 0.0)


def mixed():
    """Two continuous and three discrete states on two clocks, one input, at random."""
    rng = np.random.default_rng(1)
    rates = rng.normal(size=(2, 6)) - np.eye(2, 6)
    first = SampledUpdate("fast", PERIODS[0], SHIFTS[0], (0, 2), 0.4 * rng.normal(size=(2, 6)))
    second = SampledUpdate("slow", PERIODS[1], SHIFTS[1], (1,), 0.4 * rng.normal(size=(1, 6)))
    signals = {"y": rng.normal(size=6)}
    return LinearBlocks(("a", "b"), ("d", "e", "f"), ("u",), rates, (first, second), signals)


def followed(blocks, x, d, u, until):
    """States after events in the order of time, and of the clocks where they coincide."""
    events = sorted(
        (round(update.shift + k * update.period, 9), order)
        for order, update in enumerate(blocks.updates)
        for k in range(100)
        if update.shift + k * update.period < until - 1e-9
    )
    now = 0.0
    for at, order in [*events, (until, None)]:
        if at > now:
            held = np.append(d, u)
            x = solve_ivp(
                lambda _, x, held=held: blocks.rates @ np.append(x, held),
                (now, at),
                x,
                "DOP853",
                rtol=1e-12,
                atol=1e-14,
            ).y[:, -1]
            now = at
        if order is not None:
            update = blocks.updates[order]
            d[list(update.rows)] = update.matrix @ np.concatenate([x, d, [u]])
    return np.concatenate([x, d])


def test_a_model_of_several_clocks_and_continuous_states_is_exact():
    blocks = mixed()
    m = assemble(blocks, ["y"])
    assert m.period == pytest.approx(0.6)
    for k, column in enumerate(np.hstack([m.A, m.B]).T):
        start = np.eye(6)[k]
        exact = followed(blocks, start[:2], start[2:5].copy(), start[5], 0.6)
        np.testing.assert_allclose(column, exact, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(np.hstack([m.C, m.D])[0], blocks.signals["y"])


def test_what_is_not_sampled_is_continuous_or_held():
    blocks = LinearBlocks(
        ("x",), (), ("u",), np.array([[-2.0, 3.0]]), (), {"x": np.array([1.0, 0.0])}
    )
    m = assemble(blocks, ["x"])
    assert (m.A[0, 0], m.B[0, 0], m.period) == (-2.0, 3.0, 0.0)
    held = assemble(blocks, ["x"], 0.1)
    decay = np.exp(-0.2)
    assert (held.A[0, 0], held.B[0, 0]) == pytest.approx((decay, 1.5 * (1.0 - decay)), rel=1e-12)


@pytest.mark.parametrize(
    ("periods", "least"),
    [((0.1,), 0.1), ((0.1, 0.2), 0.2), ((0.2, 0.3), 0.6), ((1 / 30, 0.1, 1 / 15), 0.2)],
)
def test_the_period_of_a_model_is_the_least_that_all_clocks_share(periods, least):
    clocks = {f"c{k}": period for k, period in enumerate(periods)}
    assert hyper_period(clocks) == pytest.approx(least, rel=1e-12)


def test_clocks_without_a_common_period_are_refused_in_a_line():
    with pytest.raises(UserError, match=r"b = 0\.141421 s and a = 0\.1 s have no common hyper-per"):
        hyper_period({"a": 0.1, "b": 0.1 * np.sqrt(2.0)})
    with pytest.raises(UserError, match="more than 100,000 samples"):
        hyper_period({"a": 0.1, "b": 0.1 * 9973 / 9967, "c": 0.1 * 9949 / 9941})


@pytest.mark.parametrize(
    ("shift", "counter_first", "copies"),
    [(0.0, True, (5, 4)), (0.0, False, (4, 3)), (0.3, True, (6, 4)), (0.3, False, (5, 3))],
)
def test_samples_at_one_instant_are_in_the_order_of_the_updates(shift, counter_first, copies):
    """Instants that differ by rounding, 3 * 0.1 and 0.3, are one; 0.3 is 3 periods of 0.1.

    Oracle: a counter of samples every 0.1 s, of which slower clocks keep a copy, by hand. Of 0.6 s,
    a clock of 0.2 s samples last at 0.4 s, or at 0.5 s with the shift, one of 0.3 s at 0.3 s.
    """
    columns = ("integral", "counter", "second", "third", "u")
    rates = np.array([[0.0, 1.0, 0.0, 0.0, 0.0]])
    read = np.array([[0.0, 1.0, 0.0, 0.0, 0.0]])
    counter = SampledUpdate("0.1", 0.1, shift, (0,), np.array([[0.0, 1.0, 0.0, 0.0, 1.0]]))
    others = [
        SampledUpdate("0.2", 0.2, shift, (1,), read),
        SampledUpdate("0.3", 0.3, 0.3, (2,), read),
    ]
    updates = (counter, *others) if counter_first else (*others, counter)
    blocks = LinearBlocks(columns[:1], columns[1:4], columns[4:], rates, updates, {})
    m = assemble(blocks, [])
    assert m.period == pytest.approx(0.6)
    # from a counter of 0, and from one of 1 with nothing counted
    np.testing.assert_allclose(m.B[:, 0], [0.1 * (1 + 2 + 3 + 4 + 5 + 6), 6.0, *copies], rtol=1e-12)
    np.testing.assert_allclose(m.A[:, 1], [0.6, 1.0, 1.0, 1.0], rtol=1e-12)
