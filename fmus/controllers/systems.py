"""Loops of every controller: of displacement, tension and compliance, and the work loop."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

# galvanostatic; at 15 V, its compliance, the protection does not act
_GALVANOSTAT = MemberDeclaration("galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0})
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
        "galvanostat": _GALVANOSTAT,
        # by default the effects are neutral: strain neither lags nor saturates, and the load does
        # not act on the voltage
        "actuator": MemberDeclaration(
            "ppy_actuator",
            effects=("strain_saturation", "strain_lag", "force_to_voltage"),
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
        "actuator.electrochemical_displacement",
        "actuator.charge",
        "feedback.limited",
    ),
    step=0.01,  # the period at which the galvanostat looks at the voltage
    stop=50.0,
)
_TO_FILMS = (
    "controller.command -> galvanostat.current_command",
    "galvanostat.current -> actuator.current",
    "actuator.voltage -> galvanostat.voltage",
    "actuator.displacement -> controller.displacement",
)
_STATE = (
    "galvanostat.current -> controller.current",
    "actuator.voltage -> controller.voltage",
)
_SIGNALS = ("galvanostat.current", "actuator.voltage", "actuator.displacement", "actuator.charge")


def _displacement_loop(
    name: str,
    summary: str,
    controller: str,
    sensed: tuple[str, ...] = (),
    loads: tuple[str, ...] = ("actuator.force",),
    values: dict[str, float | str] | None = None,
) -> SystemDeclaration:
    """Declare an actuator behind a galvanostat whose displacement a controller commands."""
    return SystemDeclaration(
        name=name,
        summary=summary,
        members={
            "controller": MemberDeclaration(controller, values or {}),
            "galvanostat": _GALVANOSTAT,
            "actuator": MemberDeclaration("ppy_actuator"),
        },
        connections=(*_TO_FILMS, *sensed),
        inputs={"reference": ("controller.reference",), "force": loads},
        outputs=_SIGNALS,
        step=0.01,  # the period at which the galvanostat looks at the voltage
        stop=20.0,
    )


DISPLACEMENT_LOOP = _displacement_loop(
    "displacement_loop",
    "Actuator whose displacement a PI controller commands within limits of charge and voltage"
    " (thesis sections 1.4.2, 1.5).",
    "displacement_controller",
    _STATE,
    values={"hold": 0.0, "command_beside": 0.0},
)
STATE_FEEDBACK_LOOP = _displacement_loop(
    "state_feedback_loop",
    "Actuator whose displacement follows by feedback of the charge and creep that an observer"
    " estimates (thesis section 1.5.2).",
    "state_feedback",
    _STATE,
    ("actuator.force", "controller.force"),
)
ADAPTIVE_LOOP = _displacement_loop(
    "adaptive_loop",
    "Actuator whose displacement follows a model by a gain that adapts to it (thesis section"
    " 1.5.2).",
    "adaptive_controller",
)
# Potentiostat at 1 kHz with a deadbeat gain, as in potentiostat_watch. The tension falls with the
# charge, so that the gain is negative: PI with a phase margin of 60 degrees at 0.2 Hz.
TENSION_LOOP = SystemDeclaration(
    name="tension_loop",
    summary=(
        "Actuator at a given length whose tension a PID controller commands by the voltage of a"
        " potentiostat (thesis section 2.3)."
    ),
    members={
        "controller": MemberDeclaration(
            "pid",
            {
                "sample_period": 0.02,
                "proportional_gain": -0.652,
                "integral_time": 0.378,
                "tracking_time": 0.378,
                "command_min": -1.0,
                "command_max": 1.0,
                "manual": 0.0,
                "manual_command": 0.0,
                "tracking": 0.0,
                "applied_command": 0.0,
            },
        ),
        "galvanostat": MemberDeclaration(
            "galvanostat",
            {
                "potentiostat": 1.0,
                "protection_period": 1e-3,
                "control_period": 1e-3,
                "integral_gain": 2750.0,
                "current_command": 0.0,
                "voltage_limit": 15.0,
            },
        ),
        "actuator": MemberDeclaration("ppy_actuator_length_driven"),
    },
    connections=(
        "controller.command -> galvanostat.voltage_command",
        "galvanostat.current -> actuator.current",
        "actuator.voltage -> galvanostat.voltage",
        "actuator.tension -> controller.measured",
    ),
    inputs={
        "reference": ("controller.reference",),
        "length_change": ("actuator.length_change",),
    },
    outputs=("galvanostat.current", "actuator.voltage", "actuator.tension"),
    step=1e-3,
    stop=20.0,
)
IMPEDANCE_BENCH = SystemDeclaration(
    name="impedance_bench",
    summary=(
        "Voice coil that gives to an actuator as a spring and a damper would, by the force loop of"
        " the bench (thesis sections 1.5.2, 2.2)."
    ),
    members={
        "impedance": MemberDeclaration("impedance_controller"),
        "bench": MemberDeclaration("voice_coil_dma", {"hold": 0.0}),
        "actuator": MemberDeclaration("ppy_actuator_length_driven"),
    },
    connections=(
        "impedance.force_reference -> bench.force_reference",
        "bench.position -> impedance.length",
        "bench.position -> actuator.length_change",
        "actuator.tension -> bench.tension",
    ),
    inputs={"rest_length": ("impedance.rest_length",), "current": ("actuator.current",)},
    outputs=("actuator.tension", "bench.position", "bench.force_measured"),
    step=1e-4,  # s; at 1e-3 a Jacobi master overshoots by a fifth more
    stop=10.0,
)
# The proxy has the signals of the actuator, so that the rig's films take its place.
HIL_DISPLACEMENT_LOOP = SystemDeclaration(
    name="hil_displacement_loop",
    summary=(
        "Displacement loop around a real actuator: the member ``proxy`` stands for it and asks the"
        " rig (``ppy rig serve``)."
    ),
    members={
        "controller": MemberDeclaration(
            "displacement_controller", {"hold": 0.0, "command_beside": 0.0}
        ),
        "galvanostat": _GALVANOSTAT,
        "proxy": MemberDeclaration("rig_proxy"),
    },
    connections=(
        "controller.command -> galvanostat.current_command",
        "galvanostat.current -> proxy.current",
        "galvanostat.current -> controller.current",
        "proxy.voltage -> galvanostat.voltage",
        "proxy.voltage -> controller.voltage",
        "proxy.displacement -> controller.displacement",
    ),
    inputs={"reference": ("controller.reference",), "force": ("proxy.force",)},
    outputs=("controller.limited", "proxy.voltage", "proxy.displacement", "proxy.charge"),
    step=0.01,  # the period at which the galvanostat looks at the voltage
    stop=20.0,
)
SYSTEMS = (
    WORK_LOOP,
    DISPLACEMENT_LOOP,
    STATE_FEEDBACK_LOOP,
    ADAPTIVE_LOOP,
    TENSION_LOOP,
    IMPEDANCE_BENCH,
    HIL_DISPLACEMENT_LOOP,
)
_STEP: dict[str, float] = {"reference": 1e-4, "force": 0.5}
EXAMPLES = (
    # a step of the length under a constant load
    Example(
        WORK_LOOP, {"force": 0.5, "next_force": 0.5, "reference": 1e-4, "next_reference": 1e-4}
    ),
    Example(DISPLACEMENT_LOOP, _STEP),
    Example(STATE_FEEDBACK_LOOP, _STEP),
    Example(ADAPTIVE_LOOP, {"reference": 1e-4, "force": 0.0}),
    Example(TENSION_LOOP, {"reference": 1.3, "length_change": 2.5e-4}),
    Example(IMPEDANCE_BENCH, {"rest_length": 0.0, "current": 0.5}),
)
