"""Benches: a voice coil that keeps an actuator at a force, alone and behind a galvanostat."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

_ACTUATOR = MemberDeclaration("ppy_actuator_length_driven")
_WIRES = ("bench.position -> actuator.length_change", "actuator.tension -> bench.tension")
_OUTPUTS = ("actuator.tension", "actuator.voltage", "bench.position", "bench.force_measured")
_STEP = 1e-4  # s; at 1e-3 a Jacobi master overshoots by a fifth more

DMA_BENCH = SystemDeclaration(
    name="dma_bench",
    summary=(
        "Voice coil that keeps an actuator at a wanted force while current goes through it"
        " (thesis section 2.2)."
    ),
    members={
        "bench": MemberDeclaration("voice_coil_dma", {"hold": 0.0}),
        "actuator": _ACTUATOR,
    },
    connections=_WIRES,
    inputs={"force_reference": ("bench.force_reference",), "current": ("actuator.current",)},
    outputs=_OUTPUTS,
    step=_STEP,
    stop=5.0,
)
# While the protection keeps the current at zero the films discharge and the tension changes; the
# force controller must not integrate that, so its integral part is frozen (thesis section 4.2).
PROTECTED_BENCH = SystemDeclaration(
    name="protected_bench",
    summary=(
        "Bench whose controller is switched off while the protection of a galvanostat holds the"
        " current of the actuator at zero (thesis section 4.2)."
    ),
    members={
        "galvanostat": MemberDeclaration(
            "galvanostat", {"voltage_limit": 1.0, "voltage_command": 0.0}
        ),
        "bench": MemberDeclaration("voice_coil_dma"),
        "actuator": _ACTUATOR,
    },
    connections=(
        *_WIRES,
        "galvanostat.current -> actuator.current",
        "actuator.voltage -> galvanostat.voltage",
        "galvanostat.recovering -> bench.hold",
    ),
    inputs={
        "force_reference": ("bench.force_reference",),
        "current_command": ("galvanostat.current_command",),
    },
    outputs=(*_OUTPUTS, "galvanostat.recovering", "bench.coil_voltage"),
    step=_STEP,
    stop=20.0,
)
EXAMPLES = (
    Example(DMA_BENCH, {"force_reference": 1.0, "current": 0.5}),
    # drives the actuator beyond the limit of the protection
    Example(PROTECTED_BENCH, {"force_reference": 1.0, "current_command": 0.9}),
)
