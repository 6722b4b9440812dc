"""A Modelica package of components as files: a folder for a package, a file for every class.

Specification 3.6, section 13.4: ``package.mo`` makes a folder a package, and ``package.order``
lists its classes.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from fmus.kit.build.toolchain import fmi_headers
from fmus.kit.component import Component
from fmus.kit.errors import UserError
from fmus.kit.modelica.connectors import (
    INTERFACES,
    SOURCES,
    interface_classes,
    source_classes,
)
from fmus.kit.modelica.examples import EXAMPLES, example_classes
from fmus.kit.modelica.flat import flat_text
from fmus.kit.modelica.functions import function_classes
from fmus.kit.modelica.model import trace_model
from fmus.kit.modelica.names import PACKAGE, class_name, comment, string
from fmus.kit.modelica.wrapper import WRAPPERS, support_classes, wrapper_text

_FUNCTIONS = "Functions"
_LICENCES = "documentation/licenses/"
_GLUE = Path(__file__).parent / "include" / "ppy_rig_fmu.h"
_ABOUT = "Components of a polypyrrole artificial-muscle rig, with the laws of their FMUs"


def package_files(
    classes: Sequence[type[Component]], version: str, fmus: Mapping[str, bytes] | None = None
) -> dict[str, bytes]:
    """Write a Modelica package of components.

    Parameters
    ----------
    classes : sequence of type[Component]
        Components, possibly with effects stacked on them.
    version : str
        Version of the package.
    fmus : Mapping of str to bytes, optional
        Native FMUs 2.0 of all components, by name. If given, the package also has a model for each
        FMU that loads and steps it.

    Returns
    -------
    dict of str to bytes
        Contents of each file by its path relative to the parent folder of the package.

    Raises
    ------
    UserError
        If a component has no laws, two have the same name, or a law calls a function that Modelica
        does not have.
    """
    models: dict[str, str] = {}
    flat = ""
    for cls in classes:
        if cls.engine is not None:
            raise UserError(
                f"{cls.name}: it has an engine in the place of laws, and Modelica has only laws"
            )
        name = class_name(cls.name)
        if name in models:
            raise UserError(f"{cls.name}: there is a model {name} already; name each once")
        model = trace_model(cls)
        models[name] = model.text()
        flat += flat_text(model)
    examples = example_classes(classes)
    packages = [INTERFACES, _FUNCTIONS, SOURCES]
    packages += [name for name, there in ((EXAMPLES, examples), (WRAPPERS, fmus)) if there]
    texts = (
        _files_of_package(PACKAGE, "", models, _ABOUT, packages, version)
        | _files_of_package(INTERFACES, PACKAGE, interface_classes(), "Connectors")
        | _files_of_package(
            _FUNCTIONS, PACKAGE, function_classes(), "Functions that equations call"
        )
        | _files_of_package(SOURCES, PACKAGE, source_classes(), "Sources and references")
    )
    if examples:
        about = "Systems of components, ready to simulate"
        texts |= _files_of_package(EXAMPLES, PACKAGE, examples, about)
    # no class of the package: it has no package.mo, by which a tool knows a folder of classes
    texts[f"{PACKAGE}/Resources/Pymoca/{PACKAGE}.mo"] = f"package {PACKAGE}\n{flat}end {PACKAGE};\n"
    files = {path: text.encode() for path, text in texts.items()}
    return files | (_wrapper_files(classes, fmus) if fmus else {})


def _wrapper_files(
    classes: Sequence[type[Component]], fmus: Mapping[str, bytes]
) -> dict[str, bytes]:
    """Return the files of models that load FMUs, with the libraries of these FMUs."""
    models = support_classes()
    resources: dict[str, bytes] = {}
    for cls in classes:
        with zipfile.ZipFile(io.BytesIO(fmus[cls.name])) as archive:
            description = ElementTree.fromstring(archive.read("modelDescription.xml"))
            models[class_name(cls.name)] = wrapper_text(cls, description.attrib["guid"])
            for path in archive.namelist():
                for folder, destination in (("binaries/", "Library"), (_LICENCES, "Licences")):
                    if path.startswith(folder):
                        name = f"{destination}/{path.removeprefix(folder)}"
                        resources[name] = archive.read(path)
    headers = fmi_headers(2)
    for name in ("fmi2FunctionTypes.h", "fmi2TypesPlatform.h"):
        resources[f"Include/{name}"] = (headers / name).read_bytes()
    resources[f"Include/{_GLUE.name}"] = _GLUE.read_bytes()
    texts = _files_of_package(WRAPPERS, PACKAGE, models, "Components as their FMUs compute them")
    files = {path: text.encode() for path, text in texts.items()}
    return files | {f"{PACKAGE}/Resources/{path}": data for path, data in resources.items()}


def _files_of_package(
    name: str,
    within: str,
    classes: Mapping[str, str],
    about: str,
    packages: Sequence[str] = (),
    version: str = "",
) -> dict[str, str]:
    """Return the files of a Modelica package by path: of the package, and of each of its classes.

    Parameters
    ----------
    name, within : str
        Names of the package, and of the package that contains it, if any.
    classes : Mapping of str to str
        Text of each class by its name.
    about : str
        Description of the package.
    packages : sequence of str
        Packages within this one.
    version : str
        Version of the package; empty if it has none of its own.
    """
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
