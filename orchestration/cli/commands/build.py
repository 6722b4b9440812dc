"""``ppy build``: components as FMUs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fmus.kit.errors import UserError
from orchestration.cli.options import (
    Platforms,
    Set,
    With,
    comma_list,
    complete_components,
    platform_list,
)
from orchestration.cli.outputs import Outputs


def build(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[MODEL]...",
            help="Components, path/to/file.py:Class, or FMUs built from these; default all components.",
            autocompletion=complete_components,
        ),
    ] = None,
    effects: With = None,
    settings: Set = None,
    runtime: Annotated[
        str, typer.Option(help="python, native or both; pythonfmu: a stock archive of that.")
    ] = "both",
    platforms: Platforms = None,
    out: Annotated[Path, typer.Option(help="Folder that gets RUNTIME/NAME.fmu.")] = Path("fmu"),
) -> None:
    """Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.

    With --set, NAME ends in _set and the values are the FMU's defaults. With --runtime pythonfmu it is
    OUT/pythonfmu/NAME.fmu, for users of that; what it cannot promise is said.
    """
    from fmus import COMPONENTS, MODELS
    from fmus.kit import build as kit
    from fmus.kit import files, stack
    from fmus.kit.build.stock import LIMITS
    from orchestration.cli.models import model_file
    from orchestration.fmu.model import find_class, read_settings
    from orchestration.fmu.signal import declared_signal
    from orchestration.reporting.console import note, progress
    from orchestration.reporting.console import out as screen

    if (effects or settings) and not names:
        raise UserError("--with and --set are about one model; name it")
    classes = []
    for name in names or (COMPONENTS if runtime == kit.STOCK else MODELS):
        cls = find_class(name, comma_list(effects, "--with"))
        known = {p.name: declared_signal(p) for p in (*cls.layout.parameters, *cls.layout.texts)}
        if values := read_settings(name, settings or [], known):
            cls = stack(cls, name=f"{cls.name}_set", defaults=values)
        classes.append(cls)
    runtimes = kit.RUNTIMES if runtime == "both" else (runtime,)
    places = {
        f"{cls.name} ({kind})": out / kind / f"{cls.name}.fmu"
        for cls in classes
        for kind in runtimes
    }
    Outputs(
        {f"the model {name}": model_file(name) for name in names or []},
        places,
        folders={"--out": out},
    ).check()
    targets = platform_list(platforms)
    work = [(cls, kind) for cls in classes for kind in runtimes]
    with progress() as tell:
        tell(f"building {len(work)} FMUs")
        for k, (cls, kind) in enumerate(work):
            path = out / kind / f"{cls.name}.fmu"
            files.write(path, kit.build(cls, kind, targets, partial(tell.done, k, len(work))))
            screen.print(str(path))
    if runtime == kit.STOCK:
        for limit in LIMITS:
            note(f"{kit.STOCK} promises less: {limit}")
