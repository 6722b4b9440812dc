"""FMU files from Python: ``ppy.build`` and ``ppy.check``."""

from __future__ import annotations

from pathlib import Path
from typing import Unpack

from fmus.kit import Component, files
from fmus.kit import build as kit
from fmus.kit.build import host_platform
from orchestration.api.declaration import takes
from orchestration.api.options import BuildKeywords
from orchestration.fmu.check import Findings, check_fmu
from orchestration.fmu.model import find_class


@takes(BuildKeywords)
def build(model: type[Component] | str, path: str | Path, **options: Unpack[BuildKeywords]) -> Path:
    """Build a component as an FMU 2.0.

    Parameters
    ----------
    model : type[Component] or str
        A component's name, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``.
    path : str or Path
        File ``.fmu`` to write.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UserError
        If there is no such model, effect, runtime, version or compiler, or the file cannot be
        written.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> ppy.build("ppy_actuator", "actuator.fmu", effects=["strain_saturation"]).name
    'actuator.fmu'
    """
    cls = find_class(model, options["effects"]) if isinstance(model, str) else model
    platforms = options["platforms"] or [host_platform()]
    files.write(Path(path), kit.build(cls, options["runtime"], platforms, fmi=options["fmi"]))
    return Path(path)


def check(path: str | Path) -> Findings:
    """Check any FMU against the static part of the contract.

    Parameters
    ----------
    path : str or Path
        The ``.fmu`` file.

    Returns
    -------
    Findings
        A list of `orchestration.fmu.check.Finding`: errors first, then warnings, then notes.

    Raises
    ------
    UserError
        If the file is missing, no zip archive, no FMU, or of neither FMI 2.0 nor 3.0.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> findings = ppy.check(ppy.build("ppy_actuator", "actuator.fmu"))
    >>> [finding for finding in findings if finding.severity == "error"]
    []
    """
    return check_fmu(Path(path))
