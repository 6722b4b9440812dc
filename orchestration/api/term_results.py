"""Result of ``ppy.diagnose(engine="new")``: a diagnosis by terms of the laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError, files
from orchestration.api.results import (
    DiagnosisGain,
    DiagnosisResult,
    Evidence,
    ProposedExperiment,
)
from orchestration.diagnosis import Diagnosis
from orchestration.diagnosis.changes import Changed
from orchestration.diagnosis.foreign import FmuDiagnosis, corrected_system
from orchestration.diagnosis.law_map import LawMap
from orchestration.diagnosis.report import (
    Explanation,
    effect_source,
    explain,
    summary,
    terminal,
    wording,
)
from orchestration.discrepancy import Verdict
from orchestration.records import Record
from orchestration.reporting import draw, in_shell, make_page, one_line, option
from orchestration.system.ssp import write as write_ssp

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

    from orchestration.reporting.html import Page


class TermDiagnosisResult(DiagnosisResult):
    """Result of a diagnosis by terms of the laws, with the attributes of any diagnosis.

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
    causes, alternatives : list of str
        The first cause as ``LAW(SIGNAL)``, and the others of the smallest group that is sure.
    probabilities : dict of str to float
        Probability of each cause of the group, or of the best guesses.
    model : type[Component]
        The model with the terms of the first cause, or with fitted parameters alone.
    """

    def __init__(
        self,
        diagnosis: Diagnosis,
        command: Sequence[str] = (),
        changed: Changed | None = None,
        around: FmuDiagnosis | None = None,
        law_map: LawMap | None = None,
    ):
        super(DiagnosisResult, self).__init__([*diagnosis.records, *diagnosis.holdouts], command)
        self._diagnosis = diagnosis
        self._changed = changed
        self._around = around
        self._law_map = law_map
        self.verdict = Verdict(diagnosis.verdict)
        self.sentence = f"{wording.headline(diagnosis)}. {wording.support(diagnosis)}".strip()
        named = [cause.name for cause in diagnosis.causes] if diagnosis.is_named else []
        self.causes = named[:1]
        self.alternatives = named[1:]
        self.probabilities = {cause.name: float(cause.probability) for cause in diagnosis.causes}
        self.parameters = diagnosis.parameters
        self.changed = list(diagnosis.changed)
        before = diagnosis.errors(diagnosis.found.base)
        after = diagnosis.errors(diagnosis.final)
        self.gain = DiagnosisGain(_known(before), _known(after))
        self.model = diagnosis.component
        self.experiment = (
            ProposedExperiment(diagnosis.experiment, diagnosis.model.name)
            if diagnosis.experiment
            else None
        )
        self.record: Record = diagnosis.records[0]
        self.records = list(diagnosis.records)
        self.notes = [message for _, _, message in diagnosis.notes]
        self.evidence = Evidence(())
        self.law_map = [] if law_map is None else summary.law_figures(law_map)
        self.changes = None if changed is None else list(changed.changes)
        self.later = None if changed is None else TermDiagnosisResult(changed.later)

    @property
    def details(self) -> Any:
        """The complete diagnosis, with all fits."""
        return self._diagnosis

    def overview(self) -> list[RenderableType]:
        """Return the renderables that ``ppy diagnose --engine new`` prints."""
        parts: list[RenderableType] = [terminal.overview(self._diagnosis)]
        if self._changed is not None:
            parts.append(terminal.comparison(self._changed))
        if self._law_map is not None:
            parts.append(terminal.laws(self._law_map))
        return parts

    def _page(self, command: str) -> Page:
        return make_page(self._changed or self._law_map or self._diagnosis, command)

    def __repr__(self) -> str:
        causes = f" {', '.join([*self.causes, *self.alternatives])}" if self.causes else ""
        files = ", ".join(dict.fromkeys(record.source.name for record in self.records))
        name = self._diagnosis.model.name
        return one_line(f"TermDiagnosisResult {self.verdict}{causes}: {name}, {files}")

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: the form that ``ppy diagnose --json`` writes."""
        with in_shell():
            figures = summary.summary(self._diagnosis)
        if self._law_map is not None:
            figures |= {"law_map": self.law_map}
        if self.changes is None or self.later is None:
            return figures
        comparison = [change.to_dict() for change in self.changes]
        return figures | {"comparison": comparison, "later": self.later.to_dict()}

    def explain(self, first: str, second: str) -> Explanation:
        """Compare two candidates by the features that decide; see `DiagnosisResult.explain`."""
        return explain(self._diagnosis, first, second)

    def draw(self) -> Figure:
        """Draw what was left out of the output whose error falls most, above the residuals.

        Of `laws`, draw what is added to a law over its signal.

        Raises
        ------
        UserError
            If `laws` found no law to lack a function of a signal.
        """
        return draw(self._law_map or self._diagnosis)

    def fmu(
        self,
        path: str | Path,
        platforms: Sequence[str] | None = None,
        progress: Callable[[str], None] = lambda text: None,
    ) -> list[Path]:
        """Write `model` as an FMU; see `DiagnosisResult.fmu`.

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
        return super().fmu(path, platforms, progress)

    def effect(self, path: str | Path) -> Path:
        """Write the terms of the first cause as classes; see `DiagnosisResult.effect`."""
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
        """Write an FMU without equations and its correction; see `DiagnosisResult.system`."""
        if self._around is None:
            return super().system(path)
        write_ssp(corrected_system(self._around), Path(path))
        return Path(path)


def _known(errors: dict[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in errors.items() if value is not None}
