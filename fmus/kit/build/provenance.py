"""What an FMU was made from, so that it gives back its class: component, effects and remarks, in its description.

Only a component that effects or other values were laid over (:func:`fmus.kit.stack`) has it; the values themselves are
the start values of the FMU's parameters. It stands in ``VendorAnnotations`` (FMI 2.0.4, section 2.2.6)::

    <Tool name="ppy-rig">
      <MadeFrom component="ppy_actuator">        or    <MadeFrom file="models/creep.py" class="Creep" sha256="...">
        <Effect name="strain_saturation"/>
        <Effect name="sensor_lag(voltage)"/>
        <Remark>Fitted to hidden.csv</Remark>
      </MadeFrom>
    </Tool>
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from fmus.kit.component import Component, effect_name

_TOOL = "ppy-rig"


@dataclass(frozen=True)
class Provenance:
    """What a component was made from.

    Attributes
    ----------
    component : str
        Name of one of our components; empty if it is a user's class.
    file, cls : str
        A user's class: its file, as seen from the folder in which the FMU was built if it is below that, and its name.
    sha256 : str
        Of the file's contents, in hexadecimal digits.
    effects : tuple of str
        Names of the effects laid over it, innermost first; see :func:`fmus.kit.component.effect_name`.
    remarks : tuple of str
        What else was said of it.
    """

    component: str = ""
    file: str = ""
    cls: str = ""
    sha256: str = ""
    effects: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """As a user names it: ``ppy_actuator``, or ``models/creep.py:Creep``."""
        return self.component or f"{self.file}:{self.cls}"


def annotate(root: Element, cls: type[Component]) -> None:
    """Append what a stacked component was made from to a model description.

    Nothing is appended for another component, and for a class that no file gives back by name.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription``, complete up to ``DefaultExperiment``.
    cls : type[Component]
    """
    if "stacked" not in vars(cls):
        return
    base, effects = vars(cls)["stacked"]
    origin = _origin(base)
    if origin is None:
        return
    tool = SubElement(SubElement(root, "VendorAnnotations"), "Tool", name=_TOOL)
    made_from = SubElement(tool, "MadeFrom", origin)
    for effect in effects:
        SubElement(made_from, "Effect", name=effect_name(effect))
    for remark in cls.remark.splitlines():
        SubElement(made_from, "Remark").text = remark


def _origin(base: type[Component]) -> dict[str, str] | None:
    package = __package__.partition(".")[0]
    if base.__module__.partition(".")[0] == package:
        return {"component": base.name}
    module = sys.modules.get(base.__module__)
    path = Path(getattr(module, "__file__", None) or "").absolute()
    if getattr(module, base.__name__, None) is not base or not path.is_file():
        return None
    here = (
        Path.cwd()
    )  # a path from there is the same on every machine, and tells nothing of this one
    place = path.relative_to(here) if path.is_relative_to(here) else path
    return {
        "file": place.as_posix(),
        "class": base.__name__,
        "sha256": sha256(path.read_bytes()).hexdigest(),
    }


def read(root: Element) -> Provenance | None:
    """Read what an FMU was made from.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription``.

    Returns
    -------
    Provenance or None
        None for an FMU that does not tell.
    """
    found = root.find(f"VendorAnnotations/Tool[@name='{_TOOL}']/MadeFrom")
    if found is None:
        return None
    return Provenance(
        component=found.get("component", ""),
        file=found.get("file", ""),
        cls=found.get("class", ""),
        sha256=found.get("sha256", ""),
        effects=tuple(effect.get("name", "") for effect in found.iterfind("Effect")),
        remarks=tuple(remark.text or "" for remark in found.iterfind("Remark")),
    )
