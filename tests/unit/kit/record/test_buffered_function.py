"""A function with the same memory in every call returns what the function does; oracle: NumPy."""

import casadi as ca
import numpy as np
import pytest

from fmus.kit.record.buffered_function import BufferedFunction


def test_arguments_are_read_where_they_are_column_by_column():
    a, x = ca.SX.sym("a", 2, 3), ca.SX.sym("x", 3)
    matrix, vector = np.asfortranarray(np.arange(6.0).reshape(2, 3)), np.ones(3)
    product = BufferedFunction(
        ca.Function("product", [a, x], [ca.densify(a @ x)]),
        [
            matrix.ravel(order="K"),
            vector,
        ],
    )
    assert product() == pytest.approx(matrix @ np.ones(3))
    vector[:] = [1.0, -2.0, 4.0]
    assert product() == pytest.approx(matrix @ vector)


def test_a_result_is_overwritten_by_the_next_call():
    x, at = ca.SX.sym("x"), np.array([2.0])
    square = BufferedFunction(ca.Function("square", [x], [x * x]), [at])
    first = square()
    at[0] = 3.0
    square()
    assert first == pytest.approx([9.0])
