"""Claims: written expressions mean what the graph computes, as another reader of the language
says.
"""

import itertools
import math

import casadi as ca
import pytest
import rumoca

import fmus.kit as kit
from fmus.kit import UserError
from fmus.kit.modelica.expressions import Writer, apply, constant, symbol
from fmus.kit.modelica.functions import function_classes
from fmus.kit.symbolic import carry_out

a, b, c = (ca.SX.sym(name) for name in "abc")
VALUES = [0.0, 1.0, -0.7, 2.3]
SUMS = {
    "left to right": a - b - c,
    "right to left": a - (b - c),
    "sum of a sum": a + (b + c),
    "quotients": (a + 3.0) / ((b + 4.0) / (c + 5.0)),
    "product of a sum": a * (b + c) * c,
    "sign": -(a * b) - (-c),
    "sign of a factor": a * -(b + c),
    "square": (a + b) ** 2 + a * a,
    "power": (a * a + 1.0) ** (b - 0.5),
    "negative power": (a * a + 1.0) ** -1.5,
    "twice": 2.0 * (a + b),
    "inverse": 1.0 / (a * a + 0.3),
    "functions": ca.exp(a) * ca.sin(b) + ca.cos(c) + ca.tanh(a) + ca.sqrt(b * b + 1.0),
    "more functions": ca.log(a * a + 1.0) + ca.acos(ca.tanh(b)) + ca.atan2(b, 2.0 + c * c),
    "rounding": ca.floor(1.7 * a) + ca.fabs(b) + ca.sign(c),
    "limits": kit.clip(a, b - 1.0, 1.0) + ca.hypot(a, b),
    "choice": ca.if_else(a < b, a, ca.if_else(b <= c, b * b, 5.0)),
    "choice in a choice": ca.if_else(a < b, ca.if_else(b < c, 1.0, 2.0), 3.0) * 2.0,
    "choice of nothing": ca.if_else(a < b, a, 0.0) - ca.if_else(ca.logic_not(a < b), c, 0.0),
    "truth as a number": (a < b) * c + ca.if_else(ca.logic_and(a < b, b < c), 1.0, 0.0),
    "number as a truth": ca.if_else(a, b, c) + ca.if_else(ca.logic_not(c), 3.0, 4.0),
    "equality": ca.if_else(a == b, 1.0, 2.0) + ca.if_else(ca.logic_or(b != c, a < c), 5.0, 6.0),
    "equality of truths": ca.if_else((a < b) == (b < c), 1.0, 2.0)
    + ca.if_else((a < b) != (b < c), 3.0, 5.0),
}


def written(expression, type="real"):
    function = ca.Function("f", [a, b, c], ca.cse([expression]))
    arguments = [[symbol(name)] for name in "abc"]
    ((node,),) = carry_out(function, arguments, constant, apply)
    return Writer({}).define(node, "y", type)


def package():
    return "\n".join(["package Functions", *function_classes().values(), "end Functions;"])


@pytest.fixture(scope="module")
def read():
    """Values of all expressions, by another compiler, at each point."""
    points = list(itertools.product(VALUES, repeat=3))
    lines = ["model M", "Real a; Real b; Real c;"]
    lines += [f"Real y{k};" for k in range(len(SUMS))]
    lines.append("equation")
    for place, name in enumerate("abc"):
        course = repr(points[-1][place])
        for k in reversed(range(len(points) - 1)):
            course = f"if time < {k + 0.5} then {points[k][place]!r} else {course}"
        lines.append(f"{name} = {course};")
    lines += [f"y{k} = {written(expression)};" for k, expression in enumerate(SUMS.values())]
    text = "\n".join([package(), *lines, "end M;"])
    result = rumoca.Session().loads(text, model="M").simulate(t=(0.0, len(points) - 1.0), dt=1.0)
    times = list(result.time)
    places = [next(i for i, t in enumerate(times) if abs(t - k) < 1e-9) for k in range(len(points))]
    columns = {name: result[f"y{k}"] for k, name in enumerate(SUMS)}
    return points, {name: [column[i] for i in places] for name, column in columns.items()}


@pytest.mark.parametrize("name", SUMS)
def test_another_compiler_computes_the_same(name, read):
    points, columns = read
    function = ca.Function("f", [a, b, c], [SUMS[name]])
    for point, value in zip(points, columns[name], strict=True):
        assert value == pytest.approx(float(function(*point)), rel=1e-12, abs=1e-12), point


def test_brackets_stand_only_where_they_are_needed():
    assert written(a - b - c) == "a - b - c"
    assert written(a * b + c / (a + b)) == "a * b + c / (a + b)"
    assert written(ca.if_else(a < b, a, ca.if_else(b < c, b, c))) == (
        "if a < b then a else if b < c then b else c"
    )


def test_types_are_converted():
    assert written(a < b, "boolean") == "a < b"
    assert written(a, "boolean") == "abs(a) > 0.0"
    assert written(ca.SX(1.0), "boolean") == "true"
    assert written(a < b) == "if a < b then 1.0 else 0.0"
    assert written(a + 1.0, "integer") == "integer(a + 1.0 + 0.5)"


def test_a_function_that_modelica_has_not_is_named():
    with pytest.raises(UserError, match=r"^a law calls erf, which Modelica does not have$"):
        written(ca.erf(a))


def test_a_number_that_modelica_has_not_is_refused():
    with pytest.raises(UserError, match="no number for inf"):
        written(a + math.inf)
