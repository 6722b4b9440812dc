"""Claims: a class of options becomes keyword arguments and the words of a command line.

With defaults, a signature and a docstring; what it does not know is refused by name.
"""

from __future__ import annotations

import inspect
import re
from typing import Unpack

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.api.declaration import (
    Form,
    Option,
    only,
    options_of,
    takes,
    with_options,
    words_of,
)
from orchestration.api.options import (
    DiagnoseOptions,
    FitKeywords,
    GridOptions,
    LawsOptions,
    ProgressOption,
    SearchOptions,
    SettingsOption,
)


@takes(SearchOptions)
def search(record: str, **options: Unpack[SearchOptions]) -> dict[str, object]:
    """Look for something.

    Parameters
    ----------
    record : str
        Where.

    Returns
    -------
    dict
    """
    return {"record": record, **options}


def test_options_arrive_complete():
    given = {"record": "a.csv", "settings": None, "time": 3.0, "hold": ()}
    assert search("a.csv", time=3.0) == given


def test_a_value_is_made_what_is_used():
    assert search("a.csv", hold="k1")["hold"] == ["k1"]
    assert search("a.csv", hold=("k1", "b1"))["hold"] == ["k1", "b1"]


def test_the_signature_shows_every_option_with_its_default():
    parameters = inspect.signature(search).parameters
    assert list(parameters) == ["record", "settings", "hold", "time"]
    assert parameters["hold"].default == ()
    assert parameters["hold"].kind is inspect.Parameter.KEYWORD_ONLY
    assert list(inspect.signature(ppy.fit).parameters)[3:] == list(options_of(FitKeywords))


def test_the_docstring_has_every_option():
    text = inspect.getdoc(search)
    assert text.startswith(
        "Look for something.\n\nParameters\n----------\nrecord : str\n    Where.\n"
    )
    assert "\nhold : sequence of str\n    Parameters that are known and not fitted." in text
    assert '\ntime : float in s or str such as "10s", optional\n' in text
    assert text.endswith("\n\nReturns\n-------\ndict")


def test_a_wrong_name_is_refused_with_the_right_one():
    with pytest.raises(TypeError, match=r"search\(\) .* 'hodl' \(did you mean hold\?\)"):
        search("a.csv", hodl=["k1"])
    with pytest.raises(TypeError, match="record"):
        search()


def test_what_a_function_has_itself_is_documented_only():
    @takes(SettingsOption)
    def own(settings: int = 7) -> int:
        """Return it."""
        return settings

    assert own() == 7
    assert str(inspect.signature(own)) == "(settings: 'int' = 7) -> 'int'"
    assert "settings : Mapping of str to float or str, optional" in own.__doc__


def test_entries_come_before_what_is_handed_on():
    text = with_options(
        "Do.\n\nParameters\n----------\n**more\n    Others.", [Option("It.", name="a", type=int)]
    )
    assert text == "Do.\n\nParameters\n----------\na : int\n    It.\n**more\n    Others.\n"
    assert with_options(None, []) is None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, []),
        ({"hold": ["a", "b"], "each": []}, ["--hold", "a,b"]),
        ({"effects": []}, ["--effects", "none"]),
        ({"effects": None}, []),
        ({"interpolate": False}, ["--no-interpolate"]),
        ({"interpolate": True}, ["--interpolate"]),
        ({"laws": False}, ["--no-laws"]),
        ({"laws": True}, []),
        ({"time": 90.5}, ["--time", "90.5s"]),
        ({"holdout": ["b.csv", "7,8"]}, ["--holdout", "b.csv", "--holdout", "7,8"]),
        ({"mapping": {"u": "voltage[mV]"}}, ["--map", "u=voltage[mV]"]),
        ({"settings": {"R1": 0.5, "k1": "6 N/mm"}}, ["--set", "R1=0.5", "--set", "k1=6 N/mm"]),
        ({"progress": print}, []),
    ],
    ids=str,
)
def test_a_value_has_words_on_the_command_line(given, words):
    assert words_of(DiagnoseOptions, given) == words


def test_only_takes_what_a_class_declares():
    values = {"stop": 3.0, "step": None, "other": 1}
    assert only(GridOptions, values) == {"stop": 3.0, "step": None}


@pytest.mark.parametrize(
    ("kind", "value", "called"),
    [
        (int, 16.5, "a whole number"),
        (int, "many", "a whole number"),
        (int, None, "a whole number"),
        (int | None, 2.5, "a whole number"),
        (float, "half", "a number"),
    ],
)
def test_a_value_of_another_type_is_refused(kind, value, called):
    option = Option("Of it.", default=32, least=16, name="starts", type=kind)
    with pytest.raises(UserError, match=rf"^starts={re.escape(repr(value))}: must be {called}$"):
        option.given(value)


def test_a_number_of_numpy_is_one():
    whole = Option("Of it.", default=32, least=16, name="starts", type=int)
    assert whole.given(np.int64(64)) == 64
    assert whole._replace(type=int | None).given(None) is None
    assert whole._replace(type=float, least=0).given(np.float32(0.5)) == 0.5


def test_a_form_of_its_own_reads_before_the_value_is_used():
    option = Option("Twice.", form=Form(lambda typed, flag: 2 * typed), name="a", type=int)
    assert (option.read(3), option.read(None)) == (6, None)
    assert options_of(LawsOptions)["effects"].read("none") == []


def test_signatures_show_no_function_as_a_default_and_none_is_the_default():
    functions = {name: getattr(ppy, name) for name in ppy.__all__}
    for name, function in functions.items():
        if inspect.isfunction(function):
            assert " at 0x" not in str(inspect.signature(function)), name

    @takes(ProgressOption)
    def work(**options):
        options["progress"]("a step")
        return options["progress"]

    assert callable(work(progress=None))
    assert work(progress=print) is print
