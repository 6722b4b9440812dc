"""Tanks that empty through pipes."""

from pathlib import Path

from fmus.kit.registry import (
    ComponentPackage,
    Excitation,
    MemberDeclaration,
    RigDeclaration,
    SystemDeclaration,
)

CASCADE = SystemDeclaration(
    name="tank_cascade",
    summary="Two tanks, of which the upper one empties into the lower one.",
    members={
        "upper": MemberDeclaration("tank", {"conductance": 4e-3}),
        "lower": MemberDeclaration("tank", effects=("turbulence",), model_name="turbulent_tank"),
    },
    connections=("upper.outflow -> lower.inflow",),
    inputs={"inflow": ("upper.inflow",)},
    outputs=("lower.level",),
    step=1.0,
    stop=600.0,
)
RIG = RigDeclaration({"inflow": "m^3/s"}, {"level": "m"}, limits={"inflow": (0.0, 5e-3)})
PACKAGE = ComponentPackage(
    components={"tank": "tank_models.model:Tank"},
    excitations={"tank": Excitation({"inflow": (0.0, 5e-3)}, bandwidth=0.1)},
    declared_systems=(CASCADE,),
    rigs={"tank": RIG},
    experiment_folder=Path(__file__).with_name("experiments"),
    preset_folder=Path(__file__).with_name("calibrations"),
)
