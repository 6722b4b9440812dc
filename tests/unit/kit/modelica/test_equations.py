"""Claims: what laws give, or stands in several places, is a variable; all else is written out."""

import casadi as ca

from fmus.kit.modelica.equations import Definition, define
from fmus.kit.modelica.expressions import apply, constant, symbol
from fmus.kit.symbolic import carry_out

x, y, z = (ca.SX.sym(name) for name in "xyz")


def equations(expressions, laws=None, types=None, taken=(), literal=False, intermediates=None):
    laws = laws or {}
    intermediates = intermediates or {}
    groups = (expressions, laws, intermediates)
    columns = ca.cse([ca.vertcat(ca.SX(0, 1), *group.values()) for group in groups])
    function = ca.Function("f", [x, y, z], [ca.densify(column) for column in columns])
    nodes, of_laws, of_others = carry_out(function, [[symbol(n)] for n in "xyz"], constant, apply)
    targets = [
        Definition(name, (types or {}).get(name, "real"), node)
        for name, node in zip(expressions, nodes, strict=True)
    ]
    named = dict(zip(of_laws, laws, strict=True))
    others = dict(zip(of_others, intermediates, strict=True))
    return define(targets, named, others, {"x", "y", "z", *taken}, literal)


def test_a_law_has_a_variable_even_where_it_stands_once():
    made = equations({"der(x)": x * y + 1.0}, {"product": x * y})
    assert made.lines == ["product = x * y;", "der(x) = product + 1.0;"]
    assert [(a.text, a.law) for a in made.auxiliaries] == [("product", "product")]


def test_a_law_that_nothing_calls_has_none():
    assert equations({"a": x + y}, {"other": x * z}).lines == ["a = x + y;"]


def test_what_stands_in_several_places_is_named_after_what_it_computes():
    made = equations(
        {"a": ca.sin(x + y), "b": ca.cos(x + y), "c": -x, "d": y * -x}, taken={"x_plus_y"}
    )
    assert made.lines == [
        "x_plus_y_2 = x + y;",
        "a = sin(x_plus_y_2);",
        "b = cos(x_plus_y_2);",
        "c = -x;",
        "d = -y * x;",
    ]


def test_what_a_law_calls_it_is_its_name():
    shared = x * y
    made = equations(
        {"a": ca.sin(shared + z), "b": ca.cos(shared + z), "c": shared / z},
        intermediates={"arm": shared, "unused": x / y, "lead": shared + z},
        taken={"lead"},
    )
    assert made.lines[:2] == ["arm = x * y;", "lead_2 = arm + z;"]
    assert [a.law for a in made.auxiliaries] == ["", ""]


def test_names_are_composed_of_what_has_a_name_and_stay_short():
    made = equations(
        {"a": ca.sin(3.0 * x - y), "b": ca.cos(3.0 * x - y), "c": x**2 * y, "d": x**2 / z}
    )
    assert [a.text for a in made.auxiliaries] == ["difference", "square_x"]


def test_a_variable_stands_for_its_expression():
    made = equations({"a": x + y, "b": 2.0 * (x + y), "c": x + y})
    assert made.lines == ["a = x + y;", "b = 2.0 * a;", "c = a;"]


def test_a_variable_of_another_type_does_not():
    """One of type Boolean keeps its value until the next event."""
    made = equations({"a": (x < y) * 1.0, "b": (x < y) * z}, types={"a": "boolean"})
    assert made.lines == ["a = x < y;", "b = (if x < y then 1.0 else 0.0) * z;"]
    made = equations({"a": x + y, "b": (x + y) * z}, types={"a": "boolean"})
    assert made.lines == ["x_plus_y = x + y;", "a = abs(x_plus_y) > 0.0;", "b = x_plus_y * z;"]


def test_the_derivative_of_a_variable_stands_for_nothing():
    made = equations({"der(x)": x + y, "b": x + y, "der(y)": x * y, "der(z)": x * y})
    assert made.lines == [
        "x_times_y = x * y;",
        "der(x) = b;",
        "b = x + y;",
        "der(y) = x_times_y;",
        "der(z) = x_times_y;",
    ]


def test_a_law_whose_name_is_taken_is_that_at_samples():
    made = equations({"a": ca.sin(x * y)}, {"product": x * y}, taken={"product"})
    assert made.lines == ["sampled_product = x * y;", "a = sin(sampled_product);"]


def test_operands_of_an_equality_stand_twice():
    made = equations({"a": ca.if_else(x + y == z, 1.0, 2.0)})
    assert made.lines == [
        "x_plus_y = x + y;",
        "a = if x_plus_y >= z and x_plus_y <= z then 1.0 else 2.0;",
    ]


def test_what_a_truth_is_made_of_is_shared():
    expression = ca.sin(x * y) < z
    made = equations({"a": expression * x, "b": expression * y})
    assert made.lines == [
        "sin_value = sin(x * y);",
        "a = (if sin_value < z then 1.0 else 0.0) * x;",
        "b = (if sin_value < z then 1.0 else 0.0) * y;",
    ]


def test_relations_within_a_real_may_be_no_events():
    expressions = {"a": ca.if_else(x < y, z, 1.0), "b": x < y, "c": x * y}
    made = equations(expressions, types={"b": "boolean"}, literal=True)
    assert made.lines == [
        "a = noEvent(if x < y then z else 1.0);",
        "b = x < y;",
        "c = x * y;",
    ]
