"""Graphics of Modelica icons and diagrams (specification 3.6, chapter 18).

Coordinates are from -100 to 100; y increases upwards.
"""

from __future__ import annotations

from collections.abc import Sequence

SIGNAL = "0,0,127"  # colour of signals of type Real: red, green, blue
_WHOLE = "extent={{-100,-100},{100,100}}"
_SIZE = 10  # half the width of a connector
_TITLE = 'Text(extent={{-150,110},{150,150}}, textString="%name")'


def square(colour: str) -> str:
    """Write an icon that is a filled square of a colour."""
    return _icon([f"Rectangle({_WHOLE}, {_filled(colour, colour)})"])


def triangle(colour: str) -> str:
    """Write an icon that is a filled triangle of a colour, which points to the right."""
    corners = "{{-100,100},{100,0},{-100,-100}}"
    return _icon([f"Polygon(points={corners}, {_filled(colour, colour)})"])


def box(colour: str, lines: Sequence[tuple[str, str]]) -> str:
    """Write an icon that is a box with lines in it and the name of the component above it.

    Parameters
    ----------
    colour : str
        Colour of the box.
    lines : sequence of tuple
        Points of each line, between -50 and 50, and its colour. They are drawn in a row.

    Returns
    -------
    str
    """
    shapes = [f"Rectangle({_WHOLE}, {_filled(colour, '255,255,255')})", _TITLE]
    for (points, of_line), middle in zip(lines, positions(len(lines)), strict=True):
        line = f"points={{{points}}}, color={{{of_line}}}, thickness=1.0"
        shapes.append(f"Line(origin={{{middle},0}}, {line})")
    return _icon(shapes)


def positions(count: int) -> list[int]:
    """Return positions evenly between -100 and 100."""
    return [round(200 * (k + 0.5) / count) - 100 for k in range(count)]


def placement(x: int, y: int, size: int = _SIZE) -> str:
    """Write the annotation of a component's place with a space before it.

    Parameters
    ----------
    x, y : int
        Its middle.
    size : int
        Half its width.

    Returns
    -------
    str
    """
    extent = f"{{{{{x - size},{y - size}}},{{{x + size},{y + size}}}}}"
    return f" annotation(Placement(transformation(extent={extent})))"


def _icon(shapes: Sequence[str]) -> str:
    return f"Icon(graphics={{{', '.join(shapes)}}})"


def _filled(line: str, fill: str) -> str:
    return f"lineColor={{{line}}}, fillColor={{{fill}}}, fillPattern=FillPattern.Solid"
