"""``ppy build``: components as FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.options import BuildCommand
from orchestration.cli.options import platform_list
from orchestration.cli.outputs import check_outputs
from orchestration.reporting.console import note, out, progress

if TYPE_CHECKING:
    from fmus.kit import Component


class _PlannedFmu(NamedTuple):
    """An FMU to be built, and the path that it is written to."""

    cls: type[Component]
    runtime: str
    fmi: int
    path: Path


@command(BuildCommand)
def build(options: BuildCommand) -> None:
    """Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.

    With --set, NAME ends in _set and the values are the FMU's defaults. --runtime pythonfmu builds
    OUT/pythonfmu/NAME.fmu with that package, and states its limits. --fmi 3 builds
    OUT/fmi3-python/NAME.fmu and, native, OUT/fmi3/NAME.fmu. If a platform of --platforms all fails,
    it is reported and left out, and the exit status is 1.

    ppy export modelica writes components in the Modelica language.
    """
    from fmus.kit import build as kit
    from fmus.kit.build.stock import LIMITS

    platforms = platform_list(options["platforms"])
    planned = _plan(options)
    _check_planned(planned, platforms, options)
    complete = _build_all(planned, platforms, options["clocks"])
    if options["runtime"] == kit.STOCK:
        for limit in LIMITS:
            note(f"{kit.STOCK} promises less: {limit}")
    if not complete:
        raise typer.Exit(1)


def _plan(options: BuildCommand) -> list[_PlannedFmu]:
    """Return the FMUs that options select."""
    from fmus.kit import build as kit
    from fmus.kit import registry

    names = options["names"] or []
    fmi = options["fmi"]
    runtime = options["runtime"]
    if (options["laid_over"] or options["settings"]) and not names:
        raise UserError("--with and --set are about one model; name it")
    buildable = registry.components if runtime == kit.STOCK else registry.models
    runtimes = kit.RUNTIMES if runtime == "both" else (runtime,)
    classes = [_class_with_settings(name, options) for name in names or buildable()]
    planned = []
    for cls in classes:
        for kind in runtimes:
            path = options["out"] / kit.archive.folder_of(kind, fmi) / f"{cls.name}.fmu"
            planned.append(_PlannedFmu(cls, kind, fmi, path))
    return planned


def _class_with_settings(name: str, options: BuildCommand) -> type[Component]:
    """Return a component with effects laid over it, and with settings as its defaults."""
    from fmus.kit import stack
    from orchestration.cli.models import class_and_settings

    cls, values = class_and_settings(name, options)
    return stack(cls, name=f"{cls.name}_set", defaults=values) if values else cls


def _check_planned(
    planned: Sequence[_PlannedFmu], platforms: list[str] | None, options: BuildCommand
) -> None:
    """Refuse builds and files that are impossible, before any work is done."""
    from fmus.kit import build as kit
    from orchestration.cli.models import model_file

    for one in planned:
        kit.check_build(one.cls, one.runtime, platforms, one.fmi, options["clocks"])
    check_outputs(
        {},
        {f"the model {name}": model_file(name) for name in options["names"] or ()},
        {f"{one.cls.name} ({one.runtime})": one.path for one in planned},
        options["out"],
    )


def _build_all(planned: Sequence[_PlannedFmu], platforms: list[str] | None, clocks: bool) -> bool:
    """Build FMUs; return False if one lacks a platform, which is noted, as its build failed."""
    from fmus.kit import build as kit
    from fmus.kit import files

    failures: list[str] = []

    def skip_platform(path: Path, platform: str, error: UserError) -> None:
        failures.append(platform)
        note(f"{path} is without {platform}: {error}")

    with progress() as tell:
        tell(f"building {len(planned)} FMUs")
        for k, (cls, runtime, fmi, path) in enumerate(planned):
            failed = partial(skip_platform, path) if platforms is None else None
            done = partial(tell.done, k, len(planned))
            made = kit.build(cls, runtime, platforms, done, failed, fmi, clocks=clocks)
            files.write(path, made)
            out.print(str(path))
    return not failures
