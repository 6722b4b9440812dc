"""Claims: a result is a text in lines, in a notebook tables and a picture; markup in it is text."""

from __future__ import annotations

import base64
import html.parser
import re

import pytest
from rich.console import Group
from rich.text import Text

from fmus.kit import UserError
from orchestration.reporting import Displayable, one_line, pictures, plain_table
from orchestration.reporting.html.page import SCROLLED


class Elements(html.parser.HTMLParser):
    """The standard library's reading of HTML: elements in order, and whether all are closed."""

    def __init__(self, text: str):
        super().__init__()
        self.seen: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


class Result(Displayable):
    drawn = 0

    def overview(self):
        table = plain_table("of <both>", "name", "value", right=("value",))
        table.add_row("a & b", Text("1"))
        table.add_row("c", "22")
        yield Group(Text("a < b"), Text(), table)
        yield "last"


class Drawn(Result):
    def draw(self):
        self.drawn += 1
        figure, _ = pictures.panels(1, "title")
        return figure


def test_it_prints_as_lines():
    assert str(Result()).splitlines() == [
        "a < b",
        "",
        "of <both>",
        "name   value",
        "a & b      1",
        "c         22",
        "last",
    ]


def test_a_notebook_gets_a_table_and_paragraphs():
    shown = Result()._repr_mimebundle_()
    assert list(shown) == ["text/html"]
    page = shown["text/html"]
    elements = Elements(page)
    assert elements.open == []
    assert elements.seen == [
        *["p", "p", "b", "div", "table", "thead", "tr", "th", "th"],
        *["tbody", "tr", "td", "td", "tr", "td", "td", "p"],
    ]
    assert "<p>a &lt; b</p>" in page
    assert f'<div tabindex="0" style="overflow-x:auto;{SCROLLED}">' in page
    assert "of &lt;both&gt;" in page
    assert re.findall(r'<td style="text-align:(\w+)">([^<]*)</td>', page) == [
        ("left", "a &amp; b"),
        ("right", "1"),
        ("left", "c"),
        ("right", "22"),
    ]


def test_a_picture_is_drawn_once_for_both_forms():
    result = Drawn()
    shown = result._repr_mimebundle_()
    assert result.drawn == 1
    assert base64.b64decode(shown["image/png"]).startswith(b"\x89PNG")
    assert f'src="data:image/png;base64,{shown["image/png"]}"' in shown["text/html"]
    assert result._repr_html_().count("<img") == 1


def test_it_is_drawn_and_written_if_wanted(tmp_path):
    assert Drawn().plot().get_suptitle() == "title"
    assert Drawn().plot(str(tmp_path / "r.svg")).get_suptitle() == "title"
    assert (tmp_path / "r.svg").read_text(encoding="utf-8").startswith("<?xml")
    with pytest.raises(UserError, match="must end in"):
        Drawn().plot(tmp_path / "r.txt")


def test_what_has_no_picture_says_so_in_a_line(tmp_path):
    with pytest.raises(UserError, match=r"^Result: this has no picture$"):
        Result().plot(tmp_path / "r.png")
    assert not (tmp_path / "r.png").exists()


def test_a_mistake_in_a_drawing_is_not_taken_for_nothing_to_draw():
    class Wrong(Result):
        def draw(self):
            raise ValueError("a mistake")

    with pytest.raises(ValueError, match="a mistake"):
        Wrong()._repr_mimebundle_()


@pytest.mark.parametrize(
    ("text", "line"), [("Fit a\n = 1", "<Fit a = 1>"), ("x" * 200, f"<{'x' * 97}...>")]
)
def test_a_repr_is_one_line(text, line):
    assert one_line(text) == line
