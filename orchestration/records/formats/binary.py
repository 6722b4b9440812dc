"""Parquet, MATLAB and NetCDF files."""

import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit.extras import optional
from orchestration.records.formats.clocks import insert_clock
from orchestration.records.record import damaged, refuse
from orchestration.records.tables import (
    Column,
    Table,
    as_numbers,
    plain_unit,
    split_header_cell,
)

_STEPS = ("Ts", "ts", "dt", "Delta_t", "sample_time")


def read_parquet(path: Path, content: bytes) -> Table:
    """Read a Parquet file; a `Reader`.

    Units come from the column names ``name [unit]``, else from the metadata entry ``unit`` of a
    field. A damaged file is refused; without pyarrow any file is.
    """
    with optional():
        import pyarrow.parquet as parquet
    return _arrow_table(path, content, "Parquet", parquet.read_table)


def read_feather(path: Path, content: bytes) -> Table:
    """Read a Feather file of version 2; a `Reader`, see `read_parquet`."""
    with optional():
        from pyarrow import feather
    return _arrow_table(path, content, "Feather", feather.read_table)


def _arrow_table(path: Path, content: bytes, kind: str, read: Callable[[io.BytesIO], Any]) -> Table:
    """Return the table of a file that a function of pyarrow reads."""
    with damaged(path, kind):
        arrow = read(io.BytesIO(content))
        columns = []
        for field, chunks in zip(arrow.schema, arrow.columns, strict=True):
            stated = (field.metadata or {}).get(b"unit", b"").decode().strip()
            columns.append(Column.read(field.name, chunks.to_numpy(), stated))
    return Table.of(path, columns, f"the {kind} file holds no rows")


def read_netcdf(path: Path, content: bytes) -> Table:
    """Read a NetCDF 3 file, such as a result of ``ppy run``; a `Reader`.

    One column per vector over the dimension that most have, and per text, whose characters are
    along a second; units come from the attribute ``units``. Vectors over another dimension are
    named in a repair. A damaged file and one without vectors are refused.
    """
    from scipy.io import netcdf_file

    columns = []
    others: list[str] = []
    with (
        damaged(path, "NetCDF"),
        netcdf_file(io.BytesIO(content), mmap=False, maskandscale=True) as file,
    ):
        vectors = {
            name: variable
            for name, variable in file.variables.items()
            if len(variable.dimensions) == 1
            or (variable.typecode() == "c" and len(variable.dimensions) == 2)
        }
        counts = Counter(variable.dimensions[0] for variable in vectors.values())
        rows = max(file.dimensions, key=counts.__getitem__, default=None)
        for name, variable in vectors.items():
            if variable.dimensions[0] != rows:
                others.append(name)
            elif variable.typecode() == "c":
                columns.append(Column.read(name, _texts(variable.data), ""))
            else:
                unit = plain_unit(getattr(variable, "units", b"").decode())
                columns.append(Column(name, unit, as_numbers(np.ma.array(variable[:]))))
    table = Table.of(path, columns, "the NetCDF file holds no vectors")
    if others:
        table.note("ignored columns", f"not along dimension '{rows}': {', '.join(others)}")
    return table


def _texts(characters: np.ndarray) -> list[str]:
    """Return the texts of characters, shape (n,) or (n, length)."""
    rows = characters.reshape(len(characters), -1)
    return [row.tobytes().rstrip(b"\0").decode(errors="replace") for row in rows]


def read_mat(path: Path, content: bytes) -> Table:
    """Read a MATLAB file, version 4 to 7 but not 7.3; a `Reader`.

    One column per numeric vector, also of a struct or of a structure with time of Simulink, and
    per ``name(:,1)`` of a matrix along its longer side, if vectors beside it are as long. Units
    come from a variable ``units``, a struct with a text field per variable, or texts
    ``name [unit]``. Without a time a number ``Ts`` or ``dt`` is its step in s. A damaged file and
    vectors that differ in length are refused.
    """
    from scipy.io import loadmat

    with damaged(path, "MATLAB"):
        variables = loadmat(io.BytesIO(content))  # type: ignore[arg-type]  # SciPy also takes files
    variables = {name: value for name, value in variables.items() if not name.startswith("__")}
    units = _mat_units(path, variables.pop("units", None))
    variables = dict(_flat(variables))
    numeric = {name: array for name, value in variables.items() if (array := _numeric(value)).size}
    lengths = {array.size for array in numeric.values() if array.size == max(array.shape)}
    read = {name: a for name, a in numeric.items() if not lengths or max(a.shape) in lengths}
    if not read:
        raise refuse(
            path,
            f"no numeric vector among the variables {sorted(variables)} (objects of MATLAB, such as"
            " table, are not read)",
        )
    columns = [
        Column(part, units.get(name), vector.astype(float))
        for name, array in read.items()
        for part, vector in _vectors(name, array)
    ]
    table = Table.of(path, columns)
    unread = sorted(variables.keys() - read.keys())
    step = next((name for name in _STEPS if name in unread), None)
    if step is not None and not any(column.is_time for column in columns):
        insert_clock(table, float(np.ravel(variables[step])[0]), step)
        unread.remove(step)
    if unread:
        table.note("ignored columns", f"not numeric vectors, so not read: {', '.join(unread)}")
    return table


def _flat(variables: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield variables, and the fields of structs in place of these, by their own names if unique.

    A structure with time of Simulink has its signals as ``label`` and ``values``.
    """
    from scipy.io.matlab import MatlabObject, MatlabOpaque

    fields: list[tuple[str, str, Any]] = []
    for name, value in variables.items():
        array = np.asarray(value)
        # fields of an object, such as a table, are how MATLAB keeps it
        is_object = isinstance(value, (MatlabObject, MatlabOpaque))
        if array.dtype.names and array.size == 1 and not is_object:
            fields += [(name, own, item) for own, item in _fields(array.ravel()[0])]
        else:
            fields.append(("", name, value))
    names = [own for _, own, _ in fields]
    for struct, own, item in fields:
        yield (f"{struct}.{own}" if struct and names.count(own) > 1 else own), item


def _fields(struct: Any) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a struct by name, of structs in it too."""
    names = struct.dtype.names
    if {"label", "values"} <= set(names):
        yield _mat_text(struct["label"]) or "signal", struct["values"]
        return
    for name in names:
        value = struct[name]
        if isinstance(value, np.ndarray) and value.dtype.names:
            for item in value.ravel():
                yield from _fields(item)
        else:
            yield name, value


def _numeric(value: object) -> np.ndarray:
    """Return the vector or matrix of numbers in a variable of a MATLAB file, else an empty one."""
    array = np.asarray(value)
    is_numeric = array.dtype.kind in "biuf"
    return array if is_numeric and array.ndim <= 2 and array.size > 1 else np.empty(0)


def _vectors(name: str, array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield a vector, or those along the longer side of a matrix, by the names that MATLAB has."""
    if array.size == max(array.shape):
        yield name, array.ravel()
    elif array.shape[0] >= array.shape[1]:
        yield from ((f"{name}(:,{k})", column) for k, column in enumerate(array.T, start=1))
    else:
        yield from ((f"{name}({k},:)", row) for k, row in enumerate(array, start=1))


def _mat_units(path: Path, value: object) -> dict[str, str]:
    """Return the unit of each variable from the variable ``units`` of a MATLAB file.

    It is a struct with a field per variable, or texts ``name [unit]``; None if there is none.
    """
    if value is None:
        return {}
    array = np.asarray(value)
    if array.dtype.names and array.size == 1:
        entry = array.ravel()[0]
        return {name: text for name in array.dtype.names if (text := _mat_text(entry[name]))}
    units = {}
    for item in array.ravel():
        name, unit = split_header_cell(_mat_text(item))
        if not name or unit is None:
            raise refuse(
                path,
                f"variable units: '{_mat_text(item)}' is not of the form 'name [unit]' (or make"
                " units a struct)",
            )
        units[name] = unit
    return units


def _mat_text(value: object) -> str:
    """Return the text of a MATLAB char array or cell, which SciPy nests in arrays of size 1."""
    while isinstance(value, np.ndarray):
        if value.size == 0:
            return ""
        value = value.ravel()[0]
    return str(value).strip()
