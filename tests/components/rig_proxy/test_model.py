"""Claims: a proxy has the signals of the component, or the system, whose place it takes."""

from __future__ import annotations

import pytest

from fmus import component
from orchestration.system import library

REPLACED = {"rig_proxy": "ppy_actuator", "rig_proxy_length_driven": "ppy_actuator_length_driven"}


def described(variables) -> dict[str, tuple[str, str, float, str | None]]:
    return {v.name: (v.type, v.unit, v.nominal, v.display) for v in variables}


@pytest.mark.parametrize(("name", "replaced"), REPLACED.items())
def test_the_interface_is_that_of_the_component_it_replaces(name, replaced):
    stands_in, original = component(name).layout, component(replaced).layout
    assert described(stands_in.inputs) == described(original.inputs)
    wanted = described(original.measurable)
    there = described(stands_in.measurable)
    assert {key: there.get(key) for key in wanted} == wanted
    extra = {f"{key}_age" for key in wanted} | {"round_trip_time", "missed_deadlines", "link_state"}
    assert set(there) - set(wanted) == extra


def test_the_bench_is_that_of_the_system():
    stands_in, system = component("rig_proxy_bench").layout, library.system("dma_bench")
    assert {v.name for v in stands_in.inputs} == set(system.inputs)
    measured = {
        v.name
        for v in stands_in.measurable
        if not v.name.endswith(("_age", "_time", "_deadlines", "_state"))
    }
    assert measured == set(system.outputs)
