"""One-page HTML reports: self-contained, readable on a phone, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fmus.kit import UserError, files
from fmus.kit.build import STYLE

_MORE = """
body { overflow-wrap: anywhere }
p.verdict { font-size: 1.2rem; border-left: 4px solid #0b6aa2; padding-left: 0.8rem }
figure { margin: 1.2rem 0 } figcaption, .muted { color: #52616e; font-size: 0.92rem }
table { font-size: 0.9rem } td { white-space: nowrap }
td:not(:first-child) { font-variant-numeric: tabular-nums }
div.picture { overflow-x: auto }
@media (max-width: 640px) { div.picture img { max-width: none; width: 640px } }
"""
_INTERACTIVE = """
div.plot { width: 100% }
div.views { display: flex; flex-wrap: wrap; gap: 0.4rem; margin-bottom: 0.4rem }
div.views button { font: inherit; font-size: 0.9rem; padding: 0.25rem 0.8rem;
  border: 1px solid #c9d3dc; border-radius: 1rem;
  background: #fff; color: #0b3d5c; cursor: pointer }
div.views button:hover, div.views button:focus-visible { background: #eef3f7 }
@media print { div.views { display: none } }
"""
# a finger scrolls the page and does not zoom by accident; the buttons do
_DRAW = """
const touch = matchMedia("(pointer: coarse)").matches;
for (const place of document.querySelectorAll("div.plot")) {
  const figure = JSON.parse(place.nextElementSibling.textContent);
  if (touch) figure.layout.dragmode = false;
  const options = {responsive: true, displayModeBar: false};
  Plotly.newPlot(place, figure.data, figure.layout, options).then(() => {
    const legend = place.querySelector(".legend");
    const more = legend ? legend.getBoundingClientRect().height - 30 : 0;
    if (more > 0) { // the legend has taken more lines than one, and gets the room
      const height = figure.layout.height + more;
      place.style.height = height + "px";
      Plotly.relayout(place, {height: height, "margin.t": figure.layout.margin.t + more});
    }
  });
  for (const button of place.parentElement.querySelectorAll(".views button")) {
    const range = JSON.parse(button.dataset.range);
    const shown = range ? {"xaxis.range": range} : {"xaxis.autorange": true};
    button.onclick = () => Plotly.relayout(place, shown);
  }
}
"""


class Markup(str):
    """Text that is HTML already and is not escaped again."""


def escaped(text: str) -> Markup:
    """Return a text as HTML; bytes of a file name that are no text are shown as such."""
    if isinstance(text, Markup):
        return text
    return Markup(html.escape(text.encode(errors="backslashreplace").decode()))


def path_of_report(path: str | Path) -> Path:
    """Return the path of a report, by a name that is one of a page.

    Raises
    ------
    UserError
        If the name does not end in ``.html``.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise UserError(f"{target}: the name of a report ends in .html")
    return target


class Page:
    """A page that grows downwards. All texts may be `Markup`.

    Parameters
    ----------
    title : str
    verdict : str
        The result in one sentence, shown first.
    style : str
        CSS for what this page has and others have not.
    """

    def __init__(self, title: str, verdict: str, style: str = ""):
        self.title = title
        self.style = style
        self.interactive = False
        self.parts = [f"<h1>{escaped(title)}</h1>", f'<p class="verdict">{escaped(verdict)}</p>']

    def heading(self, text: str) -> None:
        """Begin a section."""
        self.parts.append(f"<h2>{escaped(text)}</h2>")

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self.parts.append(f"<p>{escaped(text)}</p>")

    def items(self, lines: Sequence[str]) -> None:
        """Add a list."""
        self.parts.append("<ul>" + "".join(f"<li>{escaped(line)}</li>" for line in lines) + "</ul>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Add a table of texts."""
        columns = "".join(f"<th>{escaped(cell)}</th>" for cell in head)
        labels = [
            "" if isinstance(cell, Markup) else escaped(cell) for cell in head
        ]  # told where a row is stacked
        body = ""
        for row in rows:
            cells = (
                f'<td data-label="{name}">{escaped(cell)}</td>'
                for name, cell in zip(labels, row, strict=True)
            )
            body += f"<tr>{''.join(cells)}</tr>"
        self.parts.append(f'<div class="table"><table><tr>{columns}</tr>{body}</table></div>')

    def picture(self, file: Path, caption: str) -> None:
        """Embed a PNG with what it shows."""
        data = base64.b64encode(file.read_bytes()).decode()
        text = escaped(caption)
        self.parts.append(
            f'<figure><div class="picture"><img alt="{text}"'
            f' src="data:image/png;base64,{data}"></div><figcaption>{text}</figcaption></figure>'
        )

    def plot(
        self,
        figure: Mapping[str, Any],
        caption: str,
        views: Mapping[str, Sequence[float] | None] | None = None,
    ) -> None:
        """Add an interactive figure.

        Parameters
        ----------
        figure : Mapping
            ``data`` and ``layout`` as plotly.js takes them.
        caption : str
        views : Mapping of str to pair of float, or None for all
            Buttons, and the range of the horizontal axis that they show.
        """
        self.interactive = True
        buttons = "".join(
            f'<button type="button" data-range="{json.dumps(ends)}">{escaped(label)}</button>'
            for label, ends in (views or {}).items()
        )
        text = escaped(caption)
        data = json.dumps(figure, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
        self.parts.append(
            f"<figure>{f'<div class=views>{buttons}</div>' if buttons else ''}"
            f'<div class="plot" role="img" aria-label="{text}"'
            f' style="height:{figure["layout"]["height"]}px"></div>'
            "<script"
            f' type="application/json">{data}</script><figcaption>{text}</figcaption></figure>'
        )

    def code(self, lines: Sequence[str]) -> None:
        """Add commands to copy."""
        self.parts.append(f"<pre><code>{escaped(chr(10).join(lines))}</code></pre>")

    def html(self) -> str:
        """Return the whole page, with the library of interactive figures in it if there are any."""
        style, body = STYLE + _MORE + self.style, "\n".join(self.parts)
        if self.interactive:
            from plotly.offline import get_plotlyjs

            style += _INTERACTIVE
            body += (
                "<noscript><p>The plots of this page are drawn by JavaScript, which is switched"
                " off.</p></noscript>"
            )
            body += f"\n<script>{get_plotlyjs()}</script>\n<script>{_DRAW}</script>"
        head = (
            '<meta charset="utf-8"><meta name="viewport" content="width=device-width,'
            ' initial-scale=1">'
        )
        head += f"<title>{escaped(self.title)}</title><style>{style}</style>"
        return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>{body}</body></html>\n'

    def write(self, path: Path) -> None:
        """Write the page.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        files.write(path, self.html().encode())
