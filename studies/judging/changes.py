"""Study of pairs of records of one specimen: which changes are claimed, and which are true.

In some pairs nothing changed, in others one parameter did.

`python -m studies.judging.changes --pairs 100 --seed 1` draws pairs with generators that share no
code with what they judge (`studies/clean`): stimuli, noise and starts are others in the second
record, and by `--factor` one parameter.
"""

from __future__ import annotations

import argparse
import tempfile
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from studies.clean import Case, cases, draw

Row = dict[str, Any]
SUBJECTS = (
    "Actuator",
    "Motor",
    "Pendulum",
    "ThermalNodes",
    "Cell",
)  # what is measured in seconds, not in minutes
COLUMNS = ["noise", "pairs", "claimed falsely", "changed", "told", "told alone"]


def pairs(count: int, seed: int) -> list[tuple[Case, Case]]:
    """Draw cases of first and second records; stimulus, noise and seed differ."""
    drawn = [
        case for case in cases(8 * count, seed) if case.plant in SUBJECTS and case.timing == "usual"
    ]
    rng = np.random.default_rng([seed, 1])
    found = []
    for first in drawn[:count]:
        others = [
            case for case in drawn if case.plant == first.plant and case.smooth == first.smooth
        ]
        second = others[rng.integers(len(others))]
        found.append((first, replace(second, seed=first.seed + 50_000, noise=first.noise)))
    return found


def judge(
    first: Case,
    second: Case,
    factor: float,
    effects: Sequence[str] | None = (),
) -> Row:
    """Draw two records, compare them, and return what was claimed and what changed."""
    import orchestration as ppy

    before = draw(first)
    plant = before.plant
    rng = np.random.default_rng(first.seed)
    physical = [n for n in plant.nominal if n not in plant.slight]
    changed = physical[rng.integers(len(physical))] if factor != 1.0 else ""
    specimen = {n: before.truth[n] * (factor if n == changed else 1.0) for n in plant.nominal}
    after = draw(second, specimen)
    row: Row = {
        "plant": plant.name,
        "noise": first.noise,
        "stimuli": [first.stimulus, second.stimulus],
    }
    with tempfile.TemporaryDirectory() as folder:
        paths = [
            record.write(Path(folder) / f"{k}.csv") for k, record in enumerate((before, after))
        ]
        began = clock.perf_counter()
        try:
            said = ppy.diagnose(
                paths[0],
                plant.model,
                compare=paths[1],
                effects=effects,
                settings=dict(plant.settings),
                laws=False,
            )
        except UserError as error:
            return row | {
                "refused": str(error).replace(folder, ""),
                "changed": changed,
                "claimed": [],
            }
    found = said.changes or []
    claimed = [c.name for c in found if c.changed]
    uncertain = [c.name for c in found if c.uncertain]
    figures = {c.name: [c.before, c.after, c.gain] for c in found if c.changed or c.name == changed}
    return row | {
        "changed": changed,
        "claimed": claimed,
        "uncertain": uncertain,
        "figures": figures,
        "seconds": clock.perf_counter() - began,
        "verdict": str(said.verdict),
        "causes": said.causes,
    }


def report(rows: Sequence[Row]) -> Topic:
    """Report how often a change was claimed falsely, and how often a true one was reported."""
    kept = [row for row in rows if "refused" not in row]
    lines: list[list[str | int | float]] = []
    for noise in [*dict.fromkeys(row["noise"] for row in kept), "all"]:
        own = [row for row in kept if noise in (row["noise"], "all")]
        changed = [row for row in own if row["changed"]]
        false = sum(any(name != row["changed"] for name in row["claimed"]) for row in own)
        told = sum(row["changed"] in row["claimed"] for row in changed)
        alone = sum(row["claimed"] == [row["changed"]] for row in changed)
        lines.append([noise, len(own), false, len(changed), told, alone])
    refused = sorted({row["refused"] for row in rows if "refused" in row})
    notes = [f"Refused: {len(rows) - len(kept)}: {'; '.join(refused)}"] if refused else []
    return Topic("Changes between two records", [Table(COLUMNS, lines), *notes])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.changes", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--factor", type=float, default=1.0, help="of one parameter in the second record"
    )
    parser.add_argument("--catalogue", action="store_true", help="with all effects; default none")
    chosen = parser.parse_args(arguments)
    rows = []
    for first, second in pairs(chosen.pairs, chosen.seed):
        effects = None if chosen.catalogue else ()
        rows.append(judge(first, second, chosen.factor, effects))
        print(rows[-1], flush=True)
    print("\n" + str(report(rows)))


if __name__ == "__main__":
    main()
