"""Variables of an FMU that can be neither set nor read by their names, with the reasons."""

from __future__ import annotations

from xml.etree.ElementTree import Element


def left_out(description: Element) -> dict[str, str]:
    """Return the reasons why variables can be neither set nor read, by name.

    Parameters
    ----------
    description : Element
        ``fmiModelDescription`` of FMI 2.0 or 3.0, without translation.

    Returns
    -------
    dict of str to str
        Each the end of a sentence that starts with the name.
    """
    reasons = {}
    for node in description.iterfind("ModelVariables/*"):
        reason = _reason(node)
        if reason:
            reasons[node.get("name", "")] = reason
    return reasons


def _reason(node: Element) -> str:
    """Return the reason for a variable; empty if it can be set or read."""
    causality = node.get("causality", "local")
    if node.tag == "Clock" and causality == "input":
        return "is an input clock, which has no value here"
    if causality == "structuralParameter":
        return f"is a structural parameter, which keeps its start value {node.get('start')} here"
    dimensions = len(node.findall("Dimension"))
    if dimensions and causality in ("parameter", "input", "output"):
        element = f"{node.get('name')}[{','.join('1' * dimensions)}]"
        return f"is an array, whose elements have names of their own, such as {element}"
    return ""
