from html.parser import HTMLParser
from pathlib import Path

from fmus.kit.build.documentation import page
from tests.support.kit_models import every_model
from tests.support.kit_samples import Thermostat


class Outline(HTMLParser):
    """Collects cells of tables, and checks that elements are closed."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.loaded = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "br", "img", "hr", "link"):
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")
        self.loaded += [
            value
            for name, value in attrs
            if name in ("src", "href") and tag in ("script", "link", "img")
        ]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "td" in self.open or "th" in self.open:
            self.cells[-1] += data


@every_model
def test_documentation_is_one_page_with_every_variable(cls):
    outline = Outline()
    outline.feed(page(cls, Path("none.md")))
    assert outline.open == []
    assert outline.loaded == []
    for v in cls.layout.variables:
        assert v.name in outline.cells


def test_documentation_shows_the_readme_and_the_remark(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text("# Rooms\n\n| a | b |\n|---|---|\n| 1 | é |\n", encoding="utf-8")
    monkeypatch.setattr(Thermostat, "remark", "with & without\nand more")
    text = page(Thermostat, readme)
    assert "<h1>Rooms</h1>" in text
    assert "<td>é</td>" in text
    assert "<li>with &amp; without</li><li>and more</li>" in text
    assert page(Thermostat, readme) == page(Thermostat, readme)
