"""The terminal as all commands use it: results and remarks, how much of them is said, tables, progress."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from time import monotonic

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)  # fmt: skip
from rich.table import Table
from rich.text import Text

# in a file or a pipe there is no edge to wrap at; 160 keeps the tables whole
_WIDTH = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 160
# names and messages are shown as they are: brackets and colons in them are no markup
out = Console(highlight=False, markup=False, emoji=False, soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, highlight=False, markup=False, emoji=False)
_EVERY = 4.0  # seconds between two lines of progress where there is no terminal
_BURST = 4  # as many may follow each other at once: a short command tells each of its steps
_verbose = False


@contextmanager
def verbosity(quiet: bool = False, verbose: bool = False) -> Iterator[None]:
    """Say less or more while the context lasts.

    Parameters
    ----------
    quiet : bool
        Only results, on standard output; no remarks, warnings and progress. Errors are not told through here.
    verbose : bool
        Also what is used and made, and how long every step took.
    """
    global _verbose
    before, (err.quiet, _verbose) = (err.quiet, _verbose), (quiet, verbose)
    try:
        yield
    finally:
        err.quiet, _verbose = before


@contextmanager
def results_withheld() -> Iterator[None]:
    """Print no results while the context lasts: something else has standard output for itself."""
    before, out.quiet = out.quiet, True
    try:
        yield
    finally:
        out.quiet = before


def wrote(path: Path) -> None:
    """Tell that a file was written."""
    if not err.quiet:
        out.print(f"wrote {path}")


def warn(text: str) -> None:
    """Tell what may spoil a result."""
    err.print(f"warning: {text}", soft_wrap=True)


def note(text: str) -> None:
    """Tell what is worth knowing."""
    err.print(f"noted: {text}", soft_wrap=True)


def detail(text: str) -> None:
    """Tell what only a user who asked for more wants to know."""
    if _verbose:
        err.print(text, soft_wrap=True, style="dim")


def tell_repairs(repairs: Sequence[object]) -> None:
    """Tell what was repaired or noticed in a record."""
    for repair in repairs:
        word = "repaired" if getattr(repair, "changed_data", False) else "noted"
        err.print(f"{word}: {getattr(repair, 'message', repair)}", soft_wrap=True, style="dim")


def plain_table(title: str | None, *columns: str, right: Collection[str] = ()) -> Table:
    """Make a plain table.

    Parameters
    ----------
    title : str or None
    *columns : str
        The last one takes the room that is left.
    right : collection of str
        Columns of numbers.
    """
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for k, column in enumerate(columns):
        table.add_column(column, no_wrap=k + 1 < len(columns), justify="right" if column in right else "left")
    return table


class Tell:
    """Says what is being done, and how far it is.

    On a terminal a bar; elsewhere lines, a few at once and then one every few seconds.

    Parameters
    ----------
    bar : rich.progress.Progress or None
    """

    def __init__(self, bar: Progress | None):
        self._bar = bar
        self._task = bar.add_task("", total=None) if bar else None
        self._text = ""
        self._began = self._since = self._last = monotonic()  # the whole, the present part, the latest count of lines
        self._lines = float(_BURST)  # how many may be said now

    def __call__(self, text: str) -> None:
        """Begin something new."""
        self._turn_to(text)
        self._began = self._since
        if self._bar is not None and self._task is not None:
            self._bar.reset(self._task, description=text, total=None)
        elif self._may_speak():
            err.print(text, soft_wrap=True)

    def done(self, part: int, whole: int, text: str = "") -> None:
        """So much of it is done.

        Parameters
        ----------
        part, whole : int
        text : str
            What comes next, where the parts have names.
        """
        if text:
            self._turn_to(text)
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=part, total=whole, description=self._text)
        elif text or monotonic() - max(self._last, self._since) >= _EVERY:
            left = (monotonic() - self._began) * (whole - part) / part if part else 0.0
            if self._may_speak():
                remaining = f", {timedelta(seconds=round(left))} left" if left else ""
                err.print(f"{self._text} ({part:,} of {whole:,}{remaining})", soft_wrap=True)

    def finish(self) -> None:
        """End what was begun."""
        self._turn_to("")

    def _turn_to(self, text: str) -> None:
        now = monotonic()
        if self._text:
            detail(f"{self._text}: took {now - self._since:.2f} s")
        self._text, self._since = text, now

    def _may_speak(self) -> bool:
        """Whether a line is due; all of them are where more was asked for."""
        now = monotonic()
        self._lines = min(float(_BURST), self._lines + (now - self._last) / _EVERY)
        self._last = now
        if self._lines < 1.0 and not _verbose:
            return False
        self._lines -= 1.0
        return True


class _Count(ProgressColumn):
    """How many parts are done: ``7 of 28``."""

    def render(self, task: Task) -> Text:
        return Text("" if task.total is None else f"{task.completed:,.0f} of {task.total:,.0f}")


@contextmanager
def progress() -> Iterator[Tell]:
    """Show on standard error what is being done, how far it is and how long it will take."""
    if not err.is_terminal or err.quiet:
        tell = Tell(None)
        yield tell
        tell.finish()
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        _Count(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        tell = Tell(bar)
        yield tell
        tell.finish()
