"""The terminal as all commands use it: results, remarks by verbosity, tables, progress.

What would be printed is a text, too, for ``str()`` of a result and for notebooks.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from threading import Timer
from time import monotonic

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table
from rich.text import Text

# in a file or a pipe there is no edge to wrap at; 160 keeps the tables whole
_WIDTH = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 160
# names and messages are shown as they are: brackets and colons in them are no markup
out = Console(highlight=False, markup=False, emoji=False, soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, highlight=False, markup=False, emoji=False)
TEXT_WIDTH = 120  # columns of tables in a text
_EVERY = 4.0  # seconds between two lines of progress where there is no terminal
_FIRST = 4  # of the parts of a step are told at once
_verbose = False


@contextmanager
def verbosity(quiet: bool = False, verbose: bool = False) -> Iterator[None]:
    """Say less or more while the context lasts.

    Parameters
    ----------
    quiet : bool
        Only results, on standard output; no remarks, warnings and progress. Errors are not told
        through here.
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


def wrote(path: Path, remark: str = "") -> None:
    """Tell that a file was written, and what is to be known of it."""
    if not err.quiet:
        out.print(f"wrote {path}" + (f" ({remark})" if remark else ""))


def warn(text: str) -> None:
    """Tell what may spoil a result."""
    err.print(f"warning: {text}", soft_wrap=True)


def alarm(text: str) -> None:
    """Tell what an operator has to see to at once, also where remarks are not wanted."""
    with verbosity():
        err.print(f"ALARM: {text}", soft_wrap=True, style="bold red")


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
        The first one holds names; where there is little room, the others wrap.
    right : collection of str
        Columns of numbers.
    """
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False)
    for k, column in enumerate(columns):
        table.add_column(column, no_wrap=k == 0, justify="right" if column in right else "left")
    return table


def plain_text(renderable: RenderableType) -> str:
    """Return what would be printed, without colours, wherever this is: a notebook too."""
    text = io.StringIO()
    plain = Console(
        file=text,
        width=TEXT_WIDTH,
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=True,
        force_terminal=False,
        force_jupyter=False,  # where it would print, and leave the text empty
    )
    plain.print(renderable)
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip("\n").split("\n"))


class Tell:
    """Says what is being done, and how far it is.

    On a terminal a bar. Elsewhere a line for every step; of its parts the first few, and then one
    every few seconds.

    Parameters
    ----------
    bar : rich.progress.Progress or None
    """

    def __init__(self, bar: Progress | None):
        self._bar = bar
        self._task = bar.add_task("", total=None) if bar else None
        self._text = ""
        self._part = 0
        self._whole = 0
        # parts and time at the first report of the step: a sweep may take up what was done before
        self._first: tuple[int, float] | None = None
        self._lines = 0  # of the step so far
        self._timer = Timer(0.0, self._say)  # for the next one
        # when the step, its present part and the latest line began
        self._began = self._since = self._said = monotonic()

    def __call__(self, text: str) -> None:
        """Begin a step."""
        self.finish()
        self._text = text
        self._part = self._whole = 0
        self._first = None
        self._lines = 0
        self._began = self._since = self._said = monotonic()
        if self._bar is not None and self._task is not None:
            self._bar.reset(self._task, description=text, total=None)
        else:
            err.print(text, soft_wrap=True)

    def done(self, part: int, whole: int, text: str = "") -> None:
        """So much of the step is done.

        Parameters
        ----------
        part, whole : int
        text : str
            What comes next, where the parts have names.
        """
        self._part, self._whole = part, whole
        if self._first is None:
            self._first = (part, monotonic())
        if text:
            self._tell_time()
            self._text, self._since = text, monotonic()
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=part, total=whole, description=self._text)
        elif text and (self._lines < _FIRST or _verbose):
            self._say()
        elif not self._timer.is_alive():
            self._timer = Timer(self._said + _EVERY - monotonic(), self._say)
            self._timer.daemon = True
            self._timer.start()

    def finish(self) -> None:
        """End what was begun."""
        self._timer.cancel()
        self._tell_time()
        self._text = ""

    def _say(self) -> None:
        """Write how far the step is, and how long the rest takes at the rate so far."""
        if not self._text:  # the step ended while the timer ran out
            return
        now = monotonic()
        remaining = ""
        first, since = self._first or (0, self._began)
        if self._part == first:  # nothing since: the pace is that before it
            first, since = 0, self._began
        if self._part:
            pace = (now - since) / (self._part - first)
            seconds = round(pace * (self._whole - self._part))
            remaining = f", {timedelta(seconds=seconds)} left" if seconds else ""
        err.print(f"{self._text} ({self._part:,} of {self._whole:,}{remaining})", soft_wrap=True)
        self._said = now
        self._lines += 1

    def _tell_time(self) -> None:
        if self._text:
            detail(f"{self._text}: took {monotonic() - self._since:.2f} s")


class _Count(ProgressColumn):
    """Count of parts that are done: ``7 of 28``."""

    def render(self, task: Task) -> Text:
        return Text("" if task.total is None else f"{task.completed:,.0f} of {task.total:,.0f}")


class _Rate(ProgressColumn):
    """Rate of parts that are done in a second, where they are many."""

    def render(self, task: Task) -> Text:
        return Text(
            f"{task.speed:,.0f}/s" if task.speed and task.speed >= 1.0 else "",
            style="progress.data.speed",
        )


@contextmanager
def progress() -> Iterator[Tell]:
    """Show on standard error what is being done, how far it is and how long it will take."""
    if not err.is_terminal or err.quiet:
        tell = Tell(None)
        try:
            yield tell
        finally:
            tell.finish()
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False, table_column=Column(ratio=1, no_wrap=True)),
        BarColumn(bar_width=16),
        _Count(table_column=Column(no_wrap=True)),
        _Rate(table_column=Column(no_wrap=True)),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True, expand=True) as bar:
        tell = Tell(bar)
        yield tell
        tell.finish()
