"""Claims: rigs that are declared have the signals of their components, and of our proxies."""

from __future__ import annotations

import pytest

from fmus import component
from fmus.rig_proxy.rigs import RIGS


@pytest.mark.parametrize(
    ("name", "components", "connected"),
    [
        ("force-driven", ["ppy_actuator"], set()),
        ("length-driven", ["ppy_actuator_length_driven"], set()),
        (
            "bench",
            ["voice_coil_dma", "ppy_actuator_length_driven"],
            {"tension", "length_change", "hold"},
        ),
    ],
)
def test_signals_are_those_of_the_components(
    name: str, components: list[str], connected: set[str]
) -> None:
    chosen, layouts = RIGS[name], [component(c).layout for c in components]
    inputs = {
        v.name: v.unit for layout in layouts for v in layout.inputs if v.name not in connected
    }
    outputs = {v.name: v.unit for layout in layouts for v in layout.measured_outputs}
    outputs |= {v.name: v.unit for layout in layouts for v in layout.states if v.output}
    assert chosen.inputs == inputs
    assert chosen.outputs == outputs


@pytest.mark.parametrize(
    ("name", "proxy"),
    [
        ("force-driven", "rig_proxy"),
        ("length-driven", "rig_proxy_length_driven"),
        ("bench", "rig_proxy_bench"),
    ],
)
def test_the_proxies_that_ship_find_their_signals(name: str, proxy: str) -> None:
    """A proxy commands every input of a rig, and asks for what the rig has, in the rig's units."""
    chosen, layout = RIGS[name], component(proxy).layout
    assert {v.name: v.unit for v in layout.inputs} == chosen.inputs
    measured = {v.name: v.unit for v in layout.outputs if f"{v.name}_age" in layout.names}
    assert len(measured) >= 4
    assert measured.items() <= chosen.outputs.items()
