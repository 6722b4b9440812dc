"""Claims: wires end at their variables, cross no box, and do not lie on each other."""

from __future__ import annotations

from itertools import combinations, pairwise

import pytest

from orchestration.system import library
from orchestration.system.layout import arrange, nets_of, route


@pytest.mark.parametrize("name", library.NAMES)
def test_wires_touch_no_box_and_do_not_lie_on_each_other(name):
    system = library.system(name)
    boxes, lanes = arrange(system)
    segments = []
    for source, connections in nets_of(system).items():
        for connection in connections:
            points = route(boxes, connection, lanes[source])
            assert points[0] == boxes[source.member].end(source.variable, output=True)
            assert points[-1] == boxes[connection.target.member].end(
                connection.target.variable, output=False
            )
            segments += [(source, *sorted(ends)) for ends in pairwise(points) if ends[0] != ends[1]]
    for _, (x0, y0), (x1, y1) in segments:
        assert x0 == x1 or y0 == y1
        for box in boxes.values():
            inside = 1e-6
            across = x0 < box.x + box.width - inside and x1 > box.x + inside
            along = min(y0, y1) < box.y - inside and max(y0, y1) > box.y - box.height + inside
            assert not (across and along)
    for (one, *first), (other, *second) in combinations(segments, 2):
        for fixed, free in ((0, 1), (1, 0)):
            on_one_line = len({round(p[fixed], 2) for p in (*first, *second)}) == 1
            starts = max(min(p[free] for p in ends) for ends in (first, second))
            ends = min(max(p[free] for p in ends) for ends in (first, second))
            assert one == other or not (on_one_line and ends - starts > 0.01), (one, other)
