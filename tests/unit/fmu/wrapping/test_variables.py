"""Claims: variables have the sizes and start values that their description states, or are refused.

Oracles: the descriptions, which are written by hand.
"""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from fmus.kit import UserError
from orchestration.fmu.wrapping import element_names, translate
from tests.support.fmi3_fmus import description


def test_sizes_are_those_of_structural_parameters():
    declared = translate(ElementTree.fromstring(description("arrays")), "a.fmu").declared
    assert {name: variable.shape for name, variable in declared.items()} == {
        "time": (),
        "n": (),
        "A": (3, 3),
        "B": (3, 2),
        "C": (2, 3),
        "u": (2,),
        "x": (3,),
        "der(x)": (3,),
        "y": (2,),
    }
    assert declared["der(x)"].elements == ("der(x[1])", "der(x[2])", "der(x[3])")


def test_elements_are_named_in_row_major_order():
    assert list(element_names("A", (2, 2))) == ["A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]"]
    assert list(element_names("k", ())) == ["k"]


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("arrays", '<Dimension start="2"/>', '<Dimension start="-2"/>', "B: the size '-2' is no"),
        ("arrays", '<Dimension start="2"/>', '<Dimension start="900000"/>', "more than 200,000"),
        ("arrays", 'valueReference="1"/>', 'valueReference="77"/>', "A: there is no variable 77"),
        ("arrays", 'start="3"', 'start="many"', "A: the size 'many' is no whole number"),
        ("arrays", 'start="3"', 'start="9"', "A: has 9 start values; expected 1 or 81"),
        ("arrays", 'start="0.1 0.2 0.3"', 'start="0.1 0.2"', "x: has 2 start values; expected 1"),
        ("lag", 'valueReference="10"', 'valueReference="ten"', "u: valueReference 'ten' is no"),
        ("lag", 'valueReference="7"', 'valueReference="10"', "k: has the value reference 10 of u"),
        ("lag", 'valueReference="10"', 'valueReference="4294967296"', "u: valueReference 42949672"),
        ("lag", 'valueReference="10"', f'valueReference="{"1" * 9999}"', "111 is beyond 32 bits$"),
        ("lag", 'name="k"', 'name="u"', "u: is the name of two variables$"),
        ("lag", 'name="k"', 'name="also_y"', "also_y: is the name of two variables$"),
        ("arrays", 'name="n"', 'name="A[2,1]"', r"A\[2,1\]: is the name of two variables$"),
    ],
)
def test_a_declaration_that_makes_no_sense_is_refused(name, old, new, message):
    text = description(name)
    assert old in text
    with pytest.raises(UserError, match=message) as caught:
        translate(ElementTree.fromstring(text.replace(old, new)), "a.fmu")
    assert str(caught.value).startswith("a.fmu: modelDescription.xml: ")
