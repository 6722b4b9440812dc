"""Annotations of Modelica models: documentation, icons and placements of connectors.

An icon is a box with the name, signals at its sides and connectors of ports below; in it are a
symbol for each domain of its ports, and steps if something in it is sampled.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence

from fmus.kit import quoting
from fmus.kit.component import Component
from fmus.kit.modelica.connectors import symbol
from fmus.kit.modelica.graphics import SIGNAL, box, placement, positions
from fmus.kit.modelica.names import string

_EDGE = 110  # distance of connectors from the middle; the box ends at 100
_STEPS = "{-40,-30},{-15,-30},{-15,0},{10,0},{10,30},{40,30}"


def annotation(cls: type[Component]) -> str:
    """Write the annotation of a model: its icon and its documentation."""
    paragraphs = [*inspect.cleandoc(cls.__doc__ or "").split("\n\n"), *cls.remark.splitlines()]
    body = "".join(f"<p>{quoting.html(' '.join(p.split()))}</p>" for p in paragraphs if p)
    symbols = [symbol(domain) for domain in dict.fromkeys(port.domain for port in cls.ports)]
    if cls.layout.sampled:
        symbols.append((_STEPS, SIGNAL))
    return (
        f"annotation({box(SIGNAL, symbols)}, Documentation(info={string(f'<html>{body}</html>')}));"
    )


def placements(cls: type[Component]) -> dict[str, str]:
    """Return the placements of the connectors of a model on its icon.

    Parameters
    ----------
    cls : type[Component]

    Returns
    -------
    dict of str to str
        Annotation by name of the connector: inputs at the left and outputs at the right, from top
        to bottom, and those of ports at the bottom, from left to right.
    """
    at_ports = {name for port in cls.ports for name in port.variables}
    inputs = [v.name for v in cls.layout.inputs if v.name not in at_ports]
    outputs = [v.name for v in cls.layout.shown]
    connectors = [name for port in cls.ports for name in port.connectors]
    return {
        **{name: placement(-_EDGE, -y) for name, y in _along_side(inputs)},
        **{name: placement(_EDGE, -y) for name, y in _along_side(outputs)},
        **{name: placement(x, -_EDGE) for name, x in _along_side(connectors)},
    }


def _along_side(names: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Return each name with its position on a side of the box, evenly between -100 and 100."""
    return zip(names, positions(len(names)), strict=True)
