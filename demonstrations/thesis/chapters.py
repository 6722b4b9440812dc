"""Claims, errata and figures of all chapters, and the page ``docs/errata.md``.

``python -m demonstrations.thesis.chapters`` writes the page.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from demonstrations.thesis import (
    actuator,
    analyser,
    degradation,
    foot,
    force_loop,
    forgetting,
    identification,
    work_loops,
)
from demonstrations.thesis.analyses import (
    charge_displacement,
    creep,
    excitation,
    impedance,
    potentiostat,
)
from demonstrations.thesis.claim import Claim, Erratum, Illustration

CHAPTERS = {
    "Chapter 2: the bench": (analyser, force_loop),
    "Chapters 1 and 3: the actuator": (
        actuator,
        identification,
        creep,
        charge_displacement,
        excitation,
        impedance,
    ),
    "Chapter 4: degradation": (forgetting, degradation, potentiostat),
    "Chapter 5: the foot": (foot, work_loops),
}
_PAGE = Path(__file__).parents[2] / "docs" / "errata.md"
_HEAD = (
    "# Errata of the source\n"
    "\n"
    "Where the thesis contradicts itself, what is printed, and what holds. Made by `python "
    "-m demonstrations.thesis.chapters`\n"
    "from the computations that `ppy thesis` shows; do not edit. Each row has a test that "
    "shows both figures.\n"
    "\n"
    "| # | where | printed | what holds | test |\n"
    "|---|---|---|---|---|\n"
)


@cache
def entries() -> dict[str, tuple[Claim | Erratum, ...]]:
    """Return all claims and errata by chapter."""
    return {
        title: tuple(e for part in parts for e in part.entries())
        for title, parts in CHAPTERS.items()
    }


def claims() -> dict[str, list[Claim]]:
    """Return the claims by chapter."""
    return {
        title: [e for e in chapter if isinstance(e, Claim)] for title, chapter in entries().items()
    }


def errata() -> list[Erratum]:
    """Return the rows of the errata page in the order of their numbers."""
    every = (e for chapter in entries().values() for e in chapter if isinstance(e, Erratum))
    return sorted(every, key=lambda e: e.number)


def illustrations() -> dict[str, list[Illustration]]:
    """Return the figures by chapter."""
    return {
        title: [i for part in parts for i in part.illustrations()]
        for title, parts in CHAPTERS.items()
    }


def errata_page() -> str:
    """Return ``docs/errata.md`` as Markdown."""
    rows = (
        " | ".join(
            [str(e.number), e.where, e.printed, e.holds.replace("|", "\\|"), f"`tests/{e.test}.py`"]
        )
        for e in errata()
    )
    return _HEAD + "".join(f"| {row} |\n" for row in rows)


if __name__ == "__main__":
    _PAGE.write_text(errata_page(), encoding="utf-8", newline="\n")
    print(_PAGE)
