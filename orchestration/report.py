"""One-page HTML reports: self-contained, readable on a phone, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from pathlib import Path

from fmus.kit import archive
from fmus.kit.documentation import STYLE

_MORE = """
p.verdict { font-size: 1.2rem; border-left: 4px solid #0b6aa2; padding-left: 0.8rem }
figure { margin: 1.2rem 0 } figcaption { color: #52616e; font-size: 0.92rem }
table { font-size: 0.9rem } td { white-space: nowrap } td:not(:first-child) { font-variant-numeric: tabular-nums }
div.picture { overflow-x: auto } @media (max-width: 640px) { div.picture img { max-width: none; width: 640px } }
"""


class Page:
    """A page that grows downwards.

    Parameters
    ----------
    title : str
    verdict : str
        The result in one sentence, shown first.
    """

    def __init__(self, title: str, verdict: str):
        self.title = title
        self.parts = [f"<h1>{html.escape(title)}</h1>", f'<p class="verdict">{html.escape(verdict)}</p>']

    def heading(self, text: str) -> None:
        """Begin a section."""
        self.parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self.parts.append(f"<p>{html.escape(text)}</p>")

    def items(self, lines: Sequence[str]) -> None:
        """Add a list."""
        self.parts.append("<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Add a table of texts."""
        columns = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
        body = "".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>" for row in rows)
        self.parts.append(f'<div class="table"><table><tr>{columns}</tr>{body}</table></div>')

    def picture(self, file: Path, caption: str) -> None:
        """Embed a PNG with what it shows."""
        data = base64.b64encode(file.read_bytes()).decode()
        text = html.escape(caption)
        self.parts.append(
            f'<figure><div class="picture"><img alt="{text}" src="data:image/png;base64,{data}"></div>'
            f"<figcaption>{text}</figcaption></figure>"
        )

    def code(self, lines: Sequence[str]) -> None:
        """Add commands to copy."""
        self.parts.append(f"<pre><code>{html.escape(chr(10).join(lines))}</code></pre>")

    def write(self, path: Path) -> None:
        """Write the page.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        head += f"<title>{html.escape(self.title)}</title><style>{STYLE}{_MORE}</style>"
        body = "\n".join(self.parts)
        archive.write(
            path, f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>{body}</body></html>\n'.encode()
        )
