"""Claims: values within laws have the names of local variables, or of functions."""

import sys

from fmus.kit import Component, Input, Output
from fmus.kit.symbolic import trace
from fmus.kit.symbolic.intermediates import recorded_intermediates


def hypotenuse(first, second):
    total = first * first + second * second
    return total**0.5


class Triangle(Component):
    """A triangle with a right angle."""

    name = "triangle"
    a = Input("m")
    b = Input("m")

    @Output("m")
    def perimeter(self):
        """Sum of the sides."""
        _legs = self.a + self.b
        return _legs + hypotenuse(self.a, self.b)


def test_names_of_variables_come_before_those_of_functions():
    with recorded_intermediates() as found:
        graph = trace(Triangle)
    texts = {name: str(value) for name, value in found}
    assert texts == {
        "total": "(sq(a)+sq(b))",
        "legs": "(a+b)",
        "hypotenuse": "sqrt((sq(a)+sq(b)))",
        "perimeter": str(graph.outputs[0]),
    }
    assert [name for name, _ in found] == ["total", "legs", "hypotenuse", "perimeter"]


def test_a_profiler_that_was_there_is_there_again():
    calls = []
    sys.setprofile(lambda *event: calls.append(event))
    mine = sys.getprofile()
    try:
        with recorded_intermediates():
            pass
        assert sys.getprofile() is mine
    finally:
        sys.setprofile(None)
