"""Claims: every name that the glossary gives is one of the source, and every source that it cites
is listed.
"""

from __future__ import annotations

import re

from tests.support import source

GLOSSARY = (source.ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
TERMS, SOURCES = GLOSSARY.split("## Sources")
ROWS = [
    [cell.strip() for cell in line.strip("|").split(" | ")]
    for line in TERMS.splitlines()
    if line.startswith("| ") and not line.startswith("| term ")
]
NAMES = [name for row in ROWS for name in re.findall(r"`([^`]+)`", row[0])]


def test_every_row_has_term_meaning_and_source() -> None:
    assert len(ROWS) > 80
    assert [row for row in ROWS if len(row) != 3 or not all(row)] == []
    assert sorted({row[0] for row in ROWS}) == sorted(row[0] for row in ROWS)


def test_every_name_is_one_of_the_source() -> None:
    assert [name for name in NAMES if not is_of_the_source(name)] == []


def test_a_name_that_is_gone_is_seen() -> None:
    assert is_of_the_source("Model.inputs")
    assert not is_of_the_source("Model.entrances")
    assert not is_of_the_source("nobody_calls_it_so")


def is_of_the_source(name: str) -> bool:
    if name.split(".")[0] in ("fmus", "orchestration"):
        return source.exists(name)
    return source.defines(name)


def test_every_source_is_listed() -> None:
    """By the names of its authors, or of the standard."""
    listed = SOURCES.split("\n* ")[1:]
    for row in ROWS:
        cited = re.sub(r", ch\. \d+|'s inequality", "", row[2])
        for work in filter(lambda w: w not in ("Here", "Bonferroni"), cited.split("; ")):
            words = re.findall(r"[A-Z][\w.-]+(?: [\d.]+)?", work.replace(" et al.", ""))
            assert any(all(word in entry for word in words) for entry in listed), work
