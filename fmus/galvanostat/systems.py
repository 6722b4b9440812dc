"""The clamped actuator, an example of the galvanostat's pins."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

EXAMPLES = (
    Example(
        SystemDeclaration(
            name="clamped_actuator",
            summary="Actuator at constant length whose current is that of a galvanostat.",
            # galvanostatic; at 15 V, its compliance, the protection does not act
            members={
                "galvanostat": MemberDeclaration(
                    "galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0}
                ),
                "actuator": MemberDeclaration("ppy_actuator_length_driven"),
            },
            connections=(
                "galvanostat.current -> actuator.current",
                "actuator.voltage -> galvanostat.voltage",
            ),
            inputs={
                "current_command": ("galvanostat.current_command",),
                "length_change": ("actuator.length_change",),
            },
            outputs=("galvanostat.current", "actuator.voltage", "actuator.tension"),
            step=0.01,  # the period at which the galvanostat looks at the voltage
            stop=20.0,
        ),
        {"current_command": 0.5, "length_change": 2e-4},
    ),
)
