"""The package of a Python FMU: the kit's light modules, the component's own, and the entry that puts them together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from fmus.kit.build.bundle import RUNTIME_MODULES, bundle, place_of
from fmus.kit.component import Component

_KIT = Path(__file__).parents[1]
_PYTHON = "Python 3.11 or newer (shared library or host process)"
_ALONE = f"{_PYTHON}; no packages beyond the standard library.\n"


def python_package(cls: type[Component]) -> dict[str, bytes]:
    """Collect what Python needs at run time.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.

    Returns
    -------
    dict of str to bytes
        Path in the archive to contents: the package in ``resources/python`` and a note on what it needs.

    Raises
    ------
    UserError
        See :func:`.bundle`.
    """
    base, effects = vars(cls).get("stacked", (cls, ()))
    needs: Mapping[str, str] = {}
    slave, own = "from .kit.slave import Slave", []
    if cls.engine is not None:
        module, name = cls.engine.slave.split(":")
        slave, own, needs = (
            f"from .{place_of(module)} import {name} as Slave",
            [module],
            cls.engine.needs,
        )
    modules, places = bundle((base, *effects), own, needs)
    modules |= {f"kit/{name}.py": (_KIT / f"{name}.py").read_bytes() for name in RUNTIME_MODULES}
    modules["__init__.py"] = _entry(cls, base, effects, places, slave).encode()
    packed = {f"resources/python/{name}": contents for name, contents in modules.items()}
    told = f"{_PYTHON} with {', '.join(needs.values())} installed.\n" if needs else _ALONE
    return packed | {"documentation/externalDependencies.txt": told.encode()}


def _entry(
    cls: type[Component],
    base: type[Component],
    effects: tuple[type[Component], ...],
    places: dict[type[Component], tuple[str, str]],
    slave: str,
) -> str:
    """Write the module that makes the component's class again and offers ``create`` (``fmi2/python.c``)."""
    imports = ["from .kit import stack", slave]
    # classes of different modules may share a name
    parts = {used: f"Part{n}" for n, used in enumerate(places)}
    imports += [
        f"from .{place} import {name} as {parts[used]}" for used, (place, name) in places.items()
    ]
    stacked = ", ".join(_part(c, parts) for c in (base, *effects))
    others = f", defaults={values!r}" if (values := vars(cls).get("stacked_with")) else ""
    model = parts[base] if cls is base else f"stack({stacked}, name={cls.name!r}{others})"
    text = '"""The component of this FMU; laws are in the folder beside."""\n\n' + "\n".join(
        sorted(imports)
    )
    return (
        text
        + f"\n\nMODEL = {model}\n\n\ndef create(memory, texts):\n    return Slave(MODEL, memory, texts)\n"
    )


def _part(cls: type[Component], parts: dict[type[Component], str]) -> str:
    """Text of a class in the FMU's package; one that is made for an output or a law is made for it again."""
    if "made_by" not in vars(cls):
        return parts[cls]
    arguments = vars(cls)["made_with"]
    of = arguments[0]
    owner = next(
        name
        for part, name in parts.items()
        if hasattr(part, of) or of in {v.name for v in part.layout.inputs}
    )
    return f"{parts[cls]}({', '.join([owner, *map(repr, arguments)])})"
