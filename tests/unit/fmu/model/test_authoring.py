"""Mistakes of authors: each is told with its file, its line, and what to write instead.

The line is looked for here in the text that was changed.
"""

from __future__ import annotations

import re

import pytest

from fmus.kit import UserError
from orchestration.cli.app import _message
from orchestration.fmu.model import find_class, load_class
from orchestration.fmu.model.authoring import line_of
from orchestration.fmu.model.loading import faulty_place, remarks_on

MODEL = '''import math

from fmus.kit import Component, Effect, Input, Output, Parameter, State, sqrt


class Tank(Component):
    """A tank."""

    name = "tank"
    area = Parameter(0.5, "m^2", min=1e-3, max=1e3, doc="cross section")
    conductance = Parameter(2e-3, "m^2/s", min=0, max=1, doc="flow per level")
    inflow = Input("m^3/s", doc="flow into the tank")
    level = State("m", rate="level_rate", start=1.0, min=0, output=True, doc="level")

    def pipe_flow(self):
        return self.conductance * self.level

    def level_rate(self):
        return (self.inflow - self.pipe_flow()) / self.area

    @Output("m^3/s")
    def outflow(self):
        """Flow out."""
        return self.pipe_flow()


class Leak(Effect):
    """A leak."""

    id = "leak"
    neutral = "leakage"
    leakage = Parameter(0.0, "m^2/s", min=0, max=1, doc="flow per level")

    def pipe_flow(self):
        return super().pipe_flow() + self.leakage * self.level


EFFECTS = {"leak": Leak}
'''
FLOW = "return self.conductance * self.level"
BRANCH = (
    "if self.level > 0.1:\n            return self.conductance * self.level\n        return 0.0"
)
# what is changed, to what, what stands on the line that is told, and the remedy
MISTAKES = {
    "an if on a signal": (
        FLOW,
        BRANCH,
        "if self.level",
        r"write where\(condition, yes, no\) for if",
    ),
    "a choice by if": (
        FLOW,
        "return self.conductance if self.level > 0 else 0.0",
        "if self.level",
        r"write where\(condition",
    ),
    "a function of math": (
        FLOW,
        "return self.conductance * math.exp(self.level)",
        "math.exp",
        r"from fmus\.kit import exp",
    ),
    "Python's max": (FLOW, "return max(self.level, 0.0)", "max(", r"maximum\(a, b\) for max"),
    "Python's and": (
        FLOW,
        "return self.area * (self.level > 0 and self.level < 1)",
        " and ",
        r"write logical_and\(a, b\) for a and b, of",
    ),
    "a typo in a variable": (
        "self.conductance *",
        "self.conductnce *",
        "self.conductnce",
        r"'conductnce' \(did you mean conductance\?\)",
    ),
    "a typo in a law": (
        "self.pipe_flow()) /",
        "self.pip_flow()) /",
        "self.pip_",
        r"mean pipe_flow\?",
    ),
    "no name": ('    name = "tank"\n', "", "class Tank", r'write name = "tank" into its body'),
    "a variable called like a law": (
        "def level_rate(self)",
        "def level(self)",
        "def level(self)",
        r"declared in line 13; .* such as level_law",
    ),
    "a variable called like what all have": (
        'inflow = Input("m',
        'time = Input("m',
        "time = Input",
        r"'time' has the name of something else .* another name",
    ),
    "a rate that is no law": (
        'rate="level_rate"',
        'rate="levl_rate"',
        "level = State",
        r"mean level_rate\?",
    ),
    "a law that is not called": (
        "self.pipe_flow()) /",
        "self.pipe_flow) /",
        "self.pipe_flow) /",
        r"write pipe_flow\(\)",
    ),
    "a variable that is called": (
        FLOW,
        "return self.conductance * self.level()",
        "self.level()",
        r"leave out the brackets",
    ),
    "a law that gives nothing": (FLOW, "self.level * 2", "self.pipe_flow()) /", r"lacks a return"),
    "a law without self": (
        "def pipe_flow(self):\n        return self.cond",
        "def pipe_flow():\n        return self.cond",
        "self.pipe_flow()) /",
        r"write self between the brackets",
    ),
    "a function that is not imported": (
        FLOW,
        "return self.conductance * tanh(self.level / 2.5)",
        "tanh(",
        r"write: from fmus\.kit import tanh",
    ),
    "a variable without self": (
        FLOW,
        "return conductance * self.level",
        "return conductance",
        r"write self\.conductance",
    ),
    "something kept in self": (
        FLOW,
        "self.old = self.level\n        return self.conductance * self.old",
        "self.old = ",
        r"declare it as a State or Discrete",
    ),
    "an argument that there is not": (
        "min=1e-3, max=1e3",
        "minimum=1e-3, max=1e3",
        "minimum",
        r"takes no argument 'minimum' \(did you mean min\?\)",
    ),
    "a unit that there is not": ('"m^2"', '"square"', '"square"', r"area: unknown unit 'square'"),
    "a unit that does not fit": (
        '"m^2/s", min=0, max=1, doc="flow per level")\n    inflow',
        '"m^3/s", min=0, max=1, doc="flow per level")\n    inflow',
        "self.pipe_flow()) /",
        r"pipe_flow\(\) gives m\^4/s",
    ),
    "a unit of an effect that does not fit": (
        'leakage = Parameter(0.0, "m^2/s"',
        'leakage = Parameter(0.0, "m^3/s"',
        "super().pipe_flow() +",
        r"leakage is declared in m\^3/s",
    ),
    "a typo in an effect": (
        "self.leakage *",
        "self.leak *",
        "self.leak *",
        r"'leak' \(did you mean leakage\?\)",
    ),
}


@pytest.fixture
def written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(before="", after=""):
        assert before in MODEL
        text = MODEL.replace(before, after, 1) if before else MODEL
        (tmp_path / "own.py").write_text(text)
        return text

    return write


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_with_line_and_remedy(written, mistake):
    before, after, on_line, remedy = MISTAKES[mistake]
    lines = written(before, after).split("\n")
    expected = [k for k, line in enumerate(lines, 1) if on_line in line]
    with pytest.raises(UserError) as caught:
        find_class("own.py:Tank")
    told = _message(caught.value)
    line = re.match(r"own\.py, line (\d+): ", told)
    assert line, told
    assert int(line[1]) in expected, told
    assert re.search(remedy, told), told
    assert "internal error" not in told


def test_a_model_without_mistakes_is_loaded(written):
    written()
    assert find_class("own.py:Tank", ["leak"]).name == "tank_with_leak"
    assert remarks_on("own.py:Tank") == ()


def test_a_law_inside_an_output_and_an_output_inside_a_law_are_remarked(written):
    written("return self.pipe_flow()\n\n\nclass", "return self.conductance * self.level\n\n\nclass")
    (remark,) = remarks_on("own.py:Tank")
    assert remark.startswith("own.py, line 22: outflow computes a law inside an output")
    assert "return self.true_outflow()" in remark
    written("self.pipe_flow()) /", "self.outflow()) /")
    (remark,) = remarks_on("own.py:Tank")
    assert remark.startswith("own.py, line 18: level_rate calls the output outflow")
    assert find_class("own.py:Tank")


def test_an_effect_is_no_model_and_says_over_what_it_goes(written):
    written()
    with pytest.raises(UserError, match=r"own\.py, line 27: Leak is an effect .* own\.py:Tank"):
        load_class("own.py:Leak")


def test_what_fails_later_in_a_users_file_is_no_internal_error(written):
    written("self.pipe_flow()\n\n\nclass", "self.pipe_flow() + {}[0]\n\n\nclass")
    with pytest.raises(UserError, match=r"own\.py, line 24: in outflow .*KeyError: 0"):
        find_class("own.py:Tank")
    written(
        "self.pipe_flow()\n\n\nclass", "self.pipe_flow() / (self.inflow / self.inflow)\n\n\nclass"
    )
    cls = find_class("own.py:Tank")
    with pytest.raises(ZeroDivisionError) as caught:
        cls().outflow()
    assert faulty_place(caught.value).endswith("own.py, line 24, in outflow")
    assert _message(caught.value).endswith("in outflow: ZeroDivisionError: float division by zero")
    assert faulty_place(ZeroDivisionError()) == ""


def test_a_line_is_that_of_a_variable_or_of_its_class():
    assert line_of(MODEL.encode(), "Tank", "inflow") == 12
    assert line_of(MODEL.encode(), "Tank", "level_start") == 6
    assert line_of(MODEL.encode(), "Tanc") is None


def test_properties_with_a_setter_are_one_name(written):
    written(
        "    def pipe_flow(self):\n        return self.cond",
        "    @property\n    def size(self):\n        return 1.0\n\n    @size.setter\n"
        "    def size(self, value):\n        pass\n\n"
        "    def pipe_flow(self):\n        return self.cond",
    )
    assert load_class("own.py:Tank")
