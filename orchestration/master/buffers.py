"""Buffers of values, and FMI calls that move values between a buffer and a member without copies in between."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.fmu.instance import Fmu
from orchestration.fmu.signal import check_type, type_of
from orchestration.system.model import Port

FmiCall = Callable[[], int]


class Buffer:
    """Values of many ports in one piece of memory, of which FMUs are handed parts to read and to write.

    Parameters
    ----------
    ports : iterable of Port
        Those that are moved in one call should stand together.

    Attributes
    ----------
    at : dict of Port to int
        Index of each.
    cells : ctypes array of double
        The values; faster than `values` one by one.
    values : ndarray
        The same memory.
    """

    def __init__(self, ports: Iterable[Port]):
        self.at = {port: k for k, port in enumerate(dict.fromkeys(ports))}
        self.cells = (ctypes.c_double * len(self.at))()
        self.values: NDArray[np.float64] = np.ctypeslib.as_array(self.cells)


class Transfer(NamedTuple):
    """A call that moves values of one type between a buffer and a member.

    Attributes
    ----------
    verb : {"Set", "Get"}
        From the buffer, or to it.
    kind : str
        Type of the variables.
    ports : list of Port
        Reals stand together in the buffer, in this order.
    """

    verb: str
    kind: str
    ports: list[Port]


def transfers(verb: str, fmu: Fmu, ports: Sequence[Port], buffer: Buffer) -> list[Transfer]:
    """List the calls that move values of a member.

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
    list of Transfer

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
    at = list(buffer.at)
    runs = _runs(sorted(buffer.at[port] for port in kinds.pop("real", [])))
    reals = [Transfer(verb, "real", at[run[0] : run[-1] + 1]) for run in runs]
    return reals + [Transfer(verb, kind, own) for kind, own in kinds.items()]


def bind(transfer: Transfer, fmu: Fmu, buffer: Buffer) -> FmiCall:
    """Prepare a transfer.

    Parameters
    ----------
    transfer : Transfer
    fmu : Fmu
        The instance.
    buffer : Buffer

    Returns
    -------
    callable
        Returns the FMI status; UserError if a type cannot hold the value in the buffer.
    """
    verb, kind, own = transfer
    if kind == "real":
        values = ctypes.byref(buffer.cells, ctypes.sizeof(ctypes.c_double) * buffer.at[own[0]])
        return fmu.bound(f"fmi2{verb}Real", *_references(fmu, own), values)
    integers = (ctypes.c_int * len(own))()
    call = fmu.bound(
        f"fmi2{verb}{kind.capitalize()}", *_references(fmu, own), ctypes.byref(integers)
    )
    if verb == "Get":
        return _reading(call, integers, own, buffer)
    return _writing(call, integers, own, buffer, kind)


def _references(fmu: Fmu, ports: Sequence[Port]) -> tuple[object, ctypes.c_size_t]:
    references = [fmu.variables[port.variable].valueReference for port in ports]
    return ctypes.byref((ctypes.c_uint * len(ports))(*references)), ctypes.c_size_t(len(ports))


def _runs(places: list[int]) -> list[list[int]]:
    """Split increasing numbers where they do not follow each other."""
    if not places:
        return []
    cuts = [k + 1 for k, (a, b) in enumerate(pairwise(places)) if b != a + 1]
    return [places[a:b] for a, b in pairwise([0, *cuts, len(places)])]


def _reading(
    call: FmiCall, integers: ctypes.Array[ctypes.c_int], ports: list[Port], buffer: Buffer
) -> FmiCall:
    cells, places = buffer.cells, [buffer.at[port] for port in ports]

    def read() -> int:
        status = call()
        for place, value in zip(places, integers, strict=True):
            cells[place] = value
        return status

    return read


def _writing(
    call: FmiCall,
    integers: ctypes.Array[ctypes.c_int],
    ports: list[Port],
    buffer: Buffer,
    kind: str,
) -> FmiCall:
    cells, places = buffer.cells, [buffer.at[port] for port in ports]

    def write() -> int:
        for k, place in enumerate(places):
            check_type(kind, cells[place], str(ports[k]))
            integers[k] = int(cells[place])
        return call()

    return write
