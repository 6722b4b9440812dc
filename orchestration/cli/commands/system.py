"""``ppy system``: systems of components shown, drawn, checked, written as SSP or as one FMU."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fmus.kit import UserError
from orchestration.cli.command import command
from orchestration.cli.commands.options import (
    CheckSystemCommand,
    DrawSystemCommand,
    ExportSystemCommand,
    PackSystemCommand,
    SystemArgument,
)
from orchestration.cli.options import platform_list
from orchestration.cli.outputs import PICTURE, check_outputs
from orchestration.reporting import plain_table
from orchestration.reporting.console import out, progress, warn, wrote

if TYPE_CHECKING:
    from orchestration.fmu import Signal, Value
    from orchestration.system import System

systems = typer.Typer(name="system", add_completion=False, rich_markup_mode="rich")


@systems.command("list")
def list_systems() -> None:
    """List the systems that ship."""
    from orchestration.system import library

    width = max(map(len, library.NAMES))
    for name, summary in library.SUMMARIES.items():
        print(f"{name:{width}}  {summary.rstrip('.')}")


@systems.command("show")
@command(SystemArgument)
def show(options: SystemArgument) -> None:
    """Show a system's members, connections, inputs and outputs."""
    from orchestration.system import check

    with _opened(options["name"]) as system:
        check(system)
        out.print(system.name, style="bold", end="  ")
        out.print(system.doc)
        _show_members(system)
        _show_connections(system)
        out.print(f"\nstep {system.step:g} s, duration {system.duration:g} s by default")
        _warn(system)


def _show_members(system: System) -> None:
    from orchestration.system import variable

    table = plain_table(None, "member", "FMU", "values given to it")
    for member in system.members:
        given = [
            f"{name}={_format_value(value, variable(member, name))}"
            for name, value in member.parameters.items()
        ]
        table.add_row(member.name, member.fmu.name, ", ".join(given))
    out.print()
    out.print(table)


def _format_value(value: Value, signal: Signal) -> str:
    return value if isinstance(value, str) else f"{value:.6g} {signal.unit}".removesuffix(" 1")


def _show_connections(system: System) -> None:
    from orchestration.system import signal_at

    rows = [
        (f"{one.source} {one.transformation}".rstrip(), str(one.target), one.target)
        for one in system.connections
    ]
    rows += [(f"input {name}", str(port), port) for name, port in system.fed_ports]
    rows += [(str(port), f"output {name}", port) for name, port in system.outputs.items()]
    table = plain_table(None, "connection", "", "", "unit")
    for source, target, port in rows:
        table.add_row(source, "→", target, signal_at(system, port).unit)
    out.print()
    out.print(table)


@systems.command("draw")
@command(DrawSystemCommand)
def draw(options: DrawSystemCommand) -> None:
    """Draw a system: members as boxes, connections as arrows."""
    from orchestration.system import check
    from orchestration.system import draw as work

    name = options["name"]
    path = options["out"] or _named_after(name, ".png")
    check_outputs({"out": path}, {"the system": Path(name)}, out=PICTURE)
    with _opened(name) as system:
        check(system)
        work(system, path)
    wrote(path)


@systems.command("export")
@command(ExportSystemCommand)
def export(options: ExportSystemCommand) -> None:
    """Write a system with its FMUs as SSP, for any master that reads it."""
    from orchestration.system import ssp
    from orchestration.system.ssp import ENDINGS

    name = options["name"]
    path = options["out"] or _named_after(name, ".ssp")
    check_outputs({"out": path}, {"the system": Path(name)}, out=ENDINGS)
    with _opened(name, options["runtime"]) as system:
        ssp.write(system, path, options["connectors"])
    wrote(path)


@systems.command("pack")
@command(PackSystemCommand)
def pack(options: PackSystemCommand) -> None:
    """Compile a system into one FMU for co-simulation, which any host takes as a model.

    Its members keep their own steps and exchange values as ppy runs them; their parameters are
    MEMBER.PARAMETER. FMUs of others go in as they are.
    """
    from fmus.kit import files
    from orchestration import master

    name = options["name"]
    path = options["fmu"] or _named_after(name, ".fmu")
    check_outputs({"fmu": path}, {"the system": Path(name)}, fmu=(".fmu",))
    with _opened(name) as system, progress() as tell:
        files.write(path, master.pack(system, platform_list(options["platforms"]), tell))
    wrote(path)


@systems.command("check")
@command(CheckSystemCommand)
def check_file(options: CheckSystemCommand) -> None:
    """Check a system: everything connected exists and fits, and every input has one source."""
    from orchestration.system import check

    file = options["file"]
    with _opened(str(file)) as system:
        check(system)
        count = _warn(system)
        parts = f"{len(system.members)} members, {len(system.connections)} connections"
        out.print(f"{file}: {parts}, no errors, {count} warnings")


def _named_after(name: str, ending: str) -> Path:
    """Return the default path of a file that is written for a system."""
    return Path(f"{Path(name).stem or 'system'}{ending}")


@contextmanager
def _opened(name_or_file: str, runtime: str | None = None) -> Iterator[System]:
    """Yield a system that ships or is in a file; its FMUs may be removed after the context."""
    from fmus.kit.storage import scratch
    from orchestration.fmu.model import refuse_runtime
    from orchestration.system import library, ssp
    from orchestration.system.ssp import ENDINGS

    path = Path(name_or_file)
    if path.suffix.lower() in ENDINGS or path.exists():
        if path.suffix.lower() not in ENDINGS:
            raise UserError(
                f"{path}: a system is a file {' or '.join(ENDINGS)}, or one of"
                f" {', '.join(library.NAMES)}"
            )
        refuse_runtime(runtime, name_or_file)
        with scratch.folder("ssp") as folder:
            yield ssp.read(path, folder)
        return
    kind = runtime or "native"
    with progress() as tell:
        if name_or_file in library.NAMES:
            tell(f"building the members of {name_or_file} ({kind}) unless they are there")
        system = library.system(name_or_file, kind)
    yield system


def _warn(system: System) -> int:
    """Print the warnings about a system, and return their number."""
    from orchestration.system import warnings

    texts = warnings(system)
    for text in texts:
        warn(text)
    return len(texts)
