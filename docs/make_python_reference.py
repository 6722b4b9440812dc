"""Make the page of the Python interface from the docstrings of ``orchestration``, its front door.

``python docs/make_python_reference.py`` writes it anew. The docstrings are numpydoc, which ruff
holds them to, so that their sections can be told by the underlined headings alone; numpydoc itself
would bring Sphinx along for that. Options that a function takes are in its docstring from their
declaration, which also says what they are called on the command line.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "python.md"
INTRODUCTION = """# Python

```python
import ppy_rig as ppy
```

Everything that the command does, as functions. Made from the docstrings and the declared options by
`docs/make_python_reference.py`; the examples are run by the tests. An option that a command takes
has its name there.

A result prints as a text, and is one line where it is a part of something. In a notebook the last
line of a cell shows its tables and its picture; `plot()` returns the picture as a figure of
matplotlib, which shows itself there without pyplot, and `to_frame()` the figures as a table of
pandas. A time is a number of seconds or a text such as `"10s"`; where several names are taken, one
may stand by itself, as in `fit="R1"`. What cannot be used raises `ppy.UserError`, whose message
names arguments as Python has them.
"""
_FEW = 3  # commands that take an option are named
_FIELDS = ("Parameters", "Attributes", "Returns", "Yields", "Raises")


def public() -> dict[str, Any]:
    """Collect what the front door offers, by name."""
    import orchestration

    names = [name for name in orchestration.__all__ if not name.startswith("_")]
    return {name: getattr(orchestration, name) for name in names}


def results(things: Mapping[str, Any]) -> dict[str, type]:
    """Classes of ours that functions return, and after them those of their attributes, by name."""
    found: dict[str, type] = {}
    newest = dict(things)
    for _ in range(2):
        newest = {
            name: cls
            for thing in newest.values()
            for name, cls in named_types(thing)
            if name not in found
        }
        found |= newest
    return {name: cls for name, cls in found.items() if name not in things}


def named_types(thing: Any) -> Iterator[tuple[str, type]]:
    """Classes of ours that a function says it returns, or that a class says its attributes are."""
    if inspect.isclass(thing):
        yield from ((base.__name__, base) for base in public_bases(thing))
        attributes = fields(sections(inspect.getdoc(thing) or "").get("Attributes", ""))
        kinds = [
            *(kind for _, kind, _ in attributes),
            *map(str, inspect.get_annotations(thing).values()),
        ]
    else:
        kinds = [str(inspect.signature(thing).return_annotation)]
    for word in re.findall(r"\w+", " ".join(kinds)):
        cls = vars(sys.modules[thing.__module__]).get(word)
        if inspect.isclass(cls) and cls.__module__.startswith("orchestration."):
            yield word, cls


def public_bases(cls: type) -> list[type]:
    """Classes of ours, which are no errors, that a class has methods from; none of them private."""
    return [
        base
        for base in cls.__mro__[1:]
        if base.__module__.startswith("orchestration.") and not base.__name__.startswith("_")
    ]


def sections(docstring: str) -> dict[str, str]:
    """Split a numpydoc docstring by section; text before the first is under the empty name."""
    first, *others = re.split(r"^(\w[\w ]*)\n-{3,}\n", inspect.cleandoc(docstring), flags=re.M)
    named = zip(others[::2], others[1::2], strict=True)
    return {"": first.strip()} | {name: text.strip("\n") for name, text in named}


def fields(text: str) -> Iterator[tuple[str, str, str]]:
    """List name, type and meaning of each entry of a section; a nameless one has its type."""
    for entry in re.split(r"\n(?=\S)", text):
        head, _, meaning = entry.partition("\n")
        name, colon, kind = head.partition(" : ")
        yield (
            (name, kind, inspect.cleandoc(meaning))
            if colon
            else ("", head, inspect.cleandoc(meaning))
        )


def markdown(text: str) -> str:
    """Prose of a docstring: its code in single backticks, its references without their roles."""
    text = re.sub(r":\w+:`~?\.?([^`]+)`", r"`\1`", text)
    return re.sub(r"``(.+?)``", r"`\1`", text)


def described(
    heading: str, text: str, on_command_line: Mapping[str, str] | None = None
) -> Iterator[str]:
    """Lines of a section, with what its entries are called on the command line."""
    if heading in _FIELDS:
        yield f"**{heading}**\n"
        for name, kind, meaning in fields(text):
            named = f"`{name}` : {kind}" if name else f"`{kind}`" if heading == "Raises" else kind
            flags = (on_command_line or {}).get(name, "")
            yield "\n  ".join(f"* {named}{flags}\n{markdown(meaning)}".rstrip().split("\n"))
        yield ""
    elif heading == "Examples":
        yield f"```pycon\n{text}\n```\n"
    else:
        yield f"**{heading}**\n\n{markdown(text)}\n"


def flags_of(thing: Any) -> dict[str, str]:
    """Collect command-line names of a function's options, with a few commands that take them."""
    called = {}
    for name, option in getattr(thing, "__options__", {}).items():
        by = [f"`ppy {c}`" for c, options in commands().items() if options.get(name) == option]
        if by:
            flags = " or ".join(f"`{flag}`" for flag in option.flags)
            called[name] = f"; {flags} of {', '.join(by)}" if len(by) <= _FEW else f"; {flags}"
    return called


@cache
def commands() -> dict[str, Mapping[str, Any]]:
    """Options of the commands that are no groups, by their names."""
    from orchestration.cli import app

    loaded = {name: app.load(name) for name in app.names()}
    return {name: getattr(command, "__options__", {}) for name, command in loaded.items()}


def entry(name: str, thing: Any, level: int = 2) -> Iterator[str]:
    """Lines on a function, a class with its own public methods and properties, or any of these."""
    yield f"{'#' * level} {name}\n"
    is_error = inspect.isclass(thing) and issubclass(thing, Exception)
    if callable(thing) and not is_error:
        yield f"```python\n{name}{signature(thing)}\n```\n"
    parts = sections(inspect.getdoc(thing) or "")
    yield f"{markdown(parts.pop(''))}\n"
    for heading, text in parts.items():
        yield from described(heading, text, flags_of(thing))
    if inspect.isclass(thing):
        yield from inherited(thing)
        for own, below in members(thing).items():
            below = getattr(thing, own) if isinstance(below, classmethod | staticmethod) else below
            if not own.startswith("_") and (
                inspect.isroutine(below) or isinstance(below, property)
            ):
                yield from entry(f"{name}.{own}", below, level + 1)
        yield from pictured(name, thing, level + 1)


def pictured(name: str, cls: type, level: int) -> Iterator[str]:
    """Lines on the picture of a result, which is drawn by a function for its type."""
    from fmus.kit import UserError
    from orchestration.reporting.drawing import draw, registered

    try:
        drawing = registered(draw, cls, "picture")
    except UserError:
        return
    yield f"{'#' * level} {name}.draw\n\n```python\n{name}.draw()\n```\n"
    parts = sections(inspect.getdoc(drawing) or "")
    yield f"{markdown(parts.pop(''))}\n"
    for heading, text in parts.items():
        yield from described(heading, text)


def inherited(cls: type) -> Iterator[str]:
    """Lines on public methods and properties that are those of a class it is made of."""
    for base in public_bases(cls):
        same = [
            name
            for name, one in vars(base).items()
            if not name.startswith("_") and inspect.getattr_static(cls, name) is one
        ]
        if same:
            names = ", ".join(f"`{cls.__name__}.{name}`" for name in same)
            yield f"As in {listed([base.__name__])}: {names}.\n"


def members(cls: type) -> dict[str, Any]:
    """Collect what a class has of its own, and from private bases, which have no entry."""
    found = dict(vars(cls))
    for base in cls.__bases__:
        if base.__name__.startswith("_"):
            found |= {name: one for name, one in vars(base).items() if name not in found}
    return found


def signature(thing: Any) -> str:
    """Names and defaults of the arguments; their types stand in the sections."""
    arguments = list(inspect.signature(thing).parameters.values())
    if arguments and arguments[0].name == "self":
        del arguments[0]
    plain = []
    for p in arguments:
        unwritable = p.default is not p.empty and repr(p.default).startswith("<")
        plain.append(p.replace(annotation=p.empty, default=... if unwritable else p.default))
    text = str(inspect.Signature(plain)).replace("Ellipsis", "...").replace("'", '"')
    return (
        text
        if len(text) < 90
        else text.replace("(", "(\n    ", 1).replace(", ", ",\n    ")[:-1] + ",\n)"
    )


def listed(names: Iterable[str], before: Iterable[str] = ()) -> str:
    """List names with links to their headings, numbered where they differ by case alone."""
    taken = {name.lower() for name in before}
    links = {name: f"{name.lower()}{'-1' * (name.lower() in taken)}" for name in names}
    return ", ".join(f"[`{name}`](#{link})" for name, link in links.items())


def page(things: Mapping[str, Any]) -> str:
    """Make the page of things by the names that offer them, and of what they return."""
    returned = results(things)
    lines = [INTRODUCTION, listed(things), ""]
    lines += [line for name, thing in things.items() for line in entry(name, thing)]
    if returned:
        lines += ["## What they return\n", listed(returned, things), ""]
        lines += [line for name, cls in returned.items() for line in entry(name, cls, 3)]
    return "\n".join(lines).rstrip("\n") + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(public()), encoding="utf-8")
