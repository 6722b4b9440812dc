"""Claims: the instructions of a function give its values, and what is shared is computed once."""

import casadi as ca
import pytest

from fmus.kit.symbolic.instructions import apply_to_symbols, carry_out

x = ca.SX.sym("x", 2)
p = ca.SX.sym("p")
SHARED = ca.exp(p) * x[1]
FUNCTION = ca.Function("f", [x, p], ca.cse([ca.vertcat(SHARED, x[0]), SHARED - 2.5, ca.SX(1, 2)]))


def test_values_of_expressions_are_those_of_the_function():
    results = carry_out(FUNCTION, [x.nz, p.nz], ca.SX, apply_to_symbols)
    again = ca.Function("g", [x, p], [ca.vertcat(*elements) for elements in results[:2]])
    for own, wanted in zip(again([0.3, 0.7], 1.1), FUNCTION([0.3, 0.7], 1.1), strict=False):
        assert own.full() == pytest.approx(wanted.full(), rel=1e-15)


def test_elements_that_are_zero_by_structure_are_left_out():
    assert carry_out(FUNCTION, [x.nz, p.nz], ca.SX, apply_to_symbols)[2] == []


def test_what_is_shared_is_one_object():
    seen = []

    def apply(operation, operands):
        seen.append(operation)
        return (operation, *operands)

    results = carry_out(FUNCTION, [("x0", "x1"), ("p",)], float, apply)
    assert sorted(seen) == sorted([ca.OP_EXP, ca.OP_MUL, ca.OP_SUB])
    assert results[1][0][1] is results[0][0]
    assert results[0] == [(ca.OP_MUL, (ca.OP_EXP, "p"), "x1"), "x0"]
