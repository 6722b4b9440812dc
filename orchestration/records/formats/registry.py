"""Choice of a file's reader by its first bytes, so that a wrong extension does no harm."""

from pathlib import Path

from orchestration.records.formats.archives import PACKED, unpacked
from orchestration.records.formats.binary import read_mat, read_netcdf, read_parquet
from orchestration.records.formats.labview import read_lvm, read_tdms
from orchestration.records.formats.opendaq import read_opendaq
from orchestration.records.formats.subprocess_reader import in_subprocess
from orchestration.records.formats.text import EXPECTED, read_text
from orchestration.records.record import refuse
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Reader, Table

_SIGNATURES: dict[bytes, Reader] = {
    b"PAR1": in_subprocess(read_parquet),
    b"CDF\x01": read_netcdf,
    b"CDF\x02": read_netcdf,
    b"TDSm": read_tdms,
    b"MATLAB 5.0": in_subprocess(read_mat),
    b"LabVIEW Measurement": read_lvm,
    b"\xef\xbb\xbfLabVIEW Measurement": read_lvm,
    b"# domain;": read_opendaq,
}
_BINARY_EXTENSIONS = {
    ".parquet": "a Parquet",
    ".tdms": "a TDMS",
    ".mat": "a MATLAB",
    ".lvm": "a LabVIEW text",
    ".nc": "a NetCDF 3",
}


def read_table(path: Path, reading: Reading = AS_IT_STANDS) -> Table:
    """Read a file of any known format.

    Parameters
    ----------
    path : Path
        The file.
    reading : Reading
        Names of columns, decimal mark and table of a file that does not tell them.

    Returns
    -------
    Table
        The raw columns.

    Raises
    ------
    UserError
        If the file cannot be opened, is empty, or is of no known format.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refuse(path, f"cannot be read: {error.strerror or error}") from error
    content = unpacked(path, content)
    if not content.strip():
        raise refuse(path, f"the file is empty; {EXPECTED}")
    extension = next((s for s in map(str.lower, path.suffixes[::-1]) if s not in PACKED), "")
    for signature, reader in _SIGNATURES.items():
        if content.startswith(signature):
            return reader(path, content)
    if content.startswith(b"\x89HDF") or content[512:516] == b"\x89HDF":
        raise refuse(path, "this is an HDF5 file (MATLAB 7.3 is one); save it from MATLAB with -v7")
    if content.startswith(b"MATLAB 7.3") or (extension == ".mat" and b"\x00" in content[:20]):
        return in_subprocess(read_mat)(path, content)  # version 4 has no signature
    if extension in _BINARY_EXTENSIONS:
        raise refuse(
            path, f"this is not {_BINARY_EXTENSIONS[extension]} file, although its name says so"
        )
    return read_text(path, content, reading)
