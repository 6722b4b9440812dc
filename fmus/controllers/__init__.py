"""Controllers of force, displacement and compliance, each sampled at a period of its own."""

from .displacement_controller import DisplacementController
from .pid import Pid

__all__ = ["DisplacementController", "Pid"]
