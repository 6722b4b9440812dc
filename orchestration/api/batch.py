"""Diagnoses of several records, each by itself, in processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from contextlib import nullcontext
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kit import UserError
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
    failures, missing
        See the attributes.

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
        failures: Mapping[str, str],
        missing: Sequence[str] = (),
    ):
        self._results = dict(results)
        self.failures = dict(failures)
        self.missing = list(missing)

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
        verdicts = [one.verdict for one in self.values()]
        counts = {verdict: verdicts.count(verdict) for verdict in verdicts}
        counts |= {"could not be diagnosed": len(self.failures), "not begun": len(self.missing)}
        return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of the records, and why some could not be diagnosed."""
        yield self.summary
        table = plain_table(None, *_HEAD, right=_HEAD[3:])
        for row in self.rows():
            table.add_row(*row)
        yield table
        for name, reason in self.failures.items():
            yield f"{name}: {reason}"

    def rows(self) -> Iterator[list[str]]:
        """Yield the texts of a row for each record."""
        for name, one in self.items():
            causes = [*one.causes, *one.alternatives]
            likely = format_percent(one.probabilities[causes[0]]) if causes else ""
            errors = [format_percent(max(part.values(), default=inf)) for part in one.gain]
            yield [name, one.verdict, " or ".join(causes), likely, *errors]

    def to_frame(self) -> pandas.DataFrame:
        """Return a table with a row for each record, and the largest errors of its outputs.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        rows = []
        for name, one in self.items():
            cause = one.causes[0] if one.causes else ""
            errors = [max(part.values(), default=inf) for part in one.gain]
            rows.append((name, one.verdict, cause, one.probabilities.get(cause), *errors))
        return pandas.DataFrame(rows, columns=[*_HEAD]).set_index("record")

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of every record, ready for JSON."""
        records = {name: one.figures() for name, one in self.items()}
        return {"records": records, "failures": self.failures, "missing": self.missing}


@make_page.register(Diagnoses)
def diagnoses_page(found: Diagnoses, command: str = "") -> Page:
    """Make the page of several diagnoses: their table, and the page of each."""
    page = Page(f"{len(found)} records, each diagnosed by itself", found.summary)
    page.table(_HEAD, [*found.rows()])
    for name, reason in found.failures.items():
        page.text(f"{name}: {reason}")
    for name, one in found.items():
        page.heading(name)
        page.include(make_page(one, command))
    return page


class Job(NamedTuple):
    """A record to diagnose.

    Attributes
    ----------
    name : str
    record : Record, str, Path, DataFrame or Mapping of str to array_like
    """

    name: str
    record: Data


def jobs_of(records: Sequence[Data]) -> list[Job]:
    """Return the records to diagnose with their names; a folder is all files in it.

    Raises
    ------
    UserError
        If there are none, or two have one name.
    """
    jobs: list[Job] = []
    for record in records:
        if isinstance(record, str | Path):
            jobs += [Job(str(path), path) for path in files_of(Path(record))]
        else:
            own = record.source.name if isinstance(record, Record) else ""
            jobs.append(Job(own or f"record {len(jobs) + 1}", record))
    if not jobs:
        raise UserError("there is no record to diagnose, in no folder either")
    names = [job.name for job in jobs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{twice}: there are two records of this name")
    return jobs


def diagnose_each(
    jobs: Sequence[Job],
    diagnose: Callable[[Data], DiagnosisResult],
    workers: int,
    progress: Callable[[str], None],
) -> Diagnoses:
    """Diagnose records by themselves, in other processes if there are several workers.

    Parameters
    ----------
    jobs : sequence of Job
    diagnose : callable
        Can be pickled.
    workers : int
    progress : callable
        Called with a text about each record that is done.

    Returns
    -------
    Diagnoses
        In the order of the jobs. After Ctrl-C those that were done.
    """
    results: dict[str, DiagnosisResult] = {}
    failures: dict[str, str] = {}

    def note(name: str, outcome: Callable[[], DiagnosisResult]) -> None:
        try:
            results[name] = outcome()
        except UserError as error:
            failures[name] = str(error).removeprefix(f"{name}: ")
        except Ended as end:
            failures[name] = end.reason
        told = results[name].verdict if name in results else failures[name]
        progress(f"{len(results) + len(failures)} of {len(jobs)} records: {name}: {told}")

    try:
        if workers == 1 or len(jobs) == 1:
            for job in jobs:
                note(job.name, partial(diagnose, job.record))
                if job.name in results and results[job.name].is_interrupted:
                    break
        else:
            for name, future in _by_processes(jobs, diagnose, workers):
                note(name, future.result)
    except KeyboardInterrupt:
        if not results:
            raise
    done = {job.name: results[job.name] for job in jobs if job.name in results}
    missing = [job.name for job in jobs if job.name not in {*results, *failures}]
    return Diagnoses(done, failures, missing)


def _by_processes(
    jobs: Sequence[Job], diagnose: Callable[[Data], DiagnosisResult], workers: int
) -> Iterator[tuple[str, Future[DiagnosisResult]]]:
    """Yield the name and the outcome of each record when it is done."""
    in_words_of_shell = option("time").startswith(flag("time"))
    with Pool(Limits(inf, inf), min(workers, len(jobs)), _begin, in_words_of_shell) as pool:
        names = {pool.submit(diagnose, job.record): job.name for job in jobs}
        for future in as_completed(names):
            yield names[future], future


def _begin(in_words_of_shell: bool) -> None:
    """Name options in a process as its parent does."""
    keep(in_shell() if in_words_of_shell else nullcontext())
