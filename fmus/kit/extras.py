"""Packages that some tasks need and others do not, and the extras of ppy-rig that bring them.

``pip install ppy-rig`` brings what FMUs and systems need. Everything else is imported where it is
used, and one line says what to install where it is not there.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from .errors import UserError


class Package(NamedTuple):
    """A package that an extra brings.

    Attributes
    ----------
    distribution : str
        Its name for ``pip``.
    extra : str
        Of ppy-rig.
    task : str
        Task that needs it, as the subject of a sentence.
    """

    distribution: str
    extra: str
    task: str


PACKAGES: Mapping[str, Package] = {
    "SALib": Package("SALib", "sweeps", "computing Sobol indices"),
    "control": Package("control", "linear", "analysing a linear model"),
    "dask": Package("dask", "zarr", "writing Zarr"),
    "distributed": Package("distributed", "cluster", "sweeping on a cluster"),
    "matplotlib": Package("matplotlib", "pictures", "drawing a picture or a page"),
    "nidaqmx": Package("nidaqmx", "nidaqmx", "a device of National Instruments"),
    "nptdms": Package("npTDMS", "records", "reading TDMS"),
    "psutil": Package("psutil", "rig", "serving a rig"),
    "pyarrow": Package("pyarrow", "records", "reading or writing Parquet"),
    "pythonfmu": Package("pythonfmu", "pythonfmu", "the runtime pythonfmu"),
    "pyvisa": Package("PyVISA", "visa", "an instrument of VISA"),
    "threadpoolctl": Package("threadpoolctl", "diagnose", "diagnosing or identifying a black box"),
    "zarr": Package("zarr", "zarr", "writing Zarr"),
    "ziglang": Package("ziglang", "native", "compiling for other platforms"),
    "zmq": Package("pyzmq", "rig", "talking to a rig"),
}
"""Name that is imported -> what it belongs to."""


def install_command(*names: str) -> str:
    """Return the command that installs packages of `PACKAGES`, with all that their tasks need."""
    extras = sorted({PACKAGES[name].extra for name in names})
    return f'pip install "ppy-rig[{",".join(extras)}]"'


def require(*names: str) -> None:
    """Refuse a task that needs packages, before any of its work is done.

    Parameters
    ----------
    names : str
        Of `PACKAGES`.

    Raises
    ------
    UserError
        If some are not installed; it says which.
    """
    absent = [name for name in names if importlib.util.find_spec(name) is None]
    if absent:
        raise _missing(*absent)


@contextmanager
def optional() -> Iterator[None]:
    """Import packages of `PACKAGES` while the context lasts, or run what does.

    Raises
    ------
    UserError
        If one is not installed.
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
