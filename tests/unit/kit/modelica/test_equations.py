"""Claims: what laws give, or stands in several places, is a variable; all else is written out."""

import casadi as ca

from fmus.kit.modelica.equations import Target, define
from fmus.kit.modelica.expressions import apply, constant, symbol
from fmus.kit.symbolic import carry_out

x, y, z = (ca.SX.sym(name) for name in "xyz")


def equations(expressions, laws=None, types=None, taken=(), literal=False):
    laws = laws or {}
    columns = ca.cse([ca.vertcat(*expressions.values()), ca.vertcat(ca.SX(0, 1), *laws.values())])
    function = ca.Function("f", [x, y, z], [ca.densify(column) for column in columns])
    nodes, of_laws = carry_out(function, [[symbol(n)] for n in "xyz"], constant, apply)
    targets = [
        Target(name, (types or {}).get(name, "real"), node)
        for name, node in zip(expressions, nodes, strict=True)
    ]
    named = dict(zip(of_laws, laws, strict=True))
    return define(targets, named, {"x", "y", "z", *taken}, literal)


def test_a_law_has_a_variable_even_where_it_stands_once():
    made = equations({"der(x)": x * y + 1.0}, {"product": x * y})
    assert made.lines == ["product = x * y;", "der(x) = product + 1.0;"]
    assert [(a.name, a.law) for a in made.auxiliaries] == [("product", "product")]


def test_a_law_that_nothing_calls_has_none():
    assert equations({"a": x + y}, {"other": x * z}).lines == ["a = x + y;"]


def test_what_stands_in_several_places_has_a_number():
    made = equations(
        {"a": ca.sin(x + y), "b": ca.cos(x + y), "c": -x, "d": y * -x}, taken={"term_1"}
    )
    assert made.lines == [
        "term_2 = x + y;",
        "a = sin(term_2);",
        "b = cos(term_2);",
        "c = -x;",
        "d = -y * x;",
    ]


def test_a_variable_stands_for_its_expression():
    made = equations({"a": x + y, "b": 2.0 * (x + y), "c": x + y})
    assert made.lines == ["a = x + y;", "b = 2.0 * a;", "c = a;"]


def test_a_variable_of_another_type_does_not():
    """One of type Boolean keeps its value until the next event."""
    made = equations({"a": (x < y) * 1.0, "b": (x < y) * z}, types={"a": "boolean"})
    assert made.lines == ["a = x < y;", "b = (if x < y then 1.0 else 0.0) * z;"]
    made = equations({"a": x + y, "b": (x + y) * z}, types={"a": "boolean"})
    assert made.lines == ["term_1 = x + y;", "a = abs(term_1) > 0.0;", "b = term_1 * z;"]


def test_the_derivative_of_a_variable_stands_for_nothing():
    made = equations({"der(x)": x + y, "b": x + y, "der(y)": x * y, "der(z)": x * y})
    assert made.lines == [
        "term_1 = x * y;",
        "der(x) = b;",
        "b = x + y;",
        "der(y) = term_1;",
        "der(z) = term_1;",
    ]


def test_a_law_whose_name_is_taken_is_that_at_samples():
    made = equations({"a": ca.sin(x * y)}, {"product": x * y}, taken={"product"})
    assert made.lines == ["sampled_product = x * y;", "a = sin(sampled_product);"]


def test_operands_of_an_equality_stand_twice():
    made = equations({"a": ca.if_else(x + y == z, 1.0, 2.0)})
    assert made.lines == [
        "term_1 = x + y;",
        "a = if term_1 >= z and term_1 <= z then 1.0 else 2.0;",
    ]


def test_what_a_truth_is_made_of_is_shared():
    expression = ca.sin(x * y) < z
    made = equations({"a": expression * x, "b": expression * y})
    assert made.lines == [
        "term_1 = sin(x * y);",
        "a = (if term_1 < z then 1.0 else 0.0) * x;",
        "b = (if term_1 < z then 1.0 else 0.0) * y;",
    ]


def test_relations_within_a_real_may_be_no_events():
    expressions = {"a": ca.if_else(x < y, z, 1.0), "b": x < y, "c": x * y}
    made = equations(expressions, types={"b": "boolean"}, literal=True)
    assert made.lines == [
        "a = noEvent(if x < y then z else 1.0);",
        "b = x < y;",
        "c = x * y;",
    ]
