"""The potentiostat-galvanostat that drives the actuator, with the voltage protection of thesis
section 4.2.
"""

from .model import Galvanostat

__all__ = ["Galvanostat"]
