"""FMU files from Python: ``ppy.build``, ``ppy.pack`` and ``ppy.check``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from fmus.kit import Component, files
from fmus.kit import build as kit
from fmus.kit.build import host_platform
from orchestration import master
from orchestration.api.declaration import takes
from orchestration.api.options import BuildKeywords
from orchestration.experiment.system_model import find_system
from orchestration.fmu.check import Findings, check_fmu
from orchestration.fmu.model import find_class
from orchestration.system import System


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


def pack(
    system: System | str | Path, path: str | Path, platforms: Sequence[str] | None = None
) -> Path:
    """Pack a system into one FMU 2.0 for co-simulation, compiled from the equations of its members.

    Each communication step of it equals that of a run with default options.

    Parameters
    ----------
    system : System, str or Path
        A system, the name of one that ships, or a file ``.ssp`` or ``.ssd``.
    path : str or Path
        File ``.fmu`` to write.
    platforms : sequence of str, optional
        FMI platforms; by default that of this machine.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UserError
        If there is no such system, it does not pass its check, a member has no equations, a
        platform fails, or the file cannot be written.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> ppy.pack("dma_bench", "bench.fmu").name
    'bench.fmu'
    """
    found = system if isinstance(system, System) else find_system(str(system))
    files.write(Path(path), master.pack(found, platforms or [host_platform()]))
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
