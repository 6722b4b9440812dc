"""Study of systems: which member is blamed, for what, and in which time.

`python -m studies.judging.bench --records 10 --stands 1 --seed 1` draws benches at any phase of the
controller with a simulation that shares no code with the components (`studies/benches`), as many
without a fault as with dry friction of the slide, and stands with weights, clean and with each of
six effects, and diagnoses each from its file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.tables import Table, Topic
from orchestration.diagnosis.systems import SystemDiagnosis, SystemOptions, diagnose_system
from orchestration.system import library
from studies.benches import KNOWN, STAND_EFFECTS, Bench, SystemRecord, draw_bench, draw_stand
from studies.judging.study import Chosen, Part, Row, Study, among, processor_time

CLEAN = "clean"
FRICTION = "dry friction"
KINDS = (CLEAN, FRICTION)
CLEAN_STAND = "clean stand"
STANDS = (CLEAN_STAND, *STAND_EFFECTS)
_FORCES = {CLEAN: (0.0, 0.0), FRICTION: (0.1, 0.5)}  # N
# Dry friction is one law over one signal: Stribeck's curve that falls off beyond all velocities of
# a record is Coulomb's, with as many parameters. Said before the study was drawn. So is an LVDT
# that leans one whose gain is wrong.
_NAMES = {
    FRICTION: ("coulomb_friction", "stribeck_friction"),
    "misalignment": ("misalignment", "sensor_gain(displacement_measured)"),
}


@dataclass(frozen=True)
class BenchCase:
    """A record of a bench or a stand.

    Attributes
    ----------
    kind : str
    seed : int
    """

    kind: str
    seed: int

    def draw(self) -> SystemRecord:
        """Draw the record."""
        if self.kind in _FORCES:
            return draw_bench(self.seed, _FORCES[self.kind])
        return draw_stand(self.seed, "" if self.kind == CLEAN_STAND else self.kind)


def cases(records: int, seed: int, kinds: Sequence[str] = KINDS) -> list[BenchCase]:
    """Return as many cases of every kind."""
    return [
        BenchCase(kind, 1000 * seed + 100 * number + k)
        for k in range(records)
        for number, kind in enumerate(kinds)
    ]


def judge(case: BenchCase) -> Row:
    """Draw a record, diagnose it from its file, and tell what was said and what is true."""
    record = case.draw()
    is_bench = isinstance(record.plant, Bench)
    system = library.system("dma_bench" if is_bench else "isotonic_stand")
    hold = () if is_bench else [f"actuator.{name}" for name in KNOWN]
    with tempfile.TemporaryDirectory() as folder:
        path = record.write(Path(folder) / "record.csv")
        begun = processor_time()
        diagnosis = diagnose_system(path, system, SystemOptions(hold=hold))
        seconds = processor_time() - begun
    plant = record.plant
    return (
        asdict(case)
        | {"seconds": seconds, "changed": sorted(record.changed), "true": plant.true}
        | _said(diagnosis, plant.true, plant.period)
    )


def _said(diagnosis: SystemDiagnosis, true: Mapping[str, float], period: float) -> Row:
    """Return what was said, and whether intervals hold what is true."""
    causes = [pair for member in diagnosis.members for pair in member.causes]
    causes.sort(key=lambda pair: -pair[1].probability)
    parameters = [pair for member in diagnosis.members for pair in member.parameters.items()]
    inside = {}
    for name, parameter in parameters:
        low, high = parameter.estimate.interval
        if name in true and np.isfinite(high - low):
            beyond = true[name] - low
            # a clock that is later by a period ticks at the same instants
            beyond = beyond % period if name == "sample_shift" else beyond
            inside[name] = bool(0.0 <= beyond <= high - low)
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

    Where nothing is hidden that is `consistent` or `recalibrate`, where every parameter that is
    said to differ does so and its interval holds it; else, that what is hidden is named first.
    """
    kind = row["kind"]
    if kind not in (CLEAN, CLEAN_STAND):
        return row["causes"][:1] in [[name] for name in _NAMES.get(kind, (kind,))]
    covered = all(row["inside"].get(name, False) for name in row["named"])
    is_fine = row["verdict"] in ("consistent", "recalibrate")
    return is_fine and covered and set(row["named"]) <= set(row["changed"])


def report(rows: Sequence[Row]) -> Topic:
    """Return tables of what was said."""
    summary = []
    for kind in (*KINDS, *STANDS):
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
            f"{1e3 * row['true']['sample_shift']:.1f}",
            f"{row['true'].get('coulomb_force', 0.0):.2f}",
            ", ".join(row["changed"]),
            row["verdict"],
            ", ".join(row["causes"] or row["named"]),
            ", ".join(name for name, holds in row["inside"].items() if not holds),
            f"{row['seconds']:.0f}",
        ]
        for row in rows
    ]
    head = [
        "record",
        "phase, ms",
        "dry friction, N",
        "not nominal",
        "verdict",
        "named",
        "intervals that miss",
        "s",
    ]
    return Topic(
        "Benches" if rows[0]["kind"] in KINDS else "Stands",
        [
            "Right is `consistent` or `recalibrate` with the true values inside where nothing is"
            " hidden, else that what is hidden is named first; of dry friction by Coulomb's law or"
            " by Stribeck's curve, which is that law where it falls off beyond all velocities of a"
            " record, and of an LVDT that leans by that or by its gain, which is the same. Seconds"
            " are of the processor.",
            Table(["record", "right", "true values inside", "s, median", "s, most"], summary),
            Table(head, every),
        ],
    )


def _described(row: Row) -> str:
    return f"{row['verdict']} {row['causes'] or row['named']} in {row['seconds']:.0f} s"


def _parts(chosen: Chosen) -> Iterator[Part]:
    benches = cases(chosen.records, chosen.seed)
    yield Part(among(benches, chosen), judge, _described, report)
    stands = cases(chosen.stands, chosen.seed, STANDS)
    yield Part(among(stands, chosen), judge, _described, report, "stands")


STUDY = Study(
    name="bench",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (10, "records of every kind of bench"),
        "--stands": (1, "records of every kind of stand"),
    },
    page="bench-records.md",
    head="""# What is said of benches with an actuator

Drawn by `python -m studies.judging.bench {options}`; `make bench-study` draws it anew.
Records of 10 to 25 s at 100 Hz of a voice coil that holds an actuator, by a simulation that shares
no code with the models under test. The 30 Hz controller begins at any phase of the record's clock;
every second bench has parameters that are not nominal, in every second the noise of the load cell
goes through the controller, and the clock of every fourth jitters by 0.3 ms. Dry friction changes
its sign within 0.7 to 2 mm/s, as that of a greased slide; one that sticks dry is in no law of the
catalogue, and not among these. Each is diagnosed by `ppy diagnose RECORD --system dma_bench`.

Records of 80 to 160 s at 10 Hz of a stand, as LabVIEW writes them: mass, current, voltage and
displacement. Weights swing or hang still, the core rubs or runs free, LVDT and frame are askew,
elongation is late, or the load adds voltage. They are diagnosed with `--system isotonic_stand
--hold actuator.alpha --hold actuator.k1`, which an analyser measures: without them an LVDT that
leans is an actuator that moves less, and a frame that bends a softer one.

{stamp}

""",
    code=(
        "orchestration/diagnosis",
        "fmus/voice_coil_dma",
        "fmus/ppy_actuator",
        "fmus/isotonic_stand",
        "studies/benches",
    ),
)


if __name__ == "__main__":
    STUDY.main()
