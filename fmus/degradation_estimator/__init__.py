"""Degradation estimator: impedance of the working actuator and the derived voltage limit."""

from pathlib import Path

from ..kit.registry import ComponentPackage
from .systems import DEGRADATION_WATCH, EXAMPLES, POTENTIOSTAT_WATCH

PACKAGE = ComponentPackage(
    components={"degradation_estimator": "fmus.degradation_estimator.model:DegradationEstimator"},
    declared_systems=(DEGRADATION_WATCH, POTENTIOSTAT_WATCH),
    examples=EXAMPLES,
    experiment_folder=Path(__file__).with_name("experiments"),
)
