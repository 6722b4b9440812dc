"""The class behind an FMU that was built here from a component with effects, or with other values, laid over it."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit.build.provenance import Provenance, read
from fmus.kit.errors import UserError
from orchestration.fmu.archive import Archive
from orchestration.fmu.effects import find_effects
from orchestration.fmu.loading import load_class
from orchestration.fmu.signal import Signal, declared_signal

if TYPE_CHECKING:
    from fmus.kit import Component


def read_provenance(path: Path) -> tuple[str, Provenance | None]:
    """Name of an FMU's model, and what it was made from; nothing of the FMU is run.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    with Archive(path) as archive:
        return archive.description.get("modelName", ""), read(archive.description)


def restore(name: str, made_from: Provenance, parameters: Mapping[str, Signal]) -> type[Component]:
    """Make the class again that an FMU was built from.

    No code of the FMU is run: the class is one of ours, or it is in a file that has not changed since.

    Parameters
    ----------
    name : str
        Of the model.
    made_from : Provenance
    parameters : Mapping of str to Signal
        The FMU's; their start values become the defaults.

    Raises
    ------
    UserError
        Saying why it cannot be made: no such component or file, another content, other effects or parameters.
    """
    from fmus.kit import stack

    base = _base(made_from)
    effects = find_effects(base, made_from.effects, made_from.place)
    plain = stack(base, *effects, name=name)
    declared = {
        p.name: declared_signal(p).default for p in (*plain.layout.parameters, *plain.layout.texts)
    }
    if declared.keys() != parameters.keys():
        other = sorted(declared.keys() ^ parameters.keys())[0]
        raise UserError(f"{made_from.place} has other parameters now, such as {other}")
    values: Any = {
        n: parameters[n].default for n, start in declared.items() if parameters[n].default != start
    }
    made = stack(base, *effects, name=name, defaults=values)
    made.remark = "\n".join(made_from.remarks)
    return made


def _base(made_from: Provenance) -> type[Component]:
    """One of our components, or a class in a file that is there with the same contents; nothing else is loaded."""
    from fmus import MODELS, component

    if made_from.component:
        if made_from.component not in MODELS:
            raise UserError(f"there is no component {made_from.component!r} here")
        return component(made_from.component)
    path = Path(made_from.file)
    if path.suffix != ".py" or not path.is_file():
        raise UserError(f"there is no file {made_from.file} here")
    if sha256(path.read_bytes()).hexdigest() != made_from.sha256:
        raise UserError(f"{made_from.file} has changed since")
    return load_class(made_from.place)
