"""Display of results in a notebook: tables and picture as HTML, the picture as PNG too.

Modules that draw and format are imported inside functions, because commands import this one.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.reporting.drawing import draw, write_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType
    from rich.table import Table

_LONGEST = 100  # characters of a ``repr``


class Displayable:
    """A result that prints as text, and shows tables and a picture in a notebook."""

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
        """Draw the result, and write the picture if a path is given.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Returns
        -------
        matplotlib.figure.Figure
            The figure of `draw`, which a notebook shows.

        Raises
        ------
        UserError
            If there is nothing to draw, or the file cannot be written.
        """
        from orchestration.reporting import pictures

        return pictures.also_saved(self.draw(), path)

    def report(self, path: str | Path, command: str = "") -> Path:
        """Write the page of the result.

        Parameters
        ----------
        path : str or Path
            An ``.html`` file.
        command : str
            Command that made the result, for the page; by default an equivalent one, where there is
            one.

        Raises
        ------
        UserError
            If the result has no page, it cannot be written, or its name does not end in ``.html``.
        """
        return write_page(self, path, command)

    def save(self, path: str | Path) -> Path:
        """Write the result to a file, from which `ppy.load` shows it again.

        Parameters
        ----------
        path : str or Path
            A ``.json`` file: the figures, and what text and page show.

        Raises
        ------
        UserError
            If it cannot be written, or its name does not end in ``.json``.
        """
        from orchestration.reporting import saving

        return saving.save(self._kept(), path)

    def _kept(self) -> dict[str, Any]:
        """Return what a file has of the result."""
        from orchestration.reporting import saving

        return saving.kept(self)

    def __str__(self) -> str:
        from orchestration.reporting.console import plain_text

        return "\n".join(plain_text(part) for part in self.overview())

    def _repr_html_(self) -> str:
        return str(self._repr_mimebundle_()["text/html"])

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Return the result by MIME type, with one drawing for HTML and PNG."""
        try:
            figure = self.draw()
        except UserError:  # there is nothing to draw
            figure = None
        return bundle(html_of(self.overview()), figure)


def bundle(html: str, figure: Figure | None) -> dict[str, Any]:
    """Return HTML with a figure below it, and the figure as PNG in base64, by MIME type."""
    if figure is None:
        return {"text/html": html}
    from orchestration.reporting.figure import rendered

    png = base64.b64encode(rendered(figure, "png")).decode()
    image = f'<img style="max-width:100%" alt="" src="data:image/png;base64,{png}">'
    return {"text/html": f"{html}\n{image}", "image/png": png}


def html_of(parts: Iterable[RenderableType]) -> str:
    """Return printed parts as HTML: texts as paragraphs, tables as tables."""
    return "\n".join(filter(None, map(_html, parts)))


def one_line(text: str) -> str:
    """Return a description as a ``repr``: one line in angle brackets, cut at 100 characters."""
    line = " ".join(text.split())
    return f"<{line}>" if len(line) <= _LONGEST else f"<{line[: _LONGEST - 3]}...>"


def _html(part: RenderableType) -> str:
    """Return a table, a text or a group of these as HTML; empty for a blank text."""
    from rich.console import Group
    from rich.table import Table

    if isinstance(part, Group):
        return html_of(part.renderables)
    if isinstance(part, Table):
        return _table(part)
    text = _escaped(part)
    return f"<p>{text}</p>" if text.strip() else ""


def _table(table: Table) -> str:
    """Return a table as HTML, with its title above it and its columns aligned as in the table."""
    from orchestration.reporting.html import SCROLLED

    head = ""
    columns = []
    for column in table.columns:
        style = f' style="text-align:{column.justify}"'
        head += f"<th{style}>{_escaped(column.header)}</th>"
        columns.append([f"<td{style}>{_escaped(cell)}</td>" for cell in column.cells])
    body = "".join(f"<tr>{''.join(row)}</tr>" for row in zip(*columns, strict=True))
    title = f"<p><b>{_escaped(table.title)}</b></p>" if table.title else ""
    return (
        # focusable, so that the keyboard scrolls a table wider than the page
        f'{title}<div tabindex="0" style="overflow-x:auto;{SCROLLED}"><table cellpadding="5">'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _escaped(content: RenderableType) -> str:
    """Return a text of Python or of rich, escaped for HTML."""
    from orchestration.reporting.html import escaped

    return escaped(str(content))
