"""Running a system in an isolated process: its rows of outputs survive a crash of a member."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.fmu.isolation import Ended, Limits, Process, SharedProgress, shared_progress
from orchestration.master.result import Run, Statistics, Stopped
from orchestration.system import System

_ROW_FILE = "run"


@dataclass(frozen=True)
class RowDescription:
    """The meaning of the rows of a run.

    Attributes
    ----------
    points : list of float
        Communication points in s.
    width : int
        Numbers in a row.
    places : dict of str to int
        Place of each recorded variable ``member.variable`` in a row.
    units, guids : dict of str to str
        Units of the recorded variables, and GUID of each member's FMU.
    """

    points: list[float]
    width: int
    places: dict[str, int]
    units: dict[str, str]
    guids: dict[str, str]


class RowRecorder:
    """Rows of outputs as a run goes on: in memory, or in a file if the process is isolated.

    Attributes
    ----------
    write : callable
        Takes the bytes of one row or several.
    """

    def __init__(self) -> None:
        shared = shared_progress.current
        self._file = (
            None if shared is None else (shared.folder / _ROW_FILE).open("w+b", buffering=0)
        )
        self._memory = BytesIO()
        self.write = (self._file or self._memory).write

    def array(self, count: int, width: int) -> Array:
        """Return the first `count` rows, shape (count, width)."""
        if self._file is None:
            numbers = np.frombuffer(self._memory.getbuffer(), count=count * width)
            return numbers.reshape(count, width)
        return _read_rows(Path(self._file.name).parent, width)[:count]


def _read_rows(folder: Path, width: int) -> Array:
    """Read the rows, shape (n, width), that a process has written to its folder."""
    path = folder / _ROW_FILE
    numbers = np.fromfile(path) if path.exists() else np.empty(0)
    if not width:
        return np.empty((0, 0))
    return numbers[: numbers.size // width * width].reshape(-1, width)


def run_isolated(
    limits: Limits,
    run: Callable[..., Run],
    system: System,
    *arguments: Any,
    progress: Callable[[int], None],
    options: Mapping[str, Any],
) -> Run:
    """Run a system in a separate process.

    Parameters
    ----------
    limits : Limits
    run : callable
        :func:`orchestration.master.run`.
    system : System
    *arguments
        Its arguments after the system.
    progress : callable
        Called with the number of points done, now and then.
    options : Mapping of str to Any
        Its keyword arguments.

    Returns
    -------
    Run

    Raises
    ------
    Stopped, UserError
        As `run` does; also if the process ends, or a call takes too long.
    """
    # a class may be known to this process only, and no run needs it
    members = tuple(replace(m, fmu=m.fmu.resolve(), cls=None) for m in system.members)
    portable = replace(system, members=members)
    with Process(limits) as process:
        try:
            stop, result = process.call(
                _run, run, portable, arguments, dict(options), callbacks={"progress": progress}
            )
        except Ended as end:
            description = process.progress.rows_description()
            points = description.points if description else ()
            message = f"{end.state.describe(points, system.name)}: {end.reason}"
            partial = _partial_run(process.progress, end.state.row, message)
            if end.interrupted:
                return partial
            raise Stopped(message, partial) from end
        except OSError as error:
            # FMUs may use up resources of their process, such as files
            message = f"{system.name}: {error.strerror or error}"
            unwritten = process.progress.state().row
            raise Stopped(message, _partial_run(process.progress, unwritten, message)) from error
    if stop is not None:
        raise Stopped(stop, result)
    complete: Run = result
    return complete


def _run(
    run: Callable[..., Run],
    system: System,
    arguments: tuple[Any, ...],
    options: Mapping[str, Any],
    progress: Callable[[int], None],
) -> tuple[str | None, Run]:
    """Run a system in the isolated process; return the message if it was stopped, and the run."""
    try:
        return None, run(system, *arguments, **options, progress=progress)
    except Stopped as stopped:
        return str(stopped), stopped.run


def _partial_run(progress: SharedProgress, unwritten: int, message: str) -> Run:
    """Return the rows that were computed before the process ended.

    Parameters
    ----------
    progress : SharedProgress
    unwritten : int
        Number of rows in the kernel's memory on disk that were not yet written to the file of rows.
    message : str
        Reason for which the process ended.
    """
    nothing = Statistics({}, 0, 0, 0, 0.0)
    description = progress.rows_description()
    if description is None:  # the run had not begun
        return Run(np.empty(0), {}, {}, False, message, nothing, {})
    written = _read_rows(progress.folder, description.width)
    more = progress.read_rows(unwritten)
    rows = written if more is None else np.concatenate([written, more])
    table = rows[: len(description.points)]
    return Run(
        time=np.array(description.points[: len(table)]),
        signals={name: table[:, place] for name, place in description.places.items()},
        units=description.units,
        complete=False,
        message=message,
        statistics=replace(nothing, steps=max(0, len(table) - 1)),
        guids=description.guids,
    )
