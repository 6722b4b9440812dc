"""Controllers of force, displacement and compliance, each sampled at a period of its own."""

from .displacement_controller import DisplacementController
from .pid import Pid
from .state_feedback import StateFeedback

__all__ = ["DisplacementController", "Pid", "StateFeedback"]
