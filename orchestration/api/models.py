"""FMU files from Python: ``ppy.build`` and ``ppy.check``."""

from __future__ import annotations

from pathlib import Path
from typing import Unpack

from fmus.kit import Component, UserError, files
from fmus.kit import build as kit
from fmus.kit.build import host_platform
from orchestration import master
from orchestration.api.declaration import takes
from orchestration.api.options import BuildKeywords
from orchestration.experiment.subjects import find_system, is_system
from orchestration.fmu.check import Findings, check_fmu
from orchestration.fmu.model import find_class
from orchestration.system import System


@takes(BuildKeywords)
def build(
    model: type[Component] | System | str, path: str | Path, **options: Unpack[BuildKeywords]
) -> Path:
    """Build a component as an FMU 2.0, or a whole system as one.

    Parameters
    ----------
    model : type[Component], System or str
        A component's name, ``path/to/file.py:Class``, or a class such as ``diagnose(...).model``. A
        system, its name or its file, is compiled from the equations of its members and computes
        what a run of it does with default options.
    path : str or Path
        File ``.fmu`` to write.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UserError
        If there is no such model, effect, runtime, version or compiler, the file cannot be written,
        or a member of a system has no equations.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> ppy.build("ppy_actuator", "actuator.fmu", effects=["strain_saturation"]).name
    'actuator.fmu'
    """
    platforms = options["platforms"] or [host_platform()]
    if isinstance(model, str) and is_system(model):
        model = find_system(model)
    if isinstance(model, System):
        _refuse_for_systems(model, options)
        made = master.pack(model, platforms)
    else:
        cls = find_class(model, options["effects"]) if isinstance(model, str) else model
        runtime, fmi, clocks = options["runtime"], options["fmi"], options["clocks"]
        made = kit.build(cls, runtime, platforms, fmi=fmi, clocks=clocks)
    files.write(Path(path), made)
    return Path(path)


def _refuse_for_systems(system: System, options: BuildKeywords) -> None:
    """Raise UserError for an option that a system does not have."""
    plain = options["runtime"] == "native" and options["fmi"] == 2 and not options["clocks"]
    if options["effects"] or not plain:
        raise UserError(
            f"{system.name} is a system, which is built native, of FMI 2.0 and without effects"
        )


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
