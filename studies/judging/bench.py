"""Study of the bench as a system: which member is blamed, for what, and in which time.

`python -m studies.judging.bench --records 10 --seed 1` draws benches at any phase of the controller
with a simulation that shares no code with the components (`studies/benches`), as many without a
fault as with dry friction of the slide, and diagnoses each from its file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.diagnosis.systems import SystemDiagnosis, diagnose_system
from orchestration.system import library
from studies.benches import BenchRecord, draw
from studies.judging.study import Chosen, Part, Row, Study, among, processor_time

CLEAN = "clean"
FRICTION = "dry friction"
KINDS = (CLEAN, FRICTION)
_FORCES = {CLEAN: (0.0, 0.0), FRICTION: (0.1, 0.5)}  # N
# Dry friction is one law over one signal: Stribeck's curve that falls off beyond all velocities of
# a record is Coulomb's, with as many parameters. Said before the study was drawn.
_NAMES = ("coulomb_friction", "stribeck_friction")


@dataclass(frozen=True)
class BenchCase:
    """A record of a bench.

    Attributes
    ----------
    kind : str
    seed : int
    """

    kind: str
    seed: int

    def draw(self) -> BenchRecord:
        """Draw the record."""
        return draw(self.seed, _FORCES[self.kind])


def cases(records: int, seed: int) -> list[BenchCase]:
    """Return as many cases of every kind."""
    return [
        BenchCase(kind, 1000 * seed + 100 * number + k)
        for k in range(records)
        for number, kind in enumerate(KINDS)
    ]


def judge(case: BenchCase) -> Row:
    """Draw a record, diagnose it from its file, and tell what was said and what is true."""
    record = case.draw()
    with tempfile.TemporaryDirectory() as folder:
        path = record.write(Path(folder) / "record.csv")
        begun = processor_time()
        diagnosis = diagnose_system(path, library.system("dma_bench"))
        seconds = processor_time() - begun
    return (
        asdict(case)
        | {
            "seconds": seconds,
            "friction": record.bench.dry_friction,
            "phase": record.bench.phase,
            "changed": sorted(record.changed),
        }
        | _said(diagnosis, record)
    )


def _said(diagnosis: SystemDiagnosis, record: BenchRecord) -> Row:
    """Return what was said, and whether intervals hold what is true."""
    truth = record.bench.values | {"coulomb_force": record.bench.dry_friction}
    causes = [pair for member in diagnosis.members for pair in member.causes]
    causes.sort(key=lambda pair: -pair[1].probability)
    parameters = [pair for member in diagnosis.members for pair in member.parameters.items()]
    inside = {}
    for name, parameter in parameters:
        if name in truth and np.isfinite(parameter.estimate.interval).all():
            low, high = parameter.estimate.interval
            inside[name] = bool(low <= truth[name] <= high)
    return {
        "verdict": str(diagnosis.verdict),
        "verdicts": {member.name: str(member.verdict) for member in diagnosis.members},
        "causes": [name for name, _ in causes],
        "probabilities": [float(cause.probability) for _, cause in causes],
        "named": sorted(name for name, parameter in parameters if parameter.differs),
        "inside": inside,
    }


def is_right(row: Row) -> bool:
    """Return whether an answer is right.

    Of a clean bench that is `consistent` or `recalibrate`, where every parameter that is said to
    differ does so and its interval holds it; with dry friction, that it is named first, as
    Coulomb's or Stribeck's.
    """
    if row["kind"] == FRICTION:
        return bool(row["causes"]) and row["causes"][0] in _NAMES
    covered = all(row["inside"].get(name, False) for name in row["named"])
    is_fine = row["verdict"] in ("consistent", "recalibrate")
    return is_fine and covered and set(row["named"]) <= set(row["changed"])


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of what was said."""
    summary = []
    for kind in KINDS:
        of = [row for row in rows if row["kind"] == kind]
        if of:
            intervals = [held for row in of for held in row["inside"].values()]
            seconds = sorted(row["seconds"] for row in of)
            summary.append(
                [
                    kind,
                    f"{sum(map(is_right, of))} of {len(of)}",
                    f"{sum(intervals)} of {len(intervals)}",
                    f"{seconds[len(seconds) // 2]:.0f}",
                    f"{seconds[-1]:.0f}",
                ]
            )
    every = [
        [
            row["kind"],
            f"{1e3 * row['phase']:.1f}",
            f"{row['friction']:.2f}" if row["friction"] else "",
            ", ".join(row["changed"]),
            row["verdict"],
            ", ".join(row["causes"] or row["named"]),
            f"{row['seconds']:.0f}",
        ]
        for row in rows
    ]
    head = ["bench", "phase, ms", "friction, N", "not nominal", "verdict", "named", "s"]
    return Topic(
        "Benches",
        [
            "Right is `consistent` or `recalibrate` with the true values inside where nothing is"
            " hidden, and dry friction named first where it is, by Coulomb's law or by Stribeck's"
            " curve, which is that law where it falls off beyond all velocities of a record."
            " Seconds are of the processor.",
            Table(["bench", "right", "true values inside", "s, median", "s, most"], summary),
            Table(head, every),
        ],
    )


def _described(row: Row) -> str:
    return f"{row['verdict']} {row['causes'] or row['named']} in {row['seconds']:.0f} s"


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield Part(among(cases(chosen.records, chosen.seed), chosen), judge, _described, report)


STUDY = Study(
    name="bench",
    about=__doc__,
    parts=_parts,
    numbers={"--records": (10, "records of every kind")},
    page="bench-records.md",
    head="""# What is said of benches with an actuator

Drawn by `python -m studies.judging.bench {options}`; `make bench-study` draws it anew.
Records of 10 to 25 s at 100 Hz of a voice coil that holds an actuator, by a simulation that shares
no code with the models under test. The 30 Hz controller begins at any phase of the record's clock;
every second bench has parameters that are not nominal, in every second the noise of the load cell
goes through the controller, and the clock of every fourth jitters by 0.3 ms. Dry friction changes
its sign within 0.7 to 2 mm/s, as that of a greased slide; one that sticks dry is in no law of the
catalogue, and not among these. Each is diagnosed by `ppy diagnose RECORD --system dma_bench`.

{stamp}

""",
    code=(
        "orchestration/diagnosis",
        "fmus/voice_coil_dma",
        "fmus/ppy_actuator",
        "studies/benches",
    ),
)


if __name__ == "__main__":
    STUDY.main()
