"""Study of models by the book: ten textbook systems, in units from um to km and ms to days.

`python -m studies.judging.book --records 60 --clean 20 --seed 1` draws records of the plants of
`studies/plants/book.py`, with one effect of `studies/hidden/book.py` hidden or none, and diagnoses
them with the models that an engineer writes first (`studies/plants/models`). What counts and what
is right are as in the studies of hidden effects and of clean records (`studies.judging.hidden`,
`studies.judging.clean`).
"""

from __future__ import annotations

from collections.abc import Iterator

from studies.clean import cases as clean_cases
from studies.hidden import cases as hidden_cases
from studies.judging import clean, hidden
from studies.judging.answers import LEAST
from studies.judging.stamp import DIAGNOSIS
from studies.judging.study import Chosen, Part, Study, among
from studies.plants import BY_THE_BOOK


def _parts(chosen: Chosen) -> Iterator[Part]:
    wanted = among(hidden_cases(chosen.records, chosen.seed, BY_THE_BOOK), chosen)
    yield hidden.part(wanted, not chosen.no_floor)
    bare = among(clean_cases(chosen.clean, chosen.seed, BY_THE_BOOK), chosen)
    yield clean.part(bare, effects=["families"], name="clean")


STUDY = Study(
    name="book",
    about=__doc__,
    parts=_parts,
    numbers={
        "--records": (60, "records with one hidden effect"),
        "--clean": (20, "records without anything hidden, in SEED-clean.jsonl"),
    },
    switches=hidden.NO_FLOOR,
    page="book-records.md",
    head=f"""# How often hidden effects are named, in models by the book

Drawn by `python -m studies.judging.book {{options}}`, a seed that was not looked at before;
`make book-study` draws it anew. Ten systems as textbooks have them, simulated by equations that
share no code with what they judge, each with the model that an engineer writes first, in the units
of its field: a micromachined accelerometer (um, ms), a loudspeaker (mm, ms), an air vessel (bar,
g/s), the swinging load of a crane and a coasting train (km), which nothing drives, a ship (degrees,
minutes), two tanks (cm, l/s, minutes), a building (kW, eight days), a lithium cell (A h, hours) and
a motor with a gear (rpm). Nothing is listed as possibly wrong: families only. What may be hidden
and what names it rightly is in `studies/hidden/book.py`. Not counted are records in which the
effect leaves less than {LEAST:g} noise widths after a refit of the base and, unless `--no-floor` is
given, those that another effect makes as well. [The other hidden records](hidden-records.md) are
judged likewise.

{{stamp}}

""",
    code=(
        *DIAGNOSIS,
        "orchestration/fmu/model/effects.py",
        "studies/hidden",
        "studies/clean",
        "studies/plants/book.py",
        "studies/plants/models",
        "studies/judging/answers.py",
        "studies/judging/book.py",
        "studies/judging/hidden.py",
    ),
)


if __name__ == "__main__":
    STUDY.main()
