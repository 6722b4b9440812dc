"""Systems of an actuator, its instrument and the degradation estimator (sections 4.2, 4.3)."""

from __future__ import annotations

from ..kit.registry import Example, MemberDeclaration, SystemDeclaration

# The estimator is the first member of both: it samples before the protection acts.
_WIRES = (
    "galvanostat.current -> actuator.current",
    "galvanostat.current -> estimator.current",
    "actuator.voltage -> estimator.voltage",
    "actuator.voltage -> galvanostat.voltage",
    "estimator.voltage_limit -> galvanostat.voltage_limit",
)

# The five-hour life (section 4.3, figs. 4-5 to 4-7): an actuator that warms up, and whose series
# resistance grows.
AMPLITUDE = 1.3  # A, of the square wave of current
FREQUENCY = 0.1  # Hz, of the square wave of current
FIRST_VOLTAGE = 1.15  # V, the printed amplitude at the start
# F; with the resistances of the fresh circuit of table 3-1 it gives the first voltage
CAPACITANCE = 3.347884872673928
# R1 falls as the actuator warms up, and grows with the charge moved. The thesis prints the time of
# the minimum, 2100 s, and a rise by 15 to 25 % in a lifetime. The conductance of electrolytes
# (0.02/K) and the heat capacity (50 J/K) are those of the effect; twice its thermal resistance and
# the growth rate are chosen to give a minimum at 2100 s and a rise by 16 % from there to the end.
_AGEING = {
    "resistance_growth_rate": 6.7e-5,
    "conductance_rise_per_kelvin": 0.02,
    "thermal_resistance": 40.0,
    "thermal_time": 2000.0,
}
# A design parameter (section 4.2): just above the first voltages, so that derating acts within the
# life.
ESTIMATOR = {"initial_voltage_limit": 1.2}  # V
_LIFE_STEP = 0.1  # s

DEGRADATION_WATCH = SystemDeclaration(
    name="degradation_watch",
    summary=(
        "Galvanostat, an actuator that ages, and an estimator that lowers the voltage limit"
        " (thesis sections 4.2, 4.3)."
    ),
    members={
        "estimator": MemberDeclaration(
            "degradation_estimator", {"sample_period": _LIFE_STEP, **ESTIMATOR}
        ),
        "galvanostat": MemberDeclaration(
            "galvanostat",
            {"protection_period": _LIFE_STEP, "control_period": _LIFE_STEP, "voltage_command": 0.0},
        ),
        "actuator": MemberDeclaration(
            "ppy_actuator",
            {"C": CAPACITANCE, **_AGEING},
            effects=("resistance_growth", "self_heating"),
            model_name="ageing_actuator",
        ),
    },
    connections=_WIRES,
    inputs={
        "current_command": ("galvanostat.current_command",),
        "force": ("actuator.force",),
    },
    outputs=(
        "galvanostat.current",
        "actuator.voltage",
        "actuator.displacement",
        "estimator.voltage_limit",
    ),
    step=_LIFE_STEP,
    stop=18000.0,
)

# At 1 kHz the potentiostat keeps the voltage practically constant between samples of the estimator.
# Its integral gain is deadbeat: an error of the voltage is gone at the next sample, but for the
# discharge of the circuit in between.
_PERIOD = 1e-3  # s
_R1 = 0.43  # ohm, as R2 of the actuator by default
_R2 = 2.35
_STEP_RESISTANCE = _R1 * _R2 / (_R1 + _R2)  # ohm, of the circuit to a step of the current
_RATE = 15.0  # Hz; of the thesis, as forgetting factor and resets are

POTENTIOSTAT_WATCH = SystemDeclaration(
    name="potentiostat_watch",
    summary=(
        "Potentiostat that keeps an actuator at a voltage, and an estimator of its circuit (thesis"
        " section 4.3, fig. 4-8)."
    ),
    members={
        "estimator": MemberDeclaration(
            "degradation_estimator",
            {
                "sample_period": 1.0 / _RATE,
                "forgetting_time": 1.0,
                "remaining_weight": 0.985**_RATE,
                "reset_interval": 5.0,
                "initial_covariance": 1.0,
                "instrumental_variable": 0.0,
                "zero_order_hold": 0.0,
                "initial_voltage_limit": 15.0,
            },
        ),
        "galvanostat": MemberDeclaration(
            "galvanostat",
            {
                "potentiostat": 1.0,
                "protection_period": _PERIOD,
                "control_period": _PERIOD,
                "integral_gain": 1.0 / (_STEP_RESISTANCE * _PERIOD),
                "current_command": 0.0,
            },
        ),
        "actuator": MemberDeclaration("ppy_actuator"),
    },
    connections=_WIRES,
    inputs={
        "voltage_command": ("galvanostat.voltage_command",),
        "force": ("actuator.force",),
    },
    outputs=("galvanostat.current", "actuator.voltage", "estimator.R1", "estimator.impedance"),
    step=_PERIOD,
    stop=160.0,
)
EXAMPLES = (
    Example(DEGRADATION_WATCH, {"current_command": 0.3, "force": 0.0}),
    Example(POTENTIOSTAT_WATCH, {"voltage_command": 0.5, "force": 0.0}),
)
