"""The foot under four actuators: the gait of thesis chapter 5, and a stance on the ground."""

from __future__ import annotations

from dataclasses import replace

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration
from .kinematics import ACTUATORS

# N, tensions under which the foot rests in its reference configuration: 5 N in the actuators with
# the longer arms, balanced by their antagonists. A charge of 2 C lowers a tension by less than 1 N.
TENSIONS = {"an": 11.624264677425735, "po": 5.0, "do": 13.543483552441367, "pl": 5.0}
# N/m and N s/m, the defaults of the actuators. The foot's compliance is that of the toe under a
# force before actuators creep, by their stiffness and tension.
_STIFFNESS = 6300.0
_DAMPING = 1.7e6

FOOT_GAIT = SystemDeclaration(
    name="foot_gait",
    summary="Foot that moves under four actuators, each driven by its current (thesis chapter 5).",
    members={
        # its stiffness at the toe includes that of tensions on changing moment arms
        "foot": MemberDeclaration(
            "foot_dynamic",
            {
                "tension_stiffness_share": 1.0,
                **{f"k_{name}": _STIFFNESS for name in ACTUATORS},
                **{f"b_{name}": _DAMPING for name in ACTUATORS},
            },
            effects=("tension_stiffness",),
            model_name="taut_foot",
        ),
        # a dashpot that has flowed to a shorter length puts the actuator under tension
        **{
            name: MemberDeclaration(
                "ppy_actuator_length_driven",
                {"maxwell_elongation_start": -TENSIONS[name] / _STIFFNESS},
            )
            for name in ACTUATORS
        },
    },
    connections=tuple(
        wire
        for name in ACTUATORS
        for wire in (
            f"foot.{name}_length_change -> {name}.length_change",
            f"{name}.tension -> foot.{name}_tension",
        )
    ),
    inputs={
        **{f"{name}_current": (f"{name}.current",) for name in ACTUATORS},
        **{f"toe_force_{axis}": (f"foot.toe_force_{axis}",) for axis in "xy"},
    },
    outputs=("foot.ankle_angle", "foot.tm_angle", "foot.mtp_angle", "foot.toe_x", "foot.toe_y"),
    step=1e-4,  # at 5e-4 the oscillation of the toe grows under a Jacobi master
    stop=2.0,
)
# kg and kg m^2, a tenth of those of `foot_free`: its 31 g weigh 0.3 N. What films can move binds,
# not what they bear: 1.3 A for half of 8 s rolls that weight from heel to ball, within 1.5 V.
_MASSES = {
    "leg_mass": 0.02,
    "m1": 0.006,
    "m2": 0.003,
    "m3": 0.001,
    "m4": 0.001,
    "ankle_inertia": 1e-4,
    "tm_inertia": 5e-5,
    "mtp_inertia": 2e-6,
    "mtp2_inertia": 2e-6,
}
# The heel is 0.2 mm above the ground and 0.28 mm lower than the ball. Dashpots have flowed to
# tensions of 1 N in po and 0.4 N in pl, whose moments an and do balance.
_START = {
    "ankle_angle_start": 0.1635,
    "mtp_angle_start": -0.14,
    "leg_height_start": 0.027923,
    "an_flow_start": -2.4961e-3,
    "po_flow_start": 4.3683e-3,
    "do_flow_start": 0.3685e-3,
    "pl_flow_start": -2.3455e-3,
}
# N s/m; over seconds, a Kelvin element of 200 s is a second dashpot, of 2.0e6, in series
_DAMPING_OF_SECONDS = 1.0 / (1.0 / _DAMPING + 1.0 / 2.0e6)
# galvanostatic; at 15 V, its compliance, the protection does not act
_GALVANOSTAT = MemberDeclaration("galvanostat", {"voltage_command": 0.0, "voltage_limit": 15.0})
FOOT_STANCE = SystemDeclaration(
    name="foot_stance",
    summary=(
        "Foot under a leg that stands on the ground, with four actuators behind galvanostats"
        " (thesis sections 5.4.1, 6.2)."
    ),
    members={
        **{f"drive_{name}": _GALVANOSTAT for name in ACTUATORS},
        **{name: MemberDeclaration("ppy_actuator") for name in ACTUATORS},
        "foot": MemberDeclaration(
            "foot_displacement_driven",
            {
                **_MASSES,
                **_START,
                **{f"k_{name}": _STIFFNESS for name in ACTUATORS},
                **{f"b_{name}": _DAMPING_OF_SECONDS for name in ACTUATORS},
                "toe_force_x": 0.0,
                "toe_force_y": 0.0,
            },
        ),
    },
    # springs and dashpots of the actuators are the foot's, so that what is exchanged is slow
    connections=tuple(
        wire
        for name in ACTUATORS
        for wire in (
            f"drive_{name}.current -> {name}.current",
            f"{name}.voltage -> drive_{name}.voltage",
            f"{name}.electrochemical_displacement -> foot.{name}_displacement",
            f"foot.{name}_force -> {name}.force",
        )
    ),
    inputs={
        **{f"{name}_current": (f"drive_{name}.current_command",) for name in ACTUATORS},
        **{f"leg_force_{axis}": (f"foot.leg_force_{axis}",) for axis in "xy"},
    },
    outputs=(
        "foot.ground_force_x",
        "foot.ground_force_y",
        "foot.leg_height",
        "foot.ankle_angle",
        "foot.mtp_angle",
    ),
    step=5e-3,
    stop=8.0,
)
# The rig's displacement includes its spring, and answers to a force a step later: in series with
# that spring of 6300 N/m, a tendon below it lets the exchange settle. It is taut by 1 N at first.
_TENDON = 3000.0
HIL_STANCE = replace(
    FOOT_STANCE,
    name="hil_stance",
    summary=(
        "Stance of a foot whose actuator ``po`` is a real one behind a tendon: the member stands"
        " for it and asks the rig (``ppy rig serve``)."
    ),
    members={
        **FOOT_STANCE.members,
        "po": MemberDeclaration("rig_proxy"),
        "foot": MemberDeclaration(
            "foot_displacement_driven",
            {
                **FOOT_STANCE.members["foot"].values,
                "k_po": _TENDON,
                "b_po": 1e15,  # the films of the rig flow themselves
                "po_flow_start": 4.5270e-3 - 1.0 / _TENDON - 1.0 / _STIFFNESS,
            },
        ),
    },
    connections=tuple(
        wire.replace("po.electrochemical_displacement", "po.displacement")
        for wire in FOOT_STANCE.connections
    ),
)
# dorsiflexion: the actuators in front contract, those behind give way
EXAMPLES = (
    Example(
        FOOT_GAIT,
        {
            "an_current": -0.5,
            "po_current": 0.5,
            "do_current": -0.5,
            "pl_current": 0.5,
            "toe_force_x": 0.0,
            "toe_force_y": 0.0,
        },
    ),
    # the leg settles on its heel and ball, with the weight that the body leaves to it
    Example(
        FOOT_STANCE,
        {**{f"{name}_current": 0.0 for name in ACTUATORS}, "leg_force_x": 0.0, "leg_force_y": 0.0},
    ),
)
