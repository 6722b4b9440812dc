"""Write ``docs/proxy-faults.md``: ``python -m tests.support.rig.masters``."""

from __future__ import annotations

import argparse
import tempfile
import threading
from pathlib import Path

from fmus.kit.build.building import RUNTIMES
from tests.support.rig.masters import (
    AFTER,
    FAULTS,
    GOOD,
    LINK_STATES,
    MASTERS,
    MAX_AGE,
    SLACK,
    STEP,
    TIMEOUT,
    Observed,
    observe,
)
from tests.support.rig.proxies import actuator_rig

PAGE = Path(__file__).parents[4] / "docs" / "proxy-faults.md"
_HEAD = f"""# What a proxy says of its values when the rig fails

Written by `make proxy-faults`: a proxy stepped at {1 / STEP:g} Hz in three masters, both builds,
with `on_stale = hold`, `max_age` {MAX_AGE:g} s and `communication_timeout` {TIMEOUT:g} s, at a rig
in a process of its own that failed after {GOOD} steps; {AFTER} steps more were asked for. The rig's
charge is the time at which it was measured, so that the true age of all that is read is known.

*Stated* is the age that stands beside the value after the last step, *true* how old it is.
*Understated* is by how much a value was older than it said at most, over all steps that the master
did not call failed; up to {1e3 * SLACK:.0f} ms lie between the FMU and the reader. *Fresh-looking*
are readings that no error, no `link_state` and no age beyond `max_age` gave away, and that were
older than that. After an error libcosim asks the FMU no more: what it shows is of the step before.

"""


def page(cases: list[tuple[str, str, str, Observed]]) -> str:
    """Write the page."""
    head = "| fault | master | build | the master | `link_state` | stated | true |"
    lines = [head + " understated | fresh-looking |", "|" + " --- |" * 9]
    for fault, master, runtime, seen in cases:
        cells = [FAULTS[fault], master, runtime, *_cells(seen)]
        lines.append("| " + " | ".join(cells) + " |")
    return _HEAD + "\n".join(lines) + "\n"


def _cells(seen: Observed) -> list[str]:
    if seen.refused:
        return ["does not begin", "", "", "", "", "0"]
    fresh = seen.looks_fresh()
    failed = [k for k, row in enumerate(seen.after, 1) if row.error]
    did = f"is told of an error in step {failed[0]}" if failed else "steps on"
    last = seen.after[-1]
    if not last.charge:
        return [did, LINK_STATES[last.link_state], "never", "never", "", str(len(fresh))]
    trusted = [row.understated for row in (*seen.before, *seen.after) if not row.error]
    states = dict.fromkeys(LINK_STATES[row.link_state] for row in seen.after)
    return [
        did,
        ", ".join(states),
        f"{last.charge_age:.2f} s",
        f"{last.clock - last.charge:.2f} s",
        f"{1e3 * max(0.0, *trusted):.0f} ms",
        str(len(fresh)),
    ]


def main() -> None:
    """Write the page, or serve the rig of a run until killed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--serve", type=int)
    parser.add_argument("--out", type=Path, default=PAGE)
    chosen = parser.parse_args()
    if chosen.serve is not None:
        with actuator_rig(port=chosen.serve, period=0.005, watchdog=10.0):
            print("ready", flush=True)
            threading.Event().wait()
    cases = []
    for fault in FAULTS:
        for master in MASTERS:
            for runtime in RUNTIMES:
                with tempfile.TemporaryDirectory() as folder:
                    seen = observe(master, runtime, fault, Path(folder))
                cases.append((fault, master, runtime, seen))
                print(fault, master, runtime, *_cells(seen), sep="; ", flush=True)
    chosen.out.write_text(page(cases), encoding="utf-8")


if __name__ == "__main__":
    main()
