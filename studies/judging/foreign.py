"""Study of FMUs without equations: a diagnosis from outside, with one hidden effect or none.

`python -m studies.judging.foreign --records 24 --clean 24 --seed 1` draws records as
`studies.judging.hidden` and `studies.judging.clean` do, builds the native FMU of the model under
test, and gives it away without its class, so that it is anybody's FMU.
All parameters that are not known are fitted from outside, starting states among them where a record
does not begin at rest. From outside, an effect inside an FMU appears as a correction only. Counted
are whether reporting one is right, and what it gains on data that no fit has seen.
"""

from __future__ import annotations

import tempfile
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

import orchestration as ppy
from benchmarks.tables import Table, Topic
from fmus.kit import UserError
from orchestration.fmu import Model, find_model
from studies.clean import Case, CleanRecord, draw
from studies.clean import cases as clean_cases
from studies.hidden import USUAL, HiddenCase, draw_hidden, left
from studies.hidden import cases as hidden_cases
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import (
    LEAST,
    Chosen,
    Part,
    Row,
    Study,
    among,
    grouped,
    settings_of,
    share,
)

NONE = "nothing"
_HALF = 0.5


def judge_clean(case: Case) -> Row:
    """Diagnose a record in which nothing is hidden."""
    return asdict(case) | {"family": NONE} | _judged(draw(case))


def judge_hidden(case: HiddenCase) -> Row:
    """Diagnose a record with an effect that leaves enough after a refit of the base."""
    drawn = draw_hidden(case)
    row = asdict(case) | {"family": case.variation.family, "widths": left(drawn)}
    return row | (_judged(drawn) if row["widths"] >= LEAST else {"verdict": ""})


def _judged(drawn: CleanRecord) -> Row:
    model = replace(find_model(drawn.plant.model), cls=None)
    starts = [] if drawn.case.at_rest else [f"{state}_start" for state in drawn.plant.states]
    fit = [
        n
        for n in (*drawn.plant.nominal, *starts)
        if n not in drawn.plant.known and n in model.parameters
    ]
    began = clock.process_time()
    with tempfile.TemporaryDirectory() as folder:
        path = drawn.write(Path(folder) / "record.csv")
        try:
            found = ppy.diagnose(path, model, settings=settings_of(drawn), fit=fit)
        except UserError as error:
            return {"verdict": "refused", "why": str(error), "causes": []}
        naive = _naive(path, model, fit, settings_of(drawn))
    outputs = found.gain.before
    return {
        "verdict": str(found.verdict),
        "causes": found.causes,
        "seconds": clock.process_time() - began,
        "naive": naive,
        "left": float(
            np.mean([found.gain.after[o] / outputs[o] for o in outputs if outputs[o] > 0.0])
        ),
    }


def _naive(path: Path, model: Model, fit: Sequence[str], settings: Mapping[str, float]) -> float:
    """Return the error that an affine function of inputs and simulated outputs leaves.

    In the unit of `left`; the outputs are those of the fitted FMU.

    The parameters are fitted to the whole record, the function to its first two thirds, and judged
    on the rest.
    """
    record = ppy.read_record(path, model)
    values = ppy.fit(record, model, fit, settings=settings).values if fit else {}
    fed = {name: record.signals[name] for name in model.inputs if name in record.signals}
    held = {n: v for n, v in settings.items() if n not in fed} | values
    made = ppy.simulate(model, fed, time=record.time, settings=held)
    simulated = {name: np.asarray(made[name]) for name in model.outputs if name in record.signals}
    rows = np.column_stack([np.ones(len(record.time)), *fed.values(), *simulated.values()])
    early = np.arange(len(rows)) < 2 * len(rows) // 3
    left = []
    for name, y in simulated.items():
        error = record.signals[name] - y
        there = np.isfinite(record.signals[name])
        weights = np.linalg.lstsq(rows[early & there], error[early & there])[0]
        after, before = (e[~early & there] for e in (error - rows @ weights, error))
        left.append(float(np.sqrt(np.mean(after**2) / np.mean(before**2))))
    return float(np.mean(left))


def _said(row: Row) -> str:
    if not row["verdict"]:
        return f"not counted: {row['widths']:.1f} noise widths"
    named_causes = ", ".join(row["causes"]) or row.get("why", "nothing named")
    return f"{row['verdict']}, {named_causes}" + (
        f", error to {100 * row['left']:.0f} %" if "left" in row else ""
    )


def report_clean(rows: Sequence[Row]) -> Topic:
    """Return how often a cause is named where nothing is hidden."""
    answered = [row for row in rows if row["verdict"] != "refused"]
    false = sum(bool(row["causes"]) for row in answered)
    told = (
        f"Nothing hidden: a cause is named in {share(false, len(answered))} of {len(answered)};"
        f" {len(rows) - len(answered)} refused."
    )
    return Topic("FMUs that are right", [told, _by_family(answered), *_time(rows), *_refused(rows)])


def report_hidden(rows: Sequence[Row]) -> Topic:
    """Return what was reported where something is hidden, and what it gained."""
    counted = [row for row in rows if row["verdict"]]
    inside = [row for row in counted if "left" in row]
    told = (
        f"Something hidden, at least {LEAST:g} noise widths of it left after a refit of the"
        f" base: {len(counted)} of {len(rows)}, {len(counted) - len(inside)} of these"
        " refused. A cause is named in"
        f" {share(sum(bool(r['causes']) for r in inside), len(inside))}; the error on data that"
        " no fit has seen is at least halved in"
        f" {share(sum(r['left'] < _HALF for r in inside), len(inside))}. An affine function of"
        " all inputs and simulated outputs, which is what one would try first, halves it in"
        f" {share(sum(r['naive'] < _HALF for r in inside), len(inside))}."
    )
    parts = [told, _by_family(counted), *_time(inside), *_refused(counted)]
    return Topic("FMUs in which something is hidden", parts)


def _by_family(rows: Sequence[Row]) -> Table:
    table = []
    for family, these in grouped(rows, "family").items():
        lefts = [row["left"] for row in these if "left" in row]
        table.append(
            [
                family,
                len(these),
                sum(bool(row["causes"]) for row in these),
                sum(x < _HALF for x in lefts),
                float(np.median(lefts)) if lefts else float("nan"),
                ", ".join(sorted({cause for row in these for cause in row["causes"]})),
            ]
        )
    columns = ["hidden", "records", "with a cause", "halved", "error left, median", "named"]
    return Table(columns, table)


def _time(rows: Sequence[Row]) -> list[str]:
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    if not seconds:
        return []
    return [f"Processor time of a diagnosis: median {np.median(seconds):.0f} s."]


def _refused(rows: Sequence[Row]) -> list[Table]:
    refused = [[_name(row), row["why"]] for row in rows if row["verdict"] == "refused"]
    return [Table(["refused", "why"], refused)] if refused else []


def _name(row: Row) -> str:
    return f"{row['plant']}, {row['family']}, {row['stimulus']}, {row['noise']}"


def _parts(chosen: Chosen) -> Iterator[Part]:
    bare = among(clean_cases(chosen.clean, chosen.seed), chosen)
    yield Part(bare, judge_clean, _said, report_clean, "clean")
    wanted = among(hidden_cases(chosen.records, chosen.seed, USUAL), chosen)
    yield Part(wanted, judge_hidden, _said, report_hidden)


STUDY = Study(
    name="foreign",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (24, "records with one hidden effect"),
        "--clean": (24, "records in which nothing is hidden"),
    },
    page="foreign-fmus.md",
    head="""# What is said of FMUs without equations

Drawn by `python -m studies.judging.foreign {options}`, a seed that was not looked at before.
The generators share no code with what they judge; the FMUs are native ones, given away without
what tells of their classes. A third of every record is held out. What an effect inside an FMU is
called cannot be known from outside: what is named is a correction of an input, of an output or by a
sensor, with its gain.

{stamp}

""",
    code=(
        *DIAGNOSIS,
        "orchestration/diagnosis/foreign",
        "studies/hidden",
        "studies/clean",
        "studies/judging/foreign.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
