"""The humanoid foot of thesis chapter 5: kinematics and statics, and a dynamic form."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage, StimulusDeclaration
from .systems import EXAMPLES, FOOT_GAIT, FOOT_STANCE, HIL_STANCE

if TYPE_CHECKING:
    from .model import Foot

__all__ = ["Foot"]
PACKAGE = ComponentPackage(
    components={
        "foot": "fmus.foot.model:Foot",
        "foot_design": "fmus.foot.design:FootDesign",
        "foot_displacement_driven": "fmus.foot.model:FootDisplacementDriven",
        "foot_dynamic": "fmus.foot.model:FootDynamic",
        "foot_free": "fmus.foot.model:FootFree",
    },
    declared_systems=(FOOT_GAIT, FOOT_STANCE, HIL_STANCE),
    examples=EXAMPLES,
    stimuli={
        "gait": StimulusDeclaration(
            "Length change of an actuator of the foot in the stance phase (eqs. 5.13 to 5.16).",
            key="actuator",
            choices=("an", "po", "do", "pl"),
            unit="m",
            signals="fmus.foot.gait:length_changes",
        )
    },
    experiment_folder=Path(__file__).with_name("experiments"),
)
__getattr__ = PACKAGE.offered
