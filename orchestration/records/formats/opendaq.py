"""CSV files of openDAQ's recorder, whose first line defines the ticks of time."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

from orchestration.records.formats.clocks import insert_clock
from orchestration.records.formats.layout import TextLayout
from orchestration.records.formats.text import decode, tabulate
from orchestration.records.record import refuse
from orchestration.records.tables import Table, numbers

_SECONDS = ("s", "seconds", "second")


def read_opendaq(path: Path, content: bytes) -> Table:
    """Read a file of openDAQ's recorder; a `Reader`.

    Time is the column ``Domain`` in ticks; without this column it counts samples from the first
    row. A domain other than time, and a resolution or step that is not a number above 0, are
    refused.
    """
    text = decode(path, content)
    fields = dict(re.findall(r"(\w+)=([^;]*)", text.lines[0]))
    unit = fields.get("unit", "s").strip()
    if unit not in _SECONDS:
        raise refuse(path, f"row 1: the domain is in '{unit}' (allowed: {', '.join(_SECONDS)})")
    tick = _positive(path, fields, "resolution")
    step = _positive(path, fields, "delta") * tick
    if len(text.lines) < 2:
        raise refuse(path, "row 1 defines the time, and no header follows")
    table = tabulate(text, TextLayout(",", 1, text.split(1, ","), 2))
    ticks = next((column for column in table.columns if column.name == "Domain"), None)
    if ticks is None:
        insert_clock(table, float(step), "row 1")
        return table
    ticks.name = "time"
    ticks.unit = "s"
    tick_numbers = numbers(table, ticks)
    ticks.cells = float(tick) * (tick_numbers - tick_numbers[0])
    message = f"time is column 'Domain' in ticks of {float(tick):g} s, from row 1"
    table.note("clock from header", message)
    return table


def _positive(path: Path, fields: dict[str, str], name: str) -> Fraction:
    """Return a field as a fraction; raise if it is not a number above 0."""
    try:
        value = Fraction(fields[name].strip())
    except (KeyError, ValueError, ZeroDivisionError):
        value = Fraction(0)
    if value <= 0:
        text = fields.get(name, "missing")
        raise refuse(path, f"row 1: {name} of the time is {text} (allowed: a number above 0)")
    return value
