"""A picture of a system: members as boxes, inputs on the left, outputs on the right, a wire for every connection."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration.reporting import pictures
from orchestration.system.layout import LETTER, TITLE, Box, Lane, arrange, nets_of, route
from orchestration.system.model import Connection, Port, System

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIRES = ("#0b6aa2", "#d1495b", "#4f7d3a", "#b07414", "#6b4c9a", "#1c8a8a", "#8a3b6e", "#52616b")
_TEXT, _PIN, _BOX = "#1d2730", "#eef2f5", "#f7fafc"


def draw(system: System, path: Path) -> None:
    """Draw a system.

    Parameters
    ----------
    system : System
        One that passes :func:`.check.check`.
    path : Path
        Picture: .png, .svg or .pdf.

    Raises
    ------
    UserError
        If an FMU cannot be read, or the file cannot be written.
    """
    from matplotlib.figure import Figure

    pictures.picture_format(path)
    boxes, lanes = arrange(system)
    figure = Figure()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for number, (source, connections) in enumerate(nets_of(system).items()):
        _wire(axes, boxes, connections, lanes[source], _WIRES[number % len(_WIRES)])
    for box in boxes.values():
        _box(axes, box)
    for name, ports in system.inputs.items():
        for port in ports:
            _pin(axes, boxes[port.member], port.variable, name, output=False)
    for name, port in system.outputs.items():
        _pin(axes, boxes[port.member], port.variable, name, output=True)
    _frame(figure, axes, system, boxes, lanes)
    pictures.save(figure, path)


def _wire(
    axes: Axes, boxes: Mapping[str, Box], connections: list[Connection], lane: Lane, color: str
) -> None:
    """Draw a net: all that comes from one output."""
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
            text = f"× {connection.factor:g}" + (
                f" {connection.offset:+g}" if connection.offset else ""
            )
            axes.text(x - 0.16, y + 0.03, text, ha="right", va="bottom", fontsize=7, color=color)
    if len(routes) > 1:  # where the net branches
        axes.plot(*routes[0][1], marker="o", markersize=3.5, color=color, zorder=3)


def _box(axes: Axes, box: Box) -> None:
    from matplotlib.patches import FancyBboxPatch, Rectangle

    shape = FancyBboxPatch(
        (box.x, box.y - box.height),
        box.width,
        box.height,
        boxstyle="round,pad=0,rounding_size=0.05",
        facecolor=_BOX,
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
        color=_TEXT,
        zorder=6,
    )
    for output, names in ((False, box.inputs), (True, box.outputs)):
        for name in names:
            x, y = box.end(name, output)
            side, shift = ("right", -0.08) if output else ("left", 0.08)
            axes.text(x + shift, y, name, ha=side, va="center", fontsize=8, color=_TEXT, zorder=6)


def _pin(axes: Axes, box: Box, variable: str, name: str, output: bool) -> None:
    """Draw an input or output of the system at the box that it belongs to."""
    x, y = box.end(variable, output)
    far = x + (0.3 if output else -0.3)
    ends = ((far, y), (x, y)) if output else ((x, y), (far, y))
    axes.annotate(
        "",
        *ends,
        arrowprops={"arrowstyle": "-|>", "color": _TEXT, "lw": 1.0, "shrinkA": 0, "shrinkB": 0},
    )
    frame = {"boxstyle": "round,pad=0.25", "facecolor": _PIN, "edgecolor": "#9aa5af"}
    axes.text(
        far,
        y,
        name,
        ha="left" if output else "right",
        va="center",
        fontsize=8,
        color=_TEXT,
        bbox=frame,
        zorder=4,
    )


def _frame(
    figure: Figure, axes: Axes, system: System, boxes: Mapping[str, Box], lanes: Mapping[Port, Lane]
) -> None:
    """Fit the picture to what is in it, under its title."""
    longest = {
        c: max(
            (len(n) for n, p in system.outputs.items() if boxes[p.member].column == c), default=0
        )
        for c in {box.column for box in boxes.values()}
    }
    rights = [box.x + box.width + 0.6 + LETTER * longest[box.column] for box in boxes.values()]
    right = max([*rights, *(lane.own + 0.2 for lane in lanes.values()), 5.0])
    bottom = min(
        [box.y - box.height for box in boxes.values()]
        + [lane.y for lane in lanes.values() if lane.y < 0]
    )
    top = max([0.15, *(lane.y for lane in lanes.values())])
    text = textwrap.wrap(system.doc, max(20, math.floor((right - 0.4) / (LETTER * 0.95))))
    height = 0.42 + 0.2 * len(text)
    axes.set_xlim(0.0, right)
    axes.set_ylim(bottom - 0.25, top + height)
    axes.text(
        0.2, top + height - 0.22, system.name, fontsize=11, weight="bold", color=_TEXT, va="center"
    )
    for line, words in enumerate(text):
        axes.text(
            0.2, top + height - 0.46 - 0.2 * line, words, fontsize=8, color="#52616b", va="center"
        )
    figure.set_size_inches(right, top + height - bottom + 0.25)
