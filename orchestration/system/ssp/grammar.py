"""The elements of SSP 1.0 that are understood; any other would make another system than its author meant."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from fmus.kit.errors import UserError
from orchestration.system.ssp.vocabulary import OUTSIDE, tag

# What may stand in an element; what it means is judged where it is read.
_CONTENTS = {
    "ssd:SystemStructureDescription": "ssd:System ssd:DefaultExperiment",
    "ssd:System": "ssd:Connectors ssd:Elements ssd:Connections ssd:ParameterBindings",
    "ssd:Elements": "ssd:Component ssd:System ssd:SignalDictionaryReference",  # only the first in the end
    "ssd:Component": "ssd:Connectors ssd:ParameterBindings",
    "ssd:Connectors": "ssd:Connector",
    "ssd:Connector": "ssc:Real ssc:Integer ssc:Boolean ssc:String ssc:Enumeration ssc:Binary",
    "ssd:Connections": "ssd:Connection",
    "ssd:Connection": "ssc:LinearTransformation",
    "ssd:ParameterBindings": "ssd:ParameterBinding",
    "ssd:ParameterBinding": "ssd:ParameterValues ssd:ParameterMapping",
    "ssd:ParameterValues": "ssv:ParameterSet",
    "ssd:DefaultExperiment": "",
    "ssv:ParameterSet": "ssv:Parameters",
    "ssv:Parameters": "ssv:Parameter",
}
# How things look, what others noted, and definitions of names that are known here already.
_PASSED_OVER = (
    "ssd:Annotations ssc:Annotations ssv:Annotations ssd:ElementGeometry ssd:SystemGeometry ssd:ConnectorGeometry "
    "ssd:ConnectionGeometry ssd:GraphicalElements ssd:Units ssd:Enumerations ssv:Units ssv:Enumerations"
)
_ALLOWED = {
    tag(name): {tag(child) for child in children.split()} for name, children in _CONTENTS.items()
}
_ALLOWED[OUTSIDE] = {tag("ssd:Connectors"), tag("ssd:Connections")}
_SILENT = {tag(name) for name in _PASSED_OVER.split()}


def check_elements(element: Element) -> None:
    """Refuse an element with contents that are not understood.

    Parameters
    ----------
    element : Element
        Of a description, or a parameter set; all that is in it is looked at.

    Raises
    ------
    UserError
        Naming the first one, and what it is in.
    """
    for node in element:
        if node.tag in _SILENT:
            continue
        if element.tag in _ALLOWED and node.tag not in _ALLOWED[element.tag]:
            raise UserError(
                f"{described(node)}, in {described(element)}, is not known to this program"
            )
        check_elements(node)


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def described(element: Element) -> str:
    """Name of an element, and what tells it from others of its kind."""
    own = [
        element.get(key)
        for key in ("name", "startElement", "startConnector", "endElement", "endConnector")
    ]
    return " ".join([local(element), *filter(None, own)])
