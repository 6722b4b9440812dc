"""Traces of outputs on disk, which may exceed the memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from xarray.backends import BackendArray
from xarray.core import indexing

from fmus.kit.arrays import Array
from orchestration.journal import opened, reserve

_AT_ONCE = 8_000_000  # most bytes of a piece


class TraceFile:
    """File of all traces by cases, outputs and points, of its final size from the start.

    It is not written by a memory map, which would count as memory of the process and crash it if
    the disk is full.

    Parameters
    ----------
    path : Path
    mode : {"w+", "r+"}
        Create the file, or continue it.
    shape : tuple of int
        Cases n, outputs m and points.

    Raises
    ------
    OSError
        If the disk is full, or the file cannot be written.
    ValueError
        If the file has another shape.
    """

    def __init__(self, path: Path, mode: str, shape: tuple[int, int, int]):
        self.path = path
        self.shape = shape
        if mode == "w+":
            np.lib.format.open_memmap(path, "w+", np.dtype("f8"), shape)
            reserve(path)
        mapped = opened(path, "r", shape, "f8")
        self._first_byte = int(mapped.offset)  # of the first case
        self._case_bytes = 8 * shape[1] * shape[2]

    def write(self, rows: Sequence[int], traces: Array) -> None:
        """Write the traces of cases, shape (k, points, m)."""
        with self.path.open("r+b") as file:
            for row, trace in zip(rows, traces, strict=True):
                file.seek(self._first_byte + row * self._case_bytes)
                file.write(np.ascontiguousarray(trace.T).data)

    def traces(self, output: int, case_shape: tuple[int, ...]) -> Any:
        """Return a lazy array of the traces of one output, shape (*case_shape, points)."""
        points = self.shape[2]
        first = self._first_byte + 8 * output * points
        return indexing.LazilyIndexedArray(
            _Traces(self.path, first, self._case_bytes, (*case_shape, points))
        )


class _Traces(BackendArray):
    """Lazy array of the traces of one output in a file.

    Parameters
    ----------
    path : Path
    first : int
        Position of the trace of the first case in the file.
    spacing : int
        Bytes from the trace of a case to that of the next one.
    shape : tuple of int
        Shape of the cases, and number of points.
    """

    def __init__(self, path: Path, first: int, spacing: int, shape: tuple[int, ...]):
        self._path = path
        self._first = first
        self._spacing = spacing
        self.shape = shape
        self.dtype = np.dtype("f8")

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self._read
        )

    def _read(self, key: tuple[Any, ...]) -> Array:
        """Read only the part that a key of integers and slices selects."""
        *cases, points = key
        *case_shape, count = self.shape
        # numbers of all cases and points: those that the key selects are to be read
        case_numbers = np.arange(int(np.prod(case_shape))).reshape(case_shape)
        rows = case_numbers[tuple(cases)]
        selected = np.arange(count)[points]
        traces = np.empty((*rows.shape, *selected.shape))
        if not traces.size:
            return traces
        low = int(selected.min())
        high = int(selected.max())
        with self._path.open("rb") as file:
            for row, index in zip(rows.ravel(), np.ndindex(rows.shape), strict=True):
                file.seek(self._first + int(row) * self._spacing + 8 * low)
                traces[index] = np.fromfile(file, "f8", high - low + 1)[selected - low]
        return traces


def iterate_pieces(array: xarray.DataArray) -> Iterator[Array]:
    """Yield the values of an array in pieces that fit into memory, in the order of its cases.

    It is halved along its first dimension that is longer than one, as often as necessary.
    """
    dimension = next((dim for dim in array.dims if array.sizes[dim] > 1), None)
    if array.nbytes <= _AT_ONCE or dimension is None:
        yield array.values
        return
    half = array.sizes[dimension] // 2
    for part in (slice(half), slice(half, None)):
        yield from iterate_pieces(array.isel({dimension: part}))
