"""Files of one simulation beside its signals: a log of calls, and serialized states of the FMU."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import fmpy

from fmus.kit import UserError
from orchestration.fmu.archive import Archive
from orchestration.fmu.instance import Fmu

_FORM = "state of an FMU, 1"


class RunFiles(NamedTuple):
    """Files that a simulation reads and writes.

    Attributes
    ----------
    calls : Path, optional
        Log of the FMU's calls, a line each.
    state_in : Path, optional
        State from which the simulation goes on in place of an initialization.
    state_out : Path, optional
        State at the last point.
    """

    calls: Path | None = None
    state_in: Path | None = None
    state_out: Path | None = None

    @property
    def start(self) -> float | None:
        """Time in s of the state to go on from, if there is one; UserError if the file has none."""
        return None if self.state_in is None else float(_read(self.state_in)[0]["time"])

    def clear_log(self) -> None:
        """Begin an empty log of calls; UserError if it cannot be written."""
        if self.calls is not None:
            _write(self.calls, b"")

    def check(self, fmu: Fmu) -> None:
        """Raise UserError if a state is wanted of an FMU that cannot serialize it."""
        able = fmu.description.coSimulation
        if (self.state_in or self.state_out) and not (
            able.canGetAndSetFMUstate and able.canSerializeFMUstate
        ):
            raise UserError(
                f"{fmu.path.name}: cannot write down its state (canSerializeFMUstate is false)"
            )

    def resume(self, fmu: Fmu) -> None:
        """Set an instance to the state that was read.

        Raises
        ------
        UserError
            If it is of another FMU, or the FMU refuses.
        """
        assert self.state_in is not None
        header, contents = _read(self.state_in)
        for name, own in _identity(fmu).items():
            if header.get(name) != own:
                raise UserError(
                    f"{self.state_in}: the state of another FMU: its {name} is {header.get(name)},"
                    f" that of {fmu.path.name} is {own}"
                )
        fmu.resume(contents)

    def write_state(self, fmu: Fmu, time: float) -> None:
        """Write the state of an instance at a time in s, if it is wanted."""
        if self.state_out is None:
            return
        header = {"form": _FORM, "time": time, **_identity(fmu)}
        _write(self.state_out, json.dumps(header).encode() + b"\n" + fmu.serialized_state())


def _identity(fmu: Fmu) -> dict[str, str]:
    """Return what the state of one FMU has in common with those of no other, by its name."""
    identifier, guid = fmu.identity
    with Archive(fmu.path) as archive:
        version = archive.description.get("fmiVersion", "")
    return {
        "modelIdentifier": identifier,
        "guid": guid,
        "fmiVersion": version,
        "platform": fmpy.platform_tuple,
    }


def _read(path: Path) -> tuple[dict[str, str], bytes]:
    """Return the header of a file and the bytes of the state in it."""
    try:
        head, _, contents = path.read_bytes().partition(b"\n")
        header = json.loads(head)
        if header["form"] == _FORM and float(header["time"]) < float("inf"):
            return header, contents
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, TypeError, KeyError):
        pass
    raise UserError(f"{path}: no state of an FMU, as --state-out writes it")


def _write(path: Path, contents: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(contents)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error
