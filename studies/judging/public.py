"""Study of public records with an engineer's first model, beside plain least squares.

`python -m studies.judging.public` reads the records where `PPY_PUBLIC_DATA` says, else in
`../shared/data`, and the starting models in its folder `models`; what is absent is left out, and
said. Errors are over the spread of what was measured. The judge runs the given model and knows
nothing else of the project.
"""

from __future__ import annotations

import argparse
import os
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tables import Cell, Table, Topic
from fmus.kit import UserError
from studies.clean import least_squares_fit

DATA = Path(
    os.environ.get("PPY_PUBLIC_DATA", Path(__file__).resolve().parents[3] / "shared" / "data")
)
WORSE = 1.02  # of the best of the others, what a refit may leave
GAINS = 1.0, 2.0, 3.0, 4.0, 5.0  # rad/s/V, from which the motor's fit starts
COLUMNS = [
    "record",
    "untouched",
    "least squares",
    "refitted",
    "refitted/best",
    "verdict",
    "causes",
    "s",
]


@dataclass(frozen=True)
class Question:
    """A record, its model, and what is known of both.

    Attributes
    ----------
    title : str
    record : Path
    model : str
        In the folder of starting models, or a component.
    settings : Mapping of str to float
    mapping : Mapping of str to str
    holdout : Path or None
        Judged instead of the record, where there is one.
    """

    title: str
    record: Path
    model: str
    settings: Mapping[str, float] = field(default_factory=dict)
    mapping: Mapping[str, str] = field(default_factory=dict)
    holdout: Path | None = None

    @property
    def subject(self) -> str:
        """The model, as a diagnosis takes it."""
        return str(DATA / "models" / self.model) if ".py:" in self.model else self.model

    @property
    def known(self) -> dict[str, Any]:
        """Settings and mapping of columns for the diagnosis."""
        return {"settings": dict(self.settings), "mapping": dict(self.mapping)}

    def absent(self) -> str:
        """Return which files are missing, or nothing."""
        needed = [self.record, *([self.holdout] if self.holdout else [])]
        needed += [Path(self.subject.rpartition(":")[0])] if ".py:" in self.model else []
        return ", ".join(path.name for path in needed if not path.exists())


def questions(folder: Path) -> list[Question]:
    """Return all questions; pulses of the cell are cut into files of their own in a folder."""
    maxwell = [DATA / f"supercapacitor_maxwell_{current}.csv" for current in ("3A", "2p2A")]
    ageing = [DATA / f"supercapacitor_{age}_ageing_5mV_per_s.csv" for age in ("before", "after")]
    motor = DATA / "dc_motor_dead_zone.csv"
    speed = {"speed": "speed[rpm]"}
    return [
        *(
            Question(f"cell, pulse {k}", path, "lfp_cell.py:Cell")
            for k, path in enumerate(pulses(folder))
        ),
        Question("supercapacitor at 3 A", maxwell[0], "supercapacitor.py:Supercap"),
        Question(
            "fitted at 3 A, judged at 2.2 A",
            maxwell[0],
            "supercapacitor.py:Supercap",
            holdout=maxwell[1],
        ),
        *(
            Question(f"motor, gain from {g}", motor, "dc_motor.py:Motor", {"gain": float(g)}, speed)
            for g in range(1, 6)
        ),
        *(
            Question(f"supercapacitor {path.stem.split('_')[1]} ageing", path, "ppy_actuator")
            for path in ageing
        ),
    ]


def pulses(folder: Path) -> list[Path]:
    """Return the cell's runs, each a file, if they are there."""
    source = DATA / "lfp_cell_ten_pulses.csv"
    if not source.exists():
        return [folder / source.name]
    head, *rows = source.read_text(encoding="utf-8").splitlines()
    found: dict[str, list[str]] = {}
    for row in rows:
        number, _, rest = row.partition(",")
        found.setdefault(number, []).append(rest)
    paths = []
    for number, lines in found.items():
        paths.append(folder / f"pulse_{number}.csv")
        paths[-1].write_text("\n".join([head.partition(",")[2], *lines]) + "\n", encoding="utf-8")
    return paths


def errors(question: Question) -> dict[str, float]:
    """Return untouched, least-squares and refitted errors of one record, of the model as it is.

    Without held-out data, of the beginning of the record, to which it is fitted.
    """
    import orchestration as ppy

    bare = ppy.diagnose(question.record, question.subject, effects=[], laws=False, **question.known)
    problem = bare.details.subject.problem
    fitted = problem.records[0]
    pairs = zip(problem.model.inputs, fitted.smooth, strict=True)
    linear = {v.name for v, is_smooth in pairs if is_smooth}
    trial = _Trial(question, bare.details.model.cls, linear, float(np.ptp(fitted.time)))
    nominal = {n: e.nominal for n, e in bare.parameters.items()}
    refitted = {n: e.value for n, e in bare.parameters.items()}
    tried = {
        "untouched": nominal,
        "least squares": trial.least_squares(nominal, refitted),
        "refitted": refitted,
    }
    return {name: trial.error(values) for name, values in tried.items()}


def answer(question: Question) -> dict[str, Any]:
    """Return errors of one record, and the verdict with the whole catalogue."""
    import orchestration as ppy

    row: dict[str, Any] = {"record": question.title} | errors(question)
    began = clock.process_time()
    full = ppy.diagnose(question.record, question.subject, laws=False, **question.known)
    return row | {
        "verdict": str(full.verdict),
        "causes": full.causes,
        "seconds": clock.process_time() - began,
    }


class _Trial:
    """Simulations of a model over its record, up to a time, s, and over held-out data.

    Inputs are interpolated as the diagnosis does it.
    """

    def __init__(self, question: Question, cls: Any, linear: Any, until: float):
        import orchestration as ppy
        from fmus.kit.record import CompiledModel

        self._model = CompiledModel(cls)
        self._settings = dict(question.settings)
        self._linear = linear
        layout = cls.layout
        self._inputs = [v.name for v in layout.inputs]
        outputs = [v.name for v in layout.outputs]
        self._starts = {p.name: p for p in layout.parameters if p.starts}
        paths = [question.record, *([question.holdout] if question.holdout else [])]
        records = [
            ppy.read_record(path, question.subject, dict(question.mapping)) for path in paths
        ]
        ends = until, *(np.inf for _ in paths[1:])
        counts = [
            int(np.searchsorted(r.time - r.time[0], end * (1.0 + 1e-9), "right"))
            for r, end in zip(records, ends, strict=True)
        ]
        self._times = [r.time[:n] for r, n in zip(records, counts, strict=True)]
        self._signals = [
            {name: values[:n] for name, values in r.signals.items()}
            for r, n in zip(records, counts, strict=True)
        ]
        self._measured = [{o: s[o] for o in outputs if o in s} for s in self._signals]

    def simulated(self, values: Mapping[str, float], which: int = 0) -> dict[str, Any]:
        signals = self._signals[which]
        inputs = {n: signals[n] for n in self._inputs if n in signals}
        own = {n: v for n, v in (self._settings | dict(values)).items() if n not in inputs}
        try:
            return self._model.run(self._times[which], inputs, own, self._linear).signals
        except UserError:
            return {o: np.full(self._times[which].size, np.nan) for o in self._measured[which]}

    def least_squares(
        self, nominal: Mapping[str, float], refitted: Mapping[str, float]
    ) -> dict[str, float]:
        """Fit the record by least squares from nominal parameters.

        States start where the diagnosis has them start, which is near what the model declares.
        """
        starts = {n: v for n, v in refitted.items() if n in self._starts}
        free = {n: v for n, v in nominal.items() if n not in starts}
        _, values = least_squares_fit(
            lambda tried: self.simulated(starts | tried),
            self._measured[0],
            free,
            sizes={n: max(abs(v), 1.0) for n, v in free.items() if v <= 0.0},
        )
        return starts | values

    def error(self, values: Mapping[str, float]) -> float:
        """Return the pooled error over the spread of the record, or of held-out data.

        States start as fits it best.
        """
        which = len(self._measured) - 1
        at = dict(values)
        if which:
            free = {n: values[n] for n in self._starts if n in values}
            sizes = {n: max(abs(v), 1.0) for n, v in free.items()}
            _, best = least_squares_fit(
                lambda v: self.simulated(at | v, which),
                self._measured[which],
                free,
                sizes=sizes,
                starts=1,
            )
            at |= best
        simulated = self.simulated(at, which)
        parts = []
        for o, y in self._measured[which].items():
            ok = np.isfinite(y)
            parts.append(np.mean((y[ok] - simulated[o][ok]) ** 2) / np.var(y[ok]))
        return float(np.sqrt(np.mean(parts)))


def report(chosen_questions: Sequence[Question], progress: Callable[[str], None] = print) -> Topic:
    """Answer all questions that can be."""
    rows: list[list[Cell]] = []
    missing = []
    for question in chosen_questions:
        if question.absent():
            missing.append(f"{question.title}: {question.absent()} is not in {DATA}")
            continue
        try:
            row = answer(question)
        except UserError as error:
            missing.append(f"{question.title}: {error}")
            continue
        best = min(row["untouched"], row["least squares"])
        shown: list[Cell] = [
            row[name] for name in ("record", "untouched", "least squares", "refitted")
        ]
        rows.append(
            [
                *shown,
                row["refitted"] / best,
                row["verdict"],
                ", ".join(row["causes"]),
                row["seconds"],
            ]
        )
        progress(
            " | ".join(f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in rows[-1])
        )
    return Topic(
        "Public records",
        [Table(COLUMNS, rows), *(["Left out: " + "; ".join(missing)] if missing else [])],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    import tempfile

    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.public", description=__doc__.split("\n\n")[0]
    )
    parser.add_argument("--only", nargs="*", default=[], help="words that a title must contain")
    chosen = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        chosen_questions = [
            q for q in questions(Path(folder)) if all(word in q.title for word in chosen.only)
        ]
        print("\n" + str(report(chosen_questions, lambda line: print(line, flush=True))))


if __name__ == "__main__":
    main()
