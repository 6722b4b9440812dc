"""Facts of each component that the contract cannot read from its FMU.

The signals and their units are those of the design, typed in again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest

from fmus import COMPONENTS
from fmus.kit.build.building import RUNTIMES
from tests.support.pace import FREE_FEET, TELLING_NAMES, slow_but

ACTUATORS = ("ppy_actuator", "ppy_actuator_length_driven")
# Tests of the front-end and of the exact solutions for a current, which need no other component
actuators_only = pytest.mark.parametrize("name", ACTUATORS)

# a free foot in Python takes as long as all others together; it is compared with its native build
EACH = [
    (name, runtime)
    for name in COMPONENTS
    for runtime in RUNTIMES
    if runtime != "python" or name not in FREE_FEET
]
TELLING = [(name, runtime) for name in TELLING_NAMES for runtime in RUNTIMES]
# Claims on the laws and the description of each component: the front-end in Python is one for all
# of them
each_component = pytest.mark.parametrize(
    ("name", "runtime"), slow_but(EACH, *((name, "native") for name in COMPONENTS), *TELLING)
)
# Claims on the front-ends: shown by a small component, and by one with samples and all types of
# variables
each_front_end = pytest.mark.parametrize(("name", "runtime"), slow_but(EACH, *TELLING))


@dataclass(frozen=True)
class Subject:
    """A component under test.

    Attributes
    ----------
    inputs : Mapping of str to float
        Two inputs at least, each with a value that is typical of it.
    output : str
        A real output that depends on the first of the parameters.
    parameters : Mapping of str to float
        Some off their defaults, a start value among them if there is one; the last has a positive
        minimum.
    signals : str
        Inputs and outputs of the design with their units.
    started : Mapping of str to float
        Start values that bring every law into play, away from kinks.
    tolerance : float or None
        Accuracy that hosts ask for where builds are compared. Rounding decides in which internal
        step a foot touches, so that builds differ by a few times the tolerance of a step.
    """

    inputs: Mapping[str, float]
    output: str
    parameters: Mapping[str, float]
    signals: str
    started: Mapping[str, float] = field(default_factory=dict)
    tolerance: float | None = None

    @property
    def first(self) -> str:
        """Name of the first input."""
        return next(iter(self.inputs))

    @property
    def second(self) -> str:
        """Name of the second input."""
        return list(self.inputs)[1]

    @property
    def parameter(self) -> str:
        """Name of a parameter."""
        return next(iter(self.parameters))

    @property
    def positive(self) -> str:
        """Name of a parameter that must not be zero."""
        return list(self.parameters)[-1]


_ACTUATOR = {"R1": 0.5, "charge_start": 0.25, "C": 2.0}
_MARGINS = " compression_margin N displacement_margin m force_margin N voltage_margin V"
_ELONGATED = {"kelvin_elongation_start": 2e-5, "maxwell_elongation_start": 1e-5}
_MOVED = (
    "toe_force_x N toe_force_y N an_length m po_length m do_length m pl_length m"
    " an_length_change m an_length_rate m/s toe_x m toe_y m"
    " ankle_torque N.m tm_torque N.m mtp_torque N.m toe_compliance_xx m/N toe_damping_xx N.s/m"
    " ankle_angle rad tm_angle rad mtp_angle rad ankle_rate rad/s tm_rate rad/s mtp_rate rad/s"
)
_FOOT = f"an_tension N po_tension N do_tension N pl_tension N {_MOVED}"
_FREE = (
    "leg_force_x N leg_force_y N mtp2_angle rad mtp2_rate rad/s leg_height m leg_advance m"
    " leg_velocity_x m/s leg_velocity_y m/s actuator_work J ground_work J load_work J joint_loss J"
    " kinetic_energy J potential_energy J ground_force_x N ground_force_y N heel_pressure N"
    " ball_pressure N toe_pressure N toes_pressure N"
)
_IN_THE_GROUND = {
    "leg_height_start": 0.021,
    "leg_velocity_y_start": 0.01,
    "leg_velocity_x_start": 0.01,
}
SUBJECTS = {
    "ppy_actuator": Subject(
        {"current": 0.9, "force": 1.0},
        "voltage",
        _ACTUATOR,
        "current A force N voltage V displacement m electrochemical_displacement m"
        " mechanical_displacement m charge C" + _MARGINS,
        _ELONGATED,
    ),
    "ppy_actuator_length_driven": Subject(
        {"current": 0.9, "length_change": 1e-3},
        "voltage",
        _ACTUATOR,
        "current A length_change m tension N voltage V electrochemical_displacement m"
        " mechanical_displacement m charge C" + _MARGINS,
        _ELONGATED,
    ),
    "ppy_actuator_voltage_driven": Subject(
        {"voltage": 0.5, "force": 1.0},
        "current",
        _ACTUATOR,
        "voltage V force N current A displacement m electrochemical_displacement m"
        " mechanical_displacement m charge C" + _MARGINS,
        _ELONGATED,
    ),
    "galvanostat": Subject(
        {"current_command": 0.9, "voltage": 1.0, "voltage_limit": 2.0, "voltage_command": 0.5},
        "current",
        {"response_time": 0.01, "lagged_current_start": 0.1, "current_limit": 0.5},
        "current_command A voltage V voltage_limit V current A saturated - recovering -",
    ),
    "voice_coil_dma": Subject(
        {"force_reference": 1.0, "tension": 0.5},
        "coil_voltage",
        {"K": 4.5, "position_start": 1e-4, "voltage_command_start": 0.5, "R": 2.5},
        "force_reference N tension N position m velocity m/s coil_current A coil_voltage V"
        " force_measured N position_measured m",
    ),
    "isotonic_stand": Subject(
        {"mass": 0.2, "displacement": 1e-3},
        "sensor_voltage",
        {"lvdt_sensitivity": 150.0, "demodulated_voltage_start": 0.1, "placing_time": 0.1},
        "mass kg displacement m tension N sensor_voltage V displacement_measured m",
    ),
    "degradation_estimator": Subject(
        {"current": 0.9, "voltage": 0.5},
        "voltage_limit",
        {"initial_voltage_limit": 1.2, "R1_start": 0.4, "forgetting_time": 100.0},
        "current A voltage V R1 Ohm R2 Ohm C F impedance Ohm impedance_change 1 voltage_limit V"
        " estimate_valid -",
    ),
    "foot": Subject(
        {"po_tension": 1.0, "ankle_angle": 0.1}, "toe_x", {"l1": 0.052, "k_an": 8000.0}, _FOOT
    ),
    "foot_design": Subject(
        {"mtp_angle": 0.2, "ankle_angle": 0.1},
        "toe_x",
        {"l1": 0.052, "actuator_force": 2.0, "k_an": 8000.0},
        f"{_FOOT} ankle_limited_force N toe_limited_force N toe_force N toe_stroke m",
    ),
    "foot_dynamic": Subject(
        {"po_tension": 0.1, "toe_force_y": 0.1},
        "toe_x",
        {"l1": 0.052, "tm_angle_start": 0.01, "k_an": 8000.0},
        _FOOT,
    ),
    "displacement_controller": Subject(
        {"reference": 2e-5, "voltage": 0.4, "displacement": 1e-5, "current": 0.3},
        "command",
        {"charge_limit": 1.0, "unlimited_command_start": 0.2, "integral_time": 5.0},
        "reference m displacement m voltage V current A hold - command_beside A command A"
        " limited - charge C",
    ),
    "state_feedback": Subject(
        {"reference": 2e-5, "force": 0.1, "displacement": 1e-5, "voltage": 0.1, "current": 0.3},
        "command",
        {"current_limit": 0.2, "charge_start": 0.2, "charge_limit": 1.0},
        "reference m displacement m voltage V current A force N command A charge C"
        " kelvin_elongation m maxwell_elongation m",
    ),
    "feedforward": Subject(
        {"next_reference": 2e-5, "force": 0.1, "next_force": 0.12},
        "command",
        {"current_limit": 0.3, "charge_start": 0.1, "sample_period": 0.2},
        "next_reference m force N next_force N active - command A charge C limited -",
    ),
    "learning_controller": Subject(
        {"feedback_command": 0.4, "reference": 2e-5, "displacement": 1e-5},
        "command",
        {"current_limit": 0.3, "learnt_start[40]": 0.1, "sample_period": 0.2},
        "reference m displacement m feedback_command A learning - command A",
    ),
    "impedance_controller": Subject(
        {"length": 5e-4, "rest_length": 2e-4},
        "force_reference",
        {"force_max": 0.7, "unlimited_force_start": 0.8, "sample_period": 0.03},
        "length m rest_length m force_reference N length_rate m/s",
    ),
    "adaptive_controller": Subject(
        {"reference": 5e-5, "displacement": 3e-5},
        "command",
        {"current_limit": 0.3, "command_within_limits_start": 0.1, "model_time": 0.8},
        "reference m displacement m command A gain 1 model_displacement m",
    ),
    "pid": Subject(
        {"reference": 1.0, "measured": 0.4, "manual_command": 0.5, "applied_command": 0.1},
        "command",
        {"command_max": 0.5, "unlimited_command_start": 0.6, "integral_time": 0.7},
        "reference N measured N manual - manual_command V tracking - applied_command V command V"
        " saturated -",
    ),
    # taut; all points of both in the ground, and slipping
    "foot_displacement_driven": Subject(
        {"pl_displacement": -4e-4, "leg_force_y": 0.1},
        "toe_x",
        {"l1": 0.052, "tm_angle_start": 0.01, "leg_held": False, "leg_mass": 0.3, "k_an": 8000.0},
        "an_displacement m po_displacement m do_displacement m pl_displacement m an_force N"
        f" po_force N do_force N pl_force N {_MOVED} {_FREE}",
        _IN_THE_GROUND | {f"{name}_flow_start": -1e-4 for name in ("an", "po", "do", "pl")},
        1e-12,
    ),
    "foot_free": Subject(
        {"po_tension": 0.1, "leg_force_y": 0.1},
        "toe_x",
        {"l1": 0.052, "tm_angle_start": 0.01, "leg_held": False, "leg_mass": 0.3, "k_an": 8000.0},
        f"{_FOOT} {_FREE}",
        _IN_THE_GROUND,
        1e-11,
    ),
}
assert set(SUBJECTS) == set(COMPONENTS), "every component is under contract"
