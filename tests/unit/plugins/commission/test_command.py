"""Options of a commissioning that make no sense are refused before a server is started, and nothing
moves before somebody says yes.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from fmus.kit import UserError
from orchestration.plugins.commission import command
from tests.support.command import refused


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--lockstep"], "--lockstep"),
        (["--archive", "a"], "--archive"),
        (["--level", "0"], "--level"),
        (["--out", "protocol.pdf"], ".html"),
        (["--backend", "nobody"], "nobody"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    tmp_path: Path, words: list[str], part: str
) -> None:
    refused(tmp_path, "rig", "commission", *words, parts=[part])


@pytest.mark.parametrize(
    ("typed", "answer"),
    [("yes\n", True), ("No\n", False), ("perhaps\nyes\n", True), ("", None), ("perhaps\n", None)],
)
def test_an_operator_answers_by_yes_or_no(monkeypatch, typed, answer):
    terminal = io.StringIO(typed)
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stdin", terminal)
    assert command._ask("Is the rig at rest?") is answer


def test_without_a_terminal_nobody_answers(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO("yes\n"))
    assert command._ask("Is the rig at rest?") is None
    with pytest.raises(UserError, match="--yes"):
        command._raise_if_refused("current 0.1 A")
