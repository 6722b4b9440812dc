"""Claims: notes are codes, each with something to do, and no decision of the source hangs on the
text of a message.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestration.discrepancy import note
from orchestration.discrepancy.note import Action, Note, NoteCode, notes_by_action

ROOT = Path(__file__).parents[3]
SOURCES = sorted(
    path for folder in ("orchestration", "fmus") for path in (ROOT / folder).rglob("*.py")
)
SENTENCE = re.compile(
    r"[A-Za-z]{2,}[,:]? +[A-Za-z]{2,}|^[a-z]{2,} | [a-z]{2,}$"
)  # words with a space between or after
LOOKS_INTO = (
    "startswith",
    "endswith",
    "find",
    "index",
    "count",
    "split",
    "partition",
    "rpartition",
)
SEARCHES = ("match", "search", "fullmatch", "findall")


def texts(node: ast.AST) -> Iterator[str]:
    """Texts that a name, a tuple or a formatted text is made of."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.Tuple | ast.List | ast.Set):
        for item in node.elts:
            yield from texts(item)
    elif isinstance(node, ast.JoinedStr):
        for item in node.values:
            yield from texts(item)


def is_message(node: ast.AST) -> bool:
    """Whether it is the text of an error or of a note."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id in ("str", "message")
    return isinstance(node, ast.Attribute) and node.attr == "message"


def looked_for(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Texts that are looked for within others, or that messages are compared with, and where."""
    for node in ast.walk(tree):
        sought: list[ast.AST] = []
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(map(is_message, sides)):
                sought = sides
            elif isinstance(node.ops[0], ast.In | ast.NotIn) and not list(
                texts(node.comparators[0])
            ):
                sought = [node.left]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") in (
            *LOOKS_INTO,
            *SEARCHES,
        ):
            sought = node.args[:1]
        yield from ((node.lineno, text) for part in sought for text in texts(part))


def is_telling(text: str) -> bool:
    """Whether it is part of a sentence, or what the names of start values end with."""
    return bool(SENTENCE.search(text)) or text == "_start"


@pytest.mark.slow
def test_nothing_hangs_on_a_sentence_nor_on_the_end_of_a_name() -> None:
    places = {
        f"{path.relative_to(ROOT).as_posix()}, line {line}": text
        for path in SOURCES
        for line, text in looked_for(ast.parse(path.read_text(encoding="utf-8")))
        if is_telling(text)
    }
    assert places == {}


@pytest.mark.parametrize(
    "code",
    [
        'note.startswith("no input moves")',
        'any("out of all reason" in note for note in notes)',
        's.name.startswith("square of ")',
        'if str(error) == "too few samples": pass',
        'name.endswith("_start")',
        'name.endswith(("_start", "_end"))',
        'text.startswith(f"{name} is not used")',
        're.search("not found", str(error))',
    ],
)
def test_the_probe_would_notice(code: str) -> None:
    assert any(is_telling(text) for _, text in looked_for(ast.parse(code)))


@pytest.mark.parametrize(
    "code",
    [
        'x.split(" ")',
        'unit.endswith("/s")',
        'kind == "ignored columns"',
        'name.startswith("linux")',
        'name in ("one kind", "another kind")',
    ],
)
def test_names_kinds_and_separators_are_no_sentences(code: str) -> None:
    assert not any(is_telling(text) for _, text in looked_for(ast.parse(code)))


@pytest.mark.parametrize("code", NoteCode)
def test_every_note_has_one_thing_to_do(code: NoteCode) -> None:
    listed = [action for action, codes in note._ACTIONS.items() if code in codes]
    assert len(listed) <= 1
    assert Note(code).action is (listed[0] if listed else Action.NONE)


def test_notes_are_grouped_in_the_order_of_what_to_do_first() -> None:
    codes = (NoteCode.EVEN_CLOCK, NoteCode.TIME_SPENT, NoteCode.EXCHANGED, NoteCode.COPIED)
    groups = notes_by_action([Note(code) for code in codes])
    assert [(action, [n.code for n in group]) for action, group in groups.items()] == [
        (Action.CHECK, [NoteCode.EXCHANGED, NoteCode.COPIED]),
        (Action.WAIT, [NoteCode.TIME_SPENT]),
        (Action.NONE, [NoteCode.EVEN_CLOCK]),
    ]
