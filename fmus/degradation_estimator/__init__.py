"""Degradation estimator: impedance while the actuator works, and the voltage limit that follows
from it.
"""

from pathlib import Path

from ..kit.registry import ComponentPackage
from .systems import DEGRADATION_WATCH, POTENTIOSTAT_WATCH

PACKAGE = ComponentPackage(
    components={"degradation_estimator": "fmus.degradation_estimator.model:DegradationEstimator"},
    declared_systems=(DEGRADATION_WATCH, POTENTIOSTAT_WATCH),
    experiment_folder=Path(__file__).with_name("experiments"),
)
