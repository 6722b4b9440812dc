"""Results in a notebook: tables and a picture as HTML, the picture as PNG, the text as ever.

What makes these is loaded when it is needed: results are defined in modules that commands load.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.reporting.drawing import draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType
    from rich.table import Table

_LONGEST = 100  # characters of a result in a line


class Displayable:
    """A result: a text when it is printed, tables and a picture in a notebook."""

    __slots__ = ()

    def overview(self) -> Iterable[RenderableType]:
        """Return the lines and tables that the result consists of."""
        raise NotImplementedError

    def draw(self) -> Figure:
        """Draw the result, as a notebook shows it.

        Returns
        -------
        matplotlib.figure.Figure
            Made without pyplot.

        Raises
        ------
        UserError
            If there is nothing to draw.
        """
        return draw(self)

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the result, and write the picture where a path is given.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Returns
        -------
        matplotlib.figure.Figure
            That of `draw`, which shows itself in a notebook.

        Raises
        ------
        UserError
            If there is nothing to draw, or the file cannot be written.
        """
        from orchestration.reporting import pictures

        return pictures.also_saved(self.draw(), path)

    def __str__(self) -> str:
        from orchestration.reporting.console import plain_text

        return "\n".join(plain_text(part) for part in self.overview())

    def _repr_html_(self) -> str:
        return str(self._repr_mimebundle_()["text/html"])

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Return the forms that a notebook chooses from; the picture is drawn once for all."""
        try:
            figure = self.draw()
        except UserError:  # there is nothing to draw
            figure = None
        return bundle(html_of(self.overview()), figure)


def bundle(html: str, figure: Figure | None) -> dict[str, Any]:
    """Return HTML with a figure below it, and the figure by itself, as notebooks keep them."""
    if figure is None:
        return {"text/html": html}
    from orchestration.reporting.figure import rendered

    drawn = base64.b64encode(rendered(figure, "png")).decode()
    image = f'<img style="max-width:100%" alt="" src="data:image/png;base64,{drawn}">'
    return {"text/html": f"{html}\n{image}", "image/png": drawn}


def html_of(parts: Iterable[RenderableType]) -> str:
    """Return what would be printed as HTML: a paragraph for a text, a table for a table."""
    return "\n".join(filter(None, map(_html, parts)))


def one_line(text: str) -> str:
    """Return a description as a ``repr``: in brackets and a line, cut where it is too long."""
    line = " ".join(text.split())
    return f"<{line}>" if len(line) <= _LONGEST else f"<{line[: _LONGEST - 3]}...>"


def _html(part: RenderableType) -> str:
    from rich.console import Group
    from rich.table import Table

    if isinstance(part, Group):
        return html_of(part.renderables)
    if isinstance(part, Table):
        return _table(part)
    text = _escaped(part)
    return f"<p>{text}</p>" if text.strip() else ""


def _table(table: Table) -> str:
    """Return a table with its title above it; numbers stand to the right."""
    from orchestration.reporting.html import SCROLLED

    columns = [(column, f' style="text-align:{column.justify}"') for column in table.columns]
    head = "".join(f"<th{style}>{_escaped(column.header)}</th>" for column, style in columns)
    cells = (
        [f"<td{style}>{_escaped(cell)}</td>" for cell in column.cells] for column, style in columns
    )
    body = "".join(f"<tr>{''.join(row)}</tr>" for row in zip(*cells, strict=True))
    title = f"<p><b>{_escaped(table.title)}</b></p>" if table.title else ""
    return (
        # within reach of the keyboard, which scrolls what is wider than the page
        f'{title}<div tabindex="0" style="overflow-x:auto;{SCROLLED}"><table cellpadding="5">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _escaped(content: RenderableType) -> str:
    """Return a text of rich, or of Python, as HTML."""
    from orchestration.reporting.html import escaped

    return escaped(str(content))
