"""Try every kind of fault and write ``docs/hil-faults.md``: ``python -m tests.support.rig.faults
[WORD ...]``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.rig.faults import table
from tests.support.rig.faults.bench import PERIOD, WATCHDOG, try_all

PAGE = Path(__file__).parents[4] / "docs" / "hil-faults.md"
_HEAD = f"""# What happens when something fails

Written by `make hil-faults`: every fault was brought about, with real processes and sockets, at a
server with a watchdog time of {WATCHDOG:g} s and a period of {PERIOD * 1000:.1f} ms, by a client
that commands every 20 ms. The device is a backend that writes down every call with its time and
fails when it is told to.

The time to the safe state ends when the backend's `safe` was called, by its own log. It begins
with the last fresh command that the server was handed (by the log of the forwarder in between),
or, where the client goes on, with the last command that the device carried out (by its own log).
It has to be below the bound: watchdog time and one period, and for a driver call that never
returns what it took to kill the device's process and to open the backend in another one. Besides,
whatever was ever written must be within the limits.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit status is 1 if a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "words", nargs="*", help="only kinds that have one of these in their name; no page then"
    )
    parser.add_argument("--out", type=Path, default=PAGE)
    chosen = parser.parse_args(arguments)
    kinds = [
        kind
        for kind in table()
        if not chosen.words or any(word in kind.kind for word in chosen.words)
    ]
    with tempfile.TemporaryDirectory() as folder:
        rows = try_all(kinds, Path(folder), lambda line: print(line, flush=True))
    broken = sum(row[-1] != "yes" for row in rows)
    print(f"{len(rows)} kinds of faults, {broken} promises broken")
    if not chosen.words:
        chosen.out.write_text(page(rows), encoding="utf-8")
    return 1 if broken else 0


def page(rows: Sequence[Sequence[str]]) -> str:
    """Write the page."""
    head = ["kind", "promised", "observed", "time to the safe state", "from", "bound", "met"]
    lines = [
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
        for row in [head, ["---"] * 7, *rows]
    ]
    return _HEAD + "\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
