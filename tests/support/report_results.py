"""Diagnoses for every kind of page that a report may become."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmus.kit import Effect
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import DiagnosisOptions, Result, diagnose
from orchestration.discrepancy.residuals.lines import SpectralLine
from orchestration.discrepancy.residuals.outliers import LevelShift
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import read_for
from orchestration.records import Record
from tests.support.diagnosis import FEW as EFFECTS_OF_A_STRAIN
from tests.support.diagnosis import broken_off

NASTY = os.fsdecode(b"r\xff <script>alert(1)&.csv")
COMMAND = f"ppy diagnose '{NASTY}'"
FEW = [effect for effect in EFFECTS_OF_A_STRAIN if effect.id != "strain_lag"]
PAGES = (
    "cause",
    "ambiguous",
    "recalibrate",
    "consistent",
    "unexplained",
    "idle",
    "voltage",
    "holdout",
    "uneven",
)


def with_verdict(result: Result, verdict: Verdict, **changes) -> Result:
    """Return a result with another verdict, and with what else is different in the diagnosis."""
    return replace(result, diagnosis=replace(result.diagnosis, verdict=verdict, **changes))


def diagnosed_results(folder: Path) -> dict[str, Result]:
    """Return a result for each of `PAGES`; its records are written to a folder."""
    model = find_model("ppy_actuator")

    def read(name: str, seed: int = 1, outputs=("voltage", "displacement")) -> Record:
        columns = {n: n for n in ("current", "force", *outputs)}
        return read_for(model, broken_off(folder / name, seed, columns))

    def diagnosed(record: Record, effects: list[type[Effect]], holdout=None) -> Result:
        return diagnose(
            record, model, holdout, DiagnosisOptions(effects=[effect.id for effect in effects])
        )

    record = read(NASTY)
    cause = diagnosed(record, FEW)
    still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
    noise = np.random.default_rng(1).standard_normal((2, record.time.size))
    at_rest = dict(zip(("voltage", "displacement"), 1e-5 * noise, strict=True))
    uneven = np.unique(np.geomspace(1, record.time.size, 900).astype(int) - 1)
    sampled = replace(
        record, time=record.time[uneven], signals={n: v[uneven] for n, v in record.signals.items()}
    )
    return {
        "cause": cause,
        **_variants(cause),
        "idle": diagnosed(replace(record, signals=record.signals | still | at_rest), FEW),
        "voltage": diagnosed(read("voltage.csv", outputs=("voltage",)), FEW[-1:]),
        "holdout": diagnosed(record, [], read(f"{'a_long_name_' * 15}.csv", 2)),
        "uneven": diagnosed(sampled, []),
    }


def _variants(cause: Result) -> dict[str, Result]:
    """Return results with other verdicts, made of one that names a cause."""
    diagnosis = cause.diagnosis
    selection = diagnosis.selection
    step = selection.steps[0]
    bare = replace(selection, steps=[])
    plain = {
        "selection": bare,
        "estimates": {n: diagnosis.estimates[n] for n in bare.base.problem.names},
    }
    (alternative, _), *others = step.rejected
    untold = replace(selection, steps=[replace(step, alternatives=[alternative], rejected=others)])
    lines = [SpectralLine(0.83, 4e-3, 1e-12)]
    shifts = [LevelShift(100.0 + k, 1e-4, 1e-12) for k in range(7)]
    residuals = {
        "voltage": replace(diagnosis.residuals["voltage"], lines=lines),
        "displacement": replace(diagnosis.residuals["displacement"], level_shifts=shifts),
    }
    unexplained = with_verdict(cause, Verdict.UNEXPLAINED, **plain, residuals=residuals)
    return {
        "ambiguous": with_verdict(cause, Verdict.AMBIGUOUS, selection=untold),
        "recalibrate": with_verdict(cause, Verdict.RECALIBRATE, **plain),
        "consistent": with_verdict(cause, Verdict.CONSISTENT, **plain, changed=[]),
        "unexplained": replace(unexplained, notes=[Note(NoteCode.NO_TRACE, "slack")]),
    }
