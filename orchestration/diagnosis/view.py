"""A diagnosis as plain data: terminal and page draw it, a file keeps it."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict

from fmus.kit.titles import in_words
from orchestration.diagnosis.remainder import TESTS

Rows = tuple[tuple[str, ...], ...]
Numbers = tuple[float | None, ...]

GROUP_HEAD = ("probability", "cause", "error", "shape", "memory", "together with")
LADDER_HEAD = ("model", "error")
REMAINDER_HEAD = ("output", "error", "noise widths", "pace", *map(in_words, TESTS))
PARAMETER_HEAD = ("parameter", "value", "95 % interval", "nominal")


class View(BaseModel):
    """Plain data that is shown: texts, tables and numbers to draw."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Answer(View):
    """The answer of a diagnosis in words and tables, whose heads are those of this module.

    Attributes
    ----------
    model, verdict, headline, support, next_step : str
    is_named : bool
        Whether causes are named, and no best guesses.
    notes : tuple of str
    causes, ladder, left, parameters : tuple of tuple of str
    aliases : tuple of str
        Sentences on laws that are the causes in other words.
    error_meaning : str
    """

    model: str
    verdict: str
    headline: str
    support: str
    next_step: str
    is_named: bool
    notes: tuple[str, ...]
    causes: Rows
    aliases: tuple[str, ...]
    ladder: Rows
    left: Rows
    error_meaning: str
    parameters: Rows


class Line(View):
    """A simulated course of an output: of the model without terms, or of the final one."""

    label: str
    is_final: bool
    values: Numbers


class CourseView(View):
    """A measured output beside the models; `before` says what precedes the unseen samples."""

    output: str
    unit: str
    caption: str
    measured_as: str
    time: Numbers
    measured: Numbers
    simulated: tuple[Line, ...]
    unseen_from: float | None
    before: str


class CurveView(View):
    """The addition of a term over its signal, with values that the record reached."""

    added: str
    signal: str
    caption: str
    x: Numbers
    y: Numbers
    samples: Numbers


class Proposal(View):
    """The experiment that tells causes apart: in words, and as a file."""

    sentence: str
    toml: str


class LawRow(View):
    """The best term of a law over a signal, and what it gains, nats."""

    law: str
    signal: str
    text: str
    shape: str
    memory: str
    gain: float


class ChangesView(View):
    """Changes in a later record, a row for each value, and that record by itself."""

    before: str
    after: str
    text: str
    rows: Rows
    intervals: Rows
    verdict: str
    by_itself: str
    notes: tuple[str, ...]


class DiagnosisView(View):
    """A diagnosis as a page shows it.

    Attributes
    ----------
    answer : Answer
    files : tuple of str
        Names of the records.
    facts : Mapping of str to str
        Versions, and digests of the files.
    command : str
        That made it.
    errors : tuple of float or None
        Of the rows of the ladder.
    courses, curves : tuple
    compared : str
        How many fits were, in words.
    sets : tuple of tuple of str
        The best of them.
    experiment : Proposal or None
    changes : ChangesView or None
    laws : tuple of LawRow or None
        Of a map of laws; None without one.
    """

    answer: Answer
    files: tuple[str, ...]
    facts: Mapping[str, str]
    command: str
    errors: Numbers
    courses: tuple[CourseView, ...]
    curves: tuple[CurveView, ...]
    compared: str
    sets: Rows
    experiment: Proposal | None
    changes: ChangesView | None
    laws: tuple[LawRow, ...] | None
