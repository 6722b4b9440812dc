"""Controllers of force, displacement and compliance, each sampled at a period of its own."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage
from .systems import EXAMPLES, SYSTEMS

if TYPE_CHECKING:
    from .adaptive_controller import AdaptiveController
    from .displacement_controller import DisplacementController
    from .feedforward import Feedforward
    from .impedance_controller import ImpedanceController
    from .learning_controller import LearningController
    from .pid import Pid
    from .state_feedback import StateFeedback

__all__ = [
    "AdaptiveController",
    "DisplacementController",
    "Feedforward",
    "ImpedanceController",
    "LearningController",
    "Pid",
    "StateFeedback",
]
PACKAGE = ComponentPackage(
    components={
        name: f"fmus.controllers.{name}:{cls}"
        for name, cls in {
            "adaptive_controller": "AdaptiveController",
            "impedance_controller": "ImpedanceController",
            "feedforward": "Feedforward",
            "learning_controller": "LearningController",
            "pid": "Pid",
            "displacement_controller": "DisplacementController",
            "state_feedback": "StateFeedback",
        }.items()
    },
    declared_systems=SYSTEMS,
    examples=EXAMPLES,
    designs={
        "pid": "fmus.controllers.tuning:tuned_pid",
        "pi": "fmus.controllers.tuning:tuned_pi",
        "state_feedback": "fmus.controllers.design:designed_state_feedback",
        "adaptive": "fmus.controllers.design:designed_adaptive",
        "impedance": "fmus.controllers.design:designed_impedance",
    },
    experiment_folder=Path(__file__).with_name("experiments"),
)
__getattr__ = PACKAGE.offered
