"""Controllers of force, displacement and compliance, each sampled at a period of its own."""

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
