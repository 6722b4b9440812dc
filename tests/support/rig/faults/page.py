"""The page ``docs/hil-faults.md`` and its picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np
from matplotlib.ticker import MaxNLocator

from orchestration.reporting import pictures
from tests.support.rig.faults.bench import PERIOD, WATCHDOG, Row
from tests.support.rig.faults.matrix import ALARM, Outcome, all_combinations

_PICTURE = "hil_faults.svg"  # in the folder `pictures` beside the page
_CELLS = ["kind", "promised", "observed", "time to the safe state", "from", "bound", "met"]
_BINS = np.arange(0.0, 0.31, 0.005)  # s; the last has all that took longer
_HEAD = f"""# What happens when something fails

Written by `make hil-faults`: every fault was brought about, with real processes and sockets, at a
server with a watchdog time of {WATCHDOG:g} s and a period of {PERIOD * 1000:.1f} ms, by a client
that commands every 20 ms. The device is one that *holds*: what it was given last stays in a file
that is mapped into memory, whichever process ends, and every call is written down with its time on
the monotonic clock, which all processes share. So when the output became zero, and what it ever
was, is known without a word of the server.

The server promises in its first line (`ready: … safe within …`) the time to the safe state:
watchdog time, one period, and what its backend took to open. The time of a row ends when the
backend's `safe` was carried out. It begins with the last fresh command that the server was handed
(by the log of the forwarder in between), or, where the client goes on, with the last command that
the device carried out. Whatever was ever written must be within the limits.

Where a command may be under way, its client sent it earlier than the server was handed it: by the
watchdog time at most, for older ones are refused as stale. From the client's side a command is
therefore held for the watchdog time more than the server promises, and no longer.

Loss, delay, doubling, damage and order of messages are those of a forwarder of the tests between
client and server; it needs no rights and no `tc netem` of a network namespace.

What no program can do: when every process of the server is stopped or killed at once, only hardware
that needs a sign of life from the computer (a watchdog timer of the device, a relay that drops out)
takes the current away. Whoever commands or records gets to know of it within {ALARM:g} s.
"""

_COMBINATIONS = f"""## Combinations, at random times

{{drawn}} of {{all}} combinations, drawn by chance: the processes of the server (front, guard, the
guard that stands by, device) stopped, killed, or hung in a call of the driver that never returns,
alone and in pairs, with a signal of a real terminal in whose foreground the server is (Ctrl-C,
Ctrl-\\, Ctrl-Z, closing it, and others) or without, while no client is there, one commands every
20 ms, `ppy rig record` records, or `ppy run hil_bench --real-time` has a bench in a loop with the
device. They happen at once, or within up to 1.5 watchdog times in any order; and by chance there
are no further threads, no address space, no descriptors or no room for the latch on the disk, or
nobody takes what the server prints. Afterwards all that was stopped goes on, and where there was no
client one tries to command: the output has to stay at zero. `make
hil-faults-all` tries every combination, with nothing lacking.

*Median*, *95 %* and *longest* are of the time from the last event before it to the safe state, of
those that had anything to make safe; *longest in all* begins with the first event that demands it.
*Served* is for signals that need nothing: the time is that of the client's end. Promised:
{{promised}} ms.

![How many combinations were safe after what time](pictures/{_PICTURE})
"""


def write(path: Path, rows: Sequence[Row], outcomes: Sequence[Outcome]) -> None:
    """Write page and picture.

    Parameters
    ----------
    path : Path
        Of the page.
    rows : sequence of Row
        What came of the kinds of faults.
    outcomes : sequence of Outcome
        What came of combinations.
    """
    modules = dict.fromkeys(row.fault.provoke.__module__ for row in rows)
    parts = [_HEAD]
    for module in modules:
        title = " ".join((import_module(module).__doc__ or "").split()).rstrip(".")
        cells = [row.cells() for row in rows if row.fault.provoke.__module__ == module]
        parts.append(f"## {title}\n\n{_table(_CELLS, cells)}")
    path.write_text("\n".join(parts), encoding="utf-8")
    add_combinations(path, outcomes)


def add_combinations(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write the part of the page on combinations, in place of an older one, and its picture."""
    kinds = path.read_text(encoding="utf-8").partition(_COMBINATIONS.partition("\n")[0])[0]
    path.write_text(f"{kinds.rstrip()}\n\n{_of_combinations(outcomes)}", encoding="utf-8")
    _draw(path.parent / "pictures" / _PICTURE, outcomes)


def _of_combinations(outcomes: Sequence[Outcome]) -> str:
    head = ["what fails", "trials", *_RESULTS, "median", "95 %", "longest", "longest in all"]
    kinds = dict.fromkeys(outcome.combination.kind for outcome in outcomes)
    rows = [
        _summary(kind, [o for o in outcomes if o.combination.kind == kind])
        for kind in sorted(kinds, key=lambda kind: (kind.count(" and "), kind))
    ]
    bounds = [outcome.bound for outcome in outcomes if outcome.result != "alarm"]
    promised = [
        f"{1000 * value:.0f}" for value in (min(bounds, default=0.0), max(bounds, default=0.0))
    ]
    intro = _COMBINATIONS.format(
        drawn=len(outcomes), all=len(all_combinations()), promised=" to ".join(promised)
    )
    lacks = dict.fromkeys(outcome.combination.lacks for outcome in outcomes)
    of_lacks = [
        _summary(
            f"no {lacking}" if lacking else "nothing",
            [o for o in outcomes if o.combination.lacks == lacking],
        )
        for lacking in sorted(lacks)
    ]
    return f"{intro}\n{_table(head, rows)}\n{_table(['what is lacking', *head[1:]], of_lacks)}"


_RESULTS = ("safe", "served", "alarm", "BROKEN")


def _summary(kind: str, outcomes: Sequence[Outcome]) -> list[str]:
    """Count results of one kind, and take quantiles of their times."""
    counts = Counter(outcome.result for outcome in outcomes)
    times = [1000 * outcome.seconds for outcome in outcomes if outcome.seconds > 0.0]
    longest = 1000 * max(outcome.exposure for outcome in outcomes)
    quantiles = (
        [f"{value:.0f} ms" for value in np.quantile(times, [0.5, 0.95, 1.0])] if times else []
    )
    return [
        kind,
        str(len(outcomes)),
        *(str(counts[result] or "") for result in _RESULTS),
        *(quantiles or ["", "", ""]),
        f"{longest:.0f} ms" if longest else "",
    ]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
        for row in [head, ["---"] * len(head), *rows]
    ]
    return "\n".join(lines) + "\n"


def _draw(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Draw the distribution of times, by how many processes fail."""
    titles = {0: "a signal alone", 1: "one process", 2: "two processes"}
    figure, axes = pictures.panels(
        len(titles),
        "Combinations of faults: time to the safe state",
        f"time [s]; {_BINS[-2]:g} s and more in the last bar",
        1.5,
    )
    for axis, (number, title) in zip(axes, titles.items(), strict=True):
        chosen = [
            outcome
            for outcome in outcomes
            if len(outcome.combination.faults) == number and outcome.seconds > 0.0
        ]
        times = np.minimum([outcome.seconds for outcome in chosen], _BINS[-2])
        axis.hist(times, _BINS, color=pictures.MODEL)
        axis.axvline(
            min((outcome.bound for outcome in chosen), default=WATCHDOG),
            color=pictures.FITTED,
            label="promised",
        )
        axis.set_ylabel("trials [1]")
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_title(title)
        axis.legend()
    pictures.save(figure, path)
