"""Diagnoses of several records, each by itself, in processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from contextlib import nullcontext
from functools import partial
from math import inf, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError
from orchestration.api.options import source_of
from orchestration.api.records import Data
from orchestration.api.results import DiagnosisResult
from orchestration.fmu.isolation import Ended, Limits, Pool, keep
from orchestration.records import Record, files_of
from orchestration.reporting import (
    Displayable,
    flag,
    format_percent,
    in_shell,
    make_page,
    one_line,
    option,
    plain_table,
)
from orchestration.reporting.html import Page

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

_HEAD = ("record", "verdict", "cause", "probability", "error before", "after")


class Diagnoses(Displayable, Mapping[str, DiagnosisResult]):
    """Diagnoses of several records by one model, each by itself: a mapping by record.

    Parameters
    ----------
    results : Mapping of str to DiagnosisResult

    Attributes
    ----------
    failures : dict of str to str
        Reasons why other records could not be diagnosed.
    missing : list of str
        Records that were not diagnosed because of Ctrl-C.
    """

    def __init__(
        self,
        results: Mapping[str, DiagnosisResult],
        failures: dict[str, str],
        missing: list[str],
    ):
        self._results = results
        self.failures = failures
        self.missing = missing

    def __getitem__(self, name: str) -> DiagnosisResult:
        return self._results[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._results)

    def __len__(self) -> int:
        return len(self._results)

    def __repr__(self) -> str:
        return one_line(f"Diagnoses: {self.summary}")

    @property
    def summary(self) -> str:
        """Numbers of records by verdict, and of those without."""
        counts = Counter(one.verdict for one in self.values())
        counts["could not be diagnosed"] = len(self.failures)
        counts["not diagnosed after Ctrl-C"] = len(self.missing)
        return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of the records, and why some could not be diagnosed."""
        yield self.summary
        yield plain_table(None, *_HEAD, right=_HEAD[3:], rows=self.table())
        for name, reason in self.failures.items():
            yield f"{name}: {reason}"

    def table(self) -> Iterator[list[str]]:
        """Yield the texts of each row of the table."""
        for *texts, probability, before, after in self._rows():
            likely = "" if isnan(probability) else format_percent(probability)
            yield [*texts, likely, format_percent(before), format_percent(after)]

    def _rows(self) -> Iterator[list[Any]]:
        """Yield the figures of each row; errors are the largest of any output."""
        for name, one in self.items():
            causes = [*one.causes, *one.alternatives]
            probability = one.probabilities[causes[0]] if causes else nan
            errors = [max(errors.values(), default=inf) for errors in one.gain]
            yield [name, one.verdict, " or ".join(causes), probability, *errors]

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each record, and the largest errors of its outputs.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame(self._rows(), columns=[*_HEAD]).set_index("record")

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of every record, ready for JSON."""
        records = {name: one.figures() for name, one in self.items()}
        return {"records": records, "failures": self.failures, "missing": self.missing}


@make_page.register(Diagnoses)
def diagnoses_page(found: Diagnoses, command: str = "") -> Page:
    """Make the page of several diagnoses: their table, and the page of each."""
    page = Page(f"{len(found)} records, each diagnosed by itself", found.summary)
    page.table(_HEAD, [*found.table()])
    for name, reason in found.failures.items():
        page.text(f"{name}: {reason}")
    for name, one in found.items():
        page.heading(name)
        page.include(make_page(one, command))
    return page


def named_records(
    records: Sequence[Data], options: Mapping[str, Any], tell: Callable[[str], None]
) -> dict[str, Data]:
    """Return records by name, with all files of a folder that have a table.

    Parameters
    ----------
    records : sequence of record, file, DataFrame or arrays by name
    options : Mapping of str to Any
        Values of `ReadingOptions`.
    tell : callable
        Called with a line about each file that is left out.

    Raises
    ------
    UserError
        If there are none, or two have one name.
    """
    pairs: list[tuple[str, Data]] = []
    for record in records:
        if isinstance(record, str | Path):
            source = source_of(record, options)
            pairs += [(str(path), path) for path in files_of(Path(record), tell, source.reading)]
        elif isinstance(record, Record):
            pairs.append((record.source.name, record))
        else:
            pairs.append((f"record {len(pairs) + 1}", record))
    if not pairs:
        raise UserError("there is no record to diagnose, in no folder either")
    (name, count), *_ = Counter(name for name, _ in pairs).most_common()
    if count > 1:
        raise UserError(f"{name}: there are {count} records of this name")
    return dict(pairs)


def diagnose_each(
    records: Mapping[str, Data],
    diagnose: Callable[[Data], DiagnosisResult],
    workers: int,
    progress: Callable[[str], None],
) -> Diagnoses:
    """Diagnose records by themselves, in other processes if there are several workers.

    Parameters
    ----------
    records : Mapping of str to record
        By name.
    diagnose : callable
        Can be pickled.
    workers : int
    progress : callable
        Called with a text about each record that is done.

    Returns
    -------
    Diagnoses
        In the order of the records. After Ctrl-C those that were done.
    """
    results: dict[str, DiagnosisResult] = {}
    failures: dict[str, str] = {}
    outcomes: Iterable[tuple[str, _Outcome]] = (
        (name, partial(diagnose, record)) for name, record in records.items()
    )
    if min(workers, len(records)) > 1:
        outcomes = _by_processes(records, diagnose, workers)
    try:
        for name, outcome in outcomes:
            try:
                results[name] = outcome()
            except UserError as error:
                failures[name] = str(error).removeprefix(f"{name}: ")
            except Ended as end:
                failures[name] = end.reason
            answer = failures.get(name) or results[name].verdict
            progress(f"{len(results) + len(failures)} of {len(records)} records: {name}: {answer}")
            if name in results and results[name].is_interrupted:
                break
    except KeyboardInterrupt:
        if not results:
            raise
    done = {name: results[name] for name in records if name in results}
    return Diagnoses(done, failures, [name for name in records if name not in results | failures])


_Outcome = Callable[[], DiagnosisResult]


def _by_processes(
    records: Mapping[str, Data], diagnose: Callable[[Data], DiagnosisResult], workers: int
) -> Iterator[tuple[str, _Outcome]]:
    """Yield the name of each record when it is done, with the call that returns its diagnosis."""
    in_words_of_shell = option("time").startswith(flag("time"))
    with Pool(Limits(inf, inf), workers, _begin, in_words_of_shell) as pool:
        names: dict[Future[DiagnosisResult], str] = {
            pool.submit(diagnose, record): name for name, record in records.items()
        }
        for future in as_completed(names):
            yield names[future], future.result


def _begin(in_words_of_shell: bool) -> None:
    """Name options in a process as its parent does."""
    keep(in_shell() if in_words_of_shell else nullcontext())
