"""What ``ppy.diagnose`` returns."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fmus.kit import Component
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.api.proposal import ProposedExperiment
from orchestration.discrepancy import pipeline
from orchestration.discrepancy.changes import Change
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.extended_model import export
from orchestration.discrepancy.foreign.surrounding import Surrounded
from orchestration.discrepancy.foreign.system import corrected
from orchestration.discrepancy.report import picture, terminal, wording
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.headline import headline
from orchestration.discrepancy.report.laws.summary import law_map
from orchestration.discrepancy.report.page import page
from orchestration.discrepancy.report.summary import summary
from orchestration.identify.estimate import Estimate
from orchestration.records import Record
from orchestration.reporting.page import path_of_report
from orchestration.reporting.plain import plain_text, preformatted
from orchestration.system.ssp.writing import write as write_ssp

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType


class Gain(NamedTuple):
    """Normalised RMS error on data that no fit has seen, by output: of the refitted model, and of the extended one."""

    before: dict[str, float]
    after: dict[str, float]


class DiagnosisResult:
    """What a model gets wrong on a record, and what follows from it.

    Parameters
    ----------
    result : pipeline.Result
    changes : list of Change, optional
    later : pipeline.Result, optional
        Diagnosis of the later record, in which they were found.
    command : sequence of str
        Words of a command that makes the same diagnosis.
    around : Surrounded, optional
        Of an FMU without equations, behind which a component was diagnosed.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``recalibrate``, ``cause``, ``ambiguous`` or ``unexplained``.
    sentence : str
        The verdict in words, with what must be known to read it.
    causes, alternatives : list of str
        Effects that were named, and those that this record cannot tell from them.
    parameters : dict of str to Estimate
        By name: ``value``, ``interval`` (95 %), ``nominal``, ``unit``; SI.
    changed : list of str
        Parameters that differ significantly from nominal.
    gain : Gain
        Errors on data that no fit has seen.
    model : type[Component] or None
        The extended model, with fitted values as defaults; None where nothing could be said.
    experiment : ProposedExperiment or None
        Where the verdict is ambiguous.
    record : Record
        The first of the records.
    records : list of Record
        All that the model was fitted to.
    notes : list of str
        What could not be judged, and why.
    changes : list of Change or None
        What changed in a later record, where one was given.
    later : DiagnosisResult or None
        What the model gets wrong on that record.
    law_map : list of dict
        What the laws lack, the best first, as in `LawsResult`; empty where nothing is left, or they were not asked.
    """

    def __init__(
        self,
        result: pipeline.Result,
        changes: Sequence[Change] | None = None,
        later: pipeline.Result | None = None,
        command: Sequence[str] = (),
        around: Surrounded | None = None,
    ):
        self._result, self._command, self._around = result, shlex.join(command), around
        self.later: DiagnosisResult | None = None if later is None else DiagnosisResult(later)
        self.changes: list[Change] | None = None if changes is None else list(changes)
        diagnosis = result.diagnosis
        errors = result.gain or diagnosis
        steps = diagnosis.selection.steps
        self.verdict: Verdict = diagnosis.verdict
        self.sentence: str = headline(result)
        self.causes: list[str] = diagnosis.causes
        self.alternatives: list[str] = [e.effect_name for step in steps for e in step.alternatives]
        self.parameters: dict[str, Estimate] = diagnosis.estimates
        self.changed: list[str] = diagnosis.changed
        self.gain = Gain(errors.before, errors.after)
        self.model: type[Component] | None = result.component
        self.experiment = (
            ProposedExperiment(result.experiment, result.model.name) if result.experiment else None
        )
        self.record: Record = result.record
        self.records: list[Record] = list(result.records)
        self.notes: list[str] = [wording.message(note) for note in result.notes]
        self.law_map: list[dict[str, Any]] = law_map(Asked(result, result.laws))

    @property
    def details(self) -> pipeline.Result:
        """Everything that the diagnosis rests on."""
        return self._result

    def __str__(self) -> str:
        return "\n".join(plain_text(part) for part in self.overview())

    def overview(self) -> list[RenderableType]:
        """What ``ppy diagnose`` prints."""
        parts: list[RenderableType] = [terminal.overview(self._result)]
        if self.changes is not None and self.later is not None:
            parts.append(terminal.comparison(self.changes, self.later.details))
        return parts

    def __repr__(self) -> str:
        causes = f" {', '.join(self.causes)}" if self.causes else ""
        return f"<DiagnosisResult {self.verdict}{causes}: {self._result.model.name}, {self._result.files}>"

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: the form that ``ppy diagnose --json`` writes."""
        figures = summary(self._result)
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
        import pandas

        rows = {
            name: {
                "value": e.value,
                "low": e.interval[0],
                "high": e.interval[1],
                "nominal": e.nominal,
                "unit": e.unit,
            }
            for name, e in self.parameters.items()
        }
        return pandas.DataFrame.from_dict(rows, orient="index")

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the output that gained most over the validation data: measured, refitted, extended, and residuals.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        return picture.draw(
            self._result.diagnosis, self._result.model, None if path is None else Path(path)
        )

    def report(self, path: str | Path, command: str = "") -> Path:
        """Write the page to look at and pass on.

        Parameters
        ----------
        path : str or Path
            An ``.html`` file.
        command : str
            What made it, for the page; unless given, a command that makes the same diagnosis.

        Raises
        ------
        UserError
            If it cannot be written, or its name does not end in ``.html``.
        """
        target = path_of_report(path)
        later = self.later.details if self.later else None
        page(self._result, command or self._command, self.changes or (), later).write(target)
        return target

    def fmu(
        self,
        path: str | Path,
        platforms: Sequence[str] | None = None,
        progress: Callable[[str], None] = lambda text: None,
    ) -> list[Path]:
        """Write the extended model as an FMU: the native build to the path, the Python build beside it.

        Parameters
        ----------
        path : str or Path
            ``F.fmu``; the Python build goes to ``F.python.fmu``.
        platforms : sequence of str, optional
            FMI platforms; default this machine's.
        progress : callable
            Told what is being done.

        Raises
        ------
        UserError
            If nothing could be said of the model, or an FMU cannot be built or written.
        """
        if self.model is None:
            raise UserError(
                f"{path}: nothing could be said of the model, so there is nothing to make an FMU of"
            )
        kept = [record.source for record in (*self._result.records, *self._result.holdouts)]
        return export(self.model, Path(path), kept, platforms or [host_platform()], progress)

    def system(self, path: str | Path) -> Path:
        """Write an FMU without equations and its correction as one system.

        Parameters
        ----------
        path : str or Path
            ``S.ssp``.

        Raises
        ------
        UserError
            If nothing could be said of the FMU, it has equations, or the file cannot be written.
        """
        if self._around is None:
            raise UserError(
                f"{path}: the model has equations; the extended one is an FMU of its own (fmu)"
            )
        if self.model is None:
            raise UserError(
                f"{path}: nothing could be said of the FMU, so there is nothing to correct it by"
            )
        write_ssp(corrected(self._around, self.model), Path(path))
        return Path(path)
