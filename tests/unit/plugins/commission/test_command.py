"""Options of a commissioning that make no sense are refused before a server is started."""

from __future__ import annotations

from pathlib import Path

import pytest

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
