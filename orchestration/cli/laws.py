"""What ``ppy laws`` reads, shows and writes."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from orchestration.api.laws import LawsResult, laws
from orchestration.cli.diagnose import Files, Writer, opened, write_all
from orchestration.cli.outputs import write_json
from orchestration.reporting.console import note, out, progress


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
) -> LawsResult:
    """Do ``ppy laws``; the command is repeated in the report, and all else is as in ``ppy diagnose``.

    Raises
    ------
    UserError
        If a record or the model cannot be used, an effect is unknown, or something could not be written.
    """
    read = opened(files, name, mapping, settings, effects, runs)
    with progress() as tell:
        result = laws(
            read.records,
            read.model,
            holdout=read.holdouts or None,
            each=each,
            effects=considered,
            hold=hold,
            settings=read.settings,
            interpolate=interpolate,
            time=time,
            mapping=read.mapping,
            progress=tell,
        )
    out.print(*result.overview(), sep="\n")
    write_json(files.result, result.to_dict())
    write_all(lambda tell: _writers(result, files, shlex.join(command), tell))
    return result


def _writers(
    result: LawsResult, files: Files, command: str, tell: Callable[[str], None]
) -> list[Writer]:
    """What writes what was asked for, or says why there is nothing to write."""

    def report(path: Path) -> list[Path]:
        tell("drawing the report")
        return [result.report(path, command)]

    def effect(path: Path) -> list[Path]:
        return [result.effect(path)] if _there(path) else []

    def fmu(path: Path) -> list[Path]:
        return result.fmu(path, files.platforms, tell) if _there(path) else []

    def _there(path: Path) -> bool:
        if result.model is None:
            note(f"no law is found to lack anything: {path} was not written")
        return result.model is not None

    return [(report, files.report), (effect, files.effect), (fmu, files.fmu)]
