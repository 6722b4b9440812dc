"""Claims: the page of coverage has a row for whatever the thesis numbers, and its commands run."""

import re
import shlex
import subprocess
import sys
from itertools import chain

import pytest

from docs import make_coverage as made
from tests.support.command import works

ROWS = list(chain.from_iterable(made.parts().values()))
COMMANDS = list(dict.fromkeys(row.command for row in ROWS))
# counted in the thesis, by chapter: equations, figures, tables
NUMBERED = {
    "eq": {2: 2, 3: 16, 4: 11, 5: 17},
    "fig": {1: 3, 2: 6, 3: 16, 4: 8, 5: 9},
    "table": {1: 1, 2: 2, 3: 2, 5: 1},
}
_PLACES = re.compile(r"(eq|fig|table)s?\.? ([\d.-]+)(?:( to | and )([\d.-]+))?")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the records that the page draws."""
    folder = tmp_path_factory.mktemp("coverage")
    subprocess.run([sys.executable, "-c", made.RECORDS], cwd=folder, check=True)
    return folder


def places(where):
    """Yield kind, chapter and number of what a row is about, whose ranges end in one chapter."""
    for kind, first, joint, last in _PLACES.findall(where):
        chapter, low = map(int, re.split("[.-]", first))
        high = int(re.split("[.-]", last)[1]) if last else low
        numbers = (low, high) if joint == " and " else range(low, high + 1)
        yield from ((kind, chapter, number) for number in numbers)


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
@pytest.mark.parametrize("command", COMMANDS)
def test_it_runs(command, folder):
    program, *arguments = shlex.split(command)
    assert program == "ppy"
    works(*arguments, cwd=folder)
