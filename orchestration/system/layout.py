"""Where everything in the picture of a system is: boxes in columns, wires in tracks and lanes. All lengths in inches.

Members stand in columns in the order in which signals pass them. Wires to the next column go straight there, in a track
of their own; those that skip columns go over the boxes, those that lead back go under them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from orchestration.system.check import interface
from orchestration.system.model import Connection, Member, Port, System

LETTER = 0.078  # width of one at the size of the text
TITLE = 0.36
_ROW, _SPACE, _TRACK = 0.24, 0.45, 0.14


@dataclass
class Box:
    """A member in the picture.

    Attributes
    ----------
    member : Member
    inputs, outputs : list of str
        Variables that are connected, or are inputs or outputs of the system.
    column : int
    x, y : float
        Upper left corner.
    """

    member: Member
    inputs: list[str]
    outputs: list[str]
    column: int
    x: float = 0.0
    y: float = 0.0

    @property
    def title(self) -> str:
        """Name of the member and its FMU."""
        return f"{self.member.name}: {self.member.fmu.stem}"

    @property
    def height(self) -> float:
        """Room for the title and the longer list of variables."""
        return TITLE + _ROW * max(len(self.inputs), len(self.outputs), 1) + 0.06

    @property
    def width(self) -> float:
        """Room for the longest of either list, and for the title."""
        of_inputs, of_outputs = (
            max((len(name) for name in names), default=0) for names in (self.inputs, self.outputs)
        )
        return max(LETTER * (of_inputs + of_outputs) + 0.45, LETTER * 1.1 * len(self.title) + 0.3)

    def end(self, variable: str, output: bool) -> tuple[float, float]:
        """Where a variable meets the outside."""
        row = (self.outputs if output else self.inputs).index(variable)
        return self.x + (self.width if output else 0.0), self.y - TITLE - _ROW * (row + 0.5)


@dataclass(frozen=True)
class Lane:
    """Where a net runs: x of its own track, x of the tracks by which it comes to other columns, y between these."""

    own: float
    entries: Mapping[int, float]
    y: float


def nets_of(system: System) -> Mapping[Port, list[Connection]]:
    """Connections by their source."""
    nets: dict[Port, list[Connection]] = {}
    for connection in system.connections:
        nets.setdefault(connection.source, []).append(connection)
    return nets


def arrange(system: System) -> tuple[dict[str, Box], dict[Port, Lane]]:
    """Give every box its place, and every net its tracks.

    Parameters
    ----------
    system : System

    Returns
    -------
    boxes : dict of str to Box
        By member.
    lanes : dict of Port to Lane
        By the source of the net.

    Raises
    ------
    UserError
        If an FMU cannot be read.
    """
    boxes = _boxes(system)
    return boxes, _place(system, boxes)


def _boxes(system: System) -> dict[str, Box]:
    used_in = {c.target for c in system.connections} | {
        port for ports in system.inputs.values() for port in ports
    }
    used_out = {c.source for c in system.connections} | set(system.outputs.values())
    columns = _columns(system)
    boxes = {}
    for member in system.members:
        model = interface(member)
        inputs = [name for name in model.inputs if Port(member.name, name) in used_in]
        outputs = [name for name in model.outputs if Port(member.name, name) in used_out]
        boxes[member.name] = Box(member, inputs, outputs, columns[member.name])
    return boxes


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
        if name not in done:
            done.append(name)

    for name in after:
        if name not in done:
            visit(name, ())
    for name in reversed(done):  # sources before what they feed
        for one, other in forward:
            if one == name:
                columns[other] = max(columns[other], columns[name] + 1)
    return columns


def _tracks(
    system: System, boxes: Mapping[str, Box]
) -> Mapping[Port, tuple[int, dict[int, int], int]]:
    """Tracks of every net: number in the gap right of its source, numbers left of columns it skips to, and lane.

    A lane is 0 for a net of neighbours only, else counted from 1 upwards over the boxes, from -1 downwards under them.
    """
    nets = nets_of(system)
    used: dict[int, int] = {}

    def track(gap: int) -> int:
        used[gap] = used.get(gap, 0) + 1
        return used[gap] - 1

    # what leaves a column turns off before what comes to the next one turns in
    own = {source: track(boxes[source.member].column) for source in nets}
    over = under = 0
    tracks = {}
    for source, connections in nets.items():
        column = boxes[source.member].column
        far = sorted({c for k in connections if (c := boxes[k.target.member].column) != column + 1})
        lane = 0
        if far and far[0] <= column:
            lane = under = under - 1
        elif far:
            lane = over = over + 1
        tracks[source] = (own[source], {other: track(other - 1) for other in far}, lane)
    return tracks


def _place(system: System, boxes: Mapping[str, Box]) -> dict[Port, Lane]:
    """Tell every box where it stands; return where the nets run."""
    tracks = _tracks(system, boxes)
    count = max(box.column for box in boxes.values()) + 1
    columns = [[box for box in boxes.values() if box.column == c] for c in range(count)]
    in_pins = [
        LETTER
        * max(
            (len(n) for n, ps in system.inputs.items() for p in ps if boxes[p.member].column == c),
            default=0,
        )
        for c in range(count)
    ]
    out_pins = [
        LETTER
        * max((len(n) for n, p in system.outputs.items() if boxes[p.member].column == c), default=0)
        for c in range(count)
    ]
    widths = dict.fromkeys(range(-1, count), 0)
    for source, (own, entries, _) in tracks.items():
        for gap, number in (
            (boxes[source.member].column, own),
            *((c - 1, n) for c, n in entries.items()),
        ):
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
    tallest = max(
        sum(box.height for box in column) + _SPACE * (len(column) - 1) for column in columns
    )
    for column in columns:
        height = sum(box.height for box in column) + _SPACE * (len(column) - 1)
        y = -(tallest - height) / 2 - 0.08 * (
            column[0].column % 2
        )  # so that rows of neighbours are not in line
        for box in column:
            box.y = y
            y -= box.height + _SPACE
    return {
        source: Lane(
            starts[boxes[source.member].column] + _TRACK * (own + 1),
            {c: starts[c - 1] + _TRACK * (n + 1) for c, n in entries.items()},
            0.15 + _TRACK * lane if lane > 0 else -tallest - 0.15 + _TRACK * lane,
        )
        for source, (own, entries, lane) in tracks.items()
    }


def route(
    boxes: Mapping[str, Box], connection: Connection, lane: Lane
) -> list[tuple[float, float]]:
    """Corners of a wire from end to end."""
    box, other = boxes[connection.source.member], boxes[connection.target.member]
    start = box.end(connection.source.variable, output=True)
    end = other.end(connection.target.variable, output=False)
    if other.column == box.column + 1:
        return [start, (lane.own, start[1]), (lane.own, end[1]), end]
    x = lane.entries[other.column]
    return [start, (lane.own, start[1]), (lane.own, lane.y), (x, lane.y), (x, end[1]), end]
