"""Study of clean records: nothing is hidden in them, so any cause that is named is false.

`python -m studies.judging.clean --records 320 --seed 1` draws plants, stimuli and kinds of noise
with generators that share no code with what they judge (`studies/clean`), diagnoses each record
from its file, and holds fitted errors against plain least squares from five starts. Every record is
kept as a line of JSON as soon as it is judged; an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import re
import tempfile
import time as clock
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from studies.clean import (
    KINDS,
    SMOOTH,
    Case,
    CleanRecord,
    cases,
    draw,
    least_squares_fit,
    pooled_error,
)
from studies.judging.study import (
    Chosen,
    Part,
    Row,
    Study,
    among,
    counted,
    grouped,
    processor_time,
    share,
    title,
)

if TYPE_CHECKING:
    from orchestration.api import DiagnosisResult

# samples a parameter, from which on fitted errors are held against least squares where fitted
EFFECTIVE = 50.0
WORSE = 1.02  # of the best of the others, what a refit may leave
COARSE = 0.05  # s, steps of the judge's simulations of what is not linear


def judge(case: Case, fitted: bool = True, effects: Sequence[str] | None = None) -> Row:
    """Draw a record, diagnose it from its file, and tell what was said and what is true.

    Parameters
    ----------
    case : Case
    fitted : bool
        Whether plain least squares is made as well, which takes longer than the diagnosis.
    effects : sequence of str, optional
        That are considered; those of the models unless given.
    """
    drawn = draw(case)
    result, row = diagnosed(drawn, effects)
    row = asdict(case) | row
    if result is None:
        return row
    values = {n: e.value for n, e in result.parameters.items()}
    linear = [*(result.details.diagnosis.estimation.linear or ())]
    return (
        row
        | (_errors(drawn, values, linear) if not result.causes else {})
        | (_least(drawn) if fitted else {})
    )


def diagnosed(
    drawn: CleanRecord, effects: Sequence[str] | None = None
) -> tuple[DiagnosisResult | None, Row]:
    """Diagnose a record from its file; return result and figures, or None where it refuses.

    Parameters
    ----------
    drawn : CleanRecord
    effects : sequence of str, optional
        Of `orchestration.diagnose`.
    """
    import orchestration as ppy

    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        began = clock.perf_counter()
        cpu = processor_time()
        try:
            settings = settings_of(drawn)
            known = drawn.plant.known
            result = ppy.diagnose(
                path,
                drawn.plant.model,
                settings=settings,
                hold=known,
                effects=effects,
                laws=False,
                engine="old",
            )
        except UserError as error:
            refused = {
                "verdict": "refused",
                "why": [_without_figures(str(error))],
                "seconds": processor_time() - cpu,
            }
            return None, refused
    took = {"seconds": processor_time() - cpu, "elapsed": clock.perf_counter() - began}
    physical = [n for n in drawn.plant.nominal if n in result.parameters]
    return result, took | {
        "samples": drawn.time.size,
        "verdict": str(result.verdict),
        "causes": result.causes,
        "alternatives": result.alternatives,
        "why": reasons(result.to_dict()),
        "inside": {
            n: bool(e.interval[0] <= drawn.truth[n] <= e.interval[1])
            for n in physical
            if np.isfinite((e := result.parameters[n]).interval).all()
        },
    }


def settings_of(drawn: CleanRecord) -> dict[str, float]:
    """Return settings that a user of the model under test would give."""
    return dict(drawn.plant.settings) | (
        {"sample_period": drawn.step} if drawn.case.plant == "VoiceCoil" else {}
    )


def reasons(figures: dict[str, Any]) -> list[str]:
    """Return what keeps a diagnosis from calling the model right, without figures."""
    found = [f"cause {cause['effect']}" for cause in figures["causes"]]
    for left in figures["residuals"].values():
        found += ["line"] * bool(left["lines_hz"]) + ["level shift"] * bool(left["level_shifts_s"])
        found += [_structure(str(text)) for text in left["structure"]]
    found += [note["code"] for note in figures["notes"] if note["code"] == "implausible"]
    return list(dict.fromkeys(found))


def _structure(text: str) -> str:
    """Return the kind of structure that a sentence is about."""
    if "worse where an input steps" in text:
        return "worse where an input steps"
    if (where := re.search(r"(?:worse|on average) where (.*?) is ", text)) is not None:
        return f"region of {where[1]}"
    if (at := re.search(r"correlates with (.*?): .*?(earlier|later|at once)", text)) is not None:
        return f"correlation with {at[1]} {at[2]}"
    return _without_figures(text)


def right(row: Row) -> bool:
    """Return whether a verdict is one that a clean record may have."""
    return row["verdict"] in ("consistent", "recalibrate")


def _without_figures(text: str) -> str:
    return re.sub(r"\S*/\S*\.csv", "FILE", re.sub(r"[-+]?\d[\d.,e+-]*", "#", text))[:110]


def _errors(drawn: CleanRecord, values: dict[str, float], linear: Collection[str]) -> Row:
    """Return pooled errors of refitted, untouched and true parameters, and how certain they are.

    They are simulated here.

    Between samples the refitted model is simulated as the diagnosis took inputs to go.
    """
    rests = {
        f"{n}_start": float(v) for n, v in zip(drawn.plant.states, drawn.plant.rest(), strict=True)
    }
    tried = {"refit": values, "untouched": dict(drawn.plant.nominal) | rests, "true": drawn.truth}
    ways = {"refit": linear}
    errors = {
        name: pooled_error(drawn.outputs, drawn.simulated(at, smooth=ways.get(name)), drawn.regular)
        for name, at in tried.items()
    }
    effective = 0.0
    for output, y in drawn.outputs.items():
        noise = y - drawn.clean[output]
        colour = max(0.0, float(np.corrcoef(noise[:-1], noise[1:])[0, 1]))
        effective += y.size * (1.0 - colour) / (1.0 + colour)
    return errors | {
        "per_parameter": effective / (len(drawn.plant.nominal) + len(drawn.plant.states))
    }


def _least(drawn: CleanRecord) -> Row:
    plant = drawn.plant
    rests = {f"{n}_start": float(v) for n, v in zip(plant.states, plant.rest(), strict=True)}
    sizes = {f"{n}_start": max(abs(drawn.truth[f"{n}_start"]), 1e-6) for n in plant.states}
    error, _ = least_squares_fit(
        lambda values: drawn.simulated(values, COARSE),
        drawn.outputs,
        dict(plant.nominal) | rests,
        used=drawn.regular,
        sizes=sizes,
    )
    return {"least": error}


def _said(row: Row) -> str:
    said = row["verdict"] if right(row) else f"{row['verdict'].upper()}: {_shortened(row['why'])}"
    ratio = f"; refit/best {_ratio(row):.3f}" if "least" in row and "refit" in row else ""
    return f"{said}{ratio} ({row['seconds']:.1f} s)"


def _ratio(row: Row) -> float:
    return float(row["refit"] / min(row["untouched"], row["least"]))


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of the verdicts."""
    judged = [row for row in rows if row["verdict"] != "refused"]
    false = [row for row in judged if row["causes"]]
    left = [row for row in judged if row["verdict"] == "unexplained" and not row["causes"]]
    parts: list[str | Table] = [
        f"{len(rows)} clean records: {len(rows) - len(judged)} refused; of {len(judged)}, "
        f"{share(len(false), len(judged))} with a false cause (1 % are allowed), "
        f"{share(len(left), len(judged))} falsely `unexplained` (3 %)."
    ]
    kinds = ("right", "false cause", "unexplained", "refused", "other")
    for axis in ("noise", "stimulus", "plant", "timing", "smooth"):
        parts.append(counted(rows, axis, kinds, _kind))
    parts += [_coverage(judged), *_fits(judged), _times(rows), *_why(rows)]
    return Topic("Clean records", parts)


def _kind(row: Row) -> str:
    if row.get("causes"):
        return "false cause"
    return (
        "right"
        if right(row)
        else row["verdict"]
        if row["verdict"] in ("unexplained", "refused")
        else "other"
    )


def _coverage(rows: Sequence[Row]) -> Table:
    """Return the share of parameters whose 95 % interval holds the truth.

    Physical parameters only, where no false cause was named.

    Apart: inputs that are held in steps, those held whose course is smooth (nothing may tell that
    they are), and those that are smooth.
    """
    kinds: dict[str, Callable[[Row], bool]] = {
        "steps": lambda row: row["stimulus"] not in SMOOTH,
        "held": lambda row: row["stimulus"] in SMOOTH and not row["smooth"],
        "smooth": lambda row: bool(row["smooth"]),
    }
    table = []
    for name, these in grouped(rows, "noise").items():
        cells: list[str | int] = [str(name)]
        for belongs in kinds.values():
            hits = [
                hit
                for row in these
                if belongs(row) and not row["causes"]
                for hit in row["inside"].values()
            ]
            cells += [len(hits), f"{100.0 * np.mean(hits):.1f} %" if hits else ""]
        table.append(cells)
    return Table(
        ["noise", *(head for kind in kinds for head in (f"intervals, {kind}", "cover"))], table
    )


def _fits(rows: Sequence[Row]) -> list[str | Table]:
    """Return how fitted errors compare with the best of the others."""
    compared = [row for row in rows if "least" in row and "refit" in row]
    if not compared:
        return []
    enough = [row for row in compared if row["per_parameter"] >= EFFECTIVE]
    bad = sorted((row for row in enough if _ratio(row) > WORSE), key=lambda row: -_ratio(row))
    text = (
        "Refitted error over the best of untouched and plain least squares from five starts, over"
        f" the whole record: {len(enough)} of {len(compared)} records have {EFFECTIVE:g} effective"
        f" samples a parameter; {share(len(bad), len(enough))} of them are beyond {WORSE:g}."
    )
    worst = [
        [title(row, Case), _ratio(row), row["refit"], row["least"], row["untouched"], row["true"]]
        for row in bad[:12]
    ]
    columns = ["record", "ratio", "refitted", "least squares", "untouched", "true"]
    return [text, *([Table(columns, worst)] if worst else [])]


def _times(rows: Sequence[Row]) -> str:
    seconds = np.array([row["seconds"] for row in rows])
    worst = max(rows, key=lambda row: row["seconds"])
    return (
        f"Processor time of a diagnosis: median {np.median(seconds):.1f} s, 90 %"
        f" {np.quantile(seconds, 0.9):.1f} s, worst {seconds.max():.1f} s ({title(worst, Case)})."
    )


def _why(rows: Sequence[Row]) -> list[str | Table]:
    """Return what was reported, by kind and noise, and in each record."""
    kinds: dict[str, Counter[str]] = defaultdict(Counter)
    wrong = [row for row in rows if not right(row)]
    for row in wrong:
        for kind in {
            re.sub(r"^(region|correlation).*?(earlier|later|at once)?$", r"\1 \2", r).strip()
            for r in row["why"]
        }:
            kinds[kind][row["noise"]] += 1
    table = [[kind, *(count[noise] for noise in KINDS)] for kind, count in sorted(kinds.items())]
    each = [[title(row, Case), row["verdict"], _shortened(row["why"])] for row in wrong]
    return [
        "What was found where nothing is, in so many records:",
        Table(["found", *KINDS], table),
        Table(["record", "verdict", "found"], each),
    ]


def _shortened(why: Sequence[str], most: int = 6) -> str:
    return "; ".join(why[:most]) + (f"; {len(why) - most} more" if len(why) > most else "")


def _judge(every: int, effects: Sequence[str] | None, case: Case) -> Row:
    """Judge a record; every so-manieth is held against least squares."""
    number = case.seed % 100_000 + 1
    return judge(case, every > 0 and number % every == 0, effects)


def part(
    wanted: Sequence[Case],
    every: int = 0,
    effects: Sequence[str] | None = None,
    name: str = "",
) -> Part:
    """Return records in which nothing is hidden as a part of a study.

    Parameters
    ----------
    wanted : sequence of Case
    every : int
        Every so-manieth is held against least squares; 0 for none.
    effects : sequence of str, optional
        That are considered; those of the models unless given.
    name : str
        Of the part.
    """
    return Part(wanted, partial(_judge, every, effects), _said, report, name)


def _parts(chosen: Chosen) -> Iterator[Part]:
    effects = ["families"] if chosen.effects else None
    yield part(among(cases(chosen.records, chosen.seed), chosen), chosen.every, effects)


STUDY = Study(
    name="clean",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (320, "records"),
        "--every": (4, "hold every so-manieth against least squares; 0 for none"),
    },
    switches={"--effects": "consider families instead of what the models list"},
    page="clean-records.md",
    head="""# What is said of records in which nothing is hidden

Drawn by `python -m studies.judging.clean {options}`; `make clean-study` draws others.
The generators share no code with the models, and whatever is named is false
([decision 20](decisions/archive.md#20-a-yardstick-that-is-not-the-codes-own)).

""",
)


if __name__ == "__main__":
    STUDY.main()
