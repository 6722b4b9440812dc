"""Study of intervals where an effect is named: how often they hold the truth, by kind of noise.

`python -m studies.judging.coverage --records 120 --seed 1` draws plants, stimuli and kinds of noise
as for clean records, and hides a term in a law that has exactly the form of the effect which is
offered. So what intervals miss is not the form. The generators share no code with what they judge.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.tables import Table, Topic
from fmus.kit import Effect
from fmus.kit.corrections import SignalTerm, correction
from orchestration.api import read_record
from orchestration.discrepancy import diagnose
from orchestration.discrepancy.data import joined_dataset
from orchestration.fmu import Model, find_model
from studies.clean import KINDS, Case, CleanRecord, conditions, draw
from studies.hidden_laws import over
from studies.judging.clean import settings_of
from studies.judging.study import Chosen, Part, Row, Study, among, grouped, share
from studies.plants import PLANTS

if TYPE_CHECKING:
    from orchestration.discrepancy import Diagnosis

_STRENGTHS = 0.5, 1.5  # of a hidden term


@dataclass(frozen=True)
class HiddenTerm:
    """A term that a law of a plant lacks: ``amount f(x / at)`` of a signal x.

    Attributes
    ----------
    plant, law, signal : str
    shape : str
        Its form f, as the kit calls it.
    unit : str
        SI unit of the law.
    amount : float
        In that unit.
    at : float
        In the unit of the signal.
    power : int
        Of f in x.
    form : callable
        f itself.
    """

    plant: str
    law: str
    signal: str
    shape: str
    unit: str
    amount: float
    at: float
    power: int
    form: Callable[[float], float]


def _cube(z: float) -> float:
    return z * z * z


TERMS = (
    HiddenTerm("Motor", "friction", "omega", "cubic", "N*m", 0.1, 150.0, 3, _cube),
    HiddenTerm("Pendulum", "friction", "velocity", "cubic", "N*m", 0.4, 0.6, 3, _cube),
    HiddenTerm("Pendulum", "gravity", "angle", "cubic", "N*m", 0.6, 0.3, 3, _cube),
    HiddenTerm("ThermalNodes", "loss", "loss", "cubic", "W", 2.5, 8.0, 3, _cube),
    HiddenTerm("Cell", "drop", "current", "asymmetric", "V", 0.03, 2.0, 1, abs),
)


@dataclass(frozen=True)
class CoverageCase(Case):
    """A record to draw, with the term hidden in it, by its place in `TERMS`, and its strength."""

    term: int = 0
    strength: float = 1.0

    def __str__(self) -> str:
        return f"{TERMS[self.term].law}, {self.strength:.2f}, {super().__str__()}"


def cases(count: int, seed: int) -> list[CoverageCase]:
    """Draw cases: terms and kinds of noise in turn, all else as for clean records."""
    rng = np.random.default_rng([seed, 32])
    drawn = []
    for k in range(count):
        term = (k + k // len(KINDS)) % len(TERMS)
        plant = PLANTS[TERMS[term].plant]
        noise = KINDS[k % len(KINDS)]
        if noise == "jitter" and plant.rate > 200.0:
            noise = KINDS[0]
        strength = float(rng.uniform(*_STRENGTHS))
        case = conditions(plant, noise, 100_000 * seed + k, rng)
        drawn.append(CoverageCase(**asdict(case), term=term, strength=strength))
    return drawn


def judge(case: CoverageCase) -> Row:
    """Draw a record, diagnose it with the effect offered, and hold intervals against the truth."""
    term = TERMS[case.term]
    amount = case.strength * term.amount
    lack = over(f"{term.law} + {term.signal}", lambda x: amount * term.form(x / term.at))
    drawn = draw(case, plant=PLANTS[term.plant].with_hidden(lack.change))
    model = find_model(drawn.plant.model)
    assert model.cls is not None
    signal = SignalTerm(term.signal, scale=term.at)
    effect = correction(model.cls, term.law, signal, term.shape, term.unit, amount)
    diagnosis = _diagnosed(drawn, model, effect)
    truth = {name: drawn.truth[name] for name in drawn.plant.nominal}
    truth[effect.neutral] = amount / term.at**term.power
    estimates = diagnosis.estimates
    return asdict(case) | {
        "named": bool(diagnosis.causes),
        "inside": {
            name: bool(estimates[name].interval[0] <= value <= estimates[name].interval[1])
            for name, value in truth.items()
            if name in estimates
        },
    }


def _diagnosed(drawn: CleanRecord, model: Model, effect: type[Effect]) -> Diagnosis:
    """Diagnose a record from its file, with one effect offered."""
    assert model.cls is not None
    with tempfile.TemporaryDirectory() as folder:
        record = read_record(drawn.write(Path(folder) / "record.csv"), model)
    given = settings_of(drawn)
    data = joined_dataset({"": record}, model, given, None)
    fixed = {name: value for name, value in given.items() if name in model.parameters}
    known = drawn.plant.known
    return diagnose(model.cls, data, [effect], fixed, held=known)


def answer_line(row: Row) -> str:
    """Return the answer to a record as a line of text."""
    missed = [name for name, inside in row["inside"].items() if not inside]
    return f"{'named' if row['named'] else 'nothing named'}; missed: {', '.join(missed) or 'none'}"


def report(rows: Sequence[Row]) -> Topic:
    """Return how often intervals hold the truth where the effect is named."""
    named = [row for row in rows if row["named"]]
    inside = [hit for row in named for hit in row["inside"].values()]
    table = []
    for noise, these in grouped(named, "noise").items():
        hits = [hit for row in these for hit in row["inside"].values()]
        table.append([str(noise), len(these), len(hits), f"{100.0 * np.mean(hits):.1f} %"])
    return Topic(
        "Intervals where an effect is named",
        [
            (
                f"{len(rows)} records, in {share(len(named), len(rows))} of which the effect is"
                f" named; intervals of 95 % hold the truth in {share(sum(inside), len(inside))}."
            ),
            Table(["noise", "records", "intervals", "cover"], table),
        ],
    )


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield Part(among(cases(chosen.records, chosen.seed), chosen), judge, answer_line, report)


STUDY = Study("coverage", __doc__, _parts, {"--records": (120, "records")})


if __name__ == "__main__":
    STUDY.main()
