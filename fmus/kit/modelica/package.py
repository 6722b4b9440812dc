"""A package of components as files: a folder for a package, a file for every other class.

Specification 3.6, section 13.4: ``package.mo`` makes a folder a package, and ``package.order``
lists its classes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.modelica.connectors import INTERFACES, interface_classes
from fmus.kit.modelica.functions import function_classes
from fmus.kit.modelica.model import model_text
from fmus.kit.modelica.names import class_name, comment, string

PACKAGE = "PpyRig"
_FUNCTIONS = "Functions"
_ABOUT = "Components of a polypyrrole artificial-muscle rig, with the laws of their FMUs"


def package_files(classes: Sequence[type[Component]], version: str) -> dict[str, str]:
    """Write a package of components.

    Parameters
    ----------
    classes : sequence of type[Component]
        Possibly with effects stacked on them.
    version : str

    Returns
    -------
    dict of str to str
        Text of each file by its path, from the folder that the package is put into.

    Raises
    ------
    UserError
        If one has no laws, if two have the same name, or if a law calls a function that the
        language has not.
    """
    models: dict[str, str] = {}
    for cls in classes:
        if cls.engine is not None:
            raise UserError(
                f"{cls.name}: it has an engine in the place of laws, and Modelica has only laws"
            )
        name = class_name(cls.name)
        if name in models:
            raise UserError(f"{cls.name}: there is a model {name} already; name each once")
        models[name] = model_text(cls)
    return (
        _folder(PACKAGE, "", models, _ABOUT, (INTERFACES, _FUNCTIONS), version)
        | _folder(INTERFACES, PACKAGE, interface_classes(), "Connectors")
        | _folder(_FUNCTIONS, PACKAGE, function_classes(), "Functions that equations call")
    )


def _folder(
    name: str,
    within: str,
    classes: Mapping[str, str],
    about: str,
    packages: Sequence[str] = (),
    version: str = "",
) -> dict[str, str]:
    """Write the files of one package."""
    path = f"{within}/{name}" if within else name
    full = f"{within}.{name}" if within else name
    annotation = f"  annotation(version={string(version)});\n" if version else ""
    files = {
        f"{path}/package.mo": (
            f"within {within};\npackage {name}{comment(about)}\n{annotation}end {name};\n"
        ),
        f"{path}/package.order": "".join(f"{each}\n" for each in (*packages, *classes)),
    }
    for each, text in classes.items():
        files[f"{path}/{each}.mo"] = f"within {full};\n{text.rstrip()}\n"
    return files
