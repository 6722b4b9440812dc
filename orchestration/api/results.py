"""Results of ``ppy.diagnose`` and ``ppy.laws``: values, tables, pictures, pages and FMUs."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kit import Component, UserError, files
from fmus.kit.build import host_platform
from orchestration.discrepancy import Verdict, export, pipeline
from orchestration.discrepancy.report import (
    TriedEffect,
    diagnosis_page,
    diagnosis_summary,
    picture,
    terminal,
    tried_effects,
    wording,
)
from orchestration.experiment.design import DiscriminatingExperiment
from orchestration.identify.changes import Change
from orchestration.identify.uncertainty import Estimate, estimates_frame
from orchestration.records import Record
from orchestration.reporting import (
    Displayable,
    in_shell,
    one_line,
    option,
    pictures,
    plain_table,
)
from orchestration.reporting.html import path_of_report

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from orchestration.diagnosis.report import Explanation
    from orchestration.reporting.html import Page


@dataclass(frozen=True)
class ProposedExperiment(Displayable):
    """Proposal of an experiment that discriminates between causes.

    Attributes
    ----------
    design : DiscriminatingExperiment
        Stimuli by input, duration, step and the expected evidence.
    component : str
        Component of the experiment.
    """

    design: DiscriminatingExperiment
    component: str

    def overview(self) -> Iterator[RenderableType]:
        """Yield a description of the stimuli and of the expected evidence."""
        yield self.design.sentence

    def __repr__(self) -> str:
        kinds = ", ".join(
            f"{name}: {stimulus.kind}" for name, stimulus in self.design.stimuli.items()
        )
        return one_line(f"ProposedExperiment {kinds}; {self.design.duration:g} s")

    def to_frame(self) -> pandas.DataFrame:
        """Return the stimuli as a table over time, SI.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        points = np.arange(0.0, self.design.duration, self.design.step)
        stimuli = {name: one.values(points) for name, one in self.design.stimuli.items()}
        return pandas.DataFrame(stimuli, index=pandas.Index(points, name="time"))

    def draw(self) -> Figure:
        """Draw the stimuli over time."""
        stimuli = self.to_frame()
        figure, axes = pictures.panels(len(stimuli.columns), "proposed experiment")
        units = self.design.rehearsal.units
        for axis, (name, values) in zip(axes, stimuli.items(), strict=True):
            axis.plot(stimuli.index, values, color=pictures.MODEL, drawstyle="steps-post")
            pictures.fit_values(axis)
            pictures.label(axis, str(name), units[str(name)])
        return figure

    def toml(self) -> str:
        """Return the experiment as TOML for ``ppy run``."""
        return self.design.toml(self.component, str(self))

    def to_toml(self, path: str | Path) -> Path:
        """Write the experiment as TOML for ``ppy run``.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        files.write(Path(path), self.toml().encode())
        return Path(path)


class DiagnosisGain(NamedTuple):
    """Normalised RMS errors on validation data, by output.

    Attributes
    ----------
    before, after : dict of str to float
        Errors of the refitted model, and of the extended one.
    """

    before: dict[str, float]
    after: dict[str, float]


@dataclass(frozen=True)
class Evidence(Displayable):
    """Evidence for and against every effect that was tried, first those that are named.

    Attributes
    ----------
    tried : tuple of TriedEffect
    """

    tried: tuple[TriedEffect, ...]

    def __repr__(self) -> str:
        named = ", ".join(f"{row.candidate.effect_name} {row.verdict}" for row in self.tried[:3])
        return one_line(f"Evidence for {len(self.tried)} tried: {named or 'nothing'}")

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of all effects that were tried."""
        if not self.tried:
            yield "no effect was tried"
            return
        table = plain_table("evidence", "effect", "fall of BIC", "verdict", "")
        for row in self.tried:
            table.add_row(row.candidate.effect_name, f"{row.gain:.1f}", row.verdict, row.reason)
        yield table

    def to_frame(self) -> pandas.DataFrame:
        """Return the evidence as a table, a row for each effect.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        columns = ["effect", "delta_bic", "p_value", "verdict", "reason"]
        rows = [
            (row.candidate.effect_name, row.gain, row.p_value, row.verdict, row.reason)
            for row in self.tried
        ]
        return pandas.DataFrame(rows, columns=columns).set_index("effect")

    def draw(self) -> Figure:
        """Draw the fall of BIC with every effect, with those that are named in another colour.

        Raises
        ------
        UserError
            If nothing was tried.
        """
        if not self.tried:
            raise UserError("no effect was tried, so there is nothing to draw")
        rows = [row for row in reversed(self.tried) if np.isfinite(row.gain)]
        height = 0.6 + 0.22 * len(rows)
        figure, (axis,) = pictures.panels(1, "evidence for each effect", "fall of BIC [1]", height)
        colours = [pictures.FITTED if row.verdict == "named" else pictures.MODEL for row in rows]
        axis.barh(range(len(rows)), [row.gain for row in rows], color=colours)
        names = [row.candidate.effect_name.replace("_", " ") for row in rows]
        axis.set_yticks(range(len(rows)), names)
        return figure


class _Result(Displayable):
    """Base of results that print as their command does, with a page and a model to build."""

    _LACKING = ""  # why there is no model to build, for messages

    model: type[Component] | None

    def __init__(self, records: Sequence[Record], command: Sequence[str]):
        self._sources = [record.source for record in records]
        self._command = shlex.join(command)

    def overview(self) -> list[RenderableType]:
        """Return the renderables that the command prints."""
        raise NotImplementedError

    def _page(self, command: str) -> Page:
        """Return the page of the result, with the command that made it."""
        raise NotImplementedError

    def report(self, path: str | Path, command: str = "") -> Path:
        """Write the result as a page of HTML.

        Parameters
        ----------
        path : str or Path
            An ``.html`` file.
        command : str
            Command that made the result, for the page; by default an equivalent one.

        Raises
        ------
        UserError
            If the page cannot be written, or its name does not end in ``.html``.
        """
        target = path_of_report(path)
        with in_shell():  # as from the command, which the page shows
            self._page(command or self._command).write(target)
        return target

    def fmu(
        self,
        path: str | Path,
        platforms: Sequence[str] | None = None,
        progress: Callable[[str], None] = lambda text: None,
    ) -> list[Path]:
        """Write `model` as an FMU: a native build, and a Python build in the same folder.

        Parameters
        ----------
        path : str or Path
            ``F.fmu`` for the native build; the Python build is ``F.python.fmu``.
        platforms : sequence of str, optional
            FMI platforms; default this machine's.
        progress : callable
            Called with a text about each step of the work.

        Raises
        ------
        UserError
            If there is no model, or an FMU cannot be built or written.
        """
        if self.model is None:
            raise UserError(f"{path}: {self._LACKING}, so there is nothing to make an FMU of")
        targets = platforms or [host_platform()]
        return export(self.model, Path(path), self._sources, targets, progress)


class DiagnosisResult(_Result):
    """Result of a diagnosis: the causes of a model's error on a record, and the extended model.

    Parameters
    ----------
    result : pipeline.Result
    changes : list of Change, optional
    later : pipeline.Result, optional
        Diagnosis of the later record, in which the changes were found.
    command : sequence of str
        Words of an equivalent command.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``recalibrate``, ``cause``, ``ambiguous`` or ``unexplained``.
    sentence : str
        The verdict in words, with its conditions.
    causes, alternatives : list of str
        Effects that are named, and those that this record cannot distinguish from them.
    parameters : dict of str to Estimate
        By name: ``value``, ``interval`` (95 %), ``nominal``, ``unit``; SI.
    changed : list of str
        Parameters that differ significantly from nominal.
    gain : DiagnosisGain
        Errors on validation data.
    model : type[Component] or None
        The extended model, with fitted values as defaults; None if the diagnosis is inconclusive.
    experiment : ProposedExperiment or None
        Experiment that discriminates between causes; None unless the verdict is ambiguous, or
        with the new engine unexplained with several guesses.
    record : Record
        The first of the records.
    records : list of Record
        All records of the estimation data.
    notes : list of str
        Remarks on parts of the record or model that could not be judged.
    evidence : Evidence
        Evidence for and against every effect that was tried.
    changes : list of Change or None
        Changes in the later record; None without one.
    later : DiagnosisResult or None
        Diagnosis of the later record.
    law_map : list of dict
        Of `laws`: what each law gains over each signal, the most first, with ``effect`` (the name
        of the cause), ``law``, ``signal``, ``memory``, ``factor``, ``shape`` and ``gain`` (nats);
        of a term of the first cause also ``curve`` (``x``, ``y``) and ``units``. Else empty.
    """

    _LACKING = "nothing could be said of the model"

    def __init__(
        self,
        result: pipeline.Result,
        changes: Sequence[Change] | None = None,
        later: pipeline.Result | None = None,
        command: Sequence[str] = (),
    ):
        super().__init__([*result.records, *result.holdouts], command)
        self._result = result
        self.later: DiagnosisResult | None = None if later is None else DiagnosisResult(later)
        self.changes: list[Change] | None = None if changes is None else list(changes)
        diagnosis = result.diagnosis
        errors = result.gain or diagnosis
        self.verdict: Verdict = diagnosis.verdict
        self.sentence: str = str(wording.headline(result))
        self.causes: list[str] = diagnosis.causes
        self.alternatives: list[str] = diagnosis.alternatives
        self.parameters: dict[str, Estimate] = diagnosis.estimates
        self.changed: list[str] = diagnosis.changed
        self.gain = DiagnosisGain(errors.before, errors.after)
        self.model = result.component
        self.experiment = (
            ProposedExperiment(result.experiment, result.model.name) if result.experiment else None
        )
        self.record: Record = result.record
        self.records: list[Record] = list(result.records)
        self.notes: list[str] = [wording.message(note) for note in result.notes]
        self.evidence = Evidence(tuple(tried_effects(diagnosis)))
        self.law_map: list[dict[str, Any]] = []

    @property
    def details(self) -> pipeline.Result:
        """The complete result of the pipeline."""
        return self._result

    def overview(self) -> list[RenderableType]:
        """Return the renderables that ``ppy diagnose`` prints."""
        parts: list[RenderableType] = [terminal.overview(self._result)]
        if self.changes is not None and self.later is not None:
            parts.append(terminal.comparison(self.changes, self.later.details))
        return parts

    def _page(self, command: str) -> Page:
        later = self.later.details if self.later else None
        return diagnosis_page(self._result, command, self.changes or (), later)

    def __repr__(self) -> str:
        causes = f" {', '.join(self.causes)}" if self.causes else ""
        return one_line(
            f"DiagnosisResult {self.verdict}{causes}: {self._result.model.name},"
            f" {self._result.files}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: the form that ``ppy diagnose --json`` writes."""
        with in_shell():
            figures = diagnosis_summary(self._result)
        if self.changes is not None and self.later is not None:
            figures |= {
                "comparison": [change.to_dict() for change in self.changes],
                "later": self.later.to_dict(),
            }
        return figures

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table, a row for each.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return estimates_frame(self.parameters)

    def draw(self) -> Figure:
        """Draw the output with the largest gain over the validation data, with residuals.

        The measured output is drawn with those of the refitted and the extended model.
        """
        return picture.draw_diagnosis(self._result.diagnosis, self._result.model)

    def explain(self, first: str, second: str) -> Explanation:
        """Compare two candidates of the new engine by the features that decide.

        Parameters
        ----------
        first, second : str
            ``LAW(SIGNAL)``, such as ``friction(velocity)``, or ``nothing`` for the model without
            terms. One that no set had is fitted now.

        Raises
        ------
        UserError
            If the diagnosis is of the old engine, there is no such law or signal, or both are the
            same.
        """
        raise UserError(
            f"{option('explain', [first, second])}: this compares candidates of the new engine; add"
            f" {option('engine', 'new')}"
        )

    def effect(self, path: str | Path) -> Path:
        """Write what the first cause adds to laws as short classes of effects.

        Parameters
        ----------
        path : str or Path
            A ``.py`` file.

        Raises
        ------
        UserError
            If no law lacks anything, a term of the cause cannot be a class of its own, the file
            cannot be written, or its name does not end in ``.py``.
        """
        raise UserError(f"{path}: {self._LACKING}, so there is nothing to write")

    def system(self, path: str | Path) -> Path:
        """Write an FMU without equations and its correction as one system.

        Parameters
        ----------
        path : str or Path
            File ``S.ssp``.

        Raises
        ------
        UserError
            If the model has equations, or the file cannot be written.
        """
        raise UserError(
            f"{path}: the model has equations; the extended one is an FMU of its own"
            f" ({option('fmu')})"
        )
