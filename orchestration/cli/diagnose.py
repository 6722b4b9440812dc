"""The command ``ppy diagnose``."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.files import write
from orchestration.api.diagnosis import DiagnosisResult, diagnose
from orchestration.api.records import read_record
from orchestration.discrepancy.extended_model import destinations
from orchestration.discrepancy.report import terminal
from orchestration.fmu.model import find_model, names_class
from orchestration.records import parse_mapping
from orchestration.reporting.console import out, progress, tell_repairs


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
    """

    record: Path
    holdout: Path | None = None
    result: Path | None = None
    report: Path | None = None
    fmu: Path | None = None
    experiment: Path | None = None

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
            written |= {f"--fmu ({kind})": p for kind, p in destinations(self.fmu, filter(None, read.values())).items()}
        for option, path in written.items():
            if path is None:
                continue
            if _is_there(option, path) and path.is_dir():
                raise UserError(f"{option} {path}: this is a folder; name a file in it")
            for what, source in read.items():
                if source is not None and _same(path, source):
                    raise UserError(f"{option} {path}: this is {what} itself; it will not be overwritten")
        named = [(option, path) for option, path in written.items() if path is not None]
        for k, (option, path) in enumerate(named):
            for other, place in named[:k]:
                if _same(path, place):
                    raise UserError(f"{other} and {option} both name {path}")
        if self.report is not None and self.report.suffix.lower() not in (".html", ".htm"):
            raise UserError(f"--report {self.report}: its name must end in .html")
        if self.experiment is not None and self.experiment.suffix.lower() != ".toml":
            raise UserError(f"--experiment {self.experiment}: its name must end in .toml")
        if self.holdout is not None and _same(self.record, self.holdout):
            raise UserError(f"--holdout {self.holdout}: this is the record itself; nothing would be held out")


def run(
    files: Files, name: str, mapping: Sequence[str], settings: Sequence[str], effects: Sequence[str] | None,
    command: Sequence[str], hold: Sequence[str] = (), interpolate: bool = False,
) -> DiagnosisResult:  # fmt: skip
    """Do ``ppy diagnose``; the command is repeated in the report.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be written.
    """
    files.check([Path(name.rpartition(":")[0])] if names_class(name) else [])
    with progress() as tell:
        tell(f"building {name} unless it is there")
        model = find_model(name)
        renamed = parse_mapping(mapping)
        record, holdout = read_record(files.record, model, renamed), None
        tell_repairs(record.repairs)
        if files.holdout is not None:
            holdout = read_record(files.holdout, model, renamed)
            tell_repairs([replace(r, message=f"{files.holdout.name}: {r.message}") for r in holdout.repairs])
        result = diagnose(
            record, model, holdout=holdout, effects=effects, hold=hold,
            settings=dict(_setting(text) for text in settings), interpolate=interpolate, progress=tell,
        )  # fmt: skip
        made = _written(result, files, shlex.join(command), tell)
    out.print(terminal.overview(result.details))
    for path in made:
        out.print(f"wrote {path}", markup=False)
    return result


def _setting(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
    return name.strip(), value.strip()


def _written(result: DiagnosisResult, files: Files, command: str, tell: Callable[[str], None]) -> list[Path]:
    """Write everything that was asked for and can be, and say what cannot."""
    made = []
    if files.result is not None:
        write(files.result, json.dumps(result.to_dict(), indent=2, allow_nan=False).encode())
        made.append(files.result)
    if files.report is not None:
        tell("drawing the report")
        made.append(result.report(files.report, command))
    if files.fmu is not None and result.model is None:
        out.print(f"nothing was found to make an FMU of: {files.fmu} was not written", markup=False)
    elif files.fmu is not None:
        tell("building the extended FMU")
        made += result.fmu(files.fmu)
    if files.experiment is not None and result.experiment is None:
        out.print(f"nothing is to be told apart: {files.experiment} was not written", markup=False)
    elif files.experiment is not None and result.experiment is not None:
        made.append(result.experiment.to_toml(files.experiment))
    return made


def _same(a: Path, b: Path) -> bool:
    return a.absolute() == b.absolute() or (a.exists() and b.exists() and a.samefile(b))


def _is_there(option: str, path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:  # such as a name that is too long
        raise UserError(f"{option} {path}: {error.strerror}") from error
