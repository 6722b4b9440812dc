"""A study: records are drawn, judged, kept as lines of JSON, and reported on a page.

Every record is kept as soon as it is judged; an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from benchmarks.tables import Table, Topic
from studies.clean import CleanRecord
from studies.judging.stamp import ROOT, stamp

LEAST = 1.3  # noise widths that must be left of a hidden effect
Row = dict[str, Any]
Chosen = argparse.Namespace
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Part:
    """Records of a study that are judged and reported alike.

    Attributes
    ----------
    cases : sequence of dataclass
        Their fields are in every row and distinguish rows.
    judge : callable
        Draws the record of a case and makes its row.
    line : callable
        Describes a row in one line.
    report : callable
        Makes a topic of all rows.
    name : str
        Of the file of its rows, after that of the study; empty for the first part.
    """

    cases: Sequence[Any]
    judge: Callable[[Any], Row]
    line: Callable[[Row], str]
    report: Callable[[Sequence[Row]], Topic]
    name: str = ""

    def rows(self, kept: Path, workers: int = 1, tell: Tell = print) -> list[Row]:
        """Judge all cases that are not kept yet.

        Parameters
        ----------
        kept : Path
            File of JSON lines.
        workers : int
            Processes.
        tell : callable
            Told every row in a line.
        """
        lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
        names = [one.name for one in fields(type(self.cases[0]))] if self.cases else []
        done = {_key(row, names): row for row in map(json.loads, lines)}
        keys = {_key(vars(case), names): case for case in self.cases}
        kept.parent.mkdir(parents=True, exist_ok=True)
        missing = {key: case for key, case in keys.items() if key not in done}
        with _mapped(workers) as mapped, kept.open("a", encoding="utf-8") as file:
            judged = zip(missing, mapped(self.judge, missing.values()), strict=True)
            for k, (key, case) in enumerate(keys.items(), start=1):
                if key not in done:
                    _, done[key] = next(judged)
                    print(json.dumps(done[key]), file=file, flush=True)
                tell(f"{k}/{len(keys)} {case}: {self.line(done[key])}")
        return [done[key] for key in keys]


def _key(row: Mapping[str, Any], names: Iterable[str]) -> str:
    return json.dumps([row.get(name) for name in names])


@contextmanager
def _mapped(workers: int) -> Iterator[Callable[..., Iterable[Row]]]:
    if workers == 1:
        yield map
        return
    with ProcessPoolExecutor(workers) as pool:
        yield pool.map


@dataclass(frozen=True)
class Study:
    """A study with its command line.

    Attributes
    ----------
    name : str
        Of its module, and of its folder in ``build``.
    about : str
        Docstring of the module.
    parts : callable
        Makes the parts of the options that were chosen.
    numbers : Mapping of str to tuple of int and str
        Options with a whole number: default, help.
    switches : Mapping of str to str
        Options without a value: help.
    page : str
        In ``docs``; empty without one.
    head : str
        Beginning of the page, with ``{options}`` and ``{stamp}``.
    code : tuple of str
        What draws the page, for the stamp.
    """

    name: str
    about: str
    parts: Callable[[Chosen], Iterable[Part]]
    numbers: Mapping[str, tuple[int, str]]
    switches: Mapping[str, str] = field(default_factory=dict)
    page: str = ""
    head: str = "{options}\n\n"
    code: tuple[str, ...] = ()

    @property
    def path(self) -> Path:
        """The page in the repository."""
        return ROOT / "docs" / self.page

    def main(self, arguments: Sequence[str] | None = None) -> None:
        """Run the command line."""
        chosen = self._parser().parse_args(arguments)
        kept = chosen.kept or ROOT / "build" / self.name / f"{chosen.seed}.jsonl"
        topics = []
        for part in self.parts(chosen):
            file = kept.with_stem(f"{kept.stem}-{part.name}") if part.name else kept
            if part.cases:
                tell = lambda line: print(line, flush=True)  # noqa: E731
                topics.append(part.report(part.rows(file, chosen.workers, tell)))
        text = "\n\n".join(map(str, topics))
        print("\n" + text)
        if chosen.out is not None:
            drawn_with = stamp(self.code) if self.code else ""
            head = self.head.format(options=self._options(chosen), stamp=drawn_with)
            chosen.out.write_text(head + text + "\n", encoding="utf-8")

    def _parser(self) -> argparse.ArgumentParser:
        parser = argparse.ArgumentParser(
            prog=f"python -m studies.judging.{self.name}", description=self.about.split("\n\n")[0]
        )
        for flag, (default, text) in self.numbers.items():
            parser.add_argument(flag, type=int, default=default, help=text)
        for flag, text in self.switches.items():
            parser.add_argument(flag, action="store_true", help=text)
        parser.add_argument("--seed", type=int, default=1)
        parser.add_argument("--only", nargs="*", default=[], help="words that a case must contain")
        parser.add_argument(
            "--without", nargs="*", default=[], help="words that a case must not contain"
        )
        parser.add_argument(
            "--kept",
            type=Path,
            help=f"JSON lines, one a record; default build/{self.name}/SEED.jsonl",
        )
        parser.add_argument("--workers", type=int, default=1, help="processes")
        parser.add_argument("--out", type=Path, help="page to write")
        return parser

    def _options(self, chosen: Chosen) -> str:
        """Return the options that draw the same records."""
        given = vars(chosen)
        words = [f"{flag} {given[_variable(flag)]}" for flag in [*self.numbers, "--seed"]]
        words += [flag for flag in self.switches if given[_variable(flag)]]
        for name in ("only", "without"):
            words += [f"--{name} {' '.join(given[name])}"] * bool(given[name])
        return " ".join(words)


def _variable(flag: str) -> str:
    return flag.lstrip("-").replace("-", "_")


def among(cases: Iterable[Any], chosen: Chosen) -> list[Any]:
    """Leave out the cases that were not chosen."""
    return [
        case
        for case in cases
        if all(word in str(case) for word in chosen.only)
        and not any(word in str(case) for word in chosen.without)
    ]


def title(row: Row, case: type) -> str:
    """Name a record by the fields of its case."""
    return str(case(**{one.name: row[one.name] for one in fields(case) if one.name in row}))


def share(part: int, whole: int) -> str:
    """Format a part of a whole with its percentage."""
    return f"{part} ({100.0 * part / max(whole, 1):.1f} %)"


def grouped(rows: Iterable[Row], axis: str) -> dict[Any, list[Row]]:
    """Group rows by a key, in the order of its values as text."""
    groups: dict[Any, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row[axis]].append(row)
    return dict(sorted(groups.items(), key=lambda item: str(item[0])))


def counted(
    rows: Iterable[Row],
    axis: str,
    kinds: Collection[str],
    kind_of: Callable[[Row], str],
    **more: Callable[[Row], Any],
) -> Table:
    """Return how many rows are of each kind, by an axis.

    Parameters
    ----------
    rows : iterable of dict
    axis : str
        Key of the rows.
    kinds : collection of str
        Of which every row is one.
    kind_of : callable
        Returns it.
    **more : callable
        Further columns by heading: how many rows it is true of. An underscore is a space.
    """
    table = []
    for name, these in grouped(rows, axis).items():
        of = Counter(map(kind_of, these))
        true = [sum(bool(holds(row)) for row in these) for holds in more.values()]
        table.append([str(name), len(these), *(of[kind] for kind in kinds), *true])
    return Table([axis, "records", *kinds, *(name.replace("_", " ") for name in more)], table)


def processor_time() -> float:
    """Return processor time of this process and its children, s: compilers run beside it."""
    return float(sum(os.times()[:4]))


def settings_of(drawn: CleanRecord) -> dict[str, float]:
    """Return settings that a user of the model under test would give."""
    return dict(drawn.plant.settings) | (
        {"sample_period": drawn.step} if drawn.case.plant == "VoiceCoil" else {}
    )
