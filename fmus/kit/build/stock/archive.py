"""Stock archives of pythonfmu: FMUs of a component with pythonfmu's binary, for its users.

pythonfmu's builder makes the archive from an adapter and the package of the Python build. It runs
in its own process, because it does not clean up modules and paths. The model description is
replaced, and the archive is packed again so that its bytes are reproducible.
"""

from __future__ import annotations

import importlib.metadata
import io
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

from fmus.kit import files
from fmus.kit.build import archive
from fmus.kit.build.documentation import documents
from fmus.kit.build.package import python_package
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.extras import require
from fmus.kit.storage import scratch

# parts of the contract (docs/reference/fmu-contract.md) that such an archive does not fulfil
LIMITS = (
    (
        "errors: every error is Fatal, not Error; a further call of the instance may crash the"
        " process"
    ),
    (
        "arguments: wrong calls, times that do not follow, negative steps and a wrong GUID are not"
        " refused"
    ),
    "leaks: every instance costs kilobytes that are not given back",
    "places: a folder whose name needs percent-encoding crashes the process",
    "Python: the process must have loaded one (3.11 or newer); no other host loads the binary",
    "platforms: those that pythonfmu has a binary for",
)
_SCRIPT = '''"""The slave of this FMU; its component is in the folder beside."""

from {package} import MODEL, create
from {package}.adapter import ComponentSlave, kept

# pythonfmu runs this for every instance, and releases the globals once too often each time
kept.append(globals())


class {name}(ComponentSlave):
    model, create = MODEL, staticmethod(create)
'''
_IN_PYTHON_BUILD = "resources/python/"


def check_stock(cls: type[Component], platforms: Sequence[str] | None) -> None:
    """Raise an error if pythonfmu cannot build a component.

    Parameters
    ----------
    cls, platforms
        See :func:`stock_archive`.

    Raises
    ------
    UserError
        If pythonfmu is not installed, has no binary for a platform, or the component has an engine
        of its own.
    """
    require("pythonfmu")
    if cls.engine is not None:
        raise UserError(
            f"{cls.name} asks something outside of it, which the pythonfmu runtime cannot; build"
            " python"
        )
    # the imported package may be that of an FMU which this process has run
    installed = importlib.metadata.distribution("pythonfmu")
    binaries = Path(str(installed.locate_file("pythonfmu/resources/binaries")))
    available = sorted(folder.name for folder in binaries.iterdir())
    absent = sorted({*(platforms or ())} - {*available})
    if absent:
        raise UserError(
            f"pythonfmu has no binary for {absent[0]}; it has some for {', '.join(available)}"
        )


def stock_archive(
    cls: type[Component],
    version: str,
    platforms: Sequence[str] | None,
    progress: Callable[[str], None],
) -> bytes:
    """Build a component's archive for pythonfmu.

    Parameters
    ----------
    cls : type[Component]
    version : str
        Version of this package.
    platforms : sequence of str, optional
        FMI platforms; by default all that pythonfmu has a binary for.
    progress : callable
        Called with a short message at each step.

    Returns
    -------
    bytes
        The same sources and the same pythonfmu give the same bytes.

    Raises
    ------
    UserError
        See :func:`check_stock`; or if pythonfmu fails.
    """
    from fmus.kit.build.description import Capabilities, describe_fmi2
    from fmus.kit.symbolic import trace

    check_stock(cls, platforms)
    progress(f"{cls.name}: pythonfmu's builder")
    package = {"adapter.py": (Path(__file__).parent / "adapter.py").read_bytes()}
    others = {}
    for path, text in python_package(cls).items():
        if path.startswith(_IN_PYTHON_BUILD):
            package[path.removeprefix(_IN_PYTHON_BUILD)] = text
        else:
            others[path] = text
    licence = importlib.metadata.distribution("pythonfmu").read_text("licenses/LICENSE") or ""
    contents = {
        **_build_by_pythonfmu(cls.name, package, platforms),
        **documents(cls),
        "documentation/licenses/pythonfmu.txt": licence.encode(),
        **others,
    }
    can = Capabilities(
        needs_execution_tool=True, interpolates_inputs=False, directional_derivatives=False
    )

    def described(guid: str) -> dict[str, bytes]:
        return {"modelDescription.xml": describe_fmi2(cls, trace(cls), can, version, guid)}

    guid = archive.identity(contents | described(archive.NO_GUID))
    return archive.pack(contents | described(guid))


def _build_by_pythonfmu(
    name: str, package: dict[str, bytes], platforms: Sequence[str] | None
) -> dict[str, bytes]:
    """Build an archive from a package by pythonfmu; return its files without the description.

    Modules are named after their contents: a process loads only one module of a name.
    """
    stem = f"{name}_{archive.identity(package).strip('{}').replace('-', '')}"
    with scratch.folder("build") as folder:
        inside = folder / f"{stem}_package"
        built = folder / "built.fmu"
        for path, text in package.items():
            files.write(inside / path, text)
        script = folder / f"{stem}.py"
        files.write(script, _SCRIPT.format(package=inside.name, name=name).encode())
        _run_pythonfmu(name, script, inside, built)
        archived = io.BytesIO(built.read_bytes())
    with zipfile.ZipFile(archived) as unpacked:
        entries = [entry for entry in unpacked.namelist() if entry != "modelDescription.xml"]
        contents = {entry: unpacked.read(entry) for entry in entries}
    return _without_other_platforms(contents, platforms)


def _run_pythonfmu(name: str, script: Path, package: Path, built: Path) -> None:
    """Run pythonfmu's builder; raise a UserError with the last line it printed if it fails."""
    arguments = ["build", "-f", str(script), "-d", str(built), str(package)]
    done = subprocess.run(
        [sys.executable, "-m", "pythonfmu", *arguments],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    if done.returncode != 0:
        lines = (done.stderr.strip() or "no message").splitlines()
        raise UserError(f"pythonfmu failed for {name}: {lines[-1]}")


def _without_other_platforms(
    built: dict[str, bytes], platforms: Sequence[str] | None
) -> dict[str, bytes]:
    """Return files without the binaries for other platforms."""
    if platforms is None:
        return built
    return {
        entry: contents
        for entry, contents in built.items()
        if not entry.startswith("binaries/") or entry.split("/")[1] in platforms
    }
