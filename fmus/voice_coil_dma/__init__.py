"""Voice-coil dynamic mechanical analyzer: the force bench of the rig."""

from .model import VoiceCoilDma

__all__ = ["VoiceCoilDma"]
