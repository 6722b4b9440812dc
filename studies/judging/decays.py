"""Study of decays: whether a law hidden in a system that nothing drives is named.

`python -m studies.judging.decays --each 2 --seed 1` draws records of every kind of `studies.decays`
with a law hidden and without, and diagnoses them from their files with models that know of none.
"""

from __future__ import annotations

import argparse
import tempfile
import time as clock
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from studies.decays import KINDS, DecayCase, cases, draw, write
from studies.judging.clean import ROOT, share
from studies.judging.kept import add_options, among, judged

Row = dict[str, Any]
RIGHT = "right"
WRONG = "another cause"
NOTHING = "no cause"
REFUSED = "refused"
OUTCOMES = (RIGHT, WRONG, NOTHING, REFUSED)
_FINE = "consistent", "recalibrate"


def judge(case: DecayCase) -> Row:
    """Draw a record, diagnose it from its files, and tell what was said."""
    import orchestration as ppy

    drawn = draw(case)
    began = clock.process_time()
    with tempfile.TemporaryDirectory() as folder:
        paths = write(drawn, Path(folder))
        try:
            result = ppy.diagnose(paths, drawn.model, hold=drawn.kind.known, laws=False)
        except UserError as error:
            return asdict(case) | {"outcome": REFUSED, "said": str(error)}
    seconds = clock.process_time() - began
    first = result.details.diagnosis.selection.steps[:1]
    names = [e.effect_name for step in first for e in (step.chosen, *step.alternatives)]
    is_named = any(part in name for name in names for part in drawn.kind.causes)
    if case.hidden:
        outcome = RIGHT if is_named else WRONG if names else NOTHING
    else:
        outcome = RIGHT if str(result.verdict) in _FINE else WRONG if names else NOTHING
    return asdict(case) | {
        "outcome": outcome,
        "verdict": str(result.verdict),
        "first": names,
        "causes": list(result.causes),
        "seconds": seconds,
        "said": result.sentence,
    }


def report(rows: Sequence[Row]) -> Topic:
    """Return a table of what was said, by kind, and the answers that are wrong."""
    parts: list[str | Table] = []
    for hidden in (True, False):
        of = [row for row in rows if row["hidden"] is hidden]
        right = sum(row["outcome"] == RIGHT for row in of)
        what = "name the hidden law first" if hidden else "are clean and left alone"
        parts.append(f"Of {len(of)} records {share(right, len(of))} {what}.")
    table = []
    for kind in KINDS:
        for hidden in (True, False):
            of = [row for row in rows if row["kind"] == kind and row["hidden"] is hidden]
            counts = [sum(row["outcome"] == outcome for row in of) for outcome in OUTCOMES]
            table.append([kind, "hidden" if hidden else "clean", *counts])
    parts.append(Table(["kind", "law", *OUTCOMES], table))
    wrong = [[_title(row), row["said"]] for row in rows if row["outcome"] != RIGHT]
    if wrong:
        parts.append(Table(["not right", "said"], wrong))
    return Topic("Decays", parts)


def _title(row: Row) -> str:
    return str(DecayCase(**{name: row[name] for name in DecayCase.__dataclass_fields__}))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.decays", description=__doc__.split("\n\n")[0]
    )
    add_options(parser, 0, "decays")
    parser.add_argument("--each", type=int, default=2, help="records of every kind")
    chosen = parser.parse_args(arguments)
    kept = chosen.kept or ROOT / "build" / "decays" / f"{chosen.seed}.jsonl"
    wanted = among(cases(chosen.each, chosen.seed), chosen)
    print(
        "\n"
        + str(report(judged(wanted, kept, judge, lambda row: f"{row['outcome']}: {row['said']}")))
    )


if __name__ == "__main__":
    main()
