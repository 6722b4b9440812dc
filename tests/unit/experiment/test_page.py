"""Claims: the page of an experiment holds picture, figures and the experiment."""

import re

import pytest

from tests.support.command import works
from tests.support.experiments import played_record


@pytest.fixture
def folder(tmp_path):
    return played_record(tmp_path)


def test_a_page_holds_picture_figures_and_the_experiment(folder):
    works("run", "play.toml", "--plot", "page.html", cwd=folder)
    page = (folder / "page.html").read_text(encoding="utf-8")
    for part in (
        "A record is played back",
        "31 points, 3 s",
        "0.61 ohm",
        "data:image/png;base64",
        "seed 3",
        "multilevel",
    ):
        assert part in page
    assert not re.search(r"(src|href)=.https?:", page)
