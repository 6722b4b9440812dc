"""``ppy build``: components as FMUs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.options import BuildCommand
from orchestration.cli.options import platform_list
from orchestration.cli.outputs import Outputs

if TYPE_CHECKING:
    from fmus.kit import Component


@command(BuildCommand)
def build(options: BuildCommand) -> None:
    """Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.

    With --set, NAME ends in _set and the values are the FMU's defaults. With --runtime pythonfmu it
    is OUT/pythonfmu/NAME.fmu, for users of that; what it cannot promise is said. Of --platforms all
    one that fails is told and left out, and the exit status is 1. With --fmi 3 it is
    OUT/fmi3/NAME.fmu, of every component that has laws.

    ppy export modelica writes components in the Modelica language.
    """
    from fmus import COMPONENTS, MODELS
    from fmus.kit import build as kit
    from fmus.kit import files
    from fmus.kit.build.stock import LIMITS
    from orchestration.cli.models import model_file
    from orchestration.reporting import note, progress
    from orchestration.reporting import out as screen

    names = options["names"] or []
    fmi = options["fmi"]
    runtime = "native" if fmi == 3 and options["runtime"] == "both" else options["runtime"]
    folder = options["out"]
    if (options["laid_over"] or options["settings"]) and not names:
        raise UserError("--with and --set are about one model; name it")
    known = COMPONENTS if fmi == 3 or runtime == kit.STOCK else MODELS
    classes = [_component(name, options) for name in names or known]
    runtimes = kit.RUNTIMES if runtime == "both" else (runtime,)
    work = [
        (cls, kind, folder / ("fmi3" if fmi == 3 else kind) / f"{cls.name}.fmu")
        for cls in classes
        for kind in runtimes
    ]
    Outputs(
        {f"the model {name}": model_file(name) for name in names},
        {f"{cls.name} ({kind})": path for cls, kind, path in work},
        folders={"--out": folder},
    ).check()
    targets = platform_list(options["platforms"])
    failures: list[str] = []

    def failed(path: Path, platform: str, error: UserError) -> None:
        failures.append(platform)
        note(f"{path} is without {platform}: {error}")

    with progress() as tell:
        tell(f"building {len(work)} FMUs")
        for k, (cls, kind, path) in enumerate(work):
            keep = partial(failed, path) if targets is None else None
            done = partial(tell.done, k, len(work))
            files.write(path, kit.build(cls, kind, targets, done, keep, fmi))
            screen.print(str(path))
    if runtime == kit.STOCK:
        for limit in LIMITS:
            note(f"{kit.STOCK} promises less: {limit}")
    if failures:
        raise typer.Exit(1)


def _component(name: str, options: BuildCommand) -> type[Component]:
    """Return a component with effects laid over it, and with settings as its defaults."""
    from fmus.kit import stack
    from orchestration.fmu import declared_signal, find_class, read_settings

    cls = find_class(name, options["laid_over"])
    known = {p.name: declared_signal(p) for p in (*cls.layout.parameters, *cls.layout.texts)}
    texts = [f"{key}={value}" for key, value in (options["settings"] or {}).items()]
    values = read_settings(name, texts, known)
    return stack(cls, name=f"{cls.name}_set", defaults=values) if values else cls
