"""Claims: every option of every command has help, and the defaults of what it is handed to."""

from __future__ import annotations

from dataclasses import fields
from typing import get_args

import pytest

from fmus.kit import UserError
from orchestration.api.declaration import options_of
from orchestration.api.forms import (
    ASSIGNMENTS,
    BAND,
    MAPPING,
    RATIOS,
    RECORDS,
    SEGMENT,
    SETTINGS,
    TEXTS,
)
from orchestration.cli.commands import options
from orchestration.cli.commands.options import VERDICTS, ServeCommand
from orchestration.diagnosis.engine import Verdict
from orchestration.rig.server import ServerSettings
from tests.support.command import refused
from tests.support.commands import COMMANDS


def test_every_option_of_every_command_has_help():
    assert len(COMMANDS) > 25
    for name, one in COMMANDS.items():
        for parameter in one.params:
            assert getattr(parameter, "help", None), f"{name} {parameter.name}"


def test_the_verdicts_that_can_be_required_are_those_that_there_are():
    assert set(VERDICTS) == set(get_args(Verdict))


DECLARED = [cls for name, cls in vars(options).items() if name.endswith("Command")]
_TYPED = (str | None, list[str] | None)
_OTHERS = (ASSIGNMENTS, BAND, MAPPING, RATIOS, RECORDS, SEGMENT, SETTINGS, TEXTS)
LISTS = {
    f"{cls.__name__} {option.flags[0]}": option
    for cls in DECLARED
    for option in options_of(cls).values()
    if option.on_command_line and option.form.typed in _TYPED and option.form not in _OTHERS
}


@pytest.mark.parametrize("name", LISTS)
@pytest.mark.parametrize("text", ["", " "])
def test_a_list_without_a_name_in_it_is_refused_with_what_is_allowed(name, text):
    option = LISTS[name]
    with pytest.raises(UserError, match=f"^{option.flags[0]} {text!r}: (name|write|there are) "):
        option.read(text if option.form.typed == str | None else [text])


def test_a_list_that_is_given_twice_is_one():
    """The names of both, and one of them twice is refused."""
    option = LISTS["SimulateCommand --outputs"]
    assert option.read(["a,b", "c"]) == ["a", "b", "c"]
    with pytest.raises(UserError, match=r"^--outputs 'a,a': a is named twice"):
        option.read(["a", "a"])


def test_every_option_that_takes_names_is_such_a_list():
    flags = {name.split()[1] for name in LISTS}
    assert {"--platforms", "--outputs", "--effects", "--with", "--keep", "--require"} <= flags


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "fig_3_3", "--set", ""],
        ["sweep", "ppy_actuator", "--over", ""],
        ["frequency", "r.csv", "--of", ""],
        ["optimise", "foot_design", "--maximise", "toe_stroke", "--over", ""],
        ["diagnose", "r.csv", "--holdout", ""],
        ["rig", "serve", "--option", ""],
        ["rig", "record", "--stimulus", "fig_3_3", "--out", "x.nc", "--set", ""],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_repeatable_option_without_a_text_is_refused(arguments, tmp_path):
    refused(tmp_path, *arguments, parts=[f"{arguments[-2]} ''"])


CHOICES = {
    f"{cls.__name__} {option.flags[0]}": option
    for cls in DECLARED
    for option in options_of(cls).values()
    if option.on_command_line and option.choices
}


@pytest.mark.parametrize("name", CHOICES)
def test_a_choice_that_there_is_not_is_refused_before_any_work(name):
    option = CHOICES[name]
    with pytest.raises(UserError, match=f"'nope': there are {', '.join(option.choices)}$"):
        option.read("nope")
    assert [option.read(choice) for choice in option.choices] == [*option.choices]


def test_a_server_has_the_defaults_of_its_settings():
    """The address is made of three options, and the rig to serve has no default."""
    usual = {field.name: field.default for field in fields(ServerSettings)}
    served = options_of(ServeCommand)
    for name in ("rate", "lockstep", "keys", "log", "priority", "cpu"):
        assert served[name].default == usual[name], name
