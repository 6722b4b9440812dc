"""Claims: a misspelt name gets a hint, whatever its case, or a short list of names; a place stands
before the mistakes of a user alone.
"""

import pytest

from fmus.kit.errors import UserError, error_context, suggestion


def test_a_similar_name_is_suggested():
    assert suggestion("R2l", ["R1", "R2", "C"]) == " (did you mean R2?)"
    assert suggestion("VOLTAGE", ["current", "Voltage"]) == " (did you mean Voltage?)"


def test_a_short_list_is_given_where_nothing_is_similar():
    assert suggestion("x", ["voltage", "current"]) == " (there are: voltage, current)"
    assert suggestion("x", []) == ""
    assert suggestion("x", ["voltage"] * 21) == ""
    assert suggestion("x", ["voltage", "current"], few=1) == ""


def test_a_place_stands_before_a_mistake_of_a_user_and_before_nothing_else():
    with pytest.raises(UserError, match=r"^pump: too fast$"), error_context("pump"):
        raise UserError("too fast")
    with pytest.raises(KeyError, match=r"^'too fast'$"), error_context("pump"):
        raise KeyError("too fast")
