"""Results of ``ppy.diagnose`` and ``ppy.laws``: values, tables, pictures, pages and FMUs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from fmus.kit import Component, UserError, files, quoting
from fmus.kit.build import host_platform
from orchestration.api.builds import export
from orchestration.diagnosis import Diagnosis, DiagnosisView
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.foreign import FmuDiagnosis, corrected_system
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.report import (
    Explanation,
    TriedSet,
    answer_of,
    changes_view,
    effect_source,
    explain,
    law_rows,
    summary,
    terminal,
    tried_sets,
    view_of,
    wording,
)
from orchestration.diagnosis.systems import SystemView
from orchestration.experiment.design import DiscriminatingExperiment
from orchestration.identify.changes import Change
from orchestration.identify.uncertainty import Estimate, estimates_frame
from orchestration.records import Record
from orchestration.reporting import (
    Displayable,
    draw,
    in_shell,
    make_page,
    one_line,
    option,
    pictures,
    plain_table,
    saving,
)
from orchestration.reporting.html import Page
from orchestration.system.ssp import write as write_ssp

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType

_DRAWN = 12  # sets of terms


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
    """Evidence for every set of terms and readings that was fitted, the best first.

    Attributes
    ----------
    tried : tuple of TriedSet
    """

    tried: tuple[TriedSet, ...]

    def __repr__(self) -> str:
        best = f", the best {self.tried[0].parts}" if self.tried else ""
        return one_line(f"Evidence for {len(self.tried)} sets of terms{best}")

    def overview(self) -> Iterator[RenderableType]:
        """Yield a table of all sets that were fitted."""
        if not self.tried:
            yield "no set of terms was fitted"
            return
        head = ("terms", "gain on fitted samples [nat]", "on unseen ones", "score")
        table = plain_table("evidence", *head)
        for row in self.tried:
            nats = (row.fitted, row.left_out, row.score)
            table.add_row(row.parts, *(f"{value:.1f}" for value in nats))
        yield table

    def to_frame(self) -> pandas.DataFrame:
        """Return the evidence as a table, a row for each set of terms.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        columns = ["terms", "fitted", "left_out", "score", "error"]
        rows = [(r.parts, r.fitted, r.left_out, r.score, r.error) for r in self.tried]
        return pandas.DataFrame(rows, columns=columns).set_index("terms")

    def draw(self) -> Figure:
        """Draw the scores of the best sets.

        Raises
        ------
        UserError
            If nothing was tried.
        """
        if not self.tried:
            raise UserError("no set of terms was fitted, so there is nothing to draw")
        rows = [*reversed(self.tried[:_DRAWN])]
        height = 0.6 + 0.22 * len(rows)
        figure, (axis,) = pictures.panels(1, "evidence for sets of terms", "score [nat]", height)
        axis.barh(range(len(rows)), [row.score for row in rows], color=pictures.MODEL)
        pictures.name_ticks(axis.yaxis, range(len(rows)), [row.parts for row in rows])
        return figure


class Diagnosed(Displayable):
    """Result of a diagnosis, of a model or of a system: parameters and a page.

    Parameters
    ----------
    command : sequence of str or Path
        Words of an equivalent command.
    """

    parameters: dict[str, Estimate]

    def __init__(self, command: Sequence[str | Path]):
        self._command = quoting.shell(command)
        self._written: Mapping[str, str] = {}

    def as_typed(self, command: str, written: Mapping[str, str]) -> Self:
        """Return the result of a command as it was typed.

        Parameters
        ----------
        command : str
        written : Mapping of str to str
            Files that it writes, by option, which are not advised then.
        """
        typed = copy(self)
        typed._command = command
        typed._written = written
        return typed

    def to_frame(self) -> pandas.DataFrame:
        """Return the parameters as a table, a row for each.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return estimates_frame(self.parameters)

    def page(self, command: str = "") -> Page:
        """Return the page of HTML, for a command that made the result."""
        return make_page(self._view(command or self._command))

    def _kept(self) -> dict[str, Any]:
        return self.to_dict()

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON, in the form of ``ppy diagnose --json``."""
        return saving.stamped(self.figures(), self._view(self._command))

    def figures(self) -> dict[str, Any]:
        """Return the figures alone, ready for JSON."""
        raise NotImplementedError

    def _view(self, command: str) -> DiagnosisView | SystemView:
        """Return what the page shows."""
        raise NotImplementedError


make_page.register(Diagnosed)(Diagnosed.page)


class DiagnosisResult(Diagnosed):
    """Result of a diagnosis: the causes of a model's error on a record, and the extended model.

    Parameters
    ----------
    diagnosis : Diagnosis
    command : sequence of str
        Words of an equivalent command.
    changed : Changed, optional
        What changed in a later record.
    around : FmuDiagnosis, optional
        If the model is an FMU without equations.
    law_map : LawMap, optional
        What each law gains over each signal.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``recalibrate``, ``cause``, ``ambiguous`` or ``unexplained``.
    sentence : str
        The verdict in words, with its conditions.
    causes, alternatives : list of str
        The first cause, as the name of an effect or ``LAW(SIGNAL)``, and the others of the smallest
        group that is sure.
    probabilities : dict of str to float
        Probability of each cause of the group, or of the best guesses.
    parameters : dict of str to Estimate
        By name: ``value``, ``interval`` (95 %), ``nominal``, ``unit``; SI.
    changed : list of str
        Parameters that differ significantly from nominal.
    gain : DiagnosisGain
        Errors on validation data.
    model : type[Component]
        The model with the terms of the first cause, or with fitted parameters alone.
    experiment : ProposedExperiment or None
        Experiment that discriminates between causes, or best guesses.
    record : Record
        The first of the records.
    records : list of Record
        All records of the estimation data.
    notes : list of str
        Remarks on parts of the record or model that could not be judged.
    evidence : Evidence
        Evidence for every set of terms that was fitted.
    changes : list of Change or None
        Changes in the later record, the last of several; None without one.
    history : dict of str to list of Change
        Changes in every later record, in time, by the path of its file.
    later : DiagnosisResult or None
        Diagnosis of the later record, the last of several.
    law_map : list of dict
        What each law gains over each signal, the best first; of `laws`.
    """

    def __init__(
        self,
        diagnosis: Diagnosis,
        command: Sequence[str | Path] = (),
        changed: Changed | None = None,
        around: FmuDiagnosis | None = None,
        law_map: LawMap | None = None,
    ):
        super().__init__(command)
        self._sources = [one.source for one in (*diagnosis.records, *diagnosis.holdouts)]
        self._diagnosis = diagnosis
        self._changed = changed
        self._around = around
        self._law_map = law_map
        self.verdict: str = diagnosis.verdict
        self.sentence = wording.answer(diagnosis)
        named = [cause.name for cause in diagnosis.causes] if diagnosis.is_named else []
        self.causes: list[str] = named[:1]
        self.alternatives: list[str] = named[1:]
        self.probabilities = {cause.name: float(cause.probability) for cause in diagnosis.causes}
        self.parameters = diagnosis.parameters
        self.changed: list[str] = list(diagnosis.changed)
        errors = (diagnosis.errors_before, diagnosis.errors_after)
        self.gain = DiagnosisGain(*map(_known, errors))
        self.model: type[Component] = diagnosis.component
        self.experiment = (
            ProposedExperiment(diagnosis.experiment, diagnosis.model.name)
            if diagnosis.experiment
            else None
        )
        self.record: Record = diagnosis.records[0]
        self.records: list[Record] = list(diagnosis.records)
        self.notes: list[str] = [message for _, _, message in diagnosis.notes]
        self.law_map: list[dict[str, Any]] = [] if law_map is None else summary.law_figures(law_map)
        self.changes: list[Change] | None = None if changed is None else list(changed.changes)
        self.later = None if changed is None else DiagnosisResult(changed.later)
        self.history: dict[str, list[Change]] = {
            str(one.later.records[0].source): list(one.changes)
            for one in (changed.in_time if changed else ())
        }

    @property
    def is_interrupted(self) -> bool:
        """True if Ctrl-C ended the search, so that it is the best answer so far."""
        return self._diagnosis.is_interrupted

    @property
    def details(self) -> Diagnosis:
        """The complete diagnosis, with all fits."""
        return self._diagnosis

    @property
    def evidence(self) -> Evidence:
        """Evidence for every set of terms that was fitted."""
        return Evidence(tuple(tried_sets(self._diagnosis)))

    def overview(self) -> list[RenderableType]:
        """Return the renderables that the command prints."""
        changes = None if self._changed is None else changes_view(self._changed)
        rows = None if self._law_map is None else [*law_rows(self._law_map)]
        return terminal.parts(answer_of(self._diagnosis, self._written), changes, rows)

    def __repr__(self) -> str:
        causes = f" {', '.join([*self.causes, *self.alternatives])}" if self.causes else ""
        names = ", ".join(dict.fromkeys(record.source.name for record in self.records))
        name = self._diagnosis.model.name
        return one_line(f"DiagnosisResult {self.verdict}{causes}: {name}, {names}")

    def figures(self) -> dict[str, Any]:
        """Return the figures alone, ready for JSON."""
        figures = summary.summary(self._diagnosis, self._written)
        if self._law_map is not None:
            figures |= {"law_map": self.law_map}
        if self.changes is None or self.later is None:
            return figures
        comparison = [change.to_dict() for change in self.changes]
        figures |= {"comparison": comparison, "later": self.later.figures()}
        if len(self.history) > 1:
            figures["history"] = [
                {"file": file, "comparison": [change.to_dict() for change in changes]}
                for file, changes in self.history.items()
            ]
        return figures

    def _view(self, command: str) -> DiagnosisView:
        shown = self._changed or self._law_map or self._diagnosis
        return view_of(shown, command, self._written)

    def draw(self) -> Figure:
        """Draw the validation data of the output whose error falls most, above the residuals.

        The result of `laws` draws what the terms of the first cause add to a law over its signal.

        Raises
        ------
        UserError
            If `laws` found no law to lack a function of a signal.
        """
        return draw(self._law_map or self._diagnosis)

    def explain(self, first: str, second: str) -> Explanation:
        """Compare two candidates by the features that decide.

        Parameters
        ----------
        first, second : str
            ``LAW(SIGNAL)``, such as ``friction(velocity)``, or ``nothing`` for the model without
            terms. One that no set had is fitted now.

        Raises
        ------
        UserError
            If there is no such law or signal, or both are the same.
        """
        return explain(self._diagnosis, first, second)

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
            If the model has no equations, or an FMU cannot be built or written.
        """
        if self._around is not None:
            raise UserError(
                f"{path}: {self._around.fmu.without_equations}; with its correction it is a system"
                f" ({option('ssp')})"
            )
        targets = platforms or [host_platform()]
        return export(self.model, Path(path), self._sources, targets, progress)

    def effect(self, path: str | Path) -> Path:
        """Write the terms of the first cause as classes of effects.

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
        target = Path(path)
        if target.suffix.lower() != ".py":
            raise UserError(f"{target}: the name of a file of Python ends in .py")
        diagnosis = self._diagnosis
        names = ", ".join(dict.fromkeys(record.source.name for record in diagnosis.records))
        with in_shell():
            text = effect_source(diagnosis.final.fit, diagnosis.terms, names)
        files.write(target, text.encode())
        return target

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
        if self._around is None:
            raise UserError(
                f"{path}: the model has equations; the extended one is an FMU of its own"
                f" ({option('fmu')})"
            )
        write_ssp(corrected_system(self._around), Path(path))
        return Path(path)


def _known(errors: dict[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in errors.items() if value is not None}
