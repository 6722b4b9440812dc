"""Claims: formulas of shapes are read as they compute, and typeset as well-formed MathML of the
same structure.
"""

from __future__ import annotations

from math import exp, sqrt, tanh
from xml.etree import ElementTree

import pytest

from fmus.kit.curves import SHAPES
from fmus.kit.errors import UserError
from orchestration.discrepancy.report.laws.formula import (
    Node,
    parse_formula,
    typeset,
    typeset_equation,
)

CALLED = {
    "tanh": tanh,
    "exp": exp,
    "sqrt": sqrt,
    "max": max,
    "min": min,
    "sign": lambda x: (x > 0) - (x < 0),
    "clip": lambda x, low, high: min(max(x, low), high),
}
POINTS = (-2.3, -0.6, 0.7, 1.9)


def value(node: Node, of: dict[str, float]) -> float:
    """An interpreter of its own, to hold the tree against what the kit computes."""
    if node.kind in ("symbol", "number"):
        return of[node.text] if node.kind == "symbol" else float(node.text)
    parts = [value(part, of) for part in node.parts]
    if node.kind == "product":
        result = 1.0
        for part in parts:
            result *= part
        return result
    return {
        "sum": lambda: sum(parts),
        "minus": lambda: -parts[0],
        "quotient": lambda: parts[0] / parts[1],
        "power": lambda: parts[0] ** parts[1],
        "bars": lambda: abs(parts[0]),
        "group": lambda: parts[0],
        "call": lambda: CALLED[node.text](*parts),
    }[node.kind]()


@pytest.mark.parametrize("shape", SHAPES)
def test_a_formula_is_read_as_the_kit_computes_it(shape):
    """The oracle is the shape itself, away from where it is rounded off."""
    read = parse_formula(SHAPES[shape].text)
    rounded = "smooth" in read.remark
    for x in POINTS:
        of = {"x": x, "a": 1.7, "w": 0.6 if not rounded else 1.2, "n": 1.3}
        known = 1.7 * float(SHAPES[shape].form(x, of["w"], 1.3))
        begins = True
        if read.sides:
            left, right = read.sides
            if read.word == "with":
                of[left.text] = value(right, of)
            else:
                begins = value(left, of) > value(right, of)
        said = value(read.value, of) if begins else 0.0
        assert said == pytest.approx(
            known, rel=1e-2 if rounded else 1e-5, abs=1e-2 if rounded else 1e-12
        )


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", ["add", "multiply"])
def test_every_shape_is_well_formed(shape, kind):
    root = ElementTree.fromstring(typeset_equation("friction", "omega", kind, SHAPES[shape].text))
    assert root.tag == "math"
    text = "".join(root.itertext())
    assert text.startswith("friction=frictionmodel")
    assert text.count("(") == text.count(")")
    assert "ω" in text  # the signal, and no x any more
    assert "x" not in [one.text for one in root.iter("mi")]
    for tag, parts in (("mfrac", 2), ("msup", 2), ("msub", 2), ("msqrt", 1)):
        assert all(len(one) == parts for one in root.iter(tag))


@pytest.mark.parametrize(
    ("text", "tags"),
    [
        ("a x^2", {"msup": 1}),
        ("a x |x|", {"msup": 0, "mfrac": 0}),
        ("a tanh(x / w), w small", {"mfrac": 0}),
        ("a x / sqrt(|x| / n)", {"mfrac": 2, "msqrt": 1}),
        ("a sign(x) exp(-(x / w)^2), smooth", {"mfrac": 0, "msup": 1}),
    ],
)
def test_structures_are_typeset_as_such(text, tags):
    root = ElementTree.fromstring(f"<math>{typeset(parse_formula(text).value)}</math>")
    assert {tag: len(list(root.iter(tag))) for tag in tags} == tags


def test_a_quotient_has_all_that_stands_before_it_above():
    root = ElementTree.fromstring(
        f"<math>{typeset(parse_formula('a x / sqrt(|x| / n)').value)}</math>"
    )
    above, below = next(root.iter("mfrac"))
    assert "".join(above.itertext()) == "a⋅x"
    assert below.find(".//msqrt") is not None


def test_a_curve_is_f_of_the_signal_and_what_is_remembered_is_x():
    assert (
        "".join(ElementTree.fromstring(typeset_equation("drop", "current")).itertext())
        == "drop=dropmodel+f⁡(current)"
    )
    text = "".join(
        ElementTree.fromstring(
            typeset_equation("drop", "current", "multiply", "a x", True)
        ).itertext()
    )
    assert text == "drop=dropmodel⋅(1+a⋅x)"


def test_names_are_no_markup():
    assert "<b>" not in typeset_equation("drop", "<b>", "add", "a x")


@pytest.mark.parametrize("text", ["a (x", "a x)", "a |x", "a + ", "a ? x", "a tanh(x, "])
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(UserError, match="is no formula"):
        parse_formula(text)
