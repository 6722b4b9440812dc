"""Diagnoses for every kind of page that a report may become."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
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


class DiagnosedResults:
    """A result for each of `PAGES`, made when it is first used.

    Parameters
    ----------
    folder : Path
        Where records are written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._model = find_model("ppy_actuator")
        self._makers: dict[str, Callable[[], Result]] = {
            "cause": lambda: self._diagnosed(self._record, FEW),
            "idle": lambda: self._diagnosed(self._at_rest(), FEW),
            "voltage": self._of_voltage_alone,
            "holdout": self._with_holdout,
            "uneven": lambda: self._diagnosed(self._uneven(), []),
        }
        self._results: dict[str, Result] = {}

    def __getitem__(self, name: str) -> Result:
        if name not in self._results:
            made = self._makers.get(name)
            self._results |= {name: made()} if made else _variants(self["cause"])
        return self._results[name]

    @cached_property
    def _record(self) -> Record:
        return self._read(NASTY)

    def _read(
        self, name: str, seed: int = 1, outputs: Sequence[str] = ("voltage", "displacement")
    ) -> Record:
        columns = {n: n for n in ("current", "force", *outputs)}
        return read_for(self._model, broken_off(self._folder / name, seed, columns, 180.0))

    def _diagnosed(
        self, record: Record, effects: list[type[Effect]], holdout: Record | None = None
    ) -> Result:
        options = DiagnosisOptions(effects=[effect.id for effect in effects])
        return diagnose(record, self._model, holdout, options)

    def _at_rest(self) -> Record:
        record = self._record
        still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
        noise = np.random.default_rng(1).standard_normal((2, record.time.size))
        outputs = dict(zip(("voltage", "displacement"), 1e-5 * noise, strict=True))
        return replace(record, signals=record.signals | still | outputs)

    def _of_voltage_alone(self) -> Result:
        return self._diagnosed(self._read("voltage.csv", outputs=("voltage",)), FEW[-1:])

    def _with_holdout(self) -> Result:
        holdout = self._read(f"{'a_long_name_' * 15}.csv", 2)
        return self._diagnosed(self._record, [], holdout)

    def _uneven(self) -> Record:
        record = self._record
        samples = np.unique(np.geomspace(1, record.time.size, 900).astype(int) - 1)
        signals = {name: values[samples] for name, values in record.signals.items()}
        return replace(record, time=record.time[samples], signals=signals)


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
