"""Results as tables, readable on a terminal and in Markdown alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Cell = str | int | float


@dataclass(frozen=True)
class Table:
    """Figures in rows.

    Attributes
    ----------
    columns : sequence of str
        Headings, with units.
    rows : sequence of sequences
        Text, integers (counts) and floats (shown with three digits).
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]

    def __str__(self) -> str:
        """Write the table in aligned Markdown, numbers to the right."""
        text = [[_shown(cell) for cell in row] for row in self.rows]
        numeric = [
            all(not isinstance(row[i], str) for row in self.rows) for i in range(len(self.columns))
        ]
        widths = [
            max(3, *(len(row[i]) for row in [self.columns, *text]))
            for i in range(len(self.columns))
        ]

        def line(cells: Sequence[str]) -> str:
            placed = [
                c.rjust(w) if n else c.ljust(w)
                for c, w, n in zip(cells, widths, numeric, strict=True)
            ]
            return "| " + " | ".join(placed) + " |"

        rule = ["-" * (w - 1) + ":" if n else "-" * w for w, n in zip(widths, numeric, strict=True)]
        return "\n".join([line(self.columns), line(rule), *map(line, text)])


@dataclass(frozen=True)
class Topic:
    """What one benchmark found.

    Attributes
    ----------
    title : str
    parts : sequence of str or Table
        Paragraphs and tables in the order of reading.
    """

    title: str
    parts: Sequence[str | Table]

    @property
    def tables(self) -> list[Table]:
        """The tables alone."""
        return [part for part in self.parts if isinstance(part, Table)]

    def __str__(self) -> str:
        """Write the topic as a section of Markdown."""
        return "\n\n".join([f"## {self.title}", *map(str, self.parts)])


def _shown(cell: Cell) -> str:
    if isinstance(cell, float):
        return f"{cell:.3g}" if abs(cell) < 1000 else f"{cell:,.0f}"
    return (
        f"{cell:,}" if isinstance(cell, int) else cell.replace("|", "\\|")
    )  # which would end the cell
