"""The provenance of an FMU in its description: the component, effects and remarks it was made from.

The class of the FMU can be rebuilt from it, with the start values of the FMU's parameters. It is
written for every registered component, and for a user's class with effects or other values
(:func:`fmus.kit.stack`). It is not written for a user's class alone, because the bytes of its FMU
would depend on the folder of its file and on everything else in that file.

Its place is ``VendorAnnotations`` in FMI 2.0 (2.0.4, section 2.2.6), and in FMI 3.0 an
``Annotation`` of the type ``ppy-rig``::

    <Tool name="ppy-rig">
      <MadeFrom component="ppy_actuator" laws="...">
        <Effect name="strain_saturation"/>
        <Effect name="sensor_lag(voltage)"/>
        <Remark>Fitted to hidden.csv</Remark>
      </MadeFrom>
    </Tool>

``laws`` is the digest of the laws with effects (:attr:`fmus.kit.symbolic.Graph.digest`): a class
with the same digest has the equations of the FMU. A user's class is written as
``<MadeFrom file="models/creep.py" class="Creep" sha256="..." laws="...">``. An effect that was made
for a record has the sample time and the length of the record in seconds:
``<Effect name="transport_delay(voltage)" step="60" duration="86400"/>``. One that a diagnosis made
of a term of a law has the term as data: ``<Effect name="friction_of_velocity"><Term law="friction"
signal="velocity" shape="dry" .../></Effect>``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement

from fmus.kit.component import Component
from fmus.kit.effects import Effect, effect_name, made_with, unstack
from fmus.kit.errors import UserError
from fmus.kit.law_terms import LawTerm
from fmus.kit.registry import is_registered
from fmus.kit.sampling import Sampling

if TYPE_CHECKING:
    from fmus.kit.symbolic import Graph

_PLACES = {  # group and element of annotations, and the attribute that names a tool, by version
    2: ("VendorAnnotations", "Tool", "name"),
    3: ("Annotations", "Annotation", "type"),
}
_TOOL = "ppy-rig"


@dataclass(frozen=True)
class Provenance:
    """The component, effects and remarks that an FMU was made from.

    Attributes
    ----------
    component : str
        Name of a registered component; empty if it is a user's class.
    file, cls : str
        File and name of a user's class. The path is relative to the working directory of the build
        if the file is below that.
    sha256 : str
        Digest of the file's contents, in hexadecimal digits.
    laws : str
        Digest of the laws; empty if the description has none.
    effects : tuple of str
        Names of the effects, innermost first; see :func:`fmus.kit.effects.effect_name`.
    remarks : tuple of str
        Further statements, one by one.
    samplings : Mapping of str to Sampling
        Sampling of the record that an effect was made for, by the effect's name.
    terms : Mapping of str to LawTerm
        Term of a law that an effect was made of, by the effect's name.
    """

    component: str = ""
    file: str = ""
    cls: str = ""
    sha256: str = ""
    laws: str = ""
    effects: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    samplings: Mapping[str, Sampling] = field(default_factory=dict)
    terms: Mapping[str, LawTerm] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """The component as a user writes it: ``ppy_actuator``, or ``models/creep.py:Creep``."""
        return self.component or f"{self.file}:{self.cls}"


def annotate(root: Element, cls: type[Component], graph: Graph, fmi: int) -> None:
    """Append the provenance of a component to a model description.

    Nothing is appended for a user's class without effects, or for a class that no file defines
    under its name.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription``, complete up to what stands before annotations.
    cls : type[Component]
    graph : Graph
        The traced component.
    fmi : {2, 3}
        Version of FMI.
    """
    made_from = _made_from(cls, graph)
    if made_from is not None:
        group, item, name = _PLACES[fmi]
        SubElement(SubElement(root, group), item, {name: _TOOL}).append(made_from)


def _made_from(cls: type[Component], graph: Graph) -> Element | None:
    """Return the element for the provenance of a component; None if it has none."""
    base, effects = unstack(cls)
    origin = _origin(base)
    # not for a user's class alone, whose FMU would depend on the rest of its file
    if origin is None or (cls is base and "file" in origin):
        return None
    made_from = Element("MadeFrom", origin, laws=graph.digest)
    made_from.extend(map(_effect_element, effects))
    for remark in cls.remark.splitlines():
        SubElement(made_from, "Remark").text = remark
    return made_from


def _effect_element(effect: type[Effect]) -> Element:
    """Return the element of an effect, with what it was made for or made of."""
    arguments = made_with(effect)
    term, sampling = arguments.get("term"), arguments.get("sampling")
    if isinstance(term, LawTerm):
        element = Element("Effect", name=term.stem)
        SubElement(element, "Term", {n: _written(v) for n, v in vars(term).items()})
        return element
    of_record = {n: repr(v) for n, v in vars(sampling).items()} if sampling else {}
    return Element("Effect", {"name": effect_name(effect)} | of_record)


def _written(value: str | float | bool | tuple[float, ...]) -> str:
    """Return a value of a term as an attribute has it."""
    if isinstance(value, tuple):
        return " ".join(map(repr, value))
    return value if isinstance(value, str) else repr(value)


def _origin(base: type[Component]) -> dict[str, str] | None:
    """Return the attributes that name a component, or the file and the name of a user's class."""
    if is_registered(base):
        return {"component": base.name}
    module = sys.modules.get(base.__module__)
    path = Path(getattr(module, "__file__", None) or "").absolute()
    if getattr(module, base.__name__, None) is not base or not path.is_file():
        return None
    # a relative path is the same on every machine, and reveals nothing about this one
    here = Path.cwd()
    place = path.relative_to(here) if path.is_relative_to(here) else path
    return {
        "file": place.as_posix(),
        "class": base.__name__,
        "sha256": sha256(path.read_bytes()).hexdigest(),
    }


def read_provenance(root: Element) -> Provenance | None:
    """Read the provenance of an FMU.

    Parameters
    ----------
    root : Element
        ``fmiModelDescription``.

    Returns
    -------
    Provenance or None
        None if the FMU has none.

    Raises
    ------
    UserError
        If the sampling of an effect is not given by two numbers, or a term is incomplete.
    """
    places = [f"{group}/{item}[@{name}='{_TOOL}']" for group, item, name in _PLACES.values()]
    found = (root.find(f"{place}/MadeFrom") for place in places)
    element = next((one for one in found if one is not None), None)
    if element is None:
        return None
    effects = {effect.get("name", ""): effect.attrib for effect in element.iterfind("Effect")}
    terms = {e.get("name", ""): e.find("Term") for e in element.iterfind("Effect")}
    return Provenance(
        component=element.get("component", ""),
        file=element.get("file", ""),
        cls=element.get("class", ""),
        sha256=element.get("sha256", ""),
        laws=element.get("laws", ""),
        effects=tuple(effects),
        remarks=tuple(remark.text or "" for remark in element.iterfind("Remark")),
        samplings={
            name: _read_sampling(name, given) for name, given in effects.items() if "step" in given
        },
        terms={n: _read_term(n, term.attrib) for n, term in terms.items() if term is not None},
    )


def _read_sampling(effect: str, given: Mapping[str, str]) -> Sampling:
    """Return the sampling from the attributes that `_sampling_attributes` writes."""
    try:
        return Sampling(float(given["step"]), float(given["duration"]))
    except (KeyError, ValueError) as error:
        raise UserError(
            f"the effect {effect} has step={given['step']!r} and"
            f" duration={given.get('duration', '')!r}, which must be two numbers, in s"
        ) from error


def _read_term(effect: str, given: Mapping[str, str]) -> LawTerm:
    """Return the term from the attributes that `_effect_element` writes."""
    values: dict[str, Any] = {}
    for one in fields(LawTerm):
        text = given.get(one.name, "" if one.name == "range" else None)  # older FMUs have none
        try:
            if text is None:
                raise ValueError("is missing")
            values[one.name] = _READ[str(one.type)](text)
        except (KeyError, ValueError) as error:
            raise UserError(
                f"the term of the effect {effect}: {one.name} {text!r} cannot be read"
            ) from error
    return LawTerm(**values)


_READ: dict[str, Callable[[str], Any]] = {
    "str": str,
    "float": float,
    "int": int,
    "bool": {"True": True, "False": False}.__getitem__,
    "tuple[float, ...]": lambda text: tuple(map(float, text.split())),
}
