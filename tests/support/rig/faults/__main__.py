"""Try every kind of fault, and combinations by chance, and write ``docs/hil-faults.md``.

``python -m tests.support.rig.faults [WORD ...]``
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.support.rig.faults import table
from tests.support.rig.faults.bench import try_all
from tests.support.rig.faults.matrix import all_combinations, drawn, try_combinations
from tests.support.rig.faults.page import add_combinations, write

PAGE = Path(__file__).parents[4] / "docs" / "hil-faults.md"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit status is 1 if a promise was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", help="only kinds that have one of these in their name")
    parser.add_argument("--combinations", type=int, default=300, help="how many are drawn")
    parser.add_argument("--all", action="store_true", help="every combination, and nothing else")
    parser.add_argument("--no-kinds", action="store_true", help="combinations alone")
    parser.add_argument("--seed", type=int, default=1, help="of combinations and their times")
    parser.add_argument("--out", type=Path, help="page; default docs/hil-faults.md if all is tried")
    chosen = parser.parse_args(arguments)
    kinds = [kind for kind in table() if any(word in kind.kind for word in chosen.words or [""])]
    combinations = drawn(0 if chosen.words else chosen.combinations, chosen.seed)
    if chosen.all or chosen.no_kinds:
        kinds = []
    if chosen.all:
        combinations = all_combinations()
    with tempfile.TemporaryDirectory() as folder:
        rows = try_all(kinds, Path(folder), _tell)
        outcomes = list(try_combinations(combinations, Path(folder), _tell, chosen.seed))
    broken = sum(not row.is_met for row in rows)
    broken += sum(outcome.result == "BROKEN" for outcome in outcomes)
    _tell(f"{len(rows)} kinds, {len(outcomes)} combinations, {broken} promises broken")
    page = chosen.out or (None if chosen.words or chosen.all else PAGE)
    if page is not None and chosen.no_kinds:
        add_combinations(page, outcomes)
    elif page is not None:
        write(page, rows, outcomes)
    return 1 if broken else 0


def _tell(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
