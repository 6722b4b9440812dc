"""``docs/errata.md``, made from the findings: ``python -m orchestration.thesis.errata`` writes it."""

from __future__ import annotations

from pathlib import Path

from orchestration.thesis.chapters import errata

PAGE = Path(__file__).parents[2] / "docs" / "errata.md"
_HEAD = """# Errata of the source

Where the thesis contradicts itself, what is printed, and what holds. Made by `python -m orchestration.thesis.errata`
from the computations that `ppy thesis` shows; do not edit. Each row has a test that shows both figures.

| # | where | printed | what holds | test |
|---|---|---|---|---|
"""


def text() -> str:
    """Return the page as Markdown."""
    rows = (
        " | ".join([str(e.number), e.where, e.printed, e.holds.replace("|", "\\|"), f"`tests/{e.test}.py`"])
        for e in errata()
    )
    return _HEAD + "".join(f"| {row} |\n" for row in rows)


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8", newline="\n")
    print(PAGE)
