"""The order of exchange: every value is there when it is needed, and loops are what graph theory
says they are.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from orchestration.master.dependency_graph import (
    Loop,
    Read,
    Structure,
    Write,
    order_exchange,
    order_steps,
)
from orchestration.system.model import Port


@st.composite
def structures(draw):
    """Members with up to three inputs and outputs each, connected and fed from outside at
    random.
    """
    names = "abcde"[: draw(st.integers(1, 5))]
    inputs = [Port(name, f"u{i}") for name in names for i in range(draw(st.integers(0, 3)))]
    outputs = [Port(name, f"y{i}") for name in names for i in range(draw(st.integers(0, 3)))]
    sources, outside = {}, []
    for port in inputs:
        others = [source for source in outputs if source.member != port.member]
        if others and draw(st.integers(0, 3)):
            sources[port] = draw(st.sampled_from(others))
        else:
            outside.append(port)
    fed = {name: [port for port in inputs if port.member == name] for name in names}
    wanted = {name: [port for port in outputs if port.member == name] for name in names}
    feedthrough = {
        port: tuple(i for i in fed[port.member] if draw(st.booleans())) for port in outputs
    }
    return Structure(sources, fed, wanted, feedthrough)


def knots(structure):
    """Strongly connected ports, of which there are at least two, by scipy."""
    ports = [
        port
        for group in (structure.fed, structure.wanted)
        for own in group.values()
        for port in own
    ]
    number = {port: k for k, port in enumerate(ports)}
    edges = [(number[source], number[target]) for target, source in structure.sources.items()]
    edges += [
        (number[i], number[port]) for port, needed in structure.feedthrough.items() for i in needed
    ]
    if not edges:
        return set()
    matrix = coo_array(
        (np.ones(len(edges)), tuple(zip(*edges, strict=True))), shape=(len(ports), len(ports))
    )
    _, labels = connected_components(matrix, directed=True, connection="strong")
    groups = [
        frozenset(port for port in ports if labels[number[port]] == label) for label in set(labels)
    ]
    return {group for group in groups if len(group) > 1}


@pytest.mark.slow
@settings(max_examples=300)
@given(structures())
def test_every_value_is_there_when_it_is_needed(structure):
    found = order_exchange(structure, set(structure.wanted))
    read = [port for ports in found.early.values() for port in ports]
    assert not any(structure.feedthrough[port] for port in read)
    written: list[Port] = []
    for operation in found.operations:
        if isinstance(operation, Write):
            written += operation.ports
            assert all(
                structure.sources.get(port, read[0] if read else None) in [*read, None]
                for port in operation.ports
            )
            continue
        if isinstance(operation, Loop):
            written += operation.inputs
        outputs = operation.outputs if isinstance(operation, Loop) else operation.ports
        assert all(set(structure.feedthrough[port]) <= set(written) for port in outputs)
        read += outputs
    assert sorted(read) == sorted(structure.feedthrough)
    assert sorted(written) == sorted(port for ports in structure.fed.values() for port in ports)
    assert {frozenset((*loop.inputs, *loop.outputs)) for loop in found.loops} == knots(structure)
    assert sorted(order_steps(structure)) == sorted(structure.wanted)


@settings(max_examples=100)
@given(structures(), st.sets(st.sampled_from("abcde")))
def test_who_does_not_take_part_is_not_asked(structure, due):
    found = order_exchange(structure, due)
    asked = {port.member for operation in found.operations for port in operation[1]} | set(
        found.early
    )
    assert asked <= due
    assert {
        p
        for o in found.operations
        if isinstance(o, Write)
        for p in o.ports
        if p not in structure.sources
    } == {
        p
        for name in due & set(structure.fed)
        for p in structure.fed[name]
        if p not in structure.sources
    }


def test_a_bench_and_its_actuator_take_one_call_each():
    """Position needs nothing, tension needs the position: read, set, read, set."""
    position, tension = Port("bench", "position"), Port("actuator", "tension")
    length, load = Port("actuator", "length"), Port("bench", "load")
    current, voltage = Port("actuator", "current"), Port("actuator", "voltage")
    structure = Structure(
        {length: position, load: tension},
        {"actuator": [length, current], "bench": [load]},
        {"actuator": [tension, voltage], "bench": [position]},
        {position: (), tension: (length,), voltage: (current,)},
    )
    found = order_exchange(structure, ["actuator", "bench"])
    assert found.early == {"actuator": (), "bench": (position,)}
    assert found.operations == [
        Write("actuator", (length, current)),
        Read("actuator", (tension, voltage)),
        Write("bench", (load,)),
    ]
    assert order_steps(structure) == ["actuator", "bench"], "in a circle, as the system names them"
