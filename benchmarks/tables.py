"""Results as tables and pages, readable on a terminal and in Markdown alike."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

Cell = str | int | float
DOCS = Path(__file__).resolve().parent.parent / "docs"
_PACKAGES = ("fmpy", "casadi", "numpy", "pythonfmu", "ziglang")


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
        columns = list(zip(self.columns, *text, strict=True))
        widths = [max(3, *map(len, column)) for column in columns]
        numeric = [
            all(not isinstance(cell, str) for cell in column)
            for column in zip(*self.rows, strict=True)
        ] or [True] * len(widths)

        def line(cells: Sequence[str]) -> str:
            placed = [
                cell.rjust(width) if number else cell.ljust(width)
                for cell, width, number in zip(cells, widths, numeric, strict=True)
            ]
            return "| " + " | ".join(placed) + " |"

        rule = ["-" * (w - 1) + ":" if n else "-" * w for w, n in zip(widths, numeric, strict=True)]
        return "\n".join([line(self.columns), line(rule), *map(line, text)])


@dataclass(frozen=True)
class Topic:
    """A section of a page.

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
    if isinstance(cell, int):
        return f"{cell:,}"
    return cell.replace("|", "\\|")  # which would end the cell


def publish(head: str, topics: Sequence[Topic], page: Path | None) -> None:
    """Print topics below the machine that they were measured on; write the page if there is one."""
    text = "\n\n".join([head, str(machine()), *map(str, topics)]) + "\n"
    print(text, flush=True)
    if page is not None:
        page.write_text(text, encoding="utf-8")


def machine() -> Table:
    """Processor, operating system, Python, compiler and the packages that the figures depend on."""
    from fmus.kit.build import toolchain

    rows = [
        ["processor", f"{_processor()}, {platform.machine()}"],
        ["cores for this process", str(len(os.sched_getaffinity(0)))],
        ["operating system", platform.freedesktop_os_release()["PRETTY_NAME"]],
        ["Python", f"{platform.python_version()} ({platform.python_implementation()})"],
        ["C compiler", toolchain.find_compiler(toolchain.host_platform()).label],
        *([name, importlib.metadata.version(name)] for name in _PACKAGES),
    ]
    return Table(["", "measured on"], rows)


def _processor() -> str:
    found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.M)
    return found[1].strip() if found else platform.processor()
