"""Study of hundreds of emulated records: how often the hidden effect is named.

A confusion matrix and the rates that count.

`python -m studies.judging.naming --seed NEW` writes ``docs/naming.md``; the seed should be one that
nobody has looked at. Every diagnosis is kept as soon as it is made, in a folder named after the
code that made it, so that an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import tempfile
import time as clock
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from studies.judging.stamp import DIAGNOSIS, digest, stamp

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "naming.md"
CODE = (*DIAGNOSIS, "studies/judging/naming.py", "fmus/ppy_actuator", "studies/emulator")
PAIRS = (
    ("strain_saturation", "double_layer"),
    ("resistance_growth", "quadratic_strain"),
    ("second_kelvin", "charge_dependent_capacitance"),
    ("nonlinear_stiffness", "force_to_voltage"),
    ("strain_hysteresis", "capacitance_fade"),
    ("transport_delay.voltage", "slack"),
    ("self_heating", "strain_lag"),
    ("sensor_drift.voltage", "charge_dependent_stiffness"),
)
VARIANTS: dict[str, dict[str, Any]] = {
    "voltage only": {"outputs": ("voltage",)},
    "displacement only": {"outputs": ("displacement",)},
    "2 Hz": {"rate": 2.0},
    "three minutes": {"duration": 180.0},
    "not at rest": {"at_rest": False},
}
_ABOUT = (
    "How often the hidden effect is named: hundreds of emulated records, a confusion matrix and"
    " the rates that count."
)
_LEGEND = (
    "*First* are those in which the hidden effect, in whatever shape, stands at the top,"
    " and *in its shape* those in which it does so by its own name; *or in the group* adds"
    " to the former those in which the verdict `ambiguous` tells it as a rival of the top."
    " *Too many* are records with more causes than were hidden, shapes of one law over one"
    " signal counted once. What is right where none is hidden is in"
    " `studies/judging/naming.py`."
)
CHANGES = {"R1 +40 %": ("R1", {"R1": 1.4}), "k2 -30 %": ("k2", {"k2": 0.7})}


@dataclass(frozen=True)
class Case:
    """A record to draw, and what should be said of it.

    Attributes
    ----------
    group : str
    hidden : tuple of str
    seed : int
    options : dict
        Of `studies.emulator.records.draw`.
    """

    group: str
    hidden: tuple[str, ...]
    seed: int
    options: dict[str, Any] = field(default_factory=dict)


def cases(seeds: int, first: int = 1) -> Iterator[Case]:
    """Return everything that is drawn, the first seeds of all groups first.

    Parameters
    ----------
    seeds : int
        Of every variation at every strength and colour; the other groups in proportion.
    first : int
        The first of them.
    """
    from studies.emulator import CATALOGUE, UNKNOWN

    for seed in range(first, first + seeds):
        for colour in (0.0, 0.9):
            for strength in (1.0, 0.3):
                group = f"strength {strength:g}, φ = {colour:g}"
                options = {"strength": strength, "noise_colour": colour}
                yield from (Case(group, (name,), seed, options) for name in CATALOGUE)
            for k in range(50):
                yield Case(f"clean, φ = {colour:g}", (), 50 * seed + k, {"noise_colour": colour})
        yield from (
            Case("outside the catalogue", (name,), 10 * seed + k)
            for name in UNKNOWN
            for k in range(2)
        )
        yield from (Case("two effects", pair, seed) for pair in PAIRS)
        for group, (_, factors) in CHANGES.items():
            yield from (
                Case(group, (), 10 * seed + k, {"changed": factors, "spread": 0.0})
                for k in range(2)
            )
        if seed - first < max(1, seeds // 2):
            for group, options in VARIANTS.items():
                yield from (Case(group, (name,), seed, options) for name in CATALOGUE)


def judge(case: Case, records: Path | None = None) -> dict[str, Any]:
    """Draw a record, diagnose it from its CSV file, and return the answer beside the right one.

    Parameters
    ----------
    case : Case
    records : Path, optional
        Folder where drawn records are kept.
    """
    from orchestration.api import read_record
    from orchestration.discrepancy import diagnose
    from orchestration.discrepancy.candidates import catalogue
    from orchestration.discrepancy.data import dataset_of
    from orchestration.fmu import find_model
    from orchestration.fmu.model import catalogue as known_effects
    from orchestration.identify import normalised_rms
    from orchestration.rig import RIG_COMPONENT
    from studies.emulator import draw_cached, write

    try:
        drawn = draw_cached(records, case.hidden, case.seed, **case.options)
    except ValueError as error:
        return asdict(case) | {"impossible": str(error)}
    model = find_model(RIG_COMPONENT)
    with tempfile.TemporaryDirectory() as folder:
        write(drawn, Path(folder) / "record.csv")
        data = dataset_of(read_record(Path(folder) / "record.csv", model), model, {})
    began = clock.perf_counter()
    # what follows in the pipeline, an FMU and an experiment, names nothing
    diagnosis = diagnose(
        model.cls, data, catalogue(model.cls, known_effects(model.cls), data.measured)
    )
    took = clock.perf_counter() - began
    first = diagnosis.validation.first
    best = {
        o: normalised_rms(y[first:], drawn.truth.outputs[o][first:])
        for o, y in data.measured.items()
    }
    inside = {
        n: bool(e.interval[0] <= getattr(drawn.truth.parameters, n) <= e.interval[1])
        for n, e in diagnosis.estimates.items()
        if n in asdict(drawn.truth.parameters) and np.isfinite(e.interval).all()
    }
    return asdict(case) | {
        "wanted": [h.id + (f"({h.output})" if h.output else "") for h in drawn.truth.hidden],
        "alike": any(h.alike for h in drawn.truth.hidden),
        "widths": [h.widths for h in drawn.truth.hidden],
        "verdict": diagnosis.verdict,
        "causes": diagnosis.causes,
        "rivals": [[e.effect_name for e in s.alternatives] for s in diagnosis.selection.steps],
        "gains": [s.gain for s in diagnosis.selection.steps],
        "differing": diagnosis.changed,
        "ratio": max(error / best[o] for o, error in diagnosis.after.items()),
        "inside": inside,
        "seconds": took,
    }


@cache
def _families() -> dict[str, str]:
    """Return effects of the catalogue by name, with what shapes of one cause have in common."""
    from orchestration.fmu import find_model
    from orchestration.fmu.model import catalogue
    from orchestration.rig import RIG_COMPONENT

    return {
        name: effect.term.family or name
        for name, effect in catalogue(find_model(RIG_COMPONENT).cls).items()
    }


def _cause(name: str) -> str:
    return _families().get(name, name)


def right(row: dict[str, Any], rivals: bool = True, shapes: bool = True) -> bool:
    """Return whether the answer is the right one.

    Parameters
    ----------
    row : dict
        As :func:`judge` gives it.
    rivals : bool
        Whether what the verdict tells as a rival of a cause counts, or only what stands first.
    shapes : bool
        Whether another shape of the same law over the same signal counts.
    """
    cause = _cause if shapes else str
    if row["group"] in CHANGES:
        return row["verdict"] == "recalibrate" and row["differing"][:1] == [
            CHANGES[row["group"]][0]
        ]
    if row["group"] == "outside the catalogue":
        return row["verdict"] == "unexplained"
    if not row["hidden"]:
        return not row["causes"] and row["verdict"] in ("consistent", "recalibrate")
    if len(row["wanted"]) > 1:
        each = zip(row["causes"], row["rivals"], strict=True)
        groups = [{*map(cause, (name, *(others if rivals else ())))} for name, others in each]
        chosen = permutations(groups, len(row["wanted"]))
        return any(
            all(cause(w) in group for w, group in zip(row["wanted"], some, strict=True))
            for some in chosen
        )
    if row["alike"] and not row["causes"]:
        return (
            row["verdict"] == "recalibrate"
        )  # other parameters of the base model do just the same
    named = [*row["causes"][:1], *(row["rivals"][0] if row["causes"] and rivals else ())]
    return cause(row["wanted"][0]) in map(cause, named)


def too_many(row: dict[str, Any]) -> bool:
    """Return whether more causes are named than were hidden, shapes of one counted once."""
    return (
        len({*map(_cause, row["causes"])}) > len(row["hidden"])
        and row["group"] != "outside the catalogue"
    )


def run(
    wanted: Iterable[Case], folder: Path, workers: int, records: Path | None = None
) -> list[dict[str, Any]]:
    """Judge all cases that are not in the folder yet, side by side."""
    folder.mkdir(parents=True, exist_ok=True)
    todo = []
    rows = []
    for case in wanted:
        file = folder / f"{hashlib.sha256(repr(case).encode()).hexdigest()[:24]}.json"
        if file.exists():
            rows.append(json.loads(file.read_text(encoding="utf-8")))
        else:
            todo.append((case, file))
    with ProcessPoolExecutor(workers) as pool:
        waiting = {pool.submit(judge, case, records): (case, file) for case, file in todo}
        for k, done in enumerate(as_completed(waiting), start=1):
            case, file = waiting[done]
            row = done.result()
            file.write_text(json.dumps(row), encoding="utf-8")
            rows.append(row)
            hidden = " + ".join(case.hidden) or "nothing"
            print(
                f"{k}/{len(todo)} {case.group}: {hidden} {case.seed}: {_summary(row)}", flush=True
            )
    return rows


def _summary(row: dict[str, Any]) -> str:
    if row.get("impossible"):
        return str(row["impossible"])
    mark = "ok " if right(row) else "NO "
    return f"{mark} {row['verdict']} {row['causes']} {row['rivals']}"


def page(rows: list[dict[str, Any]], options: str = "") -> str:
    """Write the results as Markdown, with the command line options that they were drawn by."""
    rows = [row for row in rows if "impossible" not in row]
    groups = list(dict.fromkeys(row["group"] for row in sorted(rows, key=lambda r: r["group"])))
    lines = [
        "# How often the hidden effect is named",
        "",
        _ABOUT,
        "",
        f"Drawn by `python -m studies.judging.naming{options}`: {len(rows)} records, by seeds that"
        " were not looked at before.",
        _LEGEND,
        "",
        stamp(CODE),
        "",
        *_rates(rows, groups),
        *_by_effect(rows, [group for group in groups if "strength" in group]),
        *_named_first(rows),
        *_intervals(rows),
        *_times(rows),
    ]
    return "\n".join(lines)


def _rates(rows: list[dict[str, Any]], groups: list[str]) -> list[str]:
    """Return a table of how often the hidden effect was named, by group of records."""
    lines = [
        "| records | first | in its shape | or in the group | too many | of "
        "| extended model / true model, held out (median, 90 %) |",
        "|---|---|---|---|---|---|---|",
    ]
    for group in groups:
        members = [row for row in rows if row["group"] == group]
        counts = [
            sum(right(row, rivals=False, shapes=True) for row in members),
            sum(right(row, rivals=False, shapes=False) for row in members),
            sum(map(right, members)),
            sum(map(too_many, members)),
        ]
        cells = " | ".join(map(str, counts))
        ratios = [row["ratio"] for row in members]
        spread = f"{np.median(ratios):.3f}, {np.quantile(ratios, 0.9):.3f}"
        lines.append(f"| {group} | {cells} | {len(members)} | {spread} |")
    return lines


def _by_effect(rows: list[dict[str, Any]], groups: list[str]) -> list[str]:
    """Return a table of how often each effect was named, by group of records."""
    lines = [
        "",
        "## By effect",
        "",
        "| hidden | " + " | ".join(groups) + " | all |",
        "|" + "---|" * (2 + len(groups)),
    ]
    single = [
        row for row in rows if len(row["hidden"]) == 1 and row["group"] != "outside the catalogue"
    ]
    for name in dict.fromkeys(row["hidden"][0] for row in single):
        cells = []
        for group in [*groups, None]:
            members = [
                row for row in single if row["hidden"][0] == name and group in (row["group"], None)
            ]
            cells.append(f"{sum(map(right, members))}/{len(members)}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def _named_first(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table of what was named first, by what was hidden."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows:
        hidden = " + ".join(row["wanted"]) or row["group"]
        counts[hidden][row["causes"][0] if row["causes"] else row["verdict"]] += 1
    lines = ["", "## What was named first", "", "| hidden | named first: times |", "|---|---|"]
    for hidden in sorted(counts):
        named = ", ".join(f"{name}: {count}" for name, count in counts[hidden].most_common())
        lines.append(f"| {hidden} | {named} |")
    return lines


def _intervals(rows: list[dict[str, Any]]) -> list[str]:
    """Return sentences on how many parameters lie within their intervals."""
    inside = [hit for row in rows if right(row) for hit in row["inside"].values()]
    lines = [
        "",
        f"Of {len(inside)} physical parameters of rightly judged records,"
        f" {100 * np.mean(inside):.1f} % lie within their interval.",
        "",
    ]
    clean_rows = [row for row in rows if row["group"].startswith("clean")]
    clean = [hit for row in clean_rows for hit in row["inside"].values()]
    if clean:
        lines += [f"On clean records, {100 * np.mean(clean):.1f} % of {len(clean)} do.", ""]
    return lines


def _times(rows: list[dict[str, Any]]) -> list[str]:
    """Return sentences on what moves parameters, and on how long a diagnosis took."""
    seconds = [row["seconds"] for row in rows]
    return [
        "The rig's effects have other forms than the catalogue's, which moves parameters that"
        " trade with them.",
        "",
        f"A diagnosis took {np.median(seconds):.1f} s (median),"
        f" {np.quantile(seconds, 0.95):.1f} s (95 %).",
        "",
    ]


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.naming", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument(
        "--seeds", type=int, default=4, help="of every variation; 4 are some 900 records"
    )
    parser.add_argument("--seed", type=int, default=1, help="the first of the seeds")
    parser.add_argument(
        "--folder", type=Path, help="where diagnoses are kept; default build/naming/DIGEST"
    )
    parser.add_argument(
        "--records", type=Path, help="where drawn records are kept; default nowhere"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument(
        "--only",
        nargs="*",
        default=[],
        help="words that the group or the hidden effect must contain",
    )
    parser.add_argument(
        "--out", type=Path, help="page to write; default docs/naming.md unless --only is given"
    )
    chosen = parser.parse_args()
    wanted = [
        c
        for c in cases(chosen.seeds, chosen.seed)
        if all(word in f"{c.group} {c.hidden}" for word in chosen.only)
    ]
    folder = chosen.folder or ROOT / "build" / "naming" / digest(CODE)
    options = f" --seeds {chosen.seeds} --seed {chosen.seed}"
    text = page(run(wanted, folder, chosen.workers, chosen.records), options)
    out = chosen.out or (None if chosen.only else PAGE)
    print(text)
    if out is not None:
        out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
