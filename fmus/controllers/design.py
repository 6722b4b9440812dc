"""Design of the state feedback by a linear model.

Not part of the FMU; the libraries that it needs are imported where they are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import Component, UserError, stack
from fmus.kit.extras import optional
from fmus.kit.units import format_range

from .state_feedback import StateFeedback, design_remark

if TYPE_CHECKING:
    from fmus.kit.arrays import Array

SAMPLE_PERIOD = 0.02  # s
# s, of the response to the reference and of the integral action
TIME_CONSTANTS = (0.5, 1.5)
# Standard deviations of the process noise per sample of charge, Kelvin and Maxwell elongation
DISTURBANCES = (1e-3, 1e-8, 1e-8)  # C, m, m
# Standard deviations of the measurement noise: the resolution of section 2.2.2, and a millivolt
NOISES = (3e-6, 1e-3)  # m, V

_STATES = ("charge", "kelvin_elongation", "maxwell_elongation")
_INPUTS = ("current", "force")
_OUTPUTS = ("displacement", "voltage")
# Largest element off the diagonal of the sampled state matrix of decoupled states, from rounding.
_COUPLED = 1e-12


def _linearised(plant: type[Component], values: dict[str, float]) -> tuple[Array, ...]:
    """Return A, B, C, D of an actuator, with signals in the order of `_STATES` and so on.

    Raises
    ------
    UserError
        If the actuator has other signals, or a value is out of range.
    """
    from fmus.kit.symbolic import trace

    states = [v.name for v in plant.layout.states]
    inputs = [v.name for v in plant.layout.inputs]
    outputs = [v.name for v in plant.layout.outputs]
    has_signals = {*_INPUTS} <= {*inputs} and {*_OUTPUTS} <= {*outputs}
    if sorted(states) != sorted(_STATES) or not has_signals:
        raise UserError(
            f"{plant.name}: the state feedback is for a force-driven actuator with the states"
            f" {', '.join(_STATES)}; this one has {', '.join(states)}"
        )
    _check_values(plant, values)
    A, B, C, D = trace(plant).linearise(**values)
    x = [states.index(name) for name in _STATES]
    u = [inputs.index(name) for name in _INPUTS]
    y = [outputs.index(name) for name in _OUTPUTS]
    return A[np.ix_(x, x)], B[np.ix_(x, u)], C[np.ix_(y, x)], D[np.ix_(y, u)]


def _check_values(plant: type[Component], values: dict[str, float]) -> None:
    """Raise `UserError` if a value is NaN or out of the range of its variable."""
    layout = plant.layout
    for variable in (*layout.parameters, *layout.inputs, *layout.states):
        value = values.get(variable.name, variable.start)
        if not variable.min <= value <= variable.max:
            raise UserError(
                f"{plant.name}: {variable.name} = {value:g} {variable.unit} is out of range,"
                f" {format_range(variable) or 'a number'}"
            )


def _check_times(sample_period: float, time_constants: Sequence[float]) -> None:
    if not 0.0 < sample_period < np.inf:
        raise UserError(f"sample period {sample_period:g} s: a time above 0 s")
    if len({*time_constants}) != 2 or not all(0.0 < time < np.inf for time in time_constants):
        shown = ", ".join(f"{time:g}" for time in time_constants)
        raise UserError(f"time constants {shown} s: two unequal times above 0 s")


def gains(
    plant: type[Component],
    sample_period: float = SAMPLE_PERIOD,
    time_constants: tuple[float, float] = TIME_CONSTANTS,
    **values: float,
) -> dict[str, float]:
    """Return the gains of observer and feedback for an actuator.

    The observer is the stationary Kalman filter for `DISTURBANCES` and `NOISES`
    (``control.dlqe``). The feedback of charge and integral places two poles (``control.place``);
    the gain of the reference makes a zero that cancels the second pole, so that the displacement
    follows its reference with the first time constant alone.

    Parameters
    ----------
    plant : type[Component]
        Force-driven actuator whose states are charge, Kelvin and Maxwell elongation.
    sample_period : float
        Sample period of the controller, s.
    time_constants : tuple of float
        Two unequal time constants, s: of the response to the reference, and of the integral action.
    **values : float
        Parameters, inputs and states of the plant where it is linearised, by name, SI; all others
        at their defaults.

    Returns
    -------
    dict of str to float
        Parameters of :class:`.StateFeedback`.

    Raises
    ------
    UserError
        If the plant has other states or coupled ones, or a value or a time is out of range.
    """
    with optional():
        import control

    _check_times(sample_period, time_constants)
    continuous = control.ss(*_linearised(plant, values))
    sampled: Any = control.sample_system(continuous, sample_period, method="zoh")
    A = sampled.A
    B = sampled.B
    C = sampled.C
    D = sampled.D
    if np.abs(A - np.diag(np.diag(A))).max() > _COUPLED:
        raise UserError(
            f"{plant.name}: charge and creep are coupled; the design is for decoupled ones"
        )
    predictor, *_ = control.dlqe(
        A, np.eye(3), C, np.diag(np.square(DISTURBANCES)), np.diag(np.square(NOISES))
    )
    # `dlqe` returns the gain of the predictor, A times that of a filter that corrects first
    observer = np.linalg.solve(A, predictor)
    poles = np.exp(-sample_period / np.array(time_constants))
    # states: charge, and integral of the control error r - x of the displacement
    with_integral = np.array([[A[0, 0], 0.0], [-sample_period * C[0, 0], 1.0]])
    feedback = control.place(with_integral, np.array([[B[0, 0]], [0.0]]), poles)[0]
    integral = -float(feedback[1])
    parameters = {
        "sample_period": sample_period,
        "charge_pole": A[0, 0],
        "kelvin_pole": A[1, 1],
        "maxwell_pole": A[2, 2],
        "charge_per_current": B[0, 0],
        "kelvin_per_force": B[1, 1],
        "maxwell_per_force": B[2, 1],
        "displacement_per_charge": C[0, 0],
        "displacement_per_force": D[0, 1],
        "voltage_per_charge": C[1, 0],
        "voltage_per_current": D[1, 0],
        "charge_by_displacement": observer[0, 0],
        "charge_by_voltage": observer[0, 1],
        "kelvin_by_displacement": observer[1, 0],
        "kelvin_by_voltage": observer[1, 1],
        "maxwell_by_displacement": observer[2, 0],
        "maxwell_by_voltage": observer[2, 1],
        "charge_gain": feedback[0],
        "integral_gain": integral,
        "reference_gain": integral * sample_period / (1.0 - poles[1]),
    }
    return {name: float(value) for name, value in parameters.items()}


def state_feedback(
    plant: type[Component],
    name: str = "state_feedback",
    sample_period: float = SAMPLE_PERIOD,
    time_constants: tuple[float, float] = TIME_CONSTANTS,
    **values: float,
) -> type[Component]:
    """Make the state feedback of an actuator, ready to be built.

    Parameters
    ----------
    plant, sample_period, time_constants, **values
        See :func:`gains`.
    name : str
        Name of the FMU, whose description has the gains.

    Returns
    -------
    type[Component]
        :class:`.StateFeedback` with other defaults.

    Raises
    ------
    UserError
        See :func:`gains`.
    """
    designed = gains(plant, sample_period, time_constants, **values)
    made = stack(StateFeedback, name=name, defaults=designed)
    made.remark = design_remark(designed, plant.name)
    return made
