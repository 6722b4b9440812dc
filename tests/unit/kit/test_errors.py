"""Claims: a misspelt name gets a hint, whatever its case, or a short list of names."""

from fmus.kit.errors import suggestion


def test_a_similar_name_is_suggested():
    assert suggestion("R2l", ["R1", "R2", "C"]) == " (did you mean R2?)"
    assert suggestion("VOLTAGE", ["current", "Voltage"]) == " (did you mean Voltage?)"


def test_a_short_list_is_given_where_nothing_is_similar():
    assert suggestion("x", ["voltage", "current"]) == " (there are: voltage, current)"
    assert suggestion("x", []) == ""
    assert suggestion("x", ["voltage"] * 21) == ""
    assert suggestion("x", ["voltage", "current"], few=1) == ""
