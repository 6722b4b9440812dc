"""The stand: an actuator that carries weights and is driven by its current."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

ISOTONIC_STAND = SystemDeclaration(
    name="isotonic_stand",
    summary=(
        "Galvanostat and an actuator that carries weights, its displacement by an LVDT"
        " (thesis section 2.1)."
    ),
    members={
        # galvanostatic; at 15 V, its compliance, the protection does not act
        "galvanostat": MemberDeclaration(
            "galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0}
        ),
        "actuator": MemberDeclaration("ppy_actuator"),
        "stand": MemberDeclaration("isotonic_stand"),
    },
    connections=(
        "galvanostat.current -> actuator.current",
        "actuator.voltage -> galvanostat.voltage",
        "stand.tension -> actuator.force",
        "actuator.displacement -> stand.displacement",
    ),
    inputs={
        "current_command": ("galvanostat.current_command",),
        "mass": ("stand.mass",),
        "zero": ("stand.zero",),
    },
    outputs=(
        "galvanostat.current",
        "actuator.voltage",
        "actuator.displacement",
        "stand.tension",
        "stand.displacement_measured",
    ),
    step=0.01,  # the period at which the galvanostat looks at the voltage
    stop=60.0,
)
EXAMPLES = (Example(ISOTONIC_STAND, {"current_command": 0.5, "mass": 0.1, "zero": 0.0}),)
