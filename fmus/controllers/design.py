"""Design of state feedback with observer, of an adaptive gain, and of an impedance.

Not part of the FMU; the libraries that it needs are imported where they are used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import Component, UserError, stack
from fmus.kit.registry import DesignedController, DesignRequest
from fmus.kit.units import quotient

from .adaptive_controller import AdaptiveController
from .impedance_controller import ImpedanceController
from .state_feedback import StateFeedback, design_remark
from .tuning import in_units

if TYPE_CHECKING:
    from fmus.kit.arrays import Array

_HERE = "fmus.controllers.design"
# ratio of the time constants of the integral action and of the response to the reference
_INTEGRAL_RATIO = 3.0
_RESPONSE_TIME = 0.5  # s, of state feedback without a crossover
# Standard deviations of the process noise per sample of charge, Kelvin and Maxwell elongation
_DISTURBANCES = (1e-3, 1e-8, 1e-8)  # C, m, m
# Standard deviations of the measurement noise: the resolution of section 2.2.2, and a millivolt
_NOISES = (3e-6, 1e-3)  # m, V
_PARTS = ("charge", "kelvin", "maxwell")
_STATES = ("charge", "kelvin_elongation", "maxwell_elongation")
# Largest element off the diagonal of the sampled state matrix of decoupled states, from rounding.
_COUPLED = 1e-12
_SPEED_UP = 3.0  # time constant of a plant over that of the model it follows, without a crossover
_SMALLEST_SENSITIVITY = 0.01  # of the measured value at the limit of the command
_RATE_FILTER = 2.5  # time constant of the filter of a rate, in sample periods
_LARGEST_FORCE = 1e6  # N


class _OwnCommand(StateFeedback):
    """State feedback of estimated charge and creep, whose command is the current that flows."""

    @property
    def current(self) -> Any:
        """Current since the latest sample."""
        return self.command_within_limits


def state_feedback(name: str, plant: str, **values: float) -> type[Component]:
    """Make a state feedback with the gains of a design for an actuator, by its name."""
    made = stack(_OwnCommand, name=name, defaults=values)
    made.remark = design_remark(values, plant)
    return made


def designed_state_feedback(request: DesignRequest) -> DesignedController:
    """Return the state feedback of an actuator's displacement by its current.

    The observer is the stationary Kalman filter for `_DISTURBANCES` and `_NOISES`
    (``control.dlqe``). The feedback of charge and integral places two poles (``control.place``);
    the gain of the reference makes a zero that cancels the second pole, so that the displacement
    follows its reference with the first time constant alone: that of the crossover.

    Raises
    ------
    UserError
        If the plant has other signals, other states or coupled ones.
    """
    import control

    ends = (request.command.name, request.measured.name)
    if ends != ("current", "displacement"):
        raise UserError(
            f"state_feedback: from current to displacement of an actuator, not from {ends[0]} to"
            f" {ends[1]}; pid, pi and adaptive are for any signals"
        )
    plant = request.linearise(["current", "force"], ["displacement", "voltage"])
    if sorted(plant.states) != sorted(_STATES):
        raise UserError(
            f"state_feedback: of a force-driven actuator with the states {', '.join(_STATES)};"
            f" {plant.name} has {', '.join(plant.states)}"
        )
    period = float(request.plant.dt)
    order = [plant.states.index(state) for state in _STATES]
    sampled: Any = control.sample_system(plant.state_space, period, method="zoh")
    A, B = sampled.A[np.ix_(order, order)], sampled.B[order]
    C, D = sampled.C[:, order], sampled.D
    if np.abs(A - np.diag(np.diag(A))).max() > _COUPLED:
        raise UserError(f"state_feedback: charge and creep of {plant.name} are coupled")
    numbers = {
        "sample_period": period,
        **{f"{one}_pole": A[k, k] for k, one in enumerate(_PARTS)},
        "charge_per_current": B[0, 0],
        "kelvin_per_force": B[1, 1],
        "maxwell_per_force": B[2, 1],
        "displacement_per_charge": C[0, 0],
        "displacement_per_force": D[0, 1],
        "voltage_per_charge": C[1, 0],
        "voltage_per_current": D[1, 0],
        **_observer(A, C),
        **_feedback(request, A[0, 0], B[0, 0], C[0, 0], plant.at_rest("charge")),
        **{f"{state}_start": plant.at_rest(state) for state in _STATES},
        **_current_limit(request),
    }
    arguments = {key: float(value) for key, value in numbers.items()}
    return DesignedController(
        f"{_HERE}:state_feedback",
        {"name": "controller", "plant": plant.name, **arguments},
        {one: one for one in ("displacement", "voltage", "force")},
    )


def _observer(A: Array, C: Array) -> dict[str, float]:
    """Return the gains of the stationary Kalman filter, by which it corrects a sample."""
    import control

    predictor, *_ = control.dlqe(
        A, np.eye(3), C, np.diag(np.square(_DISTURBANCES)), np.diag(np.square(_NOISES))
    )
    # `dlqe` returns the gain of the predictor, A times that of a filter that corrects first
    names = [f"{state}_by_{one}" for state in _PARTS for one in ("displacement", "voltage")]
    return dict(zip(names, np.linalg.solve(A, predictor).flat, strict=True))


def _feedback(
    request: DesignRequest, decay: float, by_current: float, displacement: float, charge: float
) -> dict[str, float]:
    """Return gains and start values of the feedback of charge and integral.

    Parameters
    ----------
    request : DesignRequest
    decay : float
        Share of the charge that is left after a sample.
    by_current : float
        Charge per current of a sample, C/A.
    displacement : float
        Displacement per charge, m/C.
    charge : float
        Charge at the operating point, C.
    """
    import control

    period, crossover = float(request.plant.dt), request.crossover
    response = _RESPONSE_TIME if crossover is None else 0.5 / np.pi / crossover
    tracking = _INTEGRAL_RATIO * response
    poles = np.exp(-period / np.array([response, tracking]))
    # states: charge, and integral of the control error r - x of the displacement
    with_integral = np.array([[decay, 0.0], [-period * displacement, 1.0]])
    placed = control.place(with_integral, np.array([[by_current], [0.0]]), poles)
    by_charge, by_integral = placed[0]
    by_reference = -by_integral * period / (1.0 - poles[1])
    fed_back = (by_charge - by_reference * displacement) * charge
    return {
        "charge_gain": by_charge,
        "integral_gain": -by_integral,
        "reference_gain": by_reference,
        "tracking_time": tracking,
        "integral_start": request.command.value + fed_back,
        "command_within_limits_start": request.command.value,
    }


def _current_limit(request: DesignRequest) -> dict[str, float]:
    """Return the limit in either direction of a controller that has one; none if none is given."""
    low, high = request.limits
    limit = min(-low, high)
    return {"current_limit": limit} if np.isfinite(limit) else {}


def adaptive(name: str, measured: str, command: str, **values: float) -> type[Component]:
    """Make an adaptive controller of signals in these SI units."""
    units = {"m": measured, "A": command, "m/A": quotient(measured, command)}
    return in_units(AdaptiveController, units, name, values)


def designed_adaptive(request: DesignRequest) -> DesignedController:
    """Return the adaptive controller of a plant that is about one lag, by its slowest pole.

    Raises
    ------
    UserError
        If the slowest pole is not that of a lag, the plant does not rest at zero, or its measured
        value falls with the command.
    """
    period = float(request.plant.dt)
    decay = max(request.plant.poles(), key=abs)
    gain = float(np.real(request.plant(1.0)))
    at_rest = (request.command.value, request.measured.value)
    if decay.imag or not 0.0 < decay.real < 1.0 or gain <= 0.0 or any(at_rest):
        raise UserError(
            f"adaptive: of a lag that rests at zero and whose {request.measured.name} rises with"
            f" its {request.command.name}; the slowest pole here is z = {decay:.4g}, the gain"
            f" {gain:.4g}, and at rest they are {at_rest[1]:.4g} and {at_rest[0]:.4g};"
            " pid and pi are for any plant"
        )
    crossover = request.crossover
    slow = -period / np.log(decay.real) / _SPEED_UP
    limit = _current_limit(request) or {"current_limit": _LARGEST_FORCE}
    reach = gain * min(limit["current_limit"], 1.0)
    arguments = {
        "sample_period": period,
        "model_time": float(slow if crossover is None else 0.5 / np.pi / crossover),
        "decay": float(decay.real),
        "displacement_per_current": float(gain * (1.0 - decay.real)),
        "smallest_sensitivity": _SMALLEST_SENSITIVITY * reach,
        **limit,
    }
    units = {"measured": request.measured.unit, "command": request.command.unit}
    return DesignedController(
        f"{_HERE}:adaptive",
        {"name": "controller", **units, **arguments},
        {"displacement": request.measured.name},
    )


def impedance(name: str, **values: float) -> type[Component]:
    """Make an impedance controller."""
    return stack(ImpedanceController, name=name, defaults=values)


def designed_impedance(request: DesignRequest) -> DesignedController:
    """Return the impedance controller of a length by the reference of a force loop.

    Stiffness and damping are those of the component, or as they are set. The rest length is the
    reference, from the length at the operating point on, and the preload the force there.

    Raises
    ------
    UserError
        If the plant is not from a force to a length.
    """
    units = (request.command.unit, request.measured.unit)
    if units != ("N", "m"):
        raise UserError(
            f"impedance: from a force in N to a length in m, not from {units[0]} to {units[1]};"
            " pid, pi and adaptive are for any signals"
        )
    period = float(request.plant.dt)
    low, high = np.clip(request.limits, -_LARGEST_FORCE, _LARGEST_FORCE)
    arguments = {
        "name": "controller",
        "sample_period": period,
        "filter_time": _RATE_FILTER * period,
        "preload": request.command.value,
        "force_min": float(low),
        "force_max": float(high),
        "previous_length_start": request.measured.value,
        "unlimited_force_start": request.command.value,
    }
    signals = {"length": request.measured.name}
    return DesignedController(
        f"{_HERE}:impedance",
        arguments,
        signals,
        "rest_length",
        "force_reference",
        ("force_min", "force_max"),
    )
