"""A run in a process beside this one: whatever a member does to its process, what was computed until then is there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.fmu.isolation.box import Box
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process
from orchestration.master.isolated.rows import left
from orchestration.master.result import Run, Statistics, Stopped
from orchestration.system.model import System

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recorded:
    """What the rows of a run are.

    Attributes
    ----------
    points : list of float
        Communication points in s.
    width : int
        Numbers in a row.
    places : dict of str to int
        Of what is recorded, by ``member.variable``.
    units, guids : dict of str to str
        Of what is recorded, and of each member's FMU.
    """

    points: list[float]
    width: int
    places: dict[str, int]
    units: dict[str, str]
    guids: dict[str, str]


def run_beside(
    limits: Limits,
    run: Callable[..., Run],
    system: System,
    *arguments: Any,
    progress: Callable[[int], None],
    options: Mapping[str, Any],
) -> Run:
    """Make a run in a process of its own.

    Parameters
    ----------
    limits : Limits
    run : callable
        :func:`orchestration.master.run.run`.
    system : System
    *arguments
        That follow it there.
    progress : callable
        Called with the number of points done, now and then.
    options : Mapping of str to Any
        Other options of it.

    Returns
    -------
    Run

    Raises
    ------
    Stopped, UserError
        As it does; also if the process ends, or a call takes too long.
    """
    # a class may be known to this process only, and no run needs it
    members = tuple(replace(m, fmu=m.fmu.resolve(), cls=None) for m in system.members)
    with Process(limits) as process:
        try:
            message, done = process.call(
                _run,
                run,
                replace(system, members=members),
                arguments,
                dict(options),
                told={"progress": progress},
            )
        except Ended as end:
            recorded = process.box.about()
            words = (
                f"{end.state.words(recorded.points if recorded else (), system.name)}: {end.reason}"
            )
            done = _partial(process.box, recorded, end.state.row, words)
            if end.interrupted:
                return done
            raise Stopped(words, done) from end
        except (
            OSError
        ) as error:  # FMUs may take away from their process what it needs, such as files
            words = f"{system.name}: {error.strerror or error}"
            raise Stopped(
                words, _partial(process.box, process.box.about(), process.box.state().row, words)
            ) from error
    if message is not None:
        raise Stopped(message, done)
    found: Run = done
    return found


def _run(
    run: Callable[..., Run],
    system: System,
    arguments: tuple[Any, ...],
    options: Mapping[str, Any],
    progress: Callable[[int], None],
) -> tuple[str | None, Run]:
    try:
        return None, run(system, *arguments, **options, progress=progress)
    except Stopped as stopped:
        return str(stopped), stopped.run


def _partial(box: Box, recorded: Recorded | None, kept: int, message: str) -> Run:
    """What was computed before the process ended; `kept` rows the kernel had not handed over."""
    nothing = Statistics({}, 0, 0, 0, 0.0)
    if recorded is None:
        return Run(np.empty(0), {}, {}, False, message, nothing, {})
    table, more = left(box.folder, recorded.width), box.filled(kept)
    if more is not None:
        table = np.concatenate([table, more])
    table = table[: len(recorded.points)]
    return Run(
        np.array(recorded.points[: len(table)]),
        {name: table[:, place] for name, place in recorded.places.items()},
        recorded.units,
        False,
        message,
        replace(nothing, steps=max(0, len(table) - 1)),
        recorded.guids,
    )
