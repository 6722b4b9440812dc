"""Study of nine laws outside of every catalogue, which should be named as laws.

`python -m studies.judging.nine_laws --each 3 --seed 1` draws two records of each plant of
`studies/nine_laws`, one of which is held out, and asks the engine for the cause. A cause of the
catalogue alone that leaves more than the noise is a fault, whatever its name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.tables import Topic
from fmus.kit import UserError
from orchestration.diagnosis import Diagnosis, Options, Term, diagnose
from orchestration.fmu import find_model
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Row, Study, among, counted, processor_time
from studies.nine_laws import NineLawsCase, cases, draw_law

KINDS = ("first", "in group", "guessed", "other")
_LEFT = 1.5  # noise widths that no effect of a catalogue may leave alone


def judge(case: NineLawsCase) -> Row:
    """Draw the records of a law, and ask the engine for its cause."""
    import orchestration as ppy

    drawn = draw_law(case)
    plant = drawn.plant
    model = find_model(plant.model)
    fitted, unseen = (ppy.read_record(one, model) for one in (drawn.fitted, drawn.held_out))
    row = asdict(case) | {"title": plant.law, "strength": drawn.strength, "noise": drawn.noise}
    began = processor_time()
    try:
        found = diagnose([fitted], model, [unseen], Options(hold=plant.known))
    except UserError as error:
        return row | {"verdict": "refused", "said": [], "right": [], "refused": str(error)}
    return row | {"seconds": processor_time() - began} | _answer(found, plant.right)


def _answer(found: Diagnosis, right: frozenset[tuple[str, str]]) -> Row:
    """Return the verdict with its causes, and which of them are right."""
    leads = [cause.parts[0] for cause in found.causes]
    left = [one.noise_widths for one in found.remainders if one.noise_widths is not None]
    # an effect of a catalogue has a cause of its own in place of law and signal
    only_catalogue = found.is_named and all(
        term.cause != (term.law, term.signal) for term in found.causes[0].terms
    )
    return {
        "verdict": found.verdict,
        "said": [
            f"{c.name} {c.probability:.2f} [{' + '.join(map(str, c.parts))}]" for c in found.causes
        ],
        "right": [isinstance(one, Term) and (one.law, one.signal) in right for one in leads],
        "catalogue": only_catalogue,
        "left": max(left, default=float("nan")),
    }


def kind_of(row: Row) -> str:
    """Return which of `KINDS` an answer is."""
    named = row["verdict"] in ("cause", "ambiguous")
    if named and any(row["right"]):
        return "first" if row["right"][0] else "in group"
    return "guessed" if any(row["right"][:1]) else "other"


def is_misled(row: Row) -> bool:
    """Return whether an effect of the catalogue alone is named that leaves more than the noise."""
    return bool(row.get("catalogue") and row["left"] > _LEFT)


def _line(row: Row) -> str:
    said = row.get("refused") or "; ".join(row["said"])
    return (
        f"{kind_of(row).upper()} {row['title']} ({row['strength']:.3g}, noise {row['noise']:.3f}):"
        f" {row['verdict']}, {row.get('left', np.nan):.2f} widths left,"
        f" {row.get('seconds', np.nan):.1f} s: {said}"
    )


def report(rows: Sequence[Row]) -> Topic:
    """Return how often each law is named."""
    table = counted(rows, "title", KINDS, kind_of, misled=is_misled)
    seconds = [row["seconds"] for row in rows if "seconds" in row]
    note = f"Processor seconds: median {np.median(seconds):.1f}, largest {np.max(seconds):.1f}."
    return Topic("Nine laws outside of the catalogue", [note, table])


def _parts(chosen: Chosen) -> Iterator[Part]:
    yield Part(among(cases(chosen.each, chosen.seed), chosen), judge, _line, report)


STUDY = Study(
    name="nine_laws",
    about=__doc__ or "",
    parts=_parts,
    numbers={"--each": (3, "records of every law")},
    code=(
        *DIAGNOSIS,
        "studies/nine_laws",
        "studies/judging/nine_laws.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
