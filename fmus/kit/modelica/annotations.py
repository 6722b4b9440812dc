"""Annotations of Modelica models: documentation, icons and placements of connectors.

An icon is a box with the name, signals at its sides and connectors of ports below.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence

from fmus.kit import quoting
from fmus.kit.component import Component
from fmus.kit.modelica.names import string

_BOX = (
    "Icon(graphics={Rectangle(extent={{-100,-100},{100,100}}, lineColor={0,0,127},"
    " fillColor={255,255,255}, fillPattern=FillPattern.Solid),"
    ' Text(extent={{-150,110},{150,150}}, textString="%name")})'
)
_EDGE = 110  # distance of connectors from the middle; the box ends at 100
_SIZE = 10


def annotation(cls: type[Component]) -> str:
    """Write the annotation of a model: its icon and its documentation."""
    paragraphs = [*inspect.cleandoc(cls.__doc__ or "").split("\n\n"), *cls.remark.splitlines()]
    body = "".join(f"<p>{quoting.html(' '.join(p.split()))}</p>" for p in paragraphs if p)
    return f"annotation({_BOX}, Documentation(info={string(f'<html>{body}</html>')}));"


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
    # in an icon y increases upwards
    return {
        **{name: _placement(-_EDGE, -y) for name, y in _positions_along_side(inputs)},
        **{name: _placement(_EDGE, -y) for name, y in _positions_along_side(outputs)},
        **{name: _placement(x, -_EDGE) for name, x in _positions_along_side(connectors)},
    }


def _positions_along_side(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return each name with its position on a side of the box, evenly between -100 and 100."""
    return [(name, round(200 * (k + 0.5) / len(names)) - 100) for k, name in enumerate(names)]


def _placement(x: int, y: int) -> str:
    extent = f"{{{{{x - _SIZE},{y - _SIZE}}},{{{x + _SIZE},{y + _SIZE}}}}}"
    return f" annotation(Placement(transformation(extent={extent})))"
