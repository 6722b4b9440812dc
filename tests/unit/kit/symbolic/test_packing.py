"""Generated C of a packed system: places in memory that do not overlap, and one model a class."""

from __future__ import annotations

import re

from fmus.kit.symbolic import packing, trace
from tests.support.kit_samples import Divider, Thermostat


def test_variables_and_what_is_read_of_them_have_places_of_their_own():
    members = [trace(cls) for cls in (Thermostat, Divider, Thermostat)]
    places = packing.Places(members, 5)
    used = [
        *(places.variable(k, name) for k, one in enumerate(members) for name in one.layout.names),
        *map(places.read, range(5)),
    ]
    numbers = [int(re.fullmatch(r"MEMBERS_BEGIN \+ (\d+)", place)[1]) for place in used]
    assert len(set(numbers)) == len(numbers)
    assert max(numbers) < places.size
    # beside its variables: step to try, start time, tolerance, a flag, clocks, slopes of inputs
    beside = sum(4 + len(one.layout.sampled) + len(one.layout.inputs) for one in members)
    assert places.size == len(numbers) + beside


def test_members_of_one_class_share_its_laws():
    graph = trace(Thermostat)
    step = packing.Operation("STEP", 1)
    copy = packing.Operation("COPY", 0, "3", "4", 1000.0, -0.5)
    program = packing.Program([copy], [], [step], [copy, copy], [])
    places = packing.Places([graph, graph], 0)
    packed = packing.PackedSystem(graph, {"a": graph, 'b"': graph}, places, program)
    files = packing.packed_sources(packed, "{guid}")
    text = files["members.h"]
    assert text.count("MEMBER_MODEL(laws_") == 1
    assert [int(n) for n in re.findall(r"&laws_0_model, MEMBERS_BEGIN \+ (\d+)", text)] == [
        0,
        places.size // 2,
    ]
    assert '{"b\\042", ' in text
    assert "{STEP, 1, 0, 0, 1.0, 0.0},\n    {END, " in text
    assert text.count("{COPY, 0, 3, 4, 1000.0, -0.5},") == 3
    assert "MODEL_MEMBERS" in files["model.h"]
