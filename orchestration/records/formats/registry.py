"""Choice of a file's reader by its first bytes, so that a wrong extension does no harm."""

import re
from collections.abc import Callable
from pathlib import Path

from orchestration.records.formats.archives import unpacked
from orchestration.records.formats.binary import (
    read_feather,
    read_mat,
    read_netcdf,
    read_parquet,
)
from orchestration.records.formats.hdf5 import read_hdf5
from orchestration.records.formats.labview import read_lvm, read_tdms
from orchestration.records.formats.mdf import read_mdf
from orchestration.records.formats.opendaq import read_opendaq
from orchestration.records.formats.oscilloscopes import (
    RIGOL,
    TEKTRONIX,
    read_rigol,
    read_tektronix,
)
from orchestration.records.formats.spreadsheet import read_spreadsheet
from orchestration.records.formats.subprocess_reader import in_subprocess
from orchestration.records.formats.text import EXPECTED, read_text
from orchestration.records.frames import Arrays, table_of
from orchestration.records.record import refuse
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Reader, Table

_SIGNATURES: dict[bytes, Reader] = {
    b"PAR1": in_subprocess(read_parquet),
    b"ARROW1": in_subprocess(read_feather),
    b"MDF     4": in_subprocess(read_mdf),
    b"CDF\x01": read_netcdf,
    b"CDF\x02": read_netcdf,
    b"TDSm": read_tdms,
    b"MATLAB 5.0": in_subprocess(read_mat),
    b"LabVIEW Measurement": read_lvm,
    b"\xef\xbb\xbfLabVIEW Measurement": read_lvm,
    b"# domain;": read_opendaq,
}
_FIRST_LINES: dict[re.Pattern[bytes], Reader] = {RIGOL: read_rigol, TEKTRONIX: read_tektronix}
_OF_SEVERAL: dict[bytes, Callable[[Path, bytes, Reading], Table]] = {
    b"\x89HDF": in_subprocess(read_hdf5),
    b"PK\x03\x04": in_subprocess(read_spreadsheet),
    b"\xd0\xcf\x11\xe0": in_subprocess(read_spreadsheet),
}
"""Readers of files with several tables, of which the user names one."""


def read_table(data: Path | Arrays, reading: Reading = AS_IT_STANDS) -> Table:
    """Read a file of any known format, or arrays.

    Parameters
    ----------
    data : Path, DataFrame or Mapping of str to array_like, shape (n,)
    reading : Reading
        Names of columns, decimal mark and table of a file that does not state them.

    Returns
    -------
    Table
        The raw columns.

    Raises
    ------
    UserError
        If the file cannot be opened, is empty, or is of no known format, or arrays have no names.
    """
    return _read_file(data, reading) if isinstance(data, Path) else table_of(data)


def _read_file(path: Path, reading: Reading) -> Table:
    """Return the table of a file, by the reader of its format."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror or error}") from error
    content = unpacked(path, content)
    if not content or content.isspace():
        raise refuse(path, f"the file is empty; {EXPECTED}")
    plain = _reader_by_form(content)
    if plain is not None:
        return plain(path, content)
    for signature, reader in _OF_SEVERAL.items():
        if content.startswith(signature):
            return reader(path, content, reading)
    if content[512:516] == b"\x89HDF":  # MATLAB writes a header of its own
        return in_subprocess(read_hdf5)(path, content, reading)
    is_mat = ".mat" in map(str.lower, path.suffixes)
    if is_mat and b"\x00" in content[:20]:  # version 4 has no signature
        return in_subprocess(read_mat)(path, content)
    return read_text(path, content, reading)


def _reader_by_form(content: bytes) -> Reader | None:
    """Return the reader of a file with one table by its first bytes or line; None without one."""
    for signature, reader in _SIGNATURES.items():
        if content.startswith(signature):
            return reader
    return next((reader for line, reader in _FIRST_LINES.items() if line.match(content)), None)
