"""The work loop: an actuator that is to go round a loop of load and length (sections 5.4, 6.2)."""

from __future__ import annotations

from ..kit.registry import MemberDeclaration, SystemDeclaration

# The currents of feedforward and learning are added and pass through the feedback, whose limits
# hold for the sum. Each is switched by an input of its own: `feedforward.active`,
# `learning.learning`, and `feedback.hold`. Length and load are given twice, now and as they are a
# sample of the feedforward later.
WORK_LOOP = SystemDeclaration(
    name="work_loop",
    summary=(
        "Actuator under a periodic load whose length follows a loop by feedforward, learning and"
        " feedback (thesis sections 5.4, 6.2)."
    ),
    # in the order in which their commands are added at a sample
    members={
        "feedforward": MemberDeclaration("feedforward", {"active": 1.0}),
        # the inverse of the nominal actuator, two samples ahead as a strain may lag, and a filter
        # that takes away the highest frequency
        "learning": MemberDeclaration(
            "learning_controller",
            {"learning": 1.0, "learning_gain": 2325.0, "lead": 2.0, "smoothing": 0.25},
        ),
        "feedback": MemberDeclaration("displacement_controller", {"hold": 0.0}),
        # by current; 15 V, its compliance, is no protection
        "galvanostat": MemberDeclaration(
            "galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0}
        ),
        # with the defaults of the effects strain neither lags nor saturates
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
