"""Optional packages, and the extras of ppy-rig that install them.

``pip install ppy-rig`` installs the packages for FMUs and systems. Every other package is imported
where it is used; if it is missing, an error of one line gives the command that installs it.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from .errors import UserError


class Package(NamedTuple):
    """An optional package.

    Attributes
    ----------
    distribution : str
        Name for ``pip``.
    extra : str
        Extra of ppy-rig that installs it.
    task : str
        Task that needs it, as the subject of a sentence.
    """

    distribution: str
    extra: str
    task: str


PACKAGES: Mapping[str, Package] = {
    "SALib": Package("SALib", "sweeps", "computing Sobol indices"),
    "asammdf": Package("asammdf", "mdf", "reading MDF"),
    "asyncua": Package("asyncua", "opcua", "the bridge to OPC UA"),
    "control": Package("control", "linear", "analysing a linear model"),
    "dask": Package("dask", "zarr", "writing Zarr"),
    "distributed": Package("distributed", "cluster", "sweeping on a cluster"),
    "emcee": Package("emcee", "sampling", "sampling a posterior"),
    "h5py": Package("h5py", "records", "reading HDF5"),
    "matplotlib": Package("matplotlib", "pictures", "drawing a picture or a page"),
    "nidaqmx": Package("nidaqmx", "nidaqmx", "a device of National Instruments"),
    "nptdms": Package("npTDMS", "records", "reading TDMS"),
    "psutil": Package("psutil", "rig", "serving a rig"),
    "pyarrow": Package("pyarrow", "records", "reading or writing Parquet"),
    "pymodbus": Package("pymodbus", "modbus", "a device of Modbus"),
    "python_calamine": Package("python-calamine", "records", "reading a spreadsheet"),
    "pythonfmu": Package("pythonfmu", "pythonfmu", "the runtime pythonfmu"),
    "pyvisa": Package("PyVISA", "visa", "an instrument of VISA"),
    "serial": Package("pyserial", "serial", "an instrument on a serial port"),
    "threadpoolctl": Package("threadpoolctl", "diagnose", "diagnosing or identifying a black box"),
    "tomlkit": Package("tomlkit", "rig", "adjusting a rig's calibration"),
    "zarr": Package("zarr", "zarr", "writing Zarr"),
    "ziglang": Package("ziglang", "native", "compiling for other platforms"),
    "zmq": Package("pyzmq", "rig", "talking to a rig"),
}
"""Name of the imported module -> optional package."""


def install_command(*names: str) -> str:
    """Return the command that installs the extras of packages of `PACKAGES`."""
    extras = sorted({PACKAGES[name].extra for name in names})
    return f'pip install "ppy-rig[{",".join(extras)}]"'


def require(*names: str) -> None:
    """Raise an error if packages for a task are not installed.

    Parameters
    ----------
    *names : str
        Keys of `PACKAGES`.

    Raises
    ------
    UserError
        If one is not installed; the message names all that are missing.
    """
    absent = [name for name in names if importlib.util.find_spec(name) is None]
    if absent:
        raise _missing(*absent)


@contextmanager
def optional() -> Iterator[None]:
    """Return a context in which a missing package of `PACKAGES` raises a readable error.

    Raises
    ------
    UserError
        In place of ModuleNotFoundError, with the command that installs the package.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        name = error.name or ""
        if name not in PACKAGES:
            raise
        raise _missing(name) from error


def _missing(*names: str) -> UserError:
    packages = [PACKAGES[name] for name in names]
    needs = ", ".join(f"{package.task} needs {package.distribution}" for package in packages)
    return UserError(f"{needs}: {install_command(*names)}")
