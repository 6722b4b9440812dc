"""Installation of the library that wraps an FMU of FMI 3.0 into its unpacked folder."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from xml.etree.ElementTree import Element

import fmpy

from fmus.kit import UserError
from fmus.kit.storage import scratch
from orchestration.fmu.wrapping.compiled import compiled
from orchestration.fmu.wrapping.translation import Translation, translate

_SOURCES = ("all.c", "events.c", "platform.c", "table.c", "values.c", "wrapper.c", "wrapper.h")


def wrap(folder: Path, root: Element, label: str) -> None:
    """Wrap an unpacked FMU of FMI 3.0, so that it can be loaded as one of FMI 2.0.

    Parameters
    ----------
    folder : Path
        Folder of the unpacked FMU, to which the libraries and their tables are added.
    root : Element
        ``fmiModelDescription`` of the FMU.
    label : str
        Name of the FMU in messages.

    Raises
    ------
    UserError
        If its description cannot be translated, its library is missing, or the wrapper cannot be
        compiled.
    """
    translation = translate(root, label)
    wrapper = compiled(_SOURCES, [2, 3], f"{label}: an FMU of FMI 3.0")
    binaries = folder / "binaries" / fmpy.platform
    resources = folder / "resources"
    for node in translation.root:
        identifier = node.get("modelIdentifier")
        if identifier is None:
            continue
        name = identifier + fmpy.sharedLibraryExtension
        library = folder / "binaries" / fmpy.platform_tuple / name
        if not library.is_file():
            raise UserError(f"{label}: binaries/{fmpy.platform_tuple}/{name} is missing")
        with scratch.written(folder):
            binaries.mkdir(exist_ok=True)
            shutil.copyfile(wrapper, binaries / name)
            table = _encode_table(translation, library, resources)
            (binaries / f"{identifier}.table").write_bytes(table)


def _encode_table(translation: Translation, library: Path, resources: Path) -> bytes:
    """Return the table that the wrapper reads when it is instantiated.

    Its lines are the path of the library, that of the resources, the number of variables, and the
    type, the value reference and the number of elements of each variable; then the interface and
    the number of clocks, and the kind, value reference, interval and shift of each.
    """
    resource_path = f"{resources}{os.sep}" if resources.is_dir() else ""
    lines = [str(library), resource_path, str(len(translation.table))]
    lines += [f"{row.type} {row.reference} {row.elements}" for row in translation.table]
    lines.append(f"{translation.interface} {len(translation.clocks)}")
    for clock in translation.clocks:
        lines.append(f"{clock.kind} {clock.reference} {clock.interval!r} {clock.shift!r}")
    return os.fsencode("\n".join([*lines, ""]))
