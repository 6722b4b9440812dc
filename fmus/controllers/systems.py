"""The work loop: an actuator in a periodic loop of load and length (sections 5.4, 6.2)."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

# The currents of feedforward and learning are added and pass through the feedback controller, whose
# limits apply to the sum. Each has its own switch: `feedforward.active`, `learning.learning` and
# `feedback.hold`. Length and load are two inputs each: now, and one sample of the feedforward
# later.
WORK_LOOP = SystemDeclaration(
    name="work_loop",
    summary=(
        "Actuator under a periodic load whose length follows a loop by feedforward, learning and"
        " feedback (thesis sections 5.4, 6.2)."
    ),
    # in the order in which their commands are added at a sample
    members={
        "feedforward": MemberDeclaration("feedforward", {"active": 1.0}),
        # gain of the inverse of the nominal actuator; a lead of two samples, since the strain may
        # lag; smoothing that removes the highest frequency
        "learning": MemberDeclaration(
            "learning_controller",
            {"learning": 1.0, "learning_gain": 2325.0, "lead": 2.0, "smoothing": 0.25},
        ),
        "feedback": MemberDeclaration("displacement_controller", {"hold": 0.0}),
        # galvanostatic; at 15 V, its compliance, the protection does not act
        "galvanostat": MemberDeclaration(
            "galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0}
        ),
        # by default the effects are neutral: strain neither lags nor saturates
        "actuator": MemberDeclaration(
            "ppy_actuator",
            effects=("strain_saturation", "strain_lag"),
            model_name="lagging_actuator",
        ),
    },
    connections=(
        "feedforward.command -> learning.feedback_command",
        "learning.command -> feedback.command_beside",
        "feedback.command -> galvanostat.current_command",
        "galvanostat.current -> actuator.current",
        "galvanostat.current -> feedback.current",
        "actuator.voltage -> galvanostat.voltage",
        "actuator.voltage -> feedback.voltage",
        "actuator.displacement -> feedback.displacement",
        "actuator.displacement -> learning.displacement",
    ),
    inputs={
        "force": ("actuator.force", "feedforward.force"),
        "reference": ("feedback.reference", "learning.reference"),
        "next_force": ("feedforward.next_force",),
        "next_reference": ("feedforward.next_reference",),
    },
    outputs=(
        "galvanostat.current",
        "actuator.voltage",
        "actuator.displacement",
        "actuator.charge",
        "feedback.limited",
    ),
    step=0.01,  # the period at which the galvanostat looks at the voltage
    stop=50.0,
)
# a step of the length under a constant load
EXAMPLES = (
    Example(
        WORK_LOOP, {"force": 0.5, "next_force": 0.5, "reference": 1e-4, "next_reference": 1e-4}
    ),
)
