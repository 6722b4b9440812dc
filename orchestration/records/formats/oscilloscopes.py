"""Text of oscilloscopes whose time is not a column, or whose settings stand beside the data."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from orchestration.records.formats.clocks import insert_clock
from orchestration.records.formats.layout import split
from orchestration.records.formats.text import decode
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table, parse_cell

RIGOL = re.compile(rb"(?:\xef\xbb\xbf)?(?:X,CH\d[^\r\n]*,Start,Increment|Time\(s\),[^\r\n]*t0\s*=)")
TEKTRONIX = re.compile(rb'(?:\xef\xbb\xbf)?"?Record Length"?,')
_SETTING = re.compile(r"t0\s*=|tInc\s*=|Start$|Increment$")
_IN_HEADER = re.compile(r"(?P<name>t0|tInc)\s*=\s*(?P<value>\S+)")


def read_rigol(path: Path, content: bytes) -> Table:
    """Read a table of Rigol; a `Reader`.

    Time is start + k × increment: both stand in the row below their names, where the first column
    is k, or in cells ``t0 =`` and ``tInc =`` of the header, where the column of time is empty.
    """
    text = decode(path, content)
    header = split(text.lines[0], ",")
    stated = {m["name"]: m["value"] for cell in header if (m := _IN_HEADER.match(cell.strip()))}
    below = [] if stated or len(text.lines) < 2 else split(text.lines[1], ",")
    if not stated:
        settings = dict(zip(header, below, strict=False))
        stated = {"t0": settings.get("Start", ""), "tInc": settings.get("Increment", "")}
    names = [cell for cell in header[1:] if not _SETTING.match(cell.strip())]
    cells, rows = _rows(path, text.lines, 2 if below else 1, range(1, 1 + len(names)))
    start, step = (_number(path, stated, name) for name in ("t0", "tInc"))
    table = Table(path, _columns(names, below[1:], cells), np.array(rows), text.repairs)
    insert_clock(table, step, "the header", start)
    return table


def read_tektronix(path: Path, content: bytes) -> Table:
    """Read a table of a Tektronix TDS; a `Reader`.

    Settings are in two columns, time and values in two others.
    """
    text = decode(path, content)
    lines = [split(line, ",") for line in text.lines]
    settings = {cells[0].strip().casefold(): cells[1] for cells in lines if len(cells) > 1}
    cells, rows = _rows(path, text.lines, 0, range(3, 5))
    names = ["time", settings.get("source", "").strip() or "CH1"]
    units = [settings.get("horizontal units", "s"), settings.get("vertical units", "")]
    return Table(path, _columns(names, units, cells), np.array(rows), text.repairs)


def _rows(
    path: Path, lines: Sequence[str], first: int, places: range
) -> tuple[list[list[str]], list[int]]:
    """Return the cells at some places of the lines from one on, and the numbers of their rows."""
    cells = []
    rows = []
    for index in range(first, len(lines)):
        found = split(lines[index], ",")
        if not found:
            continue
        if len(found) < places.stop:
            raise refuse(
                path, f"row {index + 1}: {len(found)} cells, and data are in {places.stop}"
            )
        cells.append([found[k].strip() for k in places])
        rows.append(index + 1)
    if not cells:
        raise refuse(path, "there is no row of data")
    return cells, rows


def _columns(names: Sequence[str], units: Sequence[str], cells: list[list[str]]) -> list[Column]:
    """Return the columns of rows of cells; units below the names count if the names state none."""
    columns = []
    padded = [*units, *[""] * len(names)]
    for cell, below, texts in zip(names, padded, zip(*cells, strict=True), strict=False):
        columns.append(Column.read(cell.strip(), list(texts), below))
    return columns


def _number(path: Path, stated: Mapping[str, str], name: str) -> float:
    """Return a number of the header; raise if it is none."""
    value = parse_cell(stated.get(name, ""))
    if value is None or not np.isfinite(value):
        given = stated.get(name, "") or "missing"
        raise refuse(path, f"row 1: {name} of the time is {given} (allowed: a number)")
    return value
