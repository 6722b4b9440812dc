"""The humanoid foot of thesis chapter 5: kinematics and statics, and a dynamic form."""

from .model import Foot

__all__ = ["Foot"]
