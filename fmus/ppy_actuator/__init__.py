"""The polypyrrole actuator: force-driven, length-driven and voltage-driven."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..kit.registry import ComponentPackage, Excitation

if TYPE_CHECKING:
    from .model import PpyActuator

__all__ = ["PpyActuator"]
PACKAGE = ComponentPackage(
    components={
        "ppy_actuator": "fmus.ppy_actuator.model:PpyActuator",
        "ppy_actuator_length_driven": "fmus.ppy_actuator.model:PpyActuatorLengthDriven",
        "ppy_actuator_voltage_driven": "fmus.ppy_actuator.model:PpyActuatorVoltageDriven",
    },
    default_model="ppy_actuator",
    excitations={
        # range of the galvanostat, and forces below the limit of the films
        "ppy_actuator": Excitation({"current": (-1.3, 1.3), "force": (0.0, 3.0)}, bandwidth=30.0)
    },
    experiment_folder=Path(__file__).with_name("experiments"),
)
__getattr__ = PACKAGE.offered
