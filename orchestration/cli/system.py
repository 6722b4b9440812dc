"""What ``ppy system`` shows on the terminal."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.table import Table

from fmus.kit.errors import UserError
from orchestration.reporting.console import err, out, progress
from orchestration.system import System
from orchestration.system.check import check, interface, variable, warnings
from orchestration.system.ssp.vocabulary import ENDINGS


@contextmanager
def opened(name_or_file: str, runtime: str = "native") -> Iterator[System]:
    """Give a system that ships, or one from a file; the FMUs of an archive are there only for as long."""
    from orchestration.system import library, ssp

    path = Path(name_or_file)
    if path.suffix.lower() in ENDINGS or path.exists():
        if path.suffix.lower() not in ENDINGS:
            raise UserError(f"{path}: a system is a file {' or '.join(ENDINGS)}, or one of {', '.join(library.NAMES)}")
        with tempfile.TemporaryDirectory(prefix="ppy-ssp-", ignore_cleanup_errors=True) as folder:
            yield ssp.read(path, Path(folder))
        return
    with progress() as tell:
        if name_or_file in library.NAMES:
            tell(f"building the members of {name_or_file} ({runtime}) unless they are there")
        system = library.system(name_or_file, runtime)
    yield system


def catalogue() -> None:
    """List the systems that ship."""
    from orchestration.system import library

    width = max(map(len, library.NAMES))
    for name, summary in library.SUMMARIES.items():
        print(f"{name:{width}}  {summary.rstrip('.')}")


def show(name_or_file: str) -> None:
    """Show members, connections, inputs and outputs."""
    with opened(name_or_file) as system:
        check(system)
        out.print(system.name, style="bold", end="  ")
        out.print(system.doc)
        models = {member.name: interface(member) for member in system.members}
        table = _table("member", "FMU", "values given to it")
        for member in system.members:
            given = [f"{k}={v:.6g} {variable(member, k).unit}".removesuffix(" 1") for k, v in member.parameters.items()]
            table.add_row(member.name, member.fmu.name, ", ".join(given))
        out.print()
        out.print(table)
        table = _table("connection", "", "", "unit")
        for connection in system.connections:
            unit = models[connection.target.member].inputs[connection.target.variable].unit
            factor = "" if connection.factor == 1.0 else f" × {connection.factor:g}"
            offset = "" if connection.offset == 0.0 else f" {connection.offset:+g}"
            table.add_row(f"{connection.source}{factor}{offset}", "→", str(connection.target), unit)
        for name, ports in system.inputs.items():
            for port in ports:
                table.add_row(f"input {name}", "→", str(port), models[port.member].inputs[port.variable].unit)
        for name, port in system.outputs.items():
            table.add_row(str(port), "→", f"output {name}", models[port.member].outputs[port.variable].unit)
        out.print()
        out.print(table)
        out.print(f"\nstep {system.step:g} s, duration {system.stop:g} s by default")
        _warn(system)


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in columns[:-1]:
        table.add_column(column, no_wrap=True)
    table.add_column(columns[-1])
    return table


def draw(name_or_file: str, picture: Path | None) -> None:
    """Draw a system."""
    from orchestration.reporting.pictures import picture_format
    from orchestration.system.draw import draw as work

    path = picture or Path(f"{Path(name_or_file).stem}.png")
    picture_format(path)
    _check_target(path)
    with opened(name_or_file) as system:
        check(system)
        work(system, path)
    out.print(f"wrote {path}")


def export(name: str, path: Path | None, runtime: str, connectors: bool) -> None:
    """Write a system that ships as a file."""
    from orchestration.system import ssp

    target = path or Path(f"{Path(name).stem}.ssp")
    _check_target(target)
    if Path(name).exists() and target.exists() and target.samefile(name):
        raise UserError(f"--out {target}: this is the system itself; it will not be overwritten")
    with opened(name, runtime) as system:
        ssp.write(system, target, connectors)
    out.print(f"wrote {target}")


def _check_target(path: Path) -> None:
    if path.is_dir():
        raise UserError(f"--out {path}: this is a folder; name a file in it")


def check_file(path: Path) -> None:
    """Check a system file; every error is raised."""
    with opened(str(path)) as system:
        check(system)
        found = _warn(system)
        parts = f"{len(system.members)} members, {len(system.connections)} connections"
        out.print(f"{path}: {parts}, no errors, {found} warnings")


def _warn(system: System) -> int:
    found = warnings(system)
    for text in found:
        err.print(f"warning: {text}", soft_wrap=True)
    return len(found)
