"""Buffers of values, and FMI calls that move values directly between a buffer and a member."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit import UserError
from orchestration.fmu import Fmu
from orchestration.fmu.signal import check_type, type_of
from orchestration.system import Port

FmiCall = Callable[[], int]


class Buffer:
    """The values of many ports in contiguous memory, from which FMUs read and to which they write.

    Parameters
    ----------
    ports : iterable of Port
        Ports that are moved in one call should follow each other.

    Attributes
    ----------
    at : dict of Port to int
        Place of each port.
    cells : ctypes array of double
        The values; faster than `values` where they are accessed one by one.
    values : ndarray
        The same memory.
    """

    def __init__(self, ports: Iterable[Port]):
        self.at = {port: k for k, port in enumerate(dict.fromkeys(ports))}
        self.cells = (ctypes.c_double * len(self.at))()
        self.values: NDArray[np.float64] = np.ctypeslib.as_array(self.cells)


class BufferTransfer(NamedTuple):
    """A call that moves values of one type between a buffer and a member.

    Attributes
    ----------
    verb : {"Set", "Get"}
        From the buffer, or to it.
    kind : str
        Type of the variables.
    ports : list of Port
        Reals are contiguous in the buffer, in this order.
    """

    verb: str
    kind: str
    ports: list[Port]


def list_transfers(
    verb: str, fmu: Fmu, ports: Sequence[Port], buffer: Buffer
) -> list[BufferTransfer]:
    """Return the transfers that move values of a member, one for each FMI call.

    Parameters
    ----------
    verb : {"Set", "Get"}
        From the buffer, or to it.
    fmu : Fmu
        The instance.
    ports : sequence of Port
        Variables of that member.
    buffer : Buffer

    Returns
    -------
    list of BufferTransfer

    Raises
    ------
    UserError
        If a variable does not exist or is text.
    """
    kinds: dict[str, list[Port]] = {}
    for port in ports:
        if port.variable not in fmu.variables:
            raise UserError(f"{fmu.name}: {fmu.path.name} has no variable named {port.variable!r}")
        kinds.setdefault(type_of(fmu.variables[port.variable]), []).append(port)
    if "string" in kinds:
        raise UserError(f"{kinds['string'][0]} is text, not a number")
    ports_in_buffer = list(buffer.at)  # in the order of their places
    runs = _contiguous_runs(sorted(buffer.at[port] for port in kinds.pop("real", [])))
    reals = [BufferTransfer(verb, "real", ports_in_buffer[run[0] : run[-1] + 1]) for run in runs]
    return reals + [BufferTransfer(verb, kind, others) for kind, others in kinds.items()]


def bind(transfer: BufferTransfer, fmu: Fmu, buffer: Buffer) -> FmiCall:
    """Return a function that makes the FMI call of a transfer.

    Parameters
    ----------
    transfer : BufferTransfer
    fmu : Fmu
        The instance.
    buffer : Buffer

    Returns
    -------
    callable
        Returns the FMI status; UserError if a type cannot hold the value in the buffer.
    """
    verb, kind, ports = transfer
    function = f"fmi2{verb}{kind.capitalize()}"
    if kind == "real":
        place = ctypes.sizeof(ctypes.c_double) * buffer.at[ports[0]]
        values = (ctypes.c_double * len(ports)).from_buffer(buffer.cells, place)
        return fmu.bound(function, *_references(fmu, ports), ctypes.byref(values))
    integers = (ctypes.c_int * len(ports))()
    call = fmu.bound(function, *_references(fmu, ports), ctypes.byref(integers))
    if verb == "Get":
        return _bind_reading(call, integers, ports, buffer)
    return _bind_writing(call, integers, ports, buffer, kind)


def _references(fmu: Fmu, ports: Sequence[Port]) -> tuple[object, ctypes.c_size_t]:
    """Return the value references of ports and their number, as arguments of FMI functions."""
    references = [fmu.variables[port.variable].valueReference for port in ports]
    return ctypes.byref((ctypes.c_uint * len(ports))(*references)), ctypes.c_size_t(len(ports))


def _contiguous_runs(places: list[int]) -> list[list[int]]:
    """Split increasing whole numbers into runs of consecutive ones."""
    if not places:
        return []
    cuts = [k + 1 for k, (a, b) in enumerate(pairwise(places)) if b != a + 1]
    return [places[a:b] for a, b in pairwise([0, *cuts, len(places)])]


def _bind_reading(
    call: FmiCall, integers: ctypes.Array[ctypes.c_int], ports: list[Port], buffer: Buffer
) -> FmiCall:
    """Return a call that copies integers to their places in the buffer after it has read them."""
    cells = buffer.cells
    places = [buffer.at[port] for port in ports]

    def read() -> int:
        status = call()
        for place, value in zip(places, integers, strict=True):
            cells[place] = value
        return status

    return read


def _bind_writing(
    call: FmiCall,
    integers: ctypes.Array[ctypes.c_int],
    ports: list[Port],
    buffer: Buffer,
    kind: str,
) -> FmiCall:
    """Return a call that copies integers from their places in the buffer before it sets them."""
    cells = buffer.cells
    places = [buffer.at[port] for port in ports]

    def write() -> int:
        for k, place in enumerate(places):
            check_type(kind, cells[place], str(ports[k]))
            integers[k] = int(cells[place])
        return call()

    return write
