"""The builds of an extended model: a native FMU, and a Python FMU in the same folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from fmus.kit import Component, UserError, files
from fmus.kit.build import build
from orchestration.reporting import option


def fmu_paths(path: Path, records: Iterable[Path]) -> dict[str, Path]:
    """Return the files of both builds: ``F.fmu`` of the native one, ``F.python.fmu`` of the other.

    Parameters
    ----------
    path : Path
        ``F.fmu``.
    records : iterable of Path
        Files that must not be overwritten.

    Returns
    -------
    dict of str to Path
        By runtime.

    Raises
    ------
    UserError
        If the name is not that of an FMU, or one of them is a record or a folder.
    """
    if path.suffix != ".fmu":
        raise UserError(f"{option('fmu', str(path))}: the name of an FMU ends in .fmu")
    places = {"native": path, "python": path.with_suffix(".python.fmu")}
    kept = [record for record in records if record.exists()]
    for place in places.values():
        given_as = option("fmu", str(place))
        if place.is_dir():
            raise UserError(f"{given_as}: this is a folder")
        if place.exists() and any(place.samefile(record) for record in kept):
            raise UserError(f"{given_as}: this is the record itself; it will not be overwritten")
    return places


def export(
    cls: type[Component],
    path: Path,
    records: Iterable[Path] = (),
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Path]:
    """Build a component for both runtimes, then write both FMUs.

    Parameters
    ----------
    cls : type[Component]
    path, records
        See :func:`fmu_paths`.
    platforms : sequence of str, optional
        FMI platforms; default is every one that a compiler here can serve.
    progress : callable
        Called with a text about each step of the work.

    Returns
    -------
    list of Path
        The native FMU and the Python one.

    Raises
    ------
    UserError
        If a destination is refused or cannot be written, or a build fails; then no FMU is left half
        written.
    """
    places = fmu_paths(path, records)
    contents = {
        place: build(cls, runtime, platforms, progress) for runtime, place in places.items()
    }
    for place, made in contents.items():
        files.write(place, made)
    return list(places.values())
