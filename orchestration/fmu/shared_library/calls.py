"""FMI functions called without fmpy's bookkeeping, which many thousands of steps would pay for at every call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from fmus.kit.errors import UserError
from orchestration.fmu.signal import type_of


class Transfer(NamedTuple):
    """One call that moves all values of one type between an FMU and a row of numbers."""

    call: Callable[..., int]
    kind: str
    names: list[str]
    row: (
        slice | list[int]
    )  # where the values are in the row; a slice, if they stand together, costs a fifth
    references: Any
    values: Any


def bind(library: Any, name: str, *arguments: Any) -> Callable[..., int]:
    """Return an FMI function; its first argument, the component, goes without saying."""
    function: Callable[..., int] = library[
        name
    ]  # a new object each time, so that argtypes are ours
    function.argtypes = [ctypes.c_void_p, *arguments]  # type: ignore[attr-defined]
    function.restype = ctypes.c_int  # type: ignore[attr-defined]
    return function


def transfers(
    library: Any, verb: str, names: Sequence[str], variables: Mapping[str, Any]
) -> list[Transfer]:
    """Prepare setting or getting variables, one call for each type among them.

    Parameters
    ----------
    library : ctypes.CDLL
        The FMU's.
    verb : {"Set", "Get"}
    names : sequence of str
    variables : Mapping[str, fmpy.model_description.ScalarVariable]

    Returns
    -------
    list of Transfer

    Raises
    ------
    UserError
        If a variable is text.
    """
    kinds: dict[str, list[int]] = {}
    for position, name in enumerate(names):
        kinds.setdefault(type_of(variables[name]), []).append(position)
    if "string" in kinds:
        raise UserError(f"the variable {names[kinds['string'][0]]} is text, not a number")
    prepared = []
    for kind, positions in kinds.items():
        count, number = len(positions), ctypes.c_double if kind == "real" else ctypes.c_int
        references = (ctypes.c_uint * count)(
            *(variables[names[p]].valueReference for p in positions)
        )
        name, array = f"fmi2{verb}{kind.capitalize()}", number * count
        call = bind(library, name, ctypes.c_uint * count, ctypes.c_size_t, array)
        together = slice(positions[0], positions[0] + count)
        row = together if positions == list(range(len(names))[together]) else positions
        prepared.append(
            Transfer(call, kind, [names[p] for p in positions], row, references, array())
        )
    return prepared
