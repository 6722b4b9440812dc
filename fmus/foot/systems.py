"""The gait: the foot under four actuators, each driven by its current (thesis chapter 5)."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

ACTUATORS = ("an", "po", "do", "pl")
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
)
