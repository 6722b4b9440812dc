"""Resumable studies: every judged record is kept as a line of JSON."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

Row = dict[str, Any]
C = TypeVar("C")


def judged(
    wanted: Sequence[C],
    kept: Path,
    judge: Callable[[C], Row],
    said: Callable[[Row], str],
    progress: Callable[[str], None] = print,
) -> list[Row]:
    """Judge all cases that are not kept yet.

    Parameters
    ----------
    wanted : sequence of dataclass
        Whose fields are in every row and tell rows apart.
    kept : Path
        File of JSON lines.
    judge, said : callable
        Make a row, and tell it in a line.
    progress : callable
    """
    names = [field.name for field in fields(type(wanted[0]))] if wanted else []  # type: ignore[arg-type]
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    done = {repr([row.get(n) for n in names]): row for row in map(json.loads, lines)}
    rows = []
    for k, case in enumerate(wanted, start=1):
        row = done.get(repr([getattr(case, n) for n in names]))
        if row is None:
            row = judge(case)
            kept.parent.mkdir(parents=True, exist_ok=True)
            with kept.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        rows.append(row)
        progress(f"{k}/{len(wanted)} {case}: {said(row)}")
    return rows


def add_options(parser: argparse.ArgumentParser, records: int, folder: str) -> None:
    """Add options for the records that are drawn, and where they are kept."""
    parser.add_argument("--records", type=int, default=records)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[], help="words that a case must contain")
    parser.add_argument(
        "--without", nargs="*", default=[], help="words that a case must not contain"
    )
    parser.add_argument(
        "--kept", type=Path, help=f"JSON lines, one a record; default build/{folder}/SEED.jsonl"
    )


def among(cases: Sequence[C], chosen: argparse.Namespace) -> list[C]:
    """Leave out the cases that were not chosen."""
    return [
        case
        for case in cases
        if all(word in str(case) for word in chosen.only)
        and not any(word in str(case) for word in chosen.without)
    ]
