"""Variables of an FMU that are neither set nor read by their own names here, and why."""

from __future__ import annotations

from xml.etree.ElementTree import Element


def left_out(description: Element) -> dict[str, str]:
    """Return why variables are left out, by name.

    Parameters
    ----------
    description : Element
        ``fmiModelDescription`` as it is in the archive.

    Returns
    -------
    dict of str to str
        What follows the name in a sentence.
    """
    reasons = {}
    for node in description.iterfind("ModelVariables/*"):
        reason = _reason(node)
        if reason:
            reasons[node.get("name", "")] = reason
    return reasons


def _reason(node: Element) -> str:
    causality = node.get("causality", "local")
    if node.tag == "Binary":
        return "is binary, which is not exchanged here"
    if causality == "structuralParameter":
        return f"is a structural parameter, which keeps its start value {node.get('start')} here"
    is_text = node.tag == "String" or node.find("String") is not None
    if is_text and causality in ("input", "output"):
        return f"is a text, which no {causality} can be here"
    dimensions = len(node.findall("Dimension"))
    if dimensions and causality in ("parameter", "input", "output"):
        element = f"{node.get('name')}[{','.join('1' * dimensions)}]"
        return f"is an array, whose elements have names of their own, such as {element}"
    return ""
