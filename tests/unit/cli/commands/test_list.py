"""Claims: ``ppy list`` names every component."""

from fmus import MODELS
from tests.support.command import works


def test_list_names_every_component(tmp_path):
    lines = works("list", cwd=tmp_path).splitlines()
    assert [line.split()[0] for line in lines] == list(MODELS)
    assert all(len(line.split()) > 3 for line in lines)
