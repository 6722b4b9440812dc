"""Claims: a step is exact whatever A is, and the response is that of a linear system.

Oracles: `scipy.linalg.expm` of augmented matrices, `scipy.signal.lsim`, `solve_ivp` of an A that
varies, and solutions on paper.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import lsim

from fmus.kit import UserError
from orchestration.discrepancy.candidates.linear_response import StepMatrices

RNG = np.random.default_rng(5)
RESONATOR = np.array([[0.0, 1.0], [-9.0, 0.0]])
STIFF = np.array([[-1e4, 30.0, 1.0], [2.0, -1.0, 0.0], [0.0, 4.0, -300.0]])
DEFECTIVE = np.array([[-1.0, 1.0], [0.0, -1.0]])
DOUBLE_INTEGRATOR = np.array([[0.0, 1.0], [0.0, 0.0]])
UNSTABLE = np.array([[0.4, 1.0], [0.0, -2.0]])
MATRICES = [RESONATOR, STIFF, DEFECTIVE, DOUBLE_INTEGRATOR, UNSTABLE, np.array([[-3.0]])]
IDS = ["resonator", "stiff", "defective", "double integrator", "unstable", "one state"]
EVEN = 0.1 * np.arange(40)
UNEVEN = np.cumsum(RNG.uniform(0.01, 0.3, 40))


def repeated(a, n):
    return np.broadcast_to(a, (n, *a.shape))


def by_exponentials(a, begin, end, steps):
    """Step by step: S' = A S + w0 + t r as one autonomous system of S, w and r."""
    m = a.shape[-1]
    count = begin.shape[-1]
    states = np.zeros_like(begin)
    for i, h in enumerate(steps):
        whole = np.zeros((3 * m, 3 * m))
        whole[:m, :m] = a[i]
        whole[:m, m : 2 * m] = np.eye(m)
        whole[m : 2 * m, 2 * m :] = np.eye(m)
        moved = expm(whole * h)
        for k in range(count):
            slope = (end[i, :, k] - begin[i, :, k]) / h
            states[i + 1, :, k] = (moved @ np.hstack([states[i, :, k], begin[i, :, k], slope]))[:m]
    return states


@pytest.mark.parametrize("time", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("a", MATRICES, ids=IDS)
def test_a_response_to_lines_that_jump_at_samples_is_exact(a, time):
    n = len(time)
    steps = np.diff(time)
    begin, end = RNG.standard_normal((2, n, len(a), 3))
    expected = by_exponentials(repeated(a, n), begin, end, steps)
    found = StepMatrices(repeated(a, n), repeated(a, n), steps).response(begin, end)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("a", MATRICES, ids=IDS)
def test_matrices_of_a_step_are_the_exponential_and_its_integrals(a):
    """Of the forcing [I h; 0], read off one exponential of a block matrix (Van Loan)."""
    m = len(a)
    h = 0.07
    steps = np.array([h, 2.0 * h])
    matrices = StepMatrices(repeated(a, 3), repeated(a, 3), steps)
    for i, step in enumerate(steps):
        block = np.zeros((3 * m, 3 * m))
        block[:m, :m] = a
        block[:m, m : 2 * m] = block[m : 2 * m, 2 * m :] = np.eye(m)
        expected = expm(block * step)
        found = matrices.transition[i], matrices.first[i], step * matrices.second[i]
        for one, k in zip(found, range(3), strict=True):
            assert one == pytest.approx(expected[:m, k * m : (k + 1) * m], rel=1e-9, abs=1e-14)


def test_a_continuous_forcing_gives_what_lsim_gives():
    system = RESONATOR, np.eye(2), np.eye(2), np.zeros((2, 2))
    u = RNG.standard_normal((EVEN.size, 2))
    _, _, expected = lsim(system, u, EVEN)
    begin = u[:, :, np.newaxis]
    end = np.vstack([begin[1:], begin[-1:]])
    matrices = StepMatrices(repeated(RESONATOR, 40), repeated(RESONATOR, 40), np.diff(EVEN))
    assert matrices.response(begin, end)[:, :, 0] == pytest.approx(expected, abs=1e-11)


def test_states_that_grow_beyond_every_number_in_a_step_are_refused():
    """Growth by exp(700) is a number yet, and by exp(800) none; decay by that much is nothing."""
    steps = np.array([0.1, 0.1])

    def along(rate):
        return StepMatrices(np.full((3, 1, 1), rate), np.full((3, 1, 1), rate), steps)

    assert along(7e3).transition[0, 0, 0] == pytest.approx(np.exp(700.0), rel=1e-9)
    assert along(-8e3).transition[0, 0, 0] == pytest.approx(0.0, abs=1e-300)
    with pytest.raises(UserError, match="too unstable along its simulation"):
        along(8e3)


@pytest.mark.parametrize("time", [EVEN, UNEVEN - UNEVEN[0]], ids=["even", "uneven"])
def test_solutions_on_paper(time):
    """A resonator and a double integrator under constant forcing and a ramp, from rest."""
    n = time.size
    steps = np.diff(time)
    constant = np.zeros((n, 2, 1))
    constant[:, 1] = 2.0
    pushed = StepMatrices(repeated(RESONATOR, n), repeated(RESONATOR, n), steps)
    found = pushed.response(constant, constant)[:, :, 0]
    assert found[:, 0] == pytest.approx(2.0 * (1.0 - np.cos(3.0 * time)) / 9.0, abs=1e-12)
    assert found[:, 1] == pytest.approx(2.0 * np.sin(3.0 * time) / 3.0, abs=1e-12)
    ramp = np.zeros((n, 2, 1))
    ramp[:, 1, 0] = time
    end = np.vstack([ramp[1:], ramp[-1:]])
    thrown = StepMatrices(repeated(DOUBLE_INTEGRATOR, n), repeated(DOUBLE_INTEGRATOR, n), steps)
    found = thrown.response(ramp, end)[:, :, 0]
    assert found[:, 0] == pytest.approx(time**3 / 6.0, rel=1e-12)
    assert found[:, 1] == pytest.approx(time**2 / 2.0, rel=1e-12)


def varying(n):
    """A spring that stiffens and damping that comes and goes, over two seconds."""
    time = np.linspace(0.0, 2.0, n)
    a = np.zeros((n, 2, 2))
    a[:, 0, 1] = 1.0
    a[:, 1, 0] = -4.0 - 3.0 * time
    a[:, 1, 1] = -np.cos(2.0 * time)
    return time, a


def test_a_matrix_that_varies_has_its_mean_within_every_step():
    time, a = varying(60)
    end = np.vstack([a[1:], np.full((1, 2, 2), np.nan)])
    begin, forcing_end = RNG.standard_normal((2, 60, 2, 2))
    expected = by_exponentials(0.5 * (a + end), begin, forcing_end, np.diff(time))
    found = StepMatrices(a, end, np.diff(time)).response(begin, forcing_end)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_a_matrix_that_varies_is_followed_to_second_order():
    def rate(t, s):
        a = np.array([[0.0, 1.0], [-4.0 - 3.0 * t, -np.cos(2.0 * t)]])
        return a @ s + np.array([np.sin(5.0 * t), 1.0 - t])

    errors = []
    for n in (41, 81):
        time, a = varying(n)
        w = np.stack([np.sin(5.0 * time), 1.0 - time], axis=1)[:, :, np.newaxis]
        found = StepMatrices(a, np.vstack([a[1:], a[-1:]]), np.diff(time)).response(
            w, np.vstack([w[1:], w[-1:]])
        )
        exact = solve_ivp(rate, (0.0, 2.0), [0.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y.T
        errors.append(np.abs(found[:, :, 0] - exact).max())
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_slightly_different_steps_are_not_taken_for_the_same():
    steps = np.full(30, 0.1)
    steps[7] = 0.1 * (1.0 + 1e-6)
    a = repeated(np.array([[-2.0]]), 31)
    found = StepMatrices(a, a, steps).transition[:, 0, 0]
    assert found == pytest.approx(np.exp(-2.0 * steps), rel=1e-12)


def test_a_stiff_part_follows_at_once():
    """A pole of 1 microsecond: the state is the forcing over the pole, in steps of a second."""
    a = repeated(np.array([[-1e6]]), 5)
    w = RNG.standard_normal((5, 1, 1))
    found = StepMatrices(a, a, np.ones(4)).response(w, w)
    assert found[1:] == pytest.approx(w[:-1] / 1e6, rel=1e-9)
    assert found[0] == 0.0


def test_no_states_and_no_steps():
    empty = np.zeros((4, 0, 0))
    assert StepMatrices(empty, empty, np.ones(3)).response(
        np.zeros((4, 0, 2)), np.zeros((4, 0, 2))
    ).shape == (4, 0, 2)
    single = np.full((1, 2, 2), -1.0)
    one = StepMatrices(single, single, np.empty(0))
    assert not one.response(np.ones((1, 2, 3)), np.ones((1, 2, 3))).any()


def test_the_last_forcing_is_of_no_step():
    a = repeated(UNSTABLE, 10)
    begin, end = RNG.standard_normal((2, 10, 2, 1))
    matrices = StepMatrices(a, a, np.full(9, 0.1))
    before = matrices.response(begin, end)
    begin[-1], end[-1] = np.nan, np.nan
    assert np.array_equal(matrices.response(begin, end), before)
