"""What ``ppy diagnose`` reads, shows and writes."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from fmus.kit.errors import UserError
from orchestration.api.diagnosed import DiagnosisResult
from orchestration.api.diagnosis import diagnose
from orchestration.api.records import held_out
from orchestration.cli.models import model_file, note_neutral, open_model
from orchestration.cli.outputs import JSON, PAGE, Outputs, same_file, write_json
from orchestration.discrepancy.extended_model import destinations
from orchestration.fmu.model import Model
from orchestration.records import Record, parse_mapping
from orchestration.reporting.console import note, out, progress, tell_repairs, wrote


@dataclass(frozen=True)
class Files:
    """What is read and written.

    Attributes
    ----------
    records : sequence of Path
    holdout : sequence of str
        Other records to judge by, or labels of some that were given.
    result, report, fmu, experiment : Path, optional
        JSON, HTML, FMU and TOML to write.
    platforms : sequence of str, optional
        FMI platforms to build the FMU for; default is every one that a compiler here can serve.
    compare : Path, optional
        A later record, of which it is told what changed.
    effect : Path, optional
        File of Python to write.
    ssp : Path, optional
        System to write: an FMU without equations, and its correction.
    """

    records: Sequence[Path]
    holdout: Sequence[str] = ()
    result: Path | None = None
    report: Path | None = None
    fmu: Path | None = None
    experiment: Path | None = None
    platforms: Sequence[str] | None = None
    compare: Path | None = None
    effect: Path | None = None
    ssp: Path | None = None

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
        others = [
            Path(text) for text in self.holdout if len(self.records) == 1 or Path(text).exists()
        ]
        read: dict[str, Path | None] = {
            f"the record{_number(k)}": path for k, path in enumerate(self.records)
        }
        read["the later record"] = self.compare
        read |= {f"the record held out{_number(k)}": path for k, path in enumerate(others)}
        read |= {
            f"the {'FMU' if place.suffix == '.fmu' else 'file'} of --model": place
            for place in sources
        }
        written = {
            "--json": self.result,
            "--report": self.report,
            "--experiment": self.experiment,
            "--effect-out": self.effect,
            "--ssp": self.ssp,
        }
        if self.fmu is not None:
            written |= {f"--fmu ({kind})": p for kind, p in destinations(self.fmu, ()).items()}
        endings = {
            "--json": JSON,
            "--report": PAGE,
            "--experiment": (".toml",),
            "--effect-out": (".py",),
            "--ssp": (".ssp",),
        }
        Outputs(read, written, endings).check()
        if self.compare is not None and any(
            same_file(record, self.compare) for record in self.records
        ):
            raise UserError(
                f"--compare {self.compare}: this is the record itself; nothing in it can have changed"
            )
        for path in others:
            if any(same_file(record, path) for record in self.records):
                raise UserError(
                    f"--holdout {path}: this is the record itself; nothing would be held out"
                )


def _number(k: int) -> str:
    return f" ({k + 1})" if k else ""


def run(
    files: Files,
    name: str,
    mapping: Sequence[str],
    settings: Sequence[str],
    considered: Sequence[str] | None,
    command: Sequence[str],
    hold: Sequence[str] = (),
    interpolate: bool | None = None,
    effects: Sequence[str] = (),
    time: float | None = None,
    runs: str | None = None,
    each: Sequence[str] = (),
    laws: bool = True,
    fit: Sequence[str] = (),
) -> DiagnosisResult:
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
        Whether inputs go smoothly between samples, or are held; unless given, the record tells.
    effects : sequence of str
        Laid over the model before it is judged.
    time : float, optional
        Seconds that the search may take.
    runs : str, optional
        Column that tells the records in a file apart.
    each : sequence of str
        Parameters that differ from record to record.
    laws : bool
        Whether laws are asked what they lack where something is left.
    fit : sequence of str
        Parameters of an FMU without equations.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be written.
    """
    read = opened(files, name, mapping, settings, effects, runs)
    with progress() as tell:
        result = diagnose(
            read.records,
            read.model,
            holdout=read.holdouts or None,
            compare=files.compare,
            each=each,
            effects=considered,
            hold=hold,
            settings=read.settings,
            interpolate=interpolate,
            time=time,
            mapping=read.mapping,
            laws=laws,
            fit=fit,
            progress=tell,
        )
    out.print(*result.overview(), sep="\n")
    write_json(files.result, result.to_dict())
    write_all(lambda tell: _writers(result, files, shlex.join(command), tell))
    return result


class Opened(NamedTuple):
    """What was opened before any work is done."""

    model: Model
    records: list[Record]
    holdouts: list[Record]
    mapping: dict[str, str]
    settings: dict[str, str]


def opened(
    files: Files,
    name: str,
    mapping: Sequence[str],
    settings: Sequence[str],
    effects: Sequence[str] = (),
    runs: str | None = None,
) -> Opened:
    """Open the model and the records, once it is sure that what is asked for can be written; tell what is noticed.

    Raises
    ------
    UserError
        If something could not be written, or the model or a record cannot be read.
    """
    files.check([file] if (file := model_file(name)) else [])
    model = open_model(name, effects=effects)
    note_neutral(model, [text.partition("=")[0].strip() for text in settings])
    renamed = parse_mapping(mapping)
    records, holdouts = held_out(files.records, files.holdout or None, model, renamed, runs)
    for record in (*records, *holdouts):
        called = "" if record is records[0] and not record.label else f"{_called(record)}: "
        # of a channel that is constant the diagnosis says what follows from it
        tell_repairs(
            [
                replace(r, message=f"{called}{r.message}")
                for r in record.repairs
                if r.kind != "constant"
            ]
        )
    return Opened(
        model, [*records], [*holdouts], dict(renamed), dict(_setting(text) for text in settings)
    )


def _called(record: Record) -> str:
    return f"{record.source.name}, run {record.label}" if record.label else record.source.name


def _setting(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
    return name.strip(), value.strip()


Writer = tuple[Callable[[Path], list[Path]], Path | None]


def write_all(writers: Callable[[Callable[[str], None]], Sequence[Writer]]) -> None:
    """Write everything that was asked for and can be; where one fails, the others are written before it is told.

    Parameters
    ----------
    writers : callable
        Of what is told of progress: what writes a file, and its name if it was asked for.
    """
    failures: list[Exception] = []
    made: list[Path] = []
    with progress() as tell:
        for write, path in writers(tell):
            try:
                made += write(path) if path is not None else []
            except Exception as error:
                failures.append(error)
    for path in made:
        wrote(path)
    if failures:
        raise failures[0]


def _writers(
    result: DiagnosisResult, files: Files, command: str, tell: Callable[[str], None]
) -> list[Writer]:
    """What writes what was asked for, or says why there is nothing to write."""

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

    def system(path: Path) -> list[Path]:
        return [result.system(path)]

    return [
        (report, files.report),
        (fmu, files.fmu),
        (experiment, files.experiment),
        (system, files.ssp),
    ]
