"""Vertical test stand: weights on an actuator, and an LVDT that measures its displacement."""

from .model import IsotonicStand

__all__ = ["IsotonicStand"]
