"""The components: each subpackage is one, ``kit`` is what they are made with."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from .kit.errors import UserError, suggestion

if TYPE_CHECKING:
    from .kit import Component, Effect

# name of the FMU -> module and class; strings, so that listing them imports nothing
COMPONENTS = {
    "ppy_actuator": "ppy_actuator.model:PpyActuator",
    "ppy_actuator_length_driven": "ppy_actuator.model:PpyActuatorLengthDriven",
    "ppy_actuator_voltage_driven": "ppy_actuator.model:PpyActuatorVoltageDriven",
    "galvanostat": "galvanostat.model:Galvanostat",
    "voice_coil_dma": "voice_coil_dma.model:VoiceCoilDma",
    "isotonic_stand": "isotonic_stand.model:IsotonicStand",
    "degradation_estimator": "degradation_estimator.model:DegradationEstimator",
    "foot": "foot.model:Foot",
    "foot_design": "foot.design:FootDesign",
    "foot_dynamic": "foot.model:FootDynamic",
    "adaptive_controller": "controllers.adaptive_controller:AdaptiveController",
    "impedance_controller": "controllers.impedance_controller:ImpedanceController",
    "feedforward": "controllers.feedforward:Feedforward",
    "learning_controller": "controllers.learning_controller:LearningController",
    "pid": "controllers.pid:Pid",
    "displacement_controller": "controllers.displacement_controller:DisplacementController",
    "state_feedback": "controllers.state_feedback:StateFeedback",
    "foot_free": "foot.model:FootFree",
}
# What stands for a rig, and needs one to run.
PROXIES = {
    "rig_proxy": "rig_proxy.model:RigProxy",
    "rig_proxy_length_driven": "rig_proxy.model:RigProxyLengthDriven",
    "rig_proxy_bench": "rig_proxy.model:RigProxyBench",
    "rig_proxy_thesis": "rig_proxy.model:RigProxyThesis",
    "rig_proxy_thesis_generator": "rig_proxy.model:RigProxyThesisGenerator",
}
MODELS = COMPONENTS | PROXIES


def component(name: str) -> type[Component]:
    """Load a component class by its FMU name.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    if name not in MODELS:
        raise UserError(f"no component named {name!r}{suggestion(name, MODELS)}")
    module, cls = MODELS[name].split(":")
    loaded: type[Component] = getattr(importlib.import_module(f"{__name__}.{module}"), cls)
    return loaded


def effects(name: str) -> dict[str, type[Effect]]:
    """Collect the effects of a component by id.

    They are ``EFFECTS`` of its package's module ``effects``, if there is one.

    Where a package has several components, an effect of a law that one of them has not is none of
    its own.

    Raises
    ------
    UserError
        If there is no component of that name.
    """
    cls = component(name)
    module = cls.__module__.rpartition(".")[0] + ".effects"
    if not importlib.util.find_spec(module):
        return {}
    known: dict[str, type[Effect]] = importlib.import_module(module).EFFECTS
    return {
        id: effect
        for id, effect in known.items()
        if not effect.term.law or hasattr(cls, effect.term.law)
    }
