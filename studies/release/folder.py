"""Write the release folder: ``python -m studies.release.folder --out dist/release``.

It holds every component as ``fmu/native/NAME.fmu`` and ``fmu/python/NAME.fmu``, of FMI 3.0 as
``fmu/fmi3/NAME.fmu`` and ``fmu/fmi3-python/NAME.fmu``, every system as ``ssp/NAME.ssp``,
``manifest.json`` with what each file is, and ``SHA256SUMS``, which ``sha256sum --check`` reads. All
of it is in ``ppy-rig-VERSION-fmus.zip``, too. The same sources give the same digests.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from hashlib import sha256
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

from fmus import MODELS, component
from fmus.kit import files
from fmus.kit.build import RUNTIMES, archive, available_platforms, build
from fmus.kit.storage import scratch
from orchestration.fmu import Archive
from orchestration.system import NAMES, Member, System, library, ssp

_PROJECT = "ppy-rig"
SUMS = "SHA256SUMS"
Tell = Callable[[str], None]


def write(
    out: Path,
    models: Sequence[str] = MODELS,
    systems: Sequence[str] = NAMES,
    platforms: Sequence[str] | None = None,
    tell: Tell = lambda line: None,
) -> None:
    """Write the release folder.

    Parameters
    ----------
    out : Path
        The folder; files of an earlier release in it are replaced.
    models, systems : sequence of str
        Components and systems; all unless given.
    platforms : sequence of str, optional
        FMI platforms; every one that a compiler here can serve unless given.
    tell : callable
        Told what is being made.

    Raises
    ------
    UserError
        If there is no compiler for a platform, or a file cannot be written.
    """
    served = list(available_platforms() if platforms is None else platforms)
    for name in models:
        cls = component(name)
        for fmi, runtime in product((2, 3), RUNTIMES):
            tell(f"{name} ({runtime}, FMI {fmi}.0)")
            path = out / "fmu" / archive.folder_of(runtime, fmi) / f"{name}.fmu"
            files.write(path, build(cls, runtime, served, fmi=fmi))
    for name in systems:
        tell(f"{name}.ssp")
        _write_system(out / "ssp" / f"{name}.ssp", library.system(name), served)
    _write_manifest(out, served)
    released = [*out.glob("fmu/*/*.fmu"), *out.glob("ssp/*.ssp"), out / "manifest.json"]
    contents = {
        path.relative_to(out).as_posix(): path.read_bytes() for path in (*released, out / SUMS)
    }
    files.write(out / f"{_PROJECT}-{version(_PROJECT)}-fmus.zip", archive.pack(contents))


def _write_system(path: Path, system: System, platforms: Sequence[str]) -> None:
    """Write a system whose members have a binary for every platform."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with scratch.folder("release") as folder:
        members = tuple(_for_platforms(member, folder, platforms) for member in system.members)
        ssp.write(replace(system, members=members), path)


def _for_platforms(member: Member, folder: Path, platforms: Sequence[str]) -> Member:
    if member.cls is None:
        return member
    path = folder / member.name / member.fmu.name
    files.write(path, build(member.cls, "native", platforms))
    return replace(member, fmu=path)


def _write_manifest(out: Path, platforms: Sequence[str]) -> None:
    """Write what each file is, and the digests of all."""
    paths = sorted([*out.glob("fmu/*/*.fmu"), *out.glob("ssp/*.ssp")])
    entries = [_entry(out, path) for path in paths]
    manifest = {
        "project": _PROJECT,
        "version": version(_PROJECT),
        "platforms": list(platforms),
        "files": entries,
    }
    text = json.dumps(manifest, indent=2) + "\n"
    files.write(out / "manifest.json", text.encode())
    sums = [f"{entry['sha256']}  {entry['path']}" for entry in entries]
    sums.append(f"{sha256(text.encode()).hexdigest()}  manifest.json")
    files.write(out / SUMS, ("\n".join(sums) + "\n").encode())


def _entry(out: Path, path: Path) -> dict[str, Any]:
    """Return what a file is: its digest, and of an FMU its GUID and the platforms it runs on."""
    contents = path.read_bytes()
    entry: dict[str, Any] = {
        "path": path.relative_to(out).as_posix(),
        "sha256": sha256(contents).hexdigest(),
        "bytes": len(contents),
    }
    if path.suffix == ".fmu":
        with Archive(path) as opened:
            described = opened.description
            entry["fmi"] = described.get("fmiVersion", "")
            entry["guid"] = described.get("guid", "") or described.get("instantiationToken", "")
            entry["platforms"] = opened.platforms
    return entry


def main() -> None:
    """Write the folder that the command line names."""
    parser = argparse.ArgumentParser(description="Write the release folder.")
    parser.add_argument("--out", type=Path, default=Path("dist/release"))
    write(parser.parse_args().out, tell=print)


if __name__ == "__main__":
    main()
