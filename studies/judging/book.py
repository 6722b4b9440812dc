"""Study of models by the book: ten textbook systems, in units from um to km and ms to days.

`python -m studies.judging.book --records 60 --clean 20 --seed 1` draws records of the plants of
`studies/plants/book.py`, with one effect of `studies/hidden/book.py` hidden or none, and diagnoses
them with the models that an engineer writes first (`studies/plants/models`). What counts and what
is right are as in the studies of hidden effects and of clean records (`studies.judging.hidden`,
`studies.judging.clean`).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from studies.clean import cases as clean_cases
from studies.hidden import cases as hidden_cases
from studies.judging import clean, hidden
from studies.judging.answers import LEAST
from studies.judging.clean import ROOT
from studies.judging.kept import add_options, among
from studies.judging.stamp import DIAGNOSIS, stamp
from studies.plants import BY_THE_BOOK

PAGE = ROOT / "docs" / "book-records.md"
CODE = (
    *DIAGNOSIS,
    "orchestration/fmu/model/effects.py",
    "studies/hidden",
    "studies/clean",
    "studies/plants/book.py",
    "studies/plants/models",
    "studies/judging/answers.py",
    "studies/judging/book.py",
    "studies/judging/hidden.py",
)
_HEAD = (
    "# How often hidden effects are named, in models by the book\n"
    "\n"
    "Drawn by `python -m studies.judging.book {options}`, a seed that was not looked at before;\n"
    "`make book-study` draws it anew. Ten systems as textbooks have them, simulated by equations"
    " that share no code with\n"
    "what they judge, each beside the model that an engineer writes first, in the units of its"
    " field: a micromachined\n"
    "accelerometer (um, ms), a loudspeaker (mm, ms), an air vessel (bar, g/s), the swinging load"
    " of a crane and a coasting\n"
    "train (km), which nothing drives, a ship (degrees, minutes), two tanks (cm, l/s, minutes), a"
    " building (kW, eight\n"
    "days), a lithium cell (A h, hours) and a motor with a gear (rpm). Nothing is listed as"
    " possibly wrong: families only.\n"
    "What may be hidden and what names it rightly is in `studies/hidden/book.py`. Not counted are"
    " records in which the\n"
    "effect leaves less than {least:g} noise widths after a refit of the base{alike}.\n"
    "See also [the other hidden records](hidden-records.md).\n"
    "\n"
    "{stamp}\n"
    "\n"
)
_ALIKE = ",\nand those that another effect makes as well"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.judging.book", description=__doc__.split("\n\n")[0]
    )
    add_options(parser, 60, "book")
    parser.add_argument(
        "--clean", type=int, default=20, help="records without anything hidden, in SEED-clean.jsonl"
    )
    parser.add_argument(
        "--no-floor", action="store_true", help="do not fit every effect alone, which takes longest"
    )
    parser.add_argument("--out", type=Path, help="page to write")
    chosen = parser.parse_args(arguments)
    kept = chosen.kept or ROOT / "build" / "book" / f"{chosen.seed}.jsonl"
    progress = lambda line: print(line, flush=True)  # noqa: E731
    wanted = among(hidden_cases(chosen.records, chosen.seed, BY_THE_BOOK), chosen)
    bare = among(clean_cases(chosen.clean, chosen.seed, BY_THE_BOOK), chosen)
    topics = []
    if wanted:
        topics.append(hidden.report(hidden.run(wanted, kept, not chosen.no_floor, progress)))
    if bare:
        beside = kept.with_stem(f"{kept.stem}-clean")
        topics.append(clean.report(clean.run(bare, beside, 0, progress, ["families"])))
    text = "\n\n".join(map(str, topics))
    print("\n" + text)
    if chosen.out is not None:
        options = f"--records {chosen.records} --clean {chosen.clean} --seed {chosen.seed}"
        head = _HEAD.format(
            options=options + " --no-floor" * chosen.no_floor,
            least=LEAST,
            alike="" if chosen.no_floor else _ALIKE,
            stamp=stamp(CODE),
        )
        chosen.out.write_text(head + text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
