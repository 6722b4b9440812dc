"""Terminal output of all commands: results, remarks by verbosity, tables and progress.

`plain_text` renders the same output as text, for ``str()`` of a result and for notebooks.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from threading import Timer
from time import monotonic
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from fmus.kit import quoting
from orchestration.reporting.notebook_bar import NotebookBar, in_kernel


class _Screen(Console):
    """A console on which names and messages are text: nothing in them moves a cursor or is markup.

    Brackets and colons would be markup and emojis for rich, and it passes most control characters.
    """

    def __init__(self, **about: Any):
        super().__init__(highlight=False, markup=False, emoji=False, **about)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Yield the segments of what is printed; escapes stand for what is not printable."""
        for text, style, control in super().render(renderable, options):
            shown = text if control else quoting.visible(text, keep="\n")
            yield Segment(shown, style, control)


# in a file or a pipe there is no edge to wrap at; 160 keeps the tables whole
_WIDTH = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 160
out = _Screen(soft_wrap=True, width=_WIDTH)
err = _Screen(stderr=True)
TEXT_WIDTH = 120  # columns of tables in a text
_INTERVAL = 4.0  # s between two lines of progress without a terminal
_STEADY = 0.03  # share of the parts after which their rate tells the remaining time
_FIRST_PARTS = 4  # parts of a step that are printed without waiting for the interval
_verbose = False


@contextmanager
def verbosity(quiet: bool = False, verbose: bool = False) -> Iterator[None]:
    """Print more or less than usual while the context lasts.

    Parameters
    ----------
    quiet : bool
        Print results only, on standard output, without remarks, warnings and progress. Errors are
        printed elsewhere, in any case.
    verbose : bool
        Print details too, such as files used and the duration of every step.
    """
    global _verbose
    previous = (err.quiet, _verbose)
    err.quiet = quiet
    _verbose = verbose
    try:
        yield
    finally:
        err.quiet, _verbose = previous


@contextmanager
def results_withheld() -> Iterator[None]:
    """Print no results while the context lasts, as standard output is for something else."""
    previous = out.quiet
    out.quiet = True
    try:
        yield
    finally:
        out.quiet = previous


def wrote(path: Path, remark: str = "") -> None:
    """Print that a file was written, with a remark on it."""
    if not err.quiet:
        out.print(f"wrote {path}" + (f" ({remark})" if remark else ""))


def warn(text: str) -> None:
    """Print a warning of something that may make a result wrong."""
    err.print(f"warning: {text}", soft_wrap=True)


def alarm(text: str) -> None:
    """Print an alarm for an operator who must act at once, even in quiet mode."""
    with verbosity():
        err.print(f"ALARM: {text}", soft_wrap=True, style="bold red")


def note(text: str) -> None:
    """Print a remark."""
    err.print(f"noted: {text}", soft_wrap=True)


def detail(text: str) -> None:
    """Print a detail in verbose mode only."""
    if _verbose:
        err.print(text, soft_wrap=True, style="dim")


def tell_repairs(repairs: Sequence[object]) -> None:
    """Print the repairs of a record and remarks on it, a line each."""
    for repair in repairs:
        word = "repaired" if getattr(repair, "changed_data", False) else "noted"
        err.print(f"{word}: {getattr(repair, 'message', repair)}", soft_wrap=True, style="dim")


def plain_table(
    title: str | None,
    *columns: str,
    right: Collection[str] = (),
    rows: Iterable[Sequence[str]] = (),
) -> Table:
    """Make a table without borders.

    Parameters
    ----------
    title : str or None
    *columns : str
        Headings; the first column is for names and does not wrap.
    right : collection of str
        Headings of columns that are aligned to the right, such as numbers.
    rows : iterable of sequence of str
        The first rows.
    """
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for k, column in enumerate(columns):
        table.add_column(column, no_wrap=k == 0, justify="right" if column in right else "left")
    for row in rows:
        table.add_row(*row)
    return table


def plain_text(renderable: RenderableType) -> str:
    """Return the text that a console would print, without colours."""
    text = io.StringIO()
    plain = _Screen(
        file=text,
        width=TEXT_WIDTH,
        soft_wrap=True,
        force_terminal=False,
        force_jupyter=False,  # in a notebook rich would print, and leave the text empty
    )
    plain.print(renderable)
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip("\n").split("\n"))


class Tell:
    """Display of the current step and its progress.

    It is a bar on a terminal. Elsewhere a line is printed for every step, for its first few parts,
    and then every few seconds.

    Parameters
    ----------
    bar : rich.progress.Progress or None
        The bar; None without a terminal.
    """

    def __init__(self, bar: Progress | None):
        self._bar = bar
        self._task = bar.add_task("", total=None) if bar else TaskID(0)
        self._timer = Timer(0.0, self._print_progress)  # of the next line
        self._begin("")

    def _begin(self, text: str) -> None:
        """Note that a step begins."""
        self._text = text
        self._part = self._whole = 0
        # parts and time at the first report of the step: a continued sweep begins with parts done
        self._first_report: tuple[int, float] | None = None
        self._lines = 0  # printed lines of the step
        self._part_start = self._last_line = monotonic()  # s

    def __call__(self, text: str) -> None:
        """Begin a step."""
        self.finish()
        self._begin(text)
        if self._bar is not None:
            self._bar.reset(self._task, description=text, total=None)
        else:
            err.print(text, soft_wrap=True)

    def done(self, part: int, whole: int, text: str = "") -> None:
        """Report the number of finished parts of the step.

        Parameters
        ----------
        part, whole : int
            Number of parts done, and of all parts.
        text : str
            Name of the next part; empty if the parts have no names.
        """
        self._part, self._whole = part, whole
        if self._first_report is None:
            self._first_report = (part, monotonic())
        if text:
            self._print_duration()
            self._text = text
            self._part_start = monotonic()
        if self._bar is not None:
            self._bar.update(self._task, completed=part, total=whole, description=self._text)
        elif text and (self._lines < _FIRST_PARTS or _verbose):
            self._print_progress()
        elif not self._timer.is_alive():  # print the newest report when the interval is over
            delay = self._last_line + _INTERVAL - monotonic()
            self._timer = Timer(delay, self._print_progress)
            self._timer.daemon = True
            self._timer.start()

    def finish(self) -> None:
        """End the current step."""
        self._timer.cancel()
        self._print_duration()
        self._text = ""

    def _print_progress(self) -> None:
        """Print the parts done and the remaining time, estimated from the rate so far.

        The time before the first report is no part of the rate: FMUs are built and loaded in it.
        """
        if not self._text:  # the step ended while the timer ran out
            return
        now = monotonic()
        remaining = ""
        first_part, start = self._first_report or (self._part, now)
        timed = self._part - first_part
        if timed > _STEADY * (self._whole - first_part):
            seconds = round((now - start) / timed * (self._whole - self._part))
            remaining = f", {timedelta(seconds=seconds)} left" if seconds else ""
        err.print(f"{self._text} ({self._part:,} of {self._whole:,}{remaining})", soft_wrap=True)
        self._last_line = now
        self._lines += 1

    def _print_duration(self) -> None:
        if self._text:
            detail(f"{self._text}: took {monotonic() - self._part_start:.2f} s")


class _Count(ProgressColumn):
    """Column with the number of parts done: ``7 of 28``."""

    def render(self, task: Task) -> Text:
        return Text("" if task.total is None else f"{task.completed:,.0f} of {task.total:,.0f}")


class _Rate(ProgressColumn):
    """Column with the parts done per second, empty below one."""

    def render(self, task: Task) -> Text:
        return Text(
            f"{task.speed:,.0f}/s" if task.speed and task.speed >= 1.0 else "",
            style="progress.data.speed",
        )


@contextmanager
def progress(step: str = "") -> Iterator[Tell]:
    """Show the current step, its progress and its remaining time on standard error.

    Parameters
    ----------
    step : str
        The first step; empty if it is told.
    """
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False, table_column=Column(ratio=1, no_wrap=True)),
        BarColumn(bar_width=16),
        _Count(table_column=Column(no_wrap=True)),
        _Rate(table_column=Column(no_wrap=True)),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    bar = Progress(*columns, console=err, transient=True, expand=True) if _is_watched() else None
    tell = Tell(bar)
    if bar is not None:
        bar.start()
    if step:
        tell(step)
    try:
        yield tell
    finally:
        tell.finish()
        if bar is not None:
            bar.stop()


def _is_watched() -> bool:
    """Return whether somebody sees a bar on standard error."""
    return err.is_terminal and not err.quiet


@contextmanager
def bar(step: str = "") -> Iterator[Tell | NotebookBar | None]:
    """Show progress in a notebook or on a terminal; yield None where nobody looks.

    Parameters
    ----------
    step : str
        The first step; empty if it is told.
    """
    if in_kernel():
        below = NotebookBar(step)
        try:
            yield below
        finally:
            below.finish()
    elif _is_watched():
        with progress(step) as tell:
            yield tell
    else:
        yield None
