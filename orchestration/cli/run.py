"""What ``ppy run`` shows on the terminal, and the order in which it does its work."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from fmus.kit.errors import UserError
from orchestration.reporting.console import check_results, err, out, progress

if TYPE_CHECKING:
    import xarray


def catalogue() -> None:
    """List the experiments that ship."""
    from orchestration.experiment.library import shipped

    width = max(map(len, shipped()))
    for name, path in shipped().items():
        print(f"{name:{width}}  {tomllib.loads(path.read_text(encoding='utf-8'))['title']}")


def run(
    name: str, settings: Sequence[str], runtime: str | None, result: Path | None, picture: Path | None
) -> tuple[bool, bool]:
    """Do ``ppy run``.

    Returns
    -------
    complete, reproduced : bool
        Whether it came to its end; and, where a result is made again, whether every bit is the same.
    """
    from orchestration.experiment import result_page, results
    from orchestration.experiment.reading import files, movable, read
    from orchestration.experiment.run import run as make

    source = Path(name)
    is_result = source.is_file() and source.suffix.lower() != ".toml"
    chosen = [*settings, *([f"runtime={runtime}"] if runtime else [])]
    wanted = read(name, chosen)
    _check_targets({"result" if is_result else "experiment": source} | files(wanted), result, picture)
    earlier = results.read(source) if is_result and not chosen else None
    if earlier is not None and not earlier.attrs["complete"]:
        err.print(f"noted: {name} is incomplete; it is repeated as far as it goes, {wanted.duration:g} s", markup=False)
    with progress() as tell:
        tell(f"running {name} (FMUs that are not in the cache are built first)")
        found = make(
            wanted, name, tell.done, lambda line: err.print(f"noted: {line}", markup=False),
            lambda sketch: None if result is None else results.check(sketch, result),
        )  # fmt: skip
    _show(found)
    if result is not None:
        results.write(movable(found, result.parent), result)
        out.print(f"wrote {result}" + ("" if found.attrs["complete"] else " (incomplete)"), markup=False)
    if picture is not None:
        result_page.plot(found, picture)
        out.print(f"wrote {picture}", markup=False)
    return bool(found.attrs["complete"]), earlier is None or _same(found, earlier, name)


def _check_targets(sources: Mapping[str, Path], result: Path | None, picture: Path | None) -> None:
    """Refuse, before anything is computed, names under which nothing can be written or something would be lost."""
    from orchestration.experiment import results

    page = picture is not None and picture.suffix.lower() == ".html"
    check_results(sources, result, picture, page)
    if result is not None:
        results.check_format(result)
    for path in filter(None, (result, picture)):
        folder = path.absolute().parent
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir() or not os.access(folder, os.W_OK):
            raise UserError(f"cannot write {path}: {folder} is {'read-only' if folder.is_dir() else 'no folder'}")


def _show(found: xarray.Dataset) -> None:
    from orchestration.experiment import result_page

    table = Table(box=None, pad_edge=False)
    for column in ("signal", "smallest", "largest", "last"):
        table.add_column(column, justify="left" if column == "signal" else "right")
    for row in result_page.extremes(found):
        table.add_row(*row)
    out.print(result_page.state(found), markup=False)
    out.print(table)


def _same(found: xarray.Dataset, earlier: xarray.Dataset, name: str) -> bool:
    """Say whether a result was made again bit by bit, and if not, how far it is off and why that may be."""
    from orchestration.experiment import results

    then, now = (json.loads(data.attrs["guids"]) for data in (earlier, found))
    for member in now:
        if then.get(member) != now[member]:
            err.print(
                f"warning: {name} was made with another build of {member} ({then.get(member)}, now {now[member]})",
                markup=False, soft_wrap=True,
            )  # fmt: skip
    apart = results.differences(found, earlier)
    if not apart:
        out.print(f"every value is the same to the last bit as in {name}", markup=False)
    for signal, difference in apart.items():
        unit = found[signal].units if signal in found else ""
        out.print(f"not as in {name}: {signal} differs by up to {difference:.3g} {unit}", markup=False)
    if earlier.attrs["versions"] != found.attrs["versions"]:
        err.print(
            f"noted: {name} was made with {earlier.attrs['versions']}; here is {found.attrs['versions']}", markup=False
        )
    return not apart
