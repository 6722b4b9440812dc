"""Claims: columns are proposed by unit and by the words of the trade, never by chance: where two
are as good, none is.
"""

import pytest

from orchestration.records.proposal import propose

CELL = {"current": "A", "voltage": "V"}


@pytest.mark.parametrize(
    ("columns", "matched"),
    [
        ({"Strom": "mA", "Spannung": "V"}, ["Strom", "Spannung"]),
        ({"I": "mA", "U": "mV", "T": "degC"}, ["I", "U"]),
        ({"<I>": "mA", "Ewe": "V", "control": "V/mA"}, ["<I>", "Ewe"]),
        ({"Im": "A", "Vf": "V", "Vu": "V", "Sig": "V"}, ["Im", "Vf"]),
        ({"Klemmenspannung": "", "Laststrom": ""}, ["Laststrom", "Klemmenspannung"]),
        ({"Dev1/ai0": "V", "Dev1/ai1": "A"}, ["Dev1/ai1", "Dev1/ai0"]),
        ({"Current": "A", "Voltage": "V", "Current limit": "A"}, ["Current", "Voltage"]),
        ({"voltage": "V", "current": "A", "Spannung": "V"}, ["current", "voltage"]),
    ],
)
def test_columns_are_found_by_unit_and_by_words(columns, matched):
    found = propose({name: (unit, "") for name, unit in columns.items()}, CELL)
    assert [found.matched[signal] for signal in CELL] == matched
    assert found.open == {}


def test_of_two_that_are_as_good_none_is_proposed():
    found = propose({"U1": ("V", ""), "U2": ("V", ""), "CH1": ("", "")}, CELL)
    assert found.matched == {}
    assert found.open == {"current": ["CH1"], "voltage": ["U1", "U2", "CH1"]}


def test_a_column_of_another_unit_is_never_proposed():
    found = propose({"voltage": ("K", ""), "current": ("N", "")}, CELL)
    assert found.matched == {}
    assert found.open == {"current": [], "voltage": []}


def test_letters_are_no_words_without_a_unit():
    assert propose({"i": ("", ""), "u": ("", "")}, CELL).matched == {}


def test_what_is_called_like_the_signal_needs_no_map_but_a_guessed_unit_does():
    found = propose({"current": ("mA", ""), "voltage": ("", "mV"), "n": ("", "")}, CELL)
    assert found.mapping == {"voltage": "voltage[mV]"}
    assert found.matched == {"current": "current", "voltage": "voltage"}


def test_options_are_quoted_for_a_shell():
    found = propose({"<I> shunt": ("A", ""), "it's U": ("V", "")}, CELL)
    assert found.options() == """--map '<I> shunt=current' --map 'it'"'"'s U=voltage'"""
