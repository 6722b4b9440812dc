"""``ppy build``: components as FMUs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fmus.kit import UserError, files, registry, stack
from fmus.kit import build as kit
from orchestration.cli.command import command
from orchestration.cli.commands.options import BuildCommand
from orchestration.cli.options import platform_list
from orchestration.cli.outputs import check_outputs
from orchestration.reporting.console import note, out, progress

if TYPE_CHECKING:
    from fmus.kit import Component

    # component and runtime by the path of the FMU
    _Planned = Mapping[Path, tuple[type[Component], str]]


@command(BuildCommand)
def build(options: BuildCommand) -> None:
    """Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.

    With --set, NAME ends in _set and the values are the FMU's defaults. --runtime pythonfmu builds
    OUT/pythonfmu/NAME.fmu with that package, and states its limits. --fmi 3 builds
    OUT/fmi3-python/NAME.fmu and, native, OUT/fmi3/NAME.fmu. If a platform of --platforms all fails,
    it is reported and left out, and the exit status is 1.

    ppy export modelica writes components in the Modelica language.
    """
    from fmus.kit.build.stock import LIMITS

    platforms = platform_list(options["platforms"])
    planned = _plan(options)
    _check_planned(planned, platforms, options)
    complete = _build_all(planned, platforms, options)
    if options["runtime"] == kit.STOCK:
        for limit in LIMITS:
            note(f"{kit.STOCK} promises less: {limit}")
    if not complete:
        raise typer.Exit(1)


def _plan(options: BuildCommand) -> _Planned:
    """Return the FMUs that options select."""
    names = options["names"] or []
    runtime = options["runtime"]
    if (options["laid_over"] or options["settings"]) and not names:
        raise UserError("--with and --set are about one model; name it")
    buildable = registry.components if runtime == kit.STOCK else registry.models
    runtimes = kit.RUNTIMES if runtime == "both" else (runtime,)
    planned = {}
    for name in names or buildable():
        cls = _class_with_settings(name, options)
        for kind in runtimes:
            folder = options["out"] / kit.archive.folder_of(kind, options["fmi"])
            planned[folder / f"{cls.name}.fmu"] = (cls, kind)
    return planned


def _class_with_settings(name: str, options: BuildCommand) -> type[Component]:
    """Return a component with effects laid over it, and with settings as its defaults."""
    from orchestration.cli.models import class_and_settings

    cls, values = class_and_settings(name, options)
    return stack(cls, name=f"{cls.name}_set", defaults=values) if values else cls


def _check_planned(planned: _Planned, platforms: list[str] | None, options: BuildCommand) -> None:
    """Refuse builds and files that are impossible, before any work is done."""
    from orchestration.cli.models import model_file

    for cls, runtime in planned.values():
        kit.check_build(cls, runtime, platforms, options["fmi"], options["clocks"])
    check_outputs(
        {},
        {f"the model {name}": model_file(name) for name in options["names"] or ()},
        {f"{cls.name} ({runtime})": path for path, (cls, runtime) in planned.items()},
        options["out"],
    )


def _build_all(planned: _Planned, platforms: list[str] | None, options: BuildCommand) -> bool:
    """Build FMUs; return False if one lacks a platform, which is noted, as its build failed."""
    failures: list[str] = []

    def skip_platform(path: Path, platform: str, error: UserError) -> None:
        failures.append(platform)
        note(f"{path} is without {platform}: {error}")

    with progress(f"building {len(planned)} FMUs") as tell:
        for k, (path, (cls, runtime)) in enumerate(planned.items()):
            failed = partial(skip_platform, path) if platforms is None else None
            done = partial(tell.done, k, len(planned))
            version, clocks = options["fmi"], options["clocks"]
            made = kit.build(cls, runtime, platforms, done, failed, version, clocks=clocks)
            files.write(path, made)
            out.print(str(path))
    return not failures
