"""LabVIEW files: text (.lvm) with header blocks, and binary TDMS."""

import io
import logging
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit.extras import optional
from orchestration.records.formats.clocks import insert_clock, on_one_clock
from orchestration.records.formats.layout import TextLayout
from orchestration.records.formats.text import Lines, decode, tabulate
from orchestration.records.record import damaged, refuse
from orchestration.records.tables import Column, Table, plain_unit

_END = "***End_of_Header***"
_DELIMITERS = {"tab": "\t", "comma": ",", "semicolon": ";"}


def read_lvm(path: Path, content: bytes) -> Table:
    """Read a LabVIEW text file of one segment; a `Reader`.

    Column ``X_Value`` comes first, in seconds, then the channels with the units of
    ``Y_Unit_Label``. A file without an end of its header, with several segments, or with an X
    column per channel is refused.
    """
    text = decode(path, content)
    layout = _layout(text)
    fields = _header_fields(text, layout.names - 1, layout.delimiter)
    table = tabulate(text, layout, optional_last=layout.header[-1] == "Comment")
    last = table.columns[-1]
    if last.name == "Comment" and _is_empty(last):
        table.columns.pop()
    clock, *channels = table.columns
    for column, unit in zip(channels, fields.get("Y_Unit_Label", []), strict=False):
        if column.unit is None and column.name != "Comment":
            column.unit = plain_unit(unit)
    clock.unit = "s"
    if _is_empty(clock):
        table.columns.pop(0)
        start, step = _clock_settings(path, fields)
        insert_clock(table, step, "X0 and Delta_X", start)
        table.columns[0].name = clock.name
    return table


def _layout(text: Lines) -> TextLayout:
    """Return the delimiter that the header states, and the line of the columns below it."""
    ends = [index for index, line in enumerate(text.lines) if line.strip().startswith(_END)]
    if not ends:
        raise refuse(text.path, f"LabVIEW text without a line {_END}")
    delimiter = _delimiter(text.path, text.lines[: ends[0]])
    names = _find_column_names(text, ends)
    header = [cell.strip() for cell in text.split(names, delimiter)]
    if header[0] != "X_Value":
        raise refuse(
            text.path, f"row {names + 1}: '{header[0]}' where X_Value should be the first column"
        )
    return TextLayout(delimiter, names, header, names + 1)


def _is_empty(column: Column) -> bool:
    return not any(str(cell).strip() for cell in column.cells)


def _delimiter(path: Path, header: list[str]) -> str:
    """Return the delimiter that a header names; a tab if it names none."""
    lines = [line for line in header if line.lower().startswith("separator")]
    separator = lines[0] if lines else "Separator\tTab"
    word = separator[len("separator") :].strip(" \t,;").lower() or "tab"
    if word not in _DELIMITERS:
        raise refuse(path, f"Separator '{word}' is not known (allowed: Tab, Comma)")
    return _DELIMITERS[word]


def _find_column_names(text: Lines, ends: list[int]) -> int:
    """Return the index of the line of column names; raise without data or for several segments.

    A file has one header, and one more for each segment; some programs write only the first. The
    names follow the last one. `ends` are the indices of the last lines of the headers.
    """
    last = ends[0] if len(ends) == 1 else ends[1]
    names = last + 1
    while names < len(text.lines) and not text.lines[names].strip():
        names += 1
    if names >= len(text.lines):
        raise refuse(text.path, "LabVIEW text with a header but no data")
    if len(ends) > 2:
        raise refuse(
            text.path,
            f"row {ends[2] + 1}: a second segment starts (its clock restarts); save each segment in"
            " a file of its own",
        )
    return names


def _header_fields(text: Lines, end: int, delimiter: str) -> dict[str, list[str]]:
    """Return the cells after the name of each field, from the lines before index `end`.

    Raise if the fields say that X is not one column of time.
    """
    fields = {}
    for index in range(end):
        cells = [cell.strip() for cell in text.split(index, delimiter)]
        fields[cells[0]] = cells[1:]
    if [cell.lower() for cell in fields.get("X_Columns", ["One"])][:1] == ["multi"]:
        raise refuse(
            text.path,
            "every channel has its own X column (X_Columns Multi); save it with one X column",
        )
    dimension = (fields.get("X_Dimension") or ["Time"])[0]
    if dimension not in ("", "Time"):
        raise refuse(text.path, f"X_Dimension is '{dimension}' (allowed: Time)")
    return fields


def _clock_settings(path: Path, fields: dict[str, list[str]]) -> tuple[float, float]:
    """Return X0 and Delta_X of the header in s, for ``X_Columns No``."""
    try:
        start, step = (float(fields[name][0].replace(",", ".")) for name in ("X0", "Delta_X"))
    except (KeyError, IndexError, ValueError):
        raise refuse(
            path, "no X values, and no X0 and Delta_X in the header to make them from"
        ) from None
    return start, step


def read_tdms(path: Path, content: bytes) -> Table:
    """Read a LabVIEW TDMS file; a `Reader`.

    One column per channel; time is computed from the waveform properties if no channel is called
    time. Channels that begin at different moments or have different rates are missing at the
    instants of others. A damaged file, and channels that differ in length without a clock, are
    refused; without npTDMS any file is.
    """
    channels, data = _channels(path, content)
    properties = [channel.properties for channel in channels]
    rates = {one.get("wf_increment") for one in properties}
    count = min((values.size for values in data), default=0)
    lost = max((values.size for values in data), default=0) - count
    is_cut = _ends_inside_segment(content) and len(rates) == 1
    if is_cut:
        data = [values[:count] for values in data]
    if not any(values.size for values in data):
        raise refuse(path, "the TDMS file holds no complete row of data")
    columns = _channel_columns(channels, data)
    clock = next((one for one in properties if "wf_increment" in one), None)
    source = ""
    if clock is not None and not any(column.is_time for column in columns):
        clocks = [one if "wf_increment" in one else clock for one in properties]
        columns, source = _on_waveform_clocks(path, columns, clocks)
    table = Table.of(path, columns)
    if is_cut:
        message = (
            f"the file ends inside its last segment: {count} rows are complete, {lost} incomplete"
            " ones dropped"
        )
        table.note("partial line", message, range(count + 1, count + lost + 1))
    if source:
        table.note("clock from header", source)
    return table


def _channels(path: Path, content: bytes) -> tuple[list[Any], list[np.ndarray]]:
    """Return the channels of npTDMS, and the data of each."""
    with optional():
        from nptdms import TdmsFile
    log_level = logging.root.manager.disable
    logging.disable(logging.WARNING)  # npTDMS would log the content of our repair too
    try:
        with damaged(path, "TDMS"):
            file = TdmsFile.read(io.BytesIO(content))
            channels = [channel for group in file.groups() for channel in group.channels()]
            return channels, [np.asarray(channel[:]) for channel in channels]
    finally:
        logging.disable(log_level)


def _channel_columns(channels: list[Any], data: list[np.ndarray]) -> list[Column]:
    """Return a column for each channel of npTDMS."""
    names = [channel.name for channel in channels]
    columns = []
    for channel, values in zip(channels, data, strict=True):
        column = Column.read(channel.name, values, str(channel.properties.get("unit_string", "")))
        if names.count(channel.name) > 1:
            column.name = f"{channel.group_name}/{column.name}"
        columns.append(column)
    return columns


def _on_waveform_clocks(
    path: Path, columns: list[Column], properties: list[Mapping[str, Any]]
) -> tuple[list[Column], str]:
    """Return a time and the channels at its instants, by waveform properties, and the source.

    A channel begins at ``wf_start_time`` plus ``wf_start_offset``; without a start time in all of
    them, at the offset.
    """
    starts = [one.get("wf_start_time") for one in properties]
    earliest = None if None in starts else min(starts)  # type: ignore[type-var]
    times = []
    clocks = []
    for column, one, start in zip(columns, properties, starts, strict=True):
        step = float(one["wf_increment"])
        if not step > 0:
            raise refuse(path, f"wf_increment is {step:g} s (allowed: above 0)")
        begin = float(one.get("wf_start_offset", 0.0))
        if earliest is not None:
            begin += float((start - earliest) / np.timedelta64(1, "s"))
        times.append(begin + step * np.arange(len(column.cells), dtype=np.float64))
        clocks.append(f"{begin:g} s + k × {step:g} s")
    listed = clocks[0]
    if len(set(clocks)) > 1:
        named = zip(columns, clocks, strict=True)
        listed = ", ".join(f"{clock} of {column.name}" for column, clock in named)
    return on_one_clock(columns, times), f"time is {listed}, from the waveform properties"


def _ends_inside_segment(content: bytes) -> bool:
    """Return whether a TDMS file is truncated, by the segment lengths that its lead-ins state."""
    # tag, contents, version, bytes to the next segment, bytes to the raw data
    lead_in = struct.Struct("<4sIIQQ")
    position = 0
    while position + lead_in.size <= len(content):
        position += lead_in.size + lead_in.unpack_from(content, position)[3]
    return position != len(content)
