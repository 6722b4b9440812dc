"""What a model's laws lack, from Python: ``ppy.laws`` and what it returns."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit import Component, stack
from fmus.kit.build.toolchain import host_platform
from fmus.kit.errors import UserError
from orchestration.api.command import diagnosing
from orchestration.api.diagnosed import DiagnosisResult
from orchestration.api.diagnosis import unusable
from orchestration.api.records import Records, held_out
from orchestration.api.simulation import values_of
from orchestration.discrepancy import pipeline
from orchestration.discrepancy.corrected import ask_on
from orchestration.discrepancy.extended_model import export, fitted_defaults
from orchestration.discrepancy.laws.discovery import Correction, LawMapResult
from orchestration.discrepancy.note import UnusableRecordError
from orchestration.discrepancy.report.laws import effect_file, figures, summary, terminal, wording
from orchestration.discrepancy.report.laws.asked import Asked
from orchestration.discrepancy.report.laws.page import page
from orchestration.fmu.model import Model, find_model
from orchestration.fmu.signal import numeric
from orchestration.reporting.page import path_of_report
from orchestration.reporting.plain import plain_text, preformatted

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from rich.console import RenderableType


class LawsResult:
    """What a model's laws lack on a record, and what follows from it.

    Parameters
    ----------
    asked : Asked
    command : sequence of str
        Words of a command that asks the same.

    Attributes
    ----------
    sentence : str
        What was found, in words, with what unseen data say of it.
    law_map : list of dict
        Corrections of laws, the best first: ``effect`` (the name that `diagnose` gives it), ``law``, ``signal``,
        ``memory``, ``constant`` (s, of a lag), ``kind`` (``add`` or ``multiply``), ``delta_bic``, ``shape`` (empty
        where no simple one is as good as the curve), ``parameters``, ``curve`` (``x``, ``y``, ``low``, ``high``),
        ``units`` (of ``law`` and ``signal``), ``confirmed`` (None where unseen data were not asked), ``alike`` (what
        this record cannot tell it from); SI.
    model : type[Component] or None
        The model with the best correction, with fitted values as defaults; None where there is none.
    diagnosis : DiagnosisResult
        What was found out about the model before its laws were asked.
    """

    def __init__(self, asked: Asked, command: Sequence[str] = ()):
        self._asked, self._command = asked, shlex.join(command)
        self.sentence: str = wording.sentence(asked)
        self.law_map: list[dict[str, Any]] = summary.law_map(asked)
        self.diagnosis = DiagnosisResult(asked.result)
        last = asked.rounds[-1].best
        self.model: type[Component] | None = None if last is None else _model(asked, last)

    @property
    def details(self) -> LawMapResult | None:
        """Everything that it rests on; None where no input moves, so that nothing could be asked."""
        return self._asked.found

    def __str__(self) -> str:
        return "\n".join(plain_text(part) for part in self.overview())

    def overview(self) -> list[RenderableType]:
        """What ``ppy laws`` prints."""
        return [terminal.overview(self._asked)]

    def __repr__(self) -> str:
        best = f" {self._asked.best.entry.label}" if self._asked.best else " nothing found"
        return f"<LawsResult{best}: {self._asked.result.model.name}, {self._asked.result.files}>"

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: the form that ``ppy laws --json`` writes."""
        return summary.summary(self._asked)

    def to_frame(self) -> pandas.DataFrame:
        """Return the corrections as a table, a row for each, the best first.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        columns = ("law", "signal", "memory", "constant", "kind", "delta_bic", "shape", "confirmed")
        return pandas.DataFrame(
            [{name: row[name] for name in columns} for row in self.law_map], columns=list(columns)
        )

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the curve of the best correction with its 95 % band, and where the record has been.

        Parameters
        ----------
        path : str or Path, optional
            Picture (.png, .svg or .pdf) to write as well.

        Raises
        ------
        UserError
            If no law is found to lack anything, or the file cannot be written.
        """
        return figures.draw(self._asked, self._best("draw"), None if path is None else Path(path))

    def report(self, path: str | Path, command: str = "") -> Path:
        """Write the page to look at and pass on.

        Parameters
        ----------
        path : str or Path
            An ``.html`` file.
        command : str
            What made it, for the page; unless given, a command that asks the same.

        Raises
        ------
        UserError
            If it cannot be written, or its name does not end in ``.html``.
        """
        target = path_of_report(path)
        page(self._asked, command or self._command).write(target)
        return target

    def effect(self, path: str | Path) -> Path:
        """Write the best correction as a class of a few lines, to read, to change and to lay over the model.

        Parameters
        ----------
        path : str or Path
            A ``.py`` file.

        Raises
        ------
        UserError
            If no law is found to lack anything, or it cannot be written, or its name does not end in ``.py``.
        """
        target = Path(path)
        if target.suffix.lower() != ".py":
            raise UserError(f"{target}: the name of a file of Python ends in .py")
        self._best(f"write to {target}")
        effect_file.write(self._asked, target)
        return target

    def fmu(
        self,
        path: str | Path,
        platforms: Sequence[str] | None = None,
        progress: Callable[[str], None] = lambda text: None,
    ) -> list[Path]:
        """Write the corrected model as an FMU: the native build to the path, the Python build beside it.

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
            If no law is found to lack anything, or an FMU cannot be built or written.
        """
        if self.model is None:
            raise UserError(
                f"{path}: no law is found to lack anything, so there is nothing to make an FMU of"
            )
        result = self._asked.result
        kept = [record.source for record in (*result.records, *result.holdouts)]
        return export(self.model, Path(path), kept, platforms or [host_platform()], progress)

    def _best(self, purpose: str) -> Correction:
        if self._asked.best is None:
            raise UserError(f"no law is found to lack anything, so there is nothing to {purpose}")
        return self._asked.best


def _model(asked: Asked, best: Correction) -> type[Component]:
    """The model with a correction, with fitted values as defaults."""
    cls = best.model.candidate.cls
    made = stack(cls, name=f"{cls.name}_fitted", defaults=fitted_defaults(best.model))
    made.remark = f"Fitted to {asked.result.files!a}\n{wording.sentence(asked)}"
    return made


def laws(
    record: Records,
    model: Model | str = "ppy_actuator",
    *,
    holdout: Records | None = None,
    runs: str | None = None,
    each: Sequence[str] = (),
    effects: Sequence[str] | None = (),
    hold: Sequence[str] = (),
    settings: Mapping[str, float | str] | None = None,
    mapping: Mapping[str, str] | None = None,
    interpolate: bool | None = None,
    time: float | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> LawsResult:
    """Ask every law of a model what it lacks on a record: which signal it hangs on besides, and by which curve.

    No list of effects is needed: every law is held against every input, state and law, the time, and what is
    remembered of them. The best are fitted as curves, and held against shapes that engineers know and unseen data.

    Parameters
    ----------
    record : Record, str or Path, or sequence of these
        From `read_record`, or a file. A file whose clock restarts holds several records, numbered from 1.
    model : Model or str
        A component, ``path/to/file.py:Class``, or what `find_model` returned.
    holdout : Record, str or Path, or sequence of these, optional
        Other records to judge by, or some of those given by their labels, such as ``"7,8,9"``. Without it the last
        third of the record is held out, or the last third of several records.
    runs : str, optional
        Column of a file that tells its records apart, and labels them.
    each : sequence of str
        Parameters that differ from record to record.
    effects : sequence of str, optional
        Looked for before the laws are asked, as in `diagnose`; what is named there is part of the model that is asked.
        None unless given.
    hold : sequence of str
        Parameters that are known and not fitted.
    settings : Mapping of str to float or str, optional
        Values of parameters to start from, and of inputs that stayed at a value: SI, or texts with a unit.
    mapping : Mapping of str to str, optional
        Column of a file to signal of the model, for records that are given as files.
    interpolate : bool, optional
        Whether inputs go smoothly between samples, or are held; unless given, the record tells.
    time : float, optional
        Seconds that the search for effects may take, as in `diagnose`.
    progress : callable
        Told what is being done.

    Returns
    -------
    LawsResult

    Raises
    ------
    UserError
        If a record or the model cannot be used, or an effect or a parameter is unknown.

    Examples
    --------
    >>> import orchestration as ppy
    >>> from orchestration.rig.emulator.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "right.csv")
    >>> print(ppy.laws("right.csv").sentence)
    No law is found to lack anything.
    """
    subject = find_model(model) if isinstance(model, str) else model
    given = numeric(values_of(subject, settings))
    options = pipeline.Options(
        given=given, effects=effects, hold=hold, each=each, interpolate=interpolate, time=time
    )
    measured, judged = held_out(record, holdout, subject, mapping, runs)
    try:
        result = pipeline.judge(measured, subject, judged, options, progress)
    except UnusableRecordError as error:
        raise unusable(measured, error) from error
    found = None if result.diagnosis.inconclusive else ask_on(result.diagnosis, progress)[0]
    named = model if isinstance(model, str) else subject.name
    command = diagnosing(measured, named, judged, None, options, settings, mapping, runs, "laws")
    return LawsResult(Asked(result, found), command)
