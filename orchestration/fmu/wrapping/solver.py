"""Co-simulation of FMUs for model exchange alone: a library with a solver beside the FMU's own.

The solver is CVode of SUNDIALS, whose libraries come with fmpy. Nothing else knows that it is not
the FMU's own.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import fmpy
from fmpy.model_description import CoSimulation

from fmus.kit import UserError
from fmus.kit.storage import scratch
from orchestration.fmu.wrapping.compiled import compiled

_SUNDIALS = ("core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode")  # each needs others


def solved(exchange: Any) -> CoSimulation:
    """Return the interface that an FMU for model exchange has with a solver.

    Parameters
    ----------
    exchange : fmpy.model_description.ModelExchange
    """
    return CoSimulation(
        modelIdentifier=_identifier(exchange.modelIdentifier),
        needsExecutionTool=exchange.needsExecutionTool,
        canBeInstantiatedOnlyOncePerProcess=exchange.canBeInstantiatedOnlyOncePerProcess,
        canGetAndSetFMUstate=exchange.canGetAndSetFMUstate,
        canSerializeFMUstate=exchange.canSerializeFMUstate,
        providesDirectionalDerivative=exchange.providesDirectionalDerivative,
        canHandleVariableCommunicationStepSize=True,
    )


def _identifier(exchange: str) -> str:
    """Return the name of the library with the solver, for the name of the FMU's."""
    return f"{exchange}_solver"


def add_solver(folder: Path, root: Element, label: str) -> None:
    """Put the library with the solver, and its table, into the folder of an unpacked FMU.

    Parameters
    ----------
    folder : Path
    root : Element
        ``fmiModelDescription`` of FMI 2.0 without an element ``CoSimulation``.
    label : str
        Name of the FMU in messages.

    Raises
    ------
    UserError
        If the library cannot be compiled, or fmpy has no solver for this machine.
    """
    exchange = root.find("ModelExchange")
    assert exchange is not None
    own = exchange.get("modelIdentifier", "")
    sundials = Path(fmpy.__file__).parent / "sundials" / fmpy.platform_tuple
    solver = [sundials / f"sundials_{name}{fmpy.sharedLibraryExtension}" for name in _SUNDIALS]
    if not all(path.is_file() for path in solver):
        raise UserError(f"{label}: an FMU for model exchange needs CVode, which fmpy lacks here")
    library = compiled(("solver.c", "platform.c"), [2], f"{label}: model exchange")
    binaries = folder / "binaries" / fmpy.platform
    states = len(root.findall("ModelStructure/Derivatives/Unknown"))
    indicators = int(root.get("numberOfEventIndicators", "0"))
    tells_steps = exchange.get("completedIntegratorStepNotNeeded") not in ("true", "1")
    paths = [binaries / f"{own}{fmpy.sharedLibraryExtension}", *solver]
    lines = [*map(str, paths), f"{states} {indicators} {int(tells_steps)}", ""]
    name = _identifier(own)
    with scratch.written(folder):
        (binaries / f"{name}{fmpy.sharedLibraryExtension}").write_bytes(library.read_bytes())
        (binaries / f"{name}.table").write_bytes(os.fsencode("\n".join(lines)))
