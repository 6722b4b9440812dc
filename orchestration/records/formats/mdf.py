"""MDF 4 files of ASAM, whose groups of channels have clocks of their own."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from fmus.kit.extras import optional
from orchestration.records.formats.clocks import on_one_clock
from orchestration.records.record import damaged, refuse
from orchestration.records.tables import Column, Table


def read_mdf(path: Path, content: bytes) -> Table:
    """Read an MDF 4 file; a `Reader`.

    One column per channel of numbers, converted to physical values and invalid ones missing.
    Channels of slower groups are missing at the instants of others. A damaged file is refused;
    without asammdf any file is.
    """
    with optional():
        from asammdf import MDF
    columns: list[Column] = []
    times = []
    with damaged(path, "MDF"), MDF(io.BytesIO(content)) as file:
        for signal in file.iter_channels(skip_master=True):
            if signal.samples.dtype.kind not in "biuf" or signal.samples.ndim != 1:
                continue
            values = signal.samples.astype(float)
            if signal.invalidation_bits is not None:
                values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            columns.append(Column.read(signal.name, values, str(signal.unit or "")))
            times.append(np.asarray(signal.timestamps, dtype=float))
    if not any(len(column.cells) for column in columns):
        raise refuse(path, "the MDF file holds no channel of numbers")
    table = Table.of(path, on_one_clock(columns, times))
    if len({time.size for time in times}) > 1:
        message = "channels have clocks of their own, and are missing at the instants of others"
        table.note("clocks", message)
    return table
