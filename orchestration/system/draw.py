"""A picture of a system: members as boxes, inputs on the left, outputs on the right, and a wire for every connection.

Members stand in columns in the order in which signals pass them. Wires to the next column go straight there, in a track
of their own; those that skip columns go over the boxes, those that lead back go under them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from orchestration import pictures
from orchestration.models import Model

from .check import interface
from .model import Connection, Member, Port, System

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# all lengths in inches
_ROW, _TITLE, _SPACE = 0.24, 0.36, 0.45
_LETTER = 0.078  # width of one at the size of the text
_TRACK = 0.14
_WIRES = ("#0b6aa2", "#d1495b", "#4f7d3a", "#b07414", "#6b4c9a", "#1c8a8a", "#8a3b6e", "#52616b")
_TEXT, _PIN, _BOX = "#1d2730", "#eef2f5", "#f7fafc"


@dataclass
class _Box:
    """A member in the picture.

    Attributes
    ----------
    member : Member
    model : Model
    inputs, outputs : list of str
        Variables that are connected, or are inputs or outputs of the system.
    column : int
    x, y : float
        Upper left corner.
    """

    member: Member
    model: Model
    inputs: list[str]
    outputs: list[str]
    column: int
    x: float = 0.0
    y: float = 0.0

    @property
    def title(self) -> str:
        return f"{self.member.name}: {self.member.fmu.stem}"

    @property
    def height(self) -> float:
        return _TITLE + _ROW * max(len(self.inputs), len(self.outputs), 1) + 0.06

    @property
    def width(self) -> float:
        left, right = (max((len(name) for name in names), default=0) for names in (self.inputs, self.outputs))
        return max(_LETTER * (left + right) + 0.45, _LETTER * 1.1 * len(self.title) + 0.3)

    def end(self, variable: str, output: bool) -> tuple[float, float]:
        """Where a variable meets the outside."""
        row = (self.outputs if output else self.inputs).index(variable)
        return self.x + (self.width if output else 0.0), self.y - _TITLE - _ROW * (row + 0.5)


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
    boxes = {box.member.name: box for box in _boxes(system)}
    lanes = _place(system, boxes)
    figure = Figure()
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for number, (source, connections) in enumerate(_nets(system).items()):
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


def _nets(system: System) -> Mapping[Port, list[Connection]]:
    """Connections by their source."""
    nets: dict[Port, list[Connection]] = {}
    for connection in system.connections:
        nets.setdefault(connection.source, []).append(connection)
    return nets


def _boxes(system: System) -> list[_Box]:
    used_in = {c.target for c in system.connections} | {port for ports in system.inputs.values() for port in ports}
    used_out = {c.source for c in system.connections} | set(system.outputs.values())
    columns = _columns(system)
    found = []
    for member in system.members:
        model = interface(member)
        inputs = [name for name in model.inputs if Port(member.name, name) in used_in]
        outputs = [name for name in model.outputs if Port(member.name, name) in used_out]
        found.append(_Box(member, model, inputs, outputs, columns[member.name]))
    return found


def _columns(system: System) -> dict[str, int]:
    """Column of each member: one more than that of any member before it, where leading back does not count."""
    after: dict[str, list[str]] = {member.name: [] for member in system.members}
    for connection in system.connections:
        after[connection.source.member].append(connection.target.member)
    columns = dict.fromkeys(after, 0)
    forward: set[tuple[str, str]] = set()
    done: list[str] = []

    def visit(name: str, path: tuple[str, ...]) -> None:
        for other in after[name]:
            if other not in (*path, name):
                forward.add((name, other))
                if other not in done:
                    visit(other, (*path, name))
        done.append(name) if name not in done else None

    for name in after:
        if name not in done:
            visit(name, ())
    for name in reversed(done):  # sources before what they feed
        for one, other in forward:
            if one == name:
                columns[other] = max(columns[other], columns[name] + 1)
    return columns


def _tracks(system: System, boxes: Mapping[str, _Box]) -> Mapping[Port, tuple[int, dict[int, int], int]]:
    """Tracks of every net: number in the gap right of its source, numbers left of columns it skips to, and lane.

    A lane is 0 for a net of neighbours only, else counted from 1 upwards over the boxes, from -1 downwards under them.
    """
    nets = _nets(system)
    used: dict[int, int] = {}

    def track(gap: int) -> int:
        used[gap] = used.get(gap, 0) + 1
        return used[gap] - 1

    # what leaves a column turns off before what comes to the next one turns in
    own = {source: track(boxes[source.member].column) for source in nets}
    over = under = 0
    found = {}
    for source, connections in nets.items():
        column = boxes[source.member].column
        far = sorted({c for k in connections if (c := boxes[k.target.member].column) != column + 1})
        lane = 0
        if far and far[0] <= column:
            lane = under = under - 1
        elif far:
            lane = over = over + 1
        found[source] = (own[source], {other: track(other - 1) for other in far}, lane)
    return found


@dataclass(frozen=True)
class _Lane:
    """Where a net runs: x of its own track, x of the tracks by which it comes to other columns, y between these."""

    own: float
    entries: Mapping[int, float]
    y: float


def _place(system: System, boxes: Mapping[str, _Box]) -> Mapping[Port, _Lane]:
    """Give every box its place, and every net its tracks."""
    tracks = _tracks(system, boxes)
    count = max(box.column for box in boxes.values()) + 1
    columns = [[box for box in boxes.values() if box.column == c] for c in range(count)]
    in_pins = [_LETTER * max((len(n) for n, ps in system.inputs.items() for p in ps if boxes[p.member].column == c),
                             default=0) for c in range(count)]  # fmt: skip
    out_pins = [_LETTER * max((len(n) for n, p in system.outputs.items() if boxes[p.member].column == c), default=0)
                for c in range(count)]  # fmt: skip
    widths = dict.fromkeys(range(-1, count), 0)
    for source, (own, entries, _) in tracks.items():
        for gap, number in ((boxes[source.member].column, own), *((c - 1, n) for c, n in entries.items())):
            widths[gap] = max(widths[gap], number + 1)
    starts, x = {}, 0.2
    for gap in range(-1, count):
        starts[gap] = x + (out_pins[gap] + 0.4 if gap >= 0 else 0.0)
        x = starts[gap] + _TRACK * (widths[gap] + 1) + 0.1
        if gap + 1 < count:
            x += in_pins[gap + 1] + 0.5
            for box in columns[gap + 1]:
                box.x = x
            x += max(box.width for box in columns[gap + 1])
    tallest = max(sum(box.height for box in column) + _SPACE * (len(column) - 1) for column in columns)
    for column in columns:
        height = sum(box.height for box in column) + _SPACE * (len(column) - 1)
        y = -(tallest - height) / 2 - 0.08 * (column[0].column % 2)  # so that rows of neighbours are not in line
        for box in column:
            box.y = y
            y -= box.height + _SPACE
    return {
        source: _Lane(
            starts[boxes[source.member].column] + _TRACK * (own + 1),
            {c: starts[c - 1] + _TRACK * (n + 1) for c, n in entries.items()},
            0.15 + _TRACK * lane if lane > 0 else -tallest - 0.15 + _TRACK * lane,
        )
        for source, (own, entries, lane) in tracks.items()
    }


def _route(boxes: Mapping[str, _Box], connection: Connection, lane: _Lane) -> list[tuple[float, float]]:
    """Corners of a wire from end to end."""
    box, other = boxes[connection.source.member], boxes[connection.target.member]
    start = box.end(connection.source.variable, output=True)
    end = other.end(connection.target.variable, output=False)
    if other.column == box.column + 1:
        return [start, (lane.own, start[1]), (lane.own, end[1]), end]
    x = lane.entries[other.column]
    return [start, (lane.own, start[1]), (lane.own, lane.y), (x, lane.y), (x, end[1]), end]


def _wire(axes: Axes, boxes: Mapping[str, _Box], connections: list[Connection], lane: _Lane, color: str) -> None:
    """Draw a net: all that comes from one output."""
    routes = [_route(boxes, connection, lane) for connection in connections]
    for connection, points in zip(connections, routes, strict=True):
        x, y = points[-1]
        axes.plot(*zip(*points[:-1], (x - 0.05, y), strict=True), color=color, linewidth=1.4, zorder=2)
        axes.annotate("", (x, y), (x - 0.14, y), arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.4})
        if (connection.factor, connection.offset) != (1.0, 0.0):
            text = f"× {connection.factor:g}" + (f" {connection.offset:+g}" if connection.offset else "")
            axes.text(x - 0.16, y + 0.03, text, ha="right", va="bottom", fontsize=7, color=color)
    if len(routes) > 1:  # where the net branches
        axes.plot(*routes[0][1], marker="o", markersize=3.5, color=color, zorder=3)


def _box(axes: Axes, box: _Box) -> None:
    from matplotlib.patches import FancyBboxPatch, Rectangle

    shape = FancyBboxPatch(
        (box.x, box.y - box.height), box.width, box.height,
        boxstyle="round,pad=0,rounding_size=0.05", facecolor=_BOX, edgecolor="#52616b", linewidth=1.2, zorder=4,
    )  # fmt: skip
    axes.add_patch(shape)
    bar = Rectangle((box.x, box.y - _TITLE + 0.06), box.width, _TITLE - 0.06, facecolor="#dfe7ed", zorder=5)
    bar.set_clip_path(shape)
    axes.add_patch(bar)
    middle = box.x + box.width / 2
    axes.text(middle, box.y - (_TITLE - 0.06) / 2, box.title, ha="center", va="center", fontsize=8.5, weight="bold",
              color=_TEXT, zorder=6)  # fmt: skip
    for output, names in ((False, box.inputs), (True, box.outputs)):
        for name in names:
            x, y = box.end(name, output)
            side, shift = ("right", -0.08) if output else ("left", 0.08)
            axes.text(x + shift, y, name, ha=side, va="center", fontsize=8, color=_TEXT, zorder=6)


def _pin(axes: Axes, box: _Box, variable: str, name: str, output: bool) -> None:
    """Draw an input or output of the system at the box that it belongs to."""
    x, y = box.end(variable, output)
    far = x + (0.3 if output else -0.3)
    ends = ((far, y), (x, y)) if output else ((x, y), (far, y))
    axes.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": _TEXT, "lw": 1.0, "shrinkA": 0, "shrinkB": 0})
    frame = {"boxstyle": "round,pad=0.25", "facecolor": _PIN, "edgecolor": "#9aa5af"}
    axes.text(
        far, y, name, ha="left" if output else "right", va="center", fontsize=8, color=_TEXT, bbox=frame, zorder=4
    )


def _frame(figure: Figure, axes: Axes, system: System, boxes: Mapping[str, _Box], lanes: Mapping[Port, _Lane]) -> None:
    """Fit the picture to what is in it, under its title."""
    import textwrap

    longest = {c: max((len(n) for n, p in system.outputs.items() if boxes[p.member].column == c), default=0)
               for c in {box.column for box in boxes.values()}}  # fmt: skip
    rights = [box.x + box.width + 0.6 + _LETTER * longest[box.column] for box in boxes.values()]
    right = max([*rights, *(lane.own + 0.2 for lane in lanes.values()), 5.0])
    bottom = min([box.y - box.height for box in boxes.values()] + [lane.y for lane in lanes.values() if lane.y < 0])
    top = max([0.15, *(lane.y for lane in lanes.values())])
    text = textwrap.wrap(system.doc, max(20, math.floor((right - 0.4) / (_LETTER * 0.95))))
    height = 0.42 + 0.2 * len(text)
    axes.set_xlim(0.0, right)
    axes.set_ylim(bottom - 0.25, top + height)
    axes.text(0.2, top + height - 0.22, system.name, fontsize=11, weight="bold", color=_TEXT, va="center")
    for line, words in enumerate(text):
        axes.text(0.2, top + height - 0.46 - 0.2 * line, words, fontsize=8, color="#52616b", va="center")
    figure.set_size_inches(right, top + height - bottom + 0.25)
