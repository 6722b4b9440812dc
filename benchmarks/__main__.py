"""Measure everything, print the tables and write ``docs/benchmarks.md``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from . import (
    ageing,
    building,
    coupling,
    diagnosing,
    diagnosing_split,
    importing,
    isolating,
    kernel,
    machine,
    mapping,
    master,
    pacing,
    record,
    stepping,
    stiff,
    sweeping,
    versions,
    wrapping,
)
from .tables import Topic

PAGE = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"
TOPICS: dict[str, Callable[[bool], Topic]] = {
    "step": stepping.measure,
    "versions": versions.measure,
    "kernel": kernel.measure,
    "record": record.measure,
    "stiff": stiff.measure,
    "ageing": ageing.measure,
    "master": master.measure,
    "coupling": coupling.measure,
    "pacing": pacing.measure,
    "sweeps": sweeping.measure,
    "isolation": isolating.measure,
    "fmi3": wrapping.measure,
    "diagnose": diagnosing.measure,
    "split": diagnosing_split.measure,
    "laws": mapping.measure,
    "import": importing.measure,
    "build": building.measure,
}
_HEAD = """# Benchmarks

Written by `make benchmark` (`python -m benchmarks`). Times depend on the machine;
the ratios are what counts. Whatever is compared was measured in one run, in turns. *Best* is the
shortest time, the one least disturbed; a *median ratio* is the median over the rounds of the ratio
within one round. [Clean records](clean-records.md) tells how long hundreds of diagnoses take."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "topics", nargs="*", metavar="topic", help=f"of {', '.join(TOPICS)}; default all"
    )
    parser.add_argument(
        "--quick", action="store_true", help="tiny runs, to see that everything works; no page"
    )
    parser.add_argument(
        "--out", type=Path, help="page to write; default docs/benchmarks.md after a full run of all"
    )
    chosen = parser.parse_args(arguments)
    unknown = [name for name in chosen.topics if name not in TOPICS]
    if unknown:
        parser.error(f"unknown topic {unknown[0]!r}; there are: {', '.join(TOPICS)}")
    parts = [_HEAD, str(machine.describe())]
    print(parts[1], flush=True)
    for name in chosen.topics or TOPICS:
        parts.append(str(TOPICS[name](chosen.quick)))
        print("\n" + parts[-1], flush=True)
    page = chosen.out or (None if chosen.quick or chosen.topics else PAGE)
    if page is not None:
        page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
