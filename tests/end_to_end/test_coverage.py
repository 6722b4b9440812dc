"""Claims: the page of coverage has a row for whatever the thesis numbers, and its commands run."""

import re
import shlex
import subprocess
import sys
from itertools import chain

import pytest

from demonstrations.thesis import chapters
from docs import make_coverage as made
from tests.support.command import works

ROWS = list(chain.from_iterable(made.parts().values()))
# both take minutes, and have tests of their own
COMMANDS = sorted({row.command for row in ROWS} - {"ppy thesis", "ppy rig demo --out rig"})
# counted in the thesis, by chapter: equations, figures, tables
NUMBERED = {
    "eq": {2: 2, 3: 16, 4: 11, 5: 17},
    "fig": {1: 3, 2: 6, 3: 16, 4: 8, 5: 9},
    "table": {1: 1, 2: 2, 3: 2, 5: 1},
}
_PLACES = re.compile(r"(eq|fig|table)s?\.? ((?:\d+[.-]\d+(?:, | and | to )?)+)")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the records that the page draws."""
    folder = tmp_path_factory.mktemp("coverage")
    subprocess.run([sys.executable, "-c", made.RECORDS], cwd=folder, check=True)
    return folder


def places(where):
    """Yield kind, chapter and number of what a text names; a range ends in its chapter."""
    for kind, listed in _PLACES.findall(where):
        named = [tuple(map(int, text)) for text in re.findall(r"(\d+)[.-](\d+)", listed)]
        if " to " in listed:
            (chapter, low), (_, high) = named
            named = [(chapter, number) for number in range(low, high + 1)]
        yield from ((kind, *place) for place in named)


def test_the_page_is_up_to_date():
    assert made.PAGE.read_text(encoding="utf-8") == made.page(), "run python docs/make_coverage.py"


def test_every_equation_figure_and_table_has_a_row():
    numbered = {
        (kind, chapter, number)
        for kind, counts in NUMBERED.items()
        for chapter, count in counts.items()
        for number in range(1, count + 1)
    }
    assert set(chain.from_iterable(places(row.where) for row in ROWS)) == numbered


def test_there_are_as_many_rows_as_were_looked_at():
    *chapters, workflows = made.parts().values()
    assert (sum(map(len, chapters)), len(workflows)) == (91, 6)


@pytest.mark.slow
def test_the_page_of_the_thesis_has_a_place_of_each_row_that_it_shows():
    claims = chain.from_iterable(chapters.claims().values())
    pictures = chain.from_iterable(chapters.illustrations().values())
    named = [*(claim.where for claim in claims), *(picture.title for picture in pictures)]
    shown = set(chain.from_iterable(places(where.lower()) for where in named))
    for row in ROWS:
        if row.command == "ppy thesis":
            is_named = any(row.where.split(",")[0] in where for where in named)
            assert is_named or shown & set(places(row.where)), row.where


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_it_runs(command, folder):
    program, *arguments = shlex.split(command)
    assert program == "ppy"
    works(*arguments, cwd=folder)
