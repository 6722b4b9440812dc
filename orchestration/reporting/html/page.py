"""Self-contained HTML reports of one page, which load nothing and can be read on a phone."""

from __future__ import annotations

import base64
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit import files, quoting
from fmus.kit.build import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEADING = re.compile(r"(?<=<h)\d(?=>)|(?<=</h)\d(?=>)")  # its level
_GROUND = "var(--jp-layout-color0, var(--vscode-editor-background, Canvas))"  # of notebooks, too
_EDGE = "#7f8a96 3px, rgb(127 138 150 / 0.25) 3px, transparent"
# A bar and a shadow mark an edge with hidden contents, without a script: their covers scroll with
# the contents, and they stay at the edge. The contrast of the bar is 3:1 to a light background and
# to a dark one; text over the shadow keeps 4.5:1.
SCROLLED = (
    f"background: linear-gradient(to right, {_GROUND} 1rem, transparent) 0 0 / 2rem 100% no-repeat"
    f" local, linear-gradient(to left, {_GROUND} 1rem, transparent) 100% 0 / 2rem 100% no-repeat"
    f" local, linear-gradient(to right, {_EDGE}) 0 0 / 0.9rem 100% no-repeat,"
    f" linear-gradient(to left, {_EDGE}) 100% 0 / 0.9rem 100% no-repeat"
)
# Elements may be from somebody else's file.
_NO_SCRIPTS = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; style-src'
    " 'unsafe-inline'; img-src data:\">"
)
_MORE = """
body { overflow-wrap: anywhere; max-width: 64rem }
h1 { font-size: 1.7rem; margin: 0.3rem 0 0.8rem }
h2 { margin-top: 2.4rem; border-top: 1px solid #e3e8ec; padding-top: 1.2rem }
p.about { color: #52616e; font-size: 0.92rem; margin-bottom: 0 } p.about code { background: none }
p.verdict { font-size: 1.2rem; border-left: 4px solid #0b6aa2; padding: 0.8rem 1rem;
  background: #f7f9fb; border-radius: 0 6px 6px 0 }
p.verdict code, li code, td code { overflow-wrap: anywhere }
figure { margin: 1.2rem 0; min-width: 0 }
figcaption, .muted { color: #52616e; font-size: 0.92rem }
table { font-size: 0.9rem } td { white-space: nowrap } th, td { overflow-wrap: normal }
td:not(:first-child) { font-variant-numeric: tabular-nums }
div.table, div.picture, div.scroll { overflow-x: auto; SCROLLED }
@media print { div.table, div.picture, div.scroll { background: none; overflow: visible } }
:focus-visible { outline: 2px solid #0b6aa2 }
summary { cursor: pointer; color: #0b3d5c; padding: 0.3rem 0; font-weight: 600 }
@media (max-width: 640px) { div.picture img { max-width: none; width: 640px } }
"""
_CHART = """
.chart { font-size: 0.8rem; line-height: 1.2; color: #3c4a57 }
.chart ul { display: flex; flex-wrap: wrap; gap: 0.2rem 1rem; list-style: none; padding: 0;
  margin: 0 0 0.4rem }
.chart li i { display: inline-block; width: 1.1rem; height: 0.25rem; margin-right: 0.35rem;
  vertical-align: middle }
.chart p { margin: 0.5rem 0 0.2rem } .chart p.across { text-align: center; margin: 0 }
.chart .strip { position: relative; height: 1.2rem; overflow: hidden }
.chart .strip span { position: absolute; white-space: nowrap; color: #7a5410; padding: 0 0.2rem }
.chart .plot, .chart .x, .chart .strip { position: relative; margin: 0 0.8rem 0 3.6rem }
.chart .x { height: 1.5rem } .chart .plot span, .chart .x span { position: absolute }
.chart .plot span { right: 100%; padding-right: 0.35rem; transform: translateY(50%);
  white-space: nowrap }
.chart .x span { top: 0.25rem; transform: translateX(-50%); white-space: nowrap }
.chart svg { display: block; width: 100%; height: 100%; fill: none; overflow: hidden;
  border-left: 1px solid #9aa5af; border-bottom: 1px solid #9aa5af }
.chart path { vector-effect: non-scaling-stroke; stroke-linejoin: round }
.chart .grid { stroke: #e3e8ec } .chart .mark { stroke: #b98a2f; stroke-dasharray: 4 3 }
table.heat { border-collapse: separate; border-spacing: 2px } table.heat td { border: 0;
  text-align: right }
table.heat th { border: 0; font-weight: 400; white-space: nowrap }
"""

_ELEMENTS = """
.chip { display: inline-block; padding: 0.02rem 0.55rem; border-radius: 1rem; font-size: 0.85em;
  white-space: nowrap; background: #e9eef2; color: #3c4a57 }
.chip.consistent, .chip.named { background: #dcefe2; color: #155c2e }
.chip.recalibrate { background: #dcebf6; color: #0b4f7a }
.chip.cause, .chip.wrong, .chip.differs { background: #fbe0e3; color: #8f1f30 }
.chip.ambiguous, .chip.nottoldapart { background: #fbedcf; color: #734d05 }
.chip.unexplained, .chip.cannotbejudged { background: #e9e1f5; color: #4d2c82 }
p.verdict .chip { font-weight: 600; margin-right: 0.4rem } sup { line-height: 0 }
code.id { font-size: 0.85em; color: #52616e; background: none; padding: 0 }
table { width: 100% } td .two { display: block; white-space: normal; min-width: 7rem }
td:first-child .two { min-width: 13rem } td .two .muted { display: block; line-height: 1.35 }
.bars { display: grid; grid-template-columns: minmax(6rem, max-content) 1fr max-content;
  gap: 0.25rem 0.8rem; align-items: center; margin: 0.6rem 0 1.2rem;
  font-variant-numeric: tabular-nums }
.bars b { grid-column: 1 / -1 } .bars .track { height: 0.8rem; background: #f2f5f8;
  border-radius: 2px }
.bars .track i { display: block; height: 100%; min-width: 2px; border-radius: 2px }
.equation { font: italic 1.25rem serif; margin: 0.8rem 0 1rem; overflow-x: auto }
.gain { display: block; height: 4px; border-radius: 2px; background: #0b6aa2; margin-top: 0.3rem;
  min-width: 1px }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr));
  gap: 0 1.2rem }
.pair figure { margin: 0.4rem 0 } svg.interval { display: block; margin-top: 0.35rem }
@media (max-width: 640px) {
  .bars { grid-template-columns: 1fr max-content; grid-auto-flow: dense }
  .bars .track { grid-column: 1 / -1 }
  div.table table, div.table tbody, div.table tr, div.table td { display: block }
  div.table th { display: none } div.table tr { border: 1px solid #c9d3dc; margin-bottom: 0.5rem }
  div.table tr:first-child, div.table td:empty { display: none }
  div.table td { border: 0; white-space: normal; overflow-wrap: anywhere; padding: 0.15rem 0.6rem }
  div.table td[data-head]:not([data-head=""])::before { content: attr(data-head); color: #52616e;
    display: block; font-size: 0.8rem } }
"""


class Markup(str):
    """Text in HTML, which is not escaped again."""


def escaped(text: str) -> Markup:
    """Return a text quoted for HTML, unless it is `Markup`."""
    return text if isinstance(text, Markup) else Markup(quoting.html(text))


class Page:
    """A page to which elements are appended. All texts may be `Markup`.

    Parameters
    ----------
    title : str
        The result in a sentence.
    verdict : str
        The reasons for the result, shown below the title.
    about : str
        The subject of the page, in small print above the title.
    """

    def __init__(self, title: str, verdict: str, about: str = ""):
        self.title = title
        self.parts = [f'<p class="about">{escaped(about)}</p>'] if about else []
        self.parts += [f"<h1>{escaped(title)}</h1>", f'<p class="verdict">{escaped(verdict)}</p>']

    def heading(self, text: str) -> None:
        """Append the heading of a section."""
        self.parts.append(f"<h2>{escaped(text)}</h2>")

    def subheading(self, text: str) -> None:
        """Append the heading of a part of a section."""
        self.parts.append(f"<h3>{escaped(text)}</h3>")

    def include(self, page: Page) -> None:
        """Append the elements of another page, with its headings a level lower."""
        for part in page.parts:
            self.parts.append(_HEADING.sub(lambda level: str(int(level[0]) + 1), part))

    def text(self, text: str) -> None:
        """Append a paragraph."""
        self.parts.append(f"<p>{escaped(text)}</p>")

    def items(self, lines: Sequence[str]) -> None:
        """Append a list."""
        self.parts.append("<ul>" + "".join(f"<li>{escaped(line)}</li>" for line in lines) + "</ul>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Append a table of texts."""
        columns = "".join(f'<th scope="col">{escaped(cell)}</th>' for cell in head)
        labels = [_plain([cell]) for cell in head]  # on a phone, where cells stand in a column
        body = ""
        for row in rows:
            cells = zip(labels, row, strict=False)
            text = "".join(f'<td data-head="{label}">{escaped(cell)}</td>' for label, cell in cells)
            body += f"<tr>{text}</tr>"
        self.parts.append(
            f'<div class="table" tabindex="0" role="region" aria-label="{_plain(head)}">'
            f"<table><tr>{columns}</tr>{body}</table></div>"
        )

    @contextmanager
    def folded(self, summary: str) -> Iterator[None]:
        """Hide elements that are appended in this context below a summary that opens them."""
        self.parts.append(f"<details><summary>{escaped(summary)}</summary>")
        yield
        self.parts.append("</details>")

    def picture(self, file: Path, caption: str) -> None:
        """Append a PNG from a file, with a caption."""
        self._add_png(file.read_bytes(), caption)

    def figure(self, figure: Figure, caption: str) -> None:
        """Append a figure of matplotlib, with a caption."""
        from orchestration.reporting.figure import rendered

        self._add_png(rendered(figure, "png"), caption)

    def _add_png(self, picture: bytes, caption: str) -> None:
        data = base64.b64encode(picture).decode()
        text = escaped(caption)
        self.parts.append(
            f'<figure><div class="picture" tabindex="0"><img alt="{text}"'
            f' src="data:image/png;base64,{data}"></div><figcaption>{text}</figcaption></figure>'
        )

    def chart(self, chart: Markup, caption: str) -> None:
        """Append a chart of `stacked` or `heat_map`, with a caption."""
        self.parts.append(f"<figure>{chart}<figcaption>{escaped(caption)}</figcaption></figure>")

    def code(self, lines: Sequence[str]) -> None:
        """Append commands to copy."""
        self.parts.append(f'<pre tabindex="0"><code>{escaped(chr(10).join(lines))}</code></pre>')

    def reproduction(self, files: Sequence[Path], command: str) -> None:
        """Append the command that made the page, versions, and digests of its input files."""
        self.made_by(command, facts_about(files))

    def made_by(self, command: str, facts: Mapping[str, str]) -> None:
        """Append the command that made the page, with facts of `facts_about`."""
        self.subheading("How to reproduce")
        self.code([command])
        lines = (f"{escaped(name)}: <code>{escaped(text)}</code>" for name, text in facts.items())
        self.items([*map(Markup, lines)])
        self.text("Nothing is drawn at random: the same files give the same page.")

    def html(self) -> str:
        """Return the whole page."""
        style = STYLE + _MORE.replace("SCROLLED", SCROLLED) + _CHART + _ELEMENTS
        head = (
            f'<meta charset="utf-8">{_NO_SCRIPTS}<meta name="viewport" content="width=device-width,'
            f' initial-scale=1"><title>{_plain([self.title])}</title><style>{style}</style>'
        )
        body = "\n".join(self.parts)
        return (
            f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n'
            f"<body><main>{body}</main></body></html>\n"
        )

    def write(self, path: Path) -> None:
        """Write the page.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        files.write(path, self.html().encode())


def _plain(texts: Sequence[str]) -> str:
    """Return texts without markup, for an attribute or the title, joined by commas."""
    return ", ".join(re.sub(r"<[^>]+>", " ", escaped(text)).strip() for text in texts)


def facts_about(files: Sequence[Path]) -> dict[str, str]:
    """Return versions, and digests of files, by what they are of."""
    facts = {"ppy-rig": version("ppy-rig"), "Python": platform.python_version()}
    return facts | {f"SHA-256 of {file.name}": _digest(file) for file in files}


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "cannot be read again"
