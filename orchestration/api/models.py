"""FMU files from Python: ``ppy.build`` and ``ppy.check``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fmus.kit import Component, files
from fmus.kit import build as kit
from fmus.kit.build.toolchain import host_platform
from orchestration.fmu.check import Finding, check_fmu
from orchestration.fmu.model import find_class


def build(
    model: type[Component] | str,
    path: str | Path,
    *,
    runtime: str = "native",
    effects: Sequence[str] = (),
    platforms: Sequence[str] | None = None,
) -> Path:
    """Build a component as an FMU 2.0.

    Parameters
    ----------
    model : type[Component] or str
        A component's name, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``.
    path : str or Path
        The ``.fmu`` to write.
    runtime : {"native", "python", "pythonfmu"}
        Compiled from C, laws interpreted by Python, or a stock archive of pythonfmu, which promises less.
    effects : sequence of str
        Effects of the catalogue to lay over it.
    platforms : sequence of str, optional
        FMI platforms; default this machine's.

    Returns
    -------
    Path
        What was written.

    Raises
    ------
    UserError
        If there is no such model, effect, runtime or compiler, or the file cannot be written.

    Examples
    --------
    >>> import orchestration as ppy
    >>> ppy.build("ppy_actuator", "actuator.fmu", effects=["strain_saturation"]).name
    'actuator.fmu'
    """
    cls = find_class(model, effects) if isinstance(model, str) else model
    files.write(Path(path), kit.build(cls, runtime, platforms or [host_platform()]))
    return Path(path)


def check(path: str | Path) -> list[Finding]:
    """Check an FMU, ours or anybody's, against the static part of the contract.

    Parameters
    ----------
    path : str or Path
        The ``.fmu`` file.

    Returns
    -------
    list of Finding
        Errors first, then warnings, then notes; empty if there is nothing to say.

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU, or not of FMI 2.0.

    Examples
    --------
    >>> import orchestration as ppy
    >>> findings = ppy.check(ppy.build("ppy_actuator", "actuator.fmu"))
    >>> [finding for finding in findings if finding.severity == "error"]
    []
    """
    return check_fmu(Path(path))
