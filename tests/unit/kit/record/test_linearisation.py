"""Claims: a ladder is made where it costs less, and its matrix functions are exact.

Oracle: the exponential of an augmented matrix, and eigenvalues by hand.
"""

import numpy as np
from scipy.linalg import expm

from fmus.kit.record import linearisation
from fmus.ppy_actuator.model import PpyActuator
from tests.support.stiff_drive import STEP, Nonlinear, ladder_of


def test_the_integrator_is_chosen_by_the_eigenvalues_and_the_clock():
    even = STEP * np.arange(100)
    fastest = 3.0 / 1e-3
    assert ladder_of(even).affine
    assert ladder_of(even, linear=True).affine
    assert ladder_of(0.5 * even, Nonlinear) is None  # Runge and Kutta take 75 time constants sooner
    assert not ladder_of(even, Nonlinear).affine
    assert ladder_of(even * 1.0 / (fastest * STEP)) is None
    uneven = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 100)) * 30.0 / fastest
    assert ladder_of(uneven) is None  # each sample would be made of several steps
    assert ladder_of(10.0 * uneven) is not None
    assert ladder_of(0.1 * np.arange(100), PpyActuator, inputs=2) is None
    assert ladder_of(np.array([0.0, 1.0, 1.0])) is None  # refused by the simulation, in its words


def test_matrix_functions_are_those_of_higher_precision():
    """phi_k as integrals, in the top right of the exponential of an augmented matrix (Saad)."""
    ladder = ladder_of(STEP * np.arange(10), sensitivities=("R", "L", "m"))
    jacobian, *derivatives = ladder.matrix
    n = len(jacobian)
    for block, derivative in enumerate(derivatives, 1):
        matrix = np.block([[jacobian, np.zeros((n, n))], [derivative, jacobian]])
        for level in (0, 3, ladder.levels):
            h = ladder.largest / 2**level
            for order in (1, 2, 3):
                exact = _phi(h * matrix, order)
                for i, rows in ((0, exact[:n, :n]), (block, exact[n:, :n])):
                    np.testing.assert_allclose(
                        ladder.phi[level, order - 1, i],
                        rows,
                        rtol=1e-9,
                        atol=1e-11 * np.abs(rows).max(),
                    )


def _phi(z, order):
    """phi_k of any matrix."""
    n = len(z)
    augmented = np.zeros((n * (order + 1),) * 2)
    augmented[:n, :n] = z
    for k in range(order):
        augmented[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    return expm(augmented)[:n, -n:]


def test_what_grows_without_bounds_is_infinite_and_no_warning():
    doublings = 19
    functions = linearisation._phi(np.full((1, 1, 1), 2.0**-7), doublings)
    z = 2.0 ** (np.arange(doublings, -1.0, -1.0) - 7.0)
    finite = z < 700.0
    first = functions[:, 0, 0, 0, 0]
    assert not np.isfinite(first[~finite]).any()
    np.testing.assert_allclose(first[finite], np.expm1(z[finite]) / z[finite], rtol=1e-10)
