"""Claims: a result is shown by the function for its type, which is loaded from beside its class."""

from __future__ import annotations

import sys

import pytest

from fmus.kit import UserError
from orchestration.reporting import draw, make_page, write_page

VALUES = """
class Base: pass
class Value(Base): pass
class Other: pass
"""
PICTURE = """
from orchestration.reporting import draw
from drawn.values import Base
@draw.register(Base)
def draw_base(value): return "a picture"
"""


@pytest.fixture
def values(tmp_path, monkeypatch):
    package = tmp_path / "drawn"
    package.mkdir()
    for name, text in {"__init__": "", "values": VALUES, "picture": PICTURE}.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    from drawn import values

    yield values
    for name in [name for name in sys.modules if name.partition(".")[0] == "drawn"]:
        del sys.modules[name]


def test_a_picture_is_loaded_when_it_is_first_drawn(values):
    assert "drawn.picture" not in sys.modules
    assert draw(values.Value()) == "a picture"
    assert draw(values.Base()) == "a picture"


def test_what_nothing_is_registered_for_is_refused(values):
    with pytest.raises(UserError, match=r"^Other: this has no picture$"):
        draw(values.Other())
    with pytest.raises(UserError, match=r"^Value: this has no page$"):
        make_page(values.Value())
    with pytest.raises(UserError, match=r"^int: this has no picture$"):
        draw(1)


@pytest.mark.parametrize("name", ["page.pdf", "page"])
def test_a_page_has_the_name_of_a_page(values, tmp_path, name):
    with pytest.raises(UserError, match=rf"{name}: the name of a report ends in \.html$"):
        write_page(values.Value(), tmp_path / name)
    assert not (tmp_path / name).exists()
