from html.parser import HTMLParser
from pathlib import Path

from fmus import COMPONENTS, component
from fmus.kit.build import documentation
from fmus.kit.build.documentation import page, relaxed_assumption
from fmus.kit.effects import make_effect
from orchestration.fmu.model import catalogue
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


def test_what_a_docstring_has_of_html_is_text(monkeypatch):
    hostile = (
        "Behind a<script>alert(1)</script>.fmu ![](http://host/a.png) [b](javascript:alert(1))"
    )
    monkeypatch.setattr(Thermostat, "__doc__", hostile)
    text = page(Thermostat, Path("none.md"))
    assert "&lt;script&gt;" in text
    assert not any(part in text for part in ("<script", "<img", 'href="javascript'))


README = """# A pump

## Assumptions

1. `pump_fast`: Losses are those of fig. 5-6, and R_l is 0.5 of them. Leaks are none.
2. It is cold.
"""


OF = "of its documentation"


def relaxing(number):
    return make_effect("Warm", {}, id="warm", assumption=number)


def test_an_assumption_is_the_first_sentence_of_the_readme_on_it(tmp_path, monkeypatch):
    monkeypatch.setattr(documentation, "_folder", lambda cls: tmp_path)
    assert relaxed_assumption(Thermostat, relaxing(1)) == ("", f"assumption 1 {OF}")  # no README
    (tmp_path / "README.md").write_text(README, encoding="utf-8")
    words = "the model assumes that losses are those of fig. 5-6, and R_l is 0.5 of them"
    assert relaxed_assumption(Thermostat, relaxing(1)) == (words, f"assumption 1 {OF}")
    cold = ("the model assumes that it is cold", f"assumption 2 {OF}")
    assert relaxed_assumption(Thermostat, relaxing(2)) == cold
    assert relaxed_assumption(Thermostat, relaxing(3)) == ("", f"assumption 3 {OF}")
    said = relaxed_assumption(Thermostat, relaxing("friction is viscous"))
    assert said == ("the model assumes that friction is viscous", "")


def test_every_assumption_that_an_effect_of_ours_relaxes_has_words():
    for name in COMPONENTS:
        cls = component(name)
        for effect in catalogue(cls).values():
            words, _ = relaxed_assumption(cls, effect)
            assert len(words.removeprefix("the model assumes that ")) > 10, (name, effect.id)
            assert not words.endswith("."), (name, effect.id)
