"""Reading of large text tables, beside pandas and pyarrow on the same file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pyarrow import csv

from orchestration.records import read_record
from orchestration.records.formats import read_table
from orchestration.records.tables import numbers

from .tables import Table
from .timing import Times, comparison, take_turns, timed

_SHAPES = {
    "3 columns, comma": (",", 3),
    "3 columns, semicolon": (";", 3),
    "3 columns, tab": ("\t", 3),
    "12 columns, comma": (",", 12),
}
_CELLS = 3_000_000
_TARGET = 1.3
Columns = list[NDArray[np.float64]]


def tables(quick: bool) -> Iterator[str | Table]:
    """Time our tables and records of files of several shapes."""
    seconds: dict[str, NDArray[np.float64]] = {}
    against: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="benchmark_") as folder:
        path = Path(folder, "table.csv")
        for shape, (delimiter, width) in _SHAPES.items():
            write(path, delimiter, width, (120_000 if quick else _CELLS) // width)
            actions = _actions(path, delimiter, width)
            durations = {f"{shape}: {name}": timed(read) for name, read in actions.items()}
            seconds |= take_turns(durations, 1 if quick else 9).seconds
            pandas = f"{shape}: pandas"
            against |= dict.fromkeys(durations.keys() - {pandas}, pandas)
    targets = {name: _TARGET for name in seconds if name.endswith("table")}
    yield comparison(Times(seconds), against, "ms", targets)


def _actions(path: Path, delimiter: str, width: int) -> dict[str, Callable[[], object]]:
    """Return what reads a file in each of the ways, which agree on its numbers."""
    readers = {"table": _ours, "pandas": _pandas, "pyarrow": _pyarrow}
    check_agreement({name: read(path, delimiter) for name, read in readers.items()})
    units = {f"signal{k}": "V" for k in range(1, width)}
    own = {name: partial(read, path, delimiter) for name, read in readers.items()}
    return {**own, "record": partial(read_record, path, units)}


def write(path: Path, delimiter: str, width: int, count: int) -> None:
    """Write a time in ms and normal deviates with five decimals."""
    values = np.random.default_rng(1).normal(size=(count, width - 1))
    header = ["time [s]", *(f"signal{k} [V]" for k in range(1, width))]
    with path.open("w", encoding="ascii") as file:
        file.write(delimiter.join(header) + "\n")
        for k, row in enumerate(values.tolist()):
            file.write(delimiter.join([f"{k / 1000:.3f}", *(f"{v:.5f}" for v in row)]) + "\n")


def check_agreement(columns: Mapping[str, Columns]) -> None:
    """Raise RuntimeError unless all readers found the same numbers."""
    (ours, found), *others = columns.items()
    for name, expected in others:
        if not all(map(np.array_equal, found, expected)) or len(found) != len(expected):
            raise RuntimeError(f"{ours} and {name}: not the same numbers")


def _ours(path: Path, delimiter: str) -> Columns:
    table = read_table(path)
    return [numbers(table, column) for column in table.columns]


def _pandas(path: Path, delimiter: str) -> Columns:
    frame = pd.read_csv(path, sep=delimiter)
    return [frame[name].to_numpy() for name in frame]


def _pyarrow(path: Path, delimiter: str) -> Columns:
    table = csv.read_csv(path, parse_options=csv.ParseOptions(delimiter=delimiter))
    return [column.to_numpy() for column in table.columns]
