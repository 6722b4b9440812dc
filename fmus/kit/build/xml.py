"""XML files as FMI and SSP want them: UTF-8, indented, with the declaration spelt in one way."""

from __future__ import annotations

from xml.etree.ElementTree import Element, indent, tostring


def serialized(root: Element) -> bytes:
    """Write an element as a whole file.

    Parameters
    ----------
    root : Element
        Gets indented.

    Returns
    -------
    bytes
    """
    indent(root)
    body: bytes = tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"
