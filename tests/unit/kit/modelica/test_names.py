"""Claims: what is written are identifiers, numbers and strings of Modelica 3.6, chapter 2."""

import math

import pytest
import rumoca

from fmus.kit import UserError
from fmus.kit.modelica.names import class_name, comment, identifier, real, string


def test_a_reserved_or_taken_name_gets_an_underscore():
    assert identifier("flow") == "flow_"
    assert identifier("abs") == "abs_"
    assert identifier("current") == "current"
    assert identifier("current", {"current", "current_"}) == "current__"


def test_classes_have_capitals():
    assert class_name("ppy_actuator_length_driven") == "PpyActuatorLengthDriven"
    assert class_name("pid") == "Pid"
    assert class_name("interfaces") == "Interfaces_"


@pytest.mark.parametrize("value", [0.0, -1.5, 1e-300, 6.8e-5, 123456789.0, 0.1 + 0.2, 1e22])
def test_a_number_is_read_as_the_same(value):
    text = f"model M parameter Real p = {real(value)}; Real x = p; end M;"
    assert rumoca.Session().loads(text, model="M").parameters["p"].value == value


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(UserError, match=r"^Modelica has no number for (-?inf|nan)$"):
        real(value)


def test_strings_are_escaped_and_comments_lose_the_marks_of_docstrings():
    assert string('a "b" \\ c') == r'"a \"b\" \\ c"'
    assert comment("``x`` of y") == ' "x of y"'
    assert comment("") == ""
