"""The bench with a proxy of a real actuator, which exchanges values with the rig."""

from __future__ import annotations

from ..kit.registry import MemberDeclaration, SystemDeclaration

# The proxy has the signals of the actuator, so that another FMU with them can replace it.
HIL_BENCH = SystemDeclaration(
    name="hil_bench",
    summary=(
        "Bench whose actuator is a real one: the member ``proxy`` stands for it and asks the rig"
        " (``ppy rig serve``)."
    ),
    members={
        "bench": MemberDeclaration("voice_coil_dma", {"hold": 0.0}),
        "proxy": MemberDeclaration("rig_proxy_length_driven"),
    },
    connections=("bench.position -> proxy.length_change", "proxy.tension -> bench.tension"),
    inputs={"force_reference": ("bench.force_reference",), "current": ("proxy.current",)},
    outputs=("proxy.tension", "proxy.voltage", "bench.position", "bench.force_measured"),
    step=1e-3,  # each step exchanges with the rig, which a link can do at 1 kHz
    stop=30.0,
)
