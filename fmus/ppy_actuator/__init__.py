"""The polypyrrole actuator, force-driven and length-driven."""

from .model import PpyActuator

__all__ = ["PpyActuator"]
