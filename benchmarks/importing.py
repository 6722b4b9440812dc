"""How long the command line takes to say something, and which imports take the time."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable

from .tables import Cell, Table, Topic
from .timing import take_turns

NOTHING = "python -c pass"
COMMANDS = {
    NOTHING: ("-c", "pass"),
    "ppy --help": ("-m", "orchestration.cli", "--help"),
    "ppy list": ("-m", "orchestration.cli", "list"),
}
_HEAVIEST = 8
_IMPORT = re.compile(r"^import time:\s+(\d+) \|\s+(\d+) \|\s*([\w.]+)$", re.M)


def measure(quick: bool = False) -> Topic:
    """Time the commands in fresh processes, and add up the imports by package."""
    times = take_turns(
        {name: _process(arguments) for name, arguments in COMMANDS.items()}, 2 if quick else 20
    )
    rows: list[list[Cell]] = [
        [
            name,
            times.best(name) * 1e3,
            times.ratio_of_best(name, NOTHING),
            times.median_ratio(name, NOTHING),
        ]
        for name in COMMANDS
    ]
    parts: list[str | Table] = [
        "Each in a process of its own.",
        Table(["command", "best, ms", "ratio of best", "median ratio"], rows),
    ]
    for name in list(COMMANDS)[1:]:
        parts += [
            f"Heaviest packages of `{name}` (time in their own modules, `-X importtime`):",
            _heaviest(name, quick),
        ]
    return Topic("Start of the command line", parts)


def _process(arguments: tuple[str, ...]) -> Callable[[], object]:
    command = [sys.executable, *arguments]
    return lambda: subprocess.run(
        command, check=True, capture_output=True, stdin=subprocess.DEVNULL
    )


def own_times(report: str) -> dict[str, float]:
    """Add up the output of ``-X importtime`` by package.

    Parameters
    ----------
    report : str

    Returns
    -------
    dict of str to float
        Milliseconds spent in a package's own modules; what only the interpreter's start imports is
        left out by the caller.
    """
    total: dict[str, float] = defaultdict(float)
    for own, _, module in _IMPORT.findall(report):
        total[module.split(".")[0]] += int(own) / 1e3
    return dict(total)


def _report(arguments: tuple[str, ...]) -> dict[str, float]:
    command = [sys.executable, "-X", "importtime", *arguments]
    return own_times(subprocess.run(command, check=True, capture_output=True, text=True).stderr)


def _heaviest(name: str, quick: bool) -> Table:
    """Measure the shortest import time of each package, without those that Python starts with."""
    reports = [_report(COMMANDS[name]) for _ in range(1 if quick else 5)]
    at_start = _report(COMMANDS[NOTHING])
    shortest = {
        p: min(r[p] for r in reports if p in r) for r in reports for p in r if p not in at_start
    }
    everything = sum(shortest.values())
    first = sorted(shortest.items(), key=lambda item: -item[1])[:_HEAVIEST]
    rows: list[list[Cell]] = [
        [package, spent, 100 * spent / everything] for package, spent in first
    ]
    return Table(
        ["package", "own time, ms", "share of all imports, %"], [*rows, ["all", everything, 100.0]]
    )
