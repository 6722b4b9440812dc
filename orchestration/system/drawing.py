"""Drawing of a system: members as boxes with inputs on the left and outputs on the right."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmus.kit.extras import optional
from orchestration.reporting import pictures
from orchestration.system.layout import (
    LETTER,
    TITLE,
    DiagramBox,
    Lane,
    arrange,
    nets_of,
    pin_widths,
    route,
)
from orchestration.system.model import Connection, Port, System

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIRE_COLORS = (
    "#0b6aa2",
    "#d1495b",
    "#4f7d3a",
    "#b07414",
    "#6b4c9a",
    "#1c8a8a",
    "#8a3b6e",
    "#52616b",
)
_TEXT_COLOR = "#1d2730"
_DOC_COLOR = "#52616b"
_PIN_COLOR = "#eef2f5"
_BOX_COLOR = "#f7fafc"


def draw(system: System, path: Path) -> None:
    """Draw a system.

    Parameters
    ----------
    system : System
        A system that passes its check.
    path : Path
        Picture file: .png, .svg or .pdf.

    Raises
    ------
    UserError
        If an FMU cannot be read, or the file cannot be written.
    """
    with optional():
        from matplotlib.figure import Figure

    pictures.picture_format(path)
    boxes, lanes = arrange(system)
    figure = Figure()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for number, (source, connections) in enumerate(nets_of(system).items()):
        color = _WIRE_COLORS[number % len(_WIRE_COLORS)]
        _draw_net(axes, boxes, connections, lanes[source], color)
    for box in boxes.values():
        _draw_box(axes, box)
    for name, port in system.fed_ports:
        _draw_pin(axes, boxes[port.member], port.variable, name, output=False)
    for name, port in system.outputs.items():
        _draw_pin(axes, boxes[port.member], port.variable, name, output=True)
    _draw_title(figure, axes, system, boxes, lanes)
    pictures.save(figure, path)


def _draw_net(
    axes: Axes,
    boxes: Mapping[str, DiagramBox],
    connections: list[Connection],
    lane: Lane,
    color: str,
) -> None:
    """Draw the wires from one output, with arrows, factors and offsets at the inputs."""
    routes = [route(boxes, connection, lane) for connection in connections]
    for connection, points in zip(connections, routes, strict=True):
        x, y = points[-1]
        axes.plot(
            *zip(*points[:-1], (x - 0.05, y), strict=True), color=color, linewidth=1.4, zorder=2
        )
        axes.annotate(
            "", (x, y), (x - 0.14, y), arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.4}
        )
        if not connection.passes_on:
            text = connection.transformation
            axes.text(x - 0.16, y + 0.03, text, ha="right", va="bottom", fontsize=7, color=color)
    if len(routes) > 1:  # the net branches here
        axes.plot(*routes[0][1], marker="o", markersize=3.5, color=color, zorder=3)


def _draw_box(axes: Axes, box: DiagramBox) -> None:
    """Draw a member as a box with a title, inputs on the left and outputs on the right."""
    from matplotlib.patches import FancyBboxPatch, Rectangle

    shape = FancyBboxPatch(
        (box.x, box.y - box.height),
        box.width,
        box.height,
        boxstyle="round,pad=0,rounding_size=0.05",
        facecolor=_BOX_COLOR,
        edgecolor="#52616b",
        linewidth=1.2,
        zorder=4,
    )
    axes.add_patch(shape)
    bar = Rectangle(
        (box.x, box.y - TITLE + 0.06), box.width, TITLE - 0.06, facecolor="#dfe7ed", zorder=5
    )
    bar.set_clip_path(shape)
    axes.add_patch(bar)
    middle = box.x + box.width / 2
    axes.text(
        middle,
        box.y - (TITLE - 0.06) / 2,
        box.title,
        ha="center",
        va="center",
        fontsize=8.5,
        weight="bold",
        color=_TEXT_COLOR,
        zorder=6,
    )
    style: dict[str, Any] = {"va": "center", "fontsize": 8, "color": _TEXT_COLOR, "zorder": 6}
    for name in box.inputs:
        x, y = box.end(name, output=False)
        axes.text(x + 0.08, y, name, ha="left", **style)
    for name in box.outputs:
        x, y = box.end(name, output=True)
        axes.text(x - 0.08, y, name, ha="right", **style)


def _draw_pin(axes: Axes, box: DiagramBox, variable: str, name: str, output: bool) -> None:
    """Draw an input or output of the system at the box of its member."""
    x, y = box.end(variable, output)
    far = x + (0.3 if output else -0.3)
    ends = ((far, y), (x, y)) if output else ((x, y), (far, y))
    axes.annotate(
        "",
        *ends,
        arrowprops={
            "arrowstyle": "-|>",
            "color": _TEXT_COLOR,
            "lw": 1.0,
            "shrinkA": 0,
            "shrinkB": 0,
        },
    )
    frame = {"boxstyle": "round,pad=0.25", "facecolor": _PIN_COLOR, "edgecolor": "#9aa5af"}
    axes.text(
        far,
        y,
        name,
        ha="left" if output else "right",
        va="center",
        fontsize=8,
        color=_TEXT_COLOR,
        bbox=frame,
        zorder=4,
    )


def _draw_title(
    figure: Figure,
    axes: Axes,
    system: System,
    boxes: Mapping[str, DiagramBox],
    lanes: Mapping[Port, Lane],
) -> None:
    """Set the size of the picture, and draw the name and the description of the system."""
    right = _right_border(system, boxes, lanes)
    heights = [lane.y for lane in lanes.values()]
    bottom = min([*(box.y - box.height for box in boxes.values()), *heights])
    top = max([0.15, *heights])
    lines = textwrap.wrap(system.doc, max(20, math.floor((right - 0.4) / (LETTER * 0.95))))
    height = 0.42 + 0.2 * len(lines)
    axes.set_xlim(0.0, right)
    axes.set_ylim(bottom - 0.25, top + height)
    figure.set_size_inches(right, top + height - bottom + 0.25)
    y = top + height - 0.22
    axes.text(0.2, y, system.name, fontsize=11, weight="bold", color=_TEXT_COLOR, va="center")
    for number, line in enumerate(lines):
        axes.text(0.2, y - 0.24 - 0.2 * number, line, fontsize=8, color=_DOC_COLOR, va="center")


def _right_border(
    system: System, boxes: Mapping[str, DiagramBox], lanes: Mapping[Port, Lane]
) -> float:
    """Return x of the right border of the picture, in inches, beyond all boxes, pins and tracks."""
    widths = pin_widths(system.outputs.items(), boxes)
    rights = [box.x + box.width + 0.6 + widths[box.column] for box in boxes.values()]
    return max([*rights, *(lane.source_track + 0.2 for lane in lanes.values()), 5.0])
