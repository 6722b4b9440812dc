"""The gait: the foot under four actuators, each driven by its current (thesis chapter 5)."""

from __future__ import annotations

from ..kit.registry import MemberDeclaration, SystemDeclaration

ACTUATORS = ("an", "po", "do", "pl")
# N, under which the foot rests in its reference position: 5 N in those with the longer arms, and in
# their antagonists what balances it. Two coulombs slacken an actuator by less than 1 N.
TENSIONS = {"an": 11.624264677425735, "po": 5.0, "do": 13.543483552441367, "pl": 5.0}
# N/m and N s/m, of the actuators by default. The compliance of the foot is what the toe yields
# under a force before actuators creep: it has their stiffness and damping, and their tension.
_STIFFNESS = 6300.0
_DAMPING = 1.7e6

FOOT_GAIT = SystemDeclaration(
    name="foot_gait",
    summary="Foot that moves under four actuators, each driven by its current (thesis chapter 5).",
    members={
        # its stiffness at the toe is also that of tensions on arms that change
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
        # an actuator that has flowed to a shorter length than it is held at is under tension
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
    step=1e-4,  # at 5e-4 a Jacobi master lets the toe oscillate ever more
    stop=2.0,
)
