"""``ppy export``: components in other languages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.options import ExportModelicaCommand
from orchestration.cli.outputs import check_outputs

if TYPE_CHECKING:
    from fmus.kit import Component

exports = typer.Typer(name="export", add_completion=False, rich_markup_mode="rich")


@exports.callback()
def group() -> None:
    """Write components in other languages."""


@exports.command("modelica")
@command(ExportModelicaCommand)
def modelica(options: ExportModelicaCommand) -> None:
    """Write components as a package of Modelica, OUT/PpyRig: laws, ports as connectors.

    It needs no library; its connectors fit those of the standard library. --with adds effects to a
    model, and their parameters switch them. --fitted and --set give parameters their defaults.
    --fmus adds PpyRig.FMUs, in which the same models call their FMUs.
    """
    from fmus.kit import files, registry
    from fmus.kit.build import version
    from fmus.kit.modelica import PACKAGE, package_files
    from orchestration.cli.models import model_file
    from orchestration.reporting.console import wrote

    names = options["names"] or []
    if (options["laid_over"] or options["settings"] or options["fitted"]) and not names:
        raise UserError("--with, --set and --fitted are about one model; name it")
    folder = options["out"]
    package = folder / PACKAGE
    reads = {f"the model {name}": model_file(name) for name in names}
    check_outputs({}, reads, folder=folder)
    _check_empty(package)
    classes = [_class_with_values(name, options) for name in names or registry.components()]
    contents = package_files(classes, version(), _fmus(classes) if options["fmus"] else None)
    with files.replacing(package) as new:
        for path, data in contents.items():
            target = new / Path(path).relative_to(PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            files.put(target, data)
        _check_empty(package)  # FMUs take their time
    wrote(package)


def _class_with_values(name: str, options: ExportModelicaCommand) -> type[Component]:
    """Return a component with effects laid over it; a fit and settings are its defaults."""
    from fmus.kit import stack
    from orchestration.cli.models import class_and_settings
    from orchestration.fmu.model import model_of
    from orchestration.sweeps.fitted import read_fitted

    cls, settings = class_and_settings(name, options)
    path = options["fitted"]
    fitted = read_fitted(path, model_of(cls)).values if path else {}
    return stack(cls, name=cls.name, defaults=fitted | settings)


def _fmus(classes: Sequence[type[Component]]) -> dict[str, bytes]:
    """Return the FMUs of components for this machine."""
    from fmus.kit import build
    from orchestration.reporting.console import progress

    with progress(f"building {len(classes)} FMUs unless they are there"):
        return {cls.name: build.build_cached(cls, "native").read_bytes() for cls in classes}


def _check_empty(package: Path) -> None:
    """Refuse a folder with something in it, which may be of another package."""
    if package.is_dir() and any(package.iterdir()):
        raise UserError(
            f"--out {package.parent}: {package} is there and not empty; remove it first"
        )
    if package.exists() and not package.is_dir():
        raise UserError(f"--out {package.parent}: {package} is there and no folder")
