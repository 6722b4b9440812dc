"""Layout of the picture of a system: boxes in columns, wires in tracks and lanes, in inches.

Members are in columns in the order of the signal flow. The net of wires from an output has a
vertical track of its own after the column of its member. From there wires to the next column are
straight. Wires to other columns use a horizontal lane, above the boxes if all these columns are
further right and below them otherwise, and then a vertical track before the column.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from orchestration.system.checking import interface
from orchestration.system.model import Connection, Member, Port, System

LETTER = 0.078  # width of a letter of the text
TITLE = 0.36  # height of the title of a box
_ROW = 0.24  # height of a variable in a box
_SPACE = 0.45  # between boxes of a column
_TRACK = 0.14  # between tracks


@dataclass
class DiagramBox:
    """A member in the picture.

    Attributes
    ----------
    member : Member
    inputs, outputs : list of str
        Connected variables, and those that are inputs or outputs of the system.
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
        """Name of the member and of its FMU."""
        return f"{self.member.name}: {self.member.fmu.stem}"

    @property
    def height(self) -> float:
        """Height for the title and the longer list of variables."""
        return TITLE + _ROW * max(len(self.inputs), len(self.outputs), 1) + 0.06

    @property
    def width(self) -> float:
        """Width for the longest names of both lists, and for the title."""
        longest_input = max(map(len, self.inputs), default=0)
        longest_output = max(map(len, self.outputs), default=0)
        return max(
            LETTER * (longest_input + longest_output) + 0.45, LETTER * 1.1 * len(self.title) + 0.3
        )

    def end(self, variable: str, output: bool) -> tuple[float, float]:
        """Return the point on the border at which a variable is connected."""
        row = (self.outputs if output else self.inputs).index(variable)
        return self.x + (self.width if output else 0.0), self.y - TITLE - _ROW * (row + 0.5)


@dataclass(frozen=True)
class Lane:
    """Positions of the tracks and the lane of a net.

    Attributes
    ----------
    source_track : float
        x of the track after the column of the source.
    entries : Mapping of int to float
        x of the tracks before other columns, by column.
    y : float
        y of the lane between these tracks.
    """

    source_track: float
    entries: Mapping[int, float]
    y: float


@dataclass(frozen=True)
class _NetTracks:
    """Numbers of the tracks and of the lane of a net.

    Attributes
    ----------
    source_track : int
        Track in the gap after the column of the source.
    entries : Mapping of int to int
        Tracks in the gaps before other columns, by column.
    lane : int
        From 1 upwards above the boxes, from -1 downwards below them; 0 without a lane.
    """

    source_track: int
    entries: Mapping[int, int]
    lane: int


def nets_of(system: System) -> Mapping[Port, list[Connection]]:
    """Return the nets of a system: its connections by their source."""
    nets: dict[Port, list[Connection]] = {}
    for connection in system.connections:
        nets.setdefault(connection.source, []).append(connection)
    return nets


def arrange(system: System) -> tuple[dict[str, DiagramBox], dict[Port, Lane]]:
    """Place the boxes, and choose the tracks and lanes of the nets.

    Parameters
    ----------
    system : System

    Returns
    -------
    boxes : dict of str to DiagramBox
        By member.
    lanes : dict of Port to Lane
        By the source of the net.

    Raises
    ------
    UserError
        If an FMU cannot be read.
    """
    boxes = _make_boxes(system)
    tracks, track_counts = _choose_tracks(system, boxes)
    gaps = _place_columns(system, boxes, track_counts)
    height = _place_rows(boxes)
    lanes = {
        source: Lane(
            source_track=gaps[boxes[source.member].column] + _TRACK * (net.source_track + 1),
            entries={c: gaps[c - 1] + _TRACK * (n + 1) for c, n in net.entries.items()},
            y=(0.15 if net.lane > 0 else -height - 0.15) + _TRACK * net.lane,
        )
        for source, net in tracks.items()
    }
    return boxes, lanes


def _make_boxes(system: System) -> dict[str, DiagramBox]:
    """Return the box of each member with its connected variables, still without a position."""
    connected_inputs = {c.target for c in system.connections}.union(*system.inputs.values())
    connected_outputs = {c.source for c in system.connections}.union(system.outputs.values())
    columns = _assign_columns(system)
    boxes = {}
    for member in system.members:
        model = interface(member)
        inputs = [name for name in model.inputs if Port(member.name, name) in connected_inputs]
        outputs = [name for name in model.outputs if Port(member.name, name) in connected_outputs]
        boxes[member.name] = DiagramBox(member, inputs, outputs, columns[member.name])
    return boxes


def _assign_columns(system: System) -> dict[str, int]:
    """Return the column of each member: one more than the largest of the members that feed it.

    Connections that close a cycle are ignored.
    """
    fed_by: dict[str, list[str]] = {member.name: [] for member in system.members}
    for connection in system.connections:
        fed_by[connection.source.member].append(connection.target.member)
    columns = dict.fromkeys(fed_by, 0)
    forward = _without_cycles(fed_by)
    for name in reversed(forward):  # sources before targets
        for target in forward[name]:
            columns[target] = max(columns[target], columns[name] + 1)
    return columns


def _without_cycles(successors: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """Return a graph without the edges that close a cycle, each node after its successors."""
    forward: dict[str, list[str]] = {}

    def visit(name: str, path: tuple[str, ...]) -> None:
        """Visit the successors of the last node of a path, and then the node."""
        onward = [other for other in successors[name] if other not in path]
        for other in onward:
            if other not in forward:
                visit(other, (*path, other))
        forward[name] = onward

    for name in successors:
        if name not in forward:
            visit(name, (name,))
    return forward


def _choose_tracks(
    system: System, boxes: Mapping[str, DiagramBox]
) -> tuple[dict[Port, _NetTracks], Counter[int]]:
    """Return the numbers of the tracks and of the lane of every net, by its source.

    The number of tracks in each gap is returned, too, by the column before the gap.
    """
    nets = nets_of(system)
    counts: Counter[int] = Counter()

    def next_track(gap: int) -> int:
        """Return the number of a further track in the gap after a column."""
        counts[gap] += 1
        return counts[gap] - 1

    # in a gap, the tracks from the column before it are left of those to the column behind it
    source_tracks = {source: next_track(boxes[source.member].column) for source in nets}
    lanes: Counter[int] = Counter()
    tracks = {}
    for source, connections in nets.items():
        column = boxes[source.member].column
        targets = {boxes[connection.target.member].column for connection in connections}
        distant = sorted(targets - {column + 1})
        entries = {other: next_track(other - 1) for other in distant}
        # lanes are 1, 2 … above the boxes, and -1, -2 … below them, where a wire runs backward
        side = 0 if not distant else -1 if distant[0] <= column else 1
        lanes[side] += side
        tracks[source] = _NetTracks(source_tracks[source], entries, lanes[side])
    return tracks, counts


def _place_columns(
    system: System, boxes: Mapping[str, DiagramBox], track_counts: Mapping[int, int]
) -> dict[int, float]:
    """Set x of every box, and return x of each gap's tracks, by the column before the gap.

    From left to right follow the pins of outputs of a column, the tracks of the gap, the pins of
    inputs of the next column, and its boxes.
    """
    input_widths = pin_widths(system.fed_ports, boxes)
    output_widths = pin_widths(system.outputs.items(), boxes)
    gaps = {-1: 0.2}
    for k, column in enumerate(_boxes_by_column(boxes)):
        end_of_tracks = gaps[k - 1] + _TRACK * (track_counts[k - 1] + 1) + 0.1
        x = end_of_tracks + (input_widths[k] + 0.5)
        for box in column:
            box.x = x
        gaps[k] = x + max(box.width for box in column) + (output_widths[k] + 0.4)
    return gaps


def _boxes_by_column(boxes: Mapping[str, DiagramBox]) -> list[list[DiagramBox]]:
    count = max(box.column for box in boxes.values()) + 1
    return [[box for box in boxes.values() if box.column == c] for c in range(count)]


def pin_widths(
    pins: Iterable[tuple[str, Port]], boxes: Mapping[str, DiagramBox]
) -> defaultdict[int, float]:
    """Return the width of the longest name among inputs or outputs of a system at each column.

    Parameters
    ----------
    pins : iterable of (str, Port)
        Names, and ports of members.
    boxes : Mapping of str to DiagramBox
        By member.
    """
    widths: defaultdict[int, float] = defaultdict(float)
    for name, port in pins:
        column = boxes[port.member].column
        widths[column] = max(widths[column], LETTER * len(name))
    return widths


def _place_rows(boxes: Mapping[str, DiagramBox]) -> float:
    """Set y of every box so that columns are centred; return the height of the tallest column."""
    columns = _boxes_by_column(boxes)
    heights = [sum(box.height for box in column) + _SPACE * (len(column) - 1) for column in columns]
    tallest = max(heights)
    for number, (column, height) in enumerate(zip(columns, heights, strict=True)):
        # every other column is lower, so that rows of neighbours are not in line
        y = -(tallest - height) / 2 - 0.08 * (number % 2)
        for box in column:
            box.y = y
            y -= box.height + _SPACE
    return tallest


def route(
    boxes: Mapping[str, DiagramBox], connection: Connection, lane: Lane
) -> list[tuple[float, float]]:
    """Return both ends of a wire and its corners between them, as (x, y) in inches.

    A wire to the next column needs the track of its source only; to another column it goes along
    the lane to the track before that column.
    """
    source = boxes[connection.source.member]
    target = boxes[connection.target.member]
    start = source.end(connection.source.variable, output=True)
    end = target.end(connection.target.variable, output=False)
    track = lane.source_track
    if target.column not in lane.entries:
        return [start, (track, start[1]), (track, end[1]), end]
    entry = lane.entries[target.column]
    corners = [(track, start[1]), (track, lane.y), (entry, lane.y), (entry, end[1])]
    return [start, *corners, end]
