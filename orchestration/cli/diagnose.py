"""What ``ppy diagnose`` reads, shows and writes."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.api.diagnosis import DiagnosisResult, diagnose
from orchestration.api.records import read_record
from orchestration.cli.models import model_file, note_neutral, open_model
from orchestration.cli.outputs import JSON, PAGE, Outputs, same_file, write_json
from orchestration.discrepancy.extended_model import destinations
from orchestration.discrepancy.report import terminal
from orchestration.records import parse_mapping
from orchestration.reporting.console import note, out, progress, tell_repairs, wrote


@dataclass(frozen=True)
class Files:
    """What is read and written.

    Attributes
    ----------
    record : Path
    holdout : Path, optional
        Another record to judge by.
    result, report, fmu, experiment : Path, optional
        JSON, HTML, FMU and TOML to write.
    platforms : sequence of str, optional
        FMI platforms to build the FMU for; default is every one that a compiler here can serve.
    """

    record: Path
    holdout: Path | None = None
    result: Path | None = None
    report: Path | None = None
    fmu: Path | None = None
    experiment: Path | None = None
    platforms: Sequence[str] | None = None

    def check(self, sources: Sequence[Path] = ()) -> None:
        """Refuse, before any work is done, names under which nothing can be written or something would be lost.

        Parameters
        ----------
        sources : sequence of Path
            Files of the model.

        Raises
        ------
        UserError
        """
        read = {"the record": self.record, "the record held out": self.holdout}
        read |= {f"the {'FMU' if place.suffix == '.fmu' else 'file'} of --model": place for place in sources}
        written = {"--json": self.result, "--report": self.report, "--experiment": self.experiment}
        if self.fmu is not None:
            written |= {f"--fmu ({kind})": p for kind, p in destinations(self.fmu, ()).items()}
        Outputs(read, written, {"--json": JSON, "--report": PAGE, "--experiment": (".toml",)}).check()
        if self.holdout is not None and same_file(self.record, self.holdout):
            raise UserError(f"--holdout {self.holdout}: this is the record itself; nothing would be held out")


def run(
    files: Files, name: str, mapping: Sequence[str], settings: Sequence[str], considered: Sequence[str] | None,
    command: Sequence[str], hold: Sequence[str] = (), interpolate: bool | None = None, effects: Sequence[str] = (),
    time: float | None = None,
) -> DiagnosisResult:  # fmt: skip
    """Do ``ppy diagnose``; the command is repeated in the report.

    Parameters
    ----------
    files : Files
    name : str
        Of the model.
    mapping, settings : sequence of str
    considered : sequence of str, optional
        Effects that may be named; all of the catalogue unless given.
    command : sequence of str
    hold : sequence of str
        Parameters that are not fitted.
    interpolate : bool, optional
        Whether inputs go linearly between samples, or are held; unless given, the record tells.
    effects : sequence of str
        Laid over the model before it is judged.
    time : float, optional
        Seconds that the search may take.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be written.
    """
    files.check([file] if (file := model_file(name)) else [])
    model = open_model(name, effects=effects)
    note_neutral(model, [text.partition("=")[0].strip() for text in settings])
    renamed = parse_mapping(mapping)
    record, holdout = read_record(files.record, model, renamed), None
    tell_repairs(record.repairs)
    if files.holdout is not None:
        holdout = read_record(files.holdout, model, renamed)
        tell_repairs([replace(r, message=f"{files.holdout.name}: {r.message}") for r in holdout.repairs])
    with progress() as tell:
        result = diagnose(
            record, model, holdout=holdout, effects=considered, hold=hold,
            settings=dict(_setting(text) for text in settings), interpolate=interpolate, time=time,
            progress=tell,
        )  # fmt: skip
    out.print(terminal.overview(result.details))
    write_json(files.result, result.to_dict())
    failures: list[Exception] = []
    with progress() as tell:
        made = list(_written(result, files, shlex.join(command), tell, failures.append))
    for path in made:
        wrote(path)
    if failures:
        raise failures[0]
    return result


def _setting(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
    return name.strip(), value.strip()


def _written(
    result: DiagnosisResult, files: Files, command: str, tell: Callable[[str], None],
    failed: Callable[[Exception], None],
) -> Iterator[Path]:  # fmt: skip
    """Write everything that was asked for and can be, and say what cannot; where one fails, the others are written."""

    def report(path: Path) -> list[Path]:
        tell("drawing the report")
        return [result.report(path, command)]

    def fmu(path: Path) -> list[Path]:
        if result.model is None:
            note(f"there is nothing to make an FMU of: {path} was not written")
            return []
        return result.fmu(path, files.platforms, tell)

    def experiment(path: Path) -> list[Path]:
        if result.experiment is None:
            note(f"nothing is to be told apart: {path} was not written")
            return []
        return [result.experiment.to_toml(path)]

    for write, path in ((report, files.report), (fmu, files.fmu), (experiment, files.experiment)):
        try:
            yield from write(path) if path is not None else []
        except Exception as error:
            failed(error)
