"""Output of a command as plain text: for ``str()`` of a result and for notebooks."""

from __future__ import annotations

import html
import io

from rich.console import Console, RenderableType

WIDTH = 120  # columns, for tables


def plain_text(renderable: RenderableType) -> str:
    """Return what would be printed, without colours."""
    console = Console(
        file=io.StringIO(), width=WIDTH, highlight=False, markup=False, emoji=False, soft_wrap=True
    )
    console.print(renderable)
    written: str = console.file.getvalue()  # type: ignore[attr-defined]
    return "\n".join(line.rstrip() for line in written.rstrip("\n").split("\n"))


def preformatted(text: str) -> str:
    """Return a text as HTML that keeps its columns, for a notebook."""
    return f"<pre>{html.escape(text)}</pre>"
