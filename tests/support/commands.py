"""All commands of the command line, as typer has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from orchestration.cli import app


def _walk(group: Any, *words: str) -> Iterator[tuple[str, Any]]:
    for name in group.list_commands(None):
        below = group.get_command(None, name)
        if hasattr(below, "list_commands"):
            yield from _walk(below, *words, name)
        else:
            yield " ".join((*words, name)), below


COMMANDS = dict(_walk(typer.main.get_command(app.app)))
