"""Tuning of a PID controller of any signals by the phase margin of its sampled loop.

Not part of the FMU; the libraries that it needs are imported where they are used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.declare import Declaration
from fmus.kit.effects import stack
from fmus.kit.registry import DesignedController, DesignRequest

from .pid import Pid

if TYPE_CHECKING:
    from fmus.kit.arrays import Array

_DERIVATIVE_SHARE = 0.25  # T_d / T_i, the largest for which the zeros of the controller are real
_FILTER_RATIO = 10.0  # T_d / T_f; Astrom, Hagglund: Advanced PID Control, section 3.3, have 2 to 20
_LARGEST_PEAK = 2.0  # of the sensitivity; same, section 4.6, with 1.2 to 2
_PEAK_RATIO = 1.25  # of the largest sensitivity to the least one that a phase margin allows
_FASTEST = 0.1  # crossover over sampling rate; Astrom, Wittenmark: Computer-Controlled Systems, 5.5
_SLOWEST = 1e-6  # the same
_CANDIDATES = 150  # crossovers that are tried where none is asked for
_POINTS = 3000  # of a frequency response
_LAGS = np.geomspace(1e-3, 1e4, 600)  # omega T_i, in which the controller's phase is solved
_EXACT = 1e-12  # of omega T_i
_UNLIMITED = 1e12  # largest limit of a command
# pole that still counts as stable: where a plant does not pass a constant on, the integral drifts
_MARGINAL = 1.0 + 1e-9
_TOLERANCE = 0.5  # degrees of the phase margin; more is a loop with another crossover


def pid(name: str, measured: str, command: str, **values: float) -> type[Component]:
    """Make a PID controller of other signals than force and voltage.

    Parameters
    ----------
    name : str
        Name of the FMU.
    measured, command : str
        SI units of the measured value and of the command.
    **values : float
        Values of parameters and start values, SI.

    Returns
    -------
    type[Component]
        :class:`.Pid` with these units and defaults.

    Raises
    ------
    UserError
        If there is no such parameter, or a value is out of range.
    """
    units = {"N": measured, "V": command, "V/N": _ratio(command, measured)}
    redeclared = {
        key: replace(variable, unit=units.get(variable.unit, variable.unit))
        for key, variable in Pid.declared.items()
        if isinstance(variable, Declaration)
    }
    about = {
        "name": name,
        "__doc__": f"PID controller of a value in {measured} by a command in {command}.",
        "__module__": Pid.__module__,
        "presets": {},
    }
    made: type[Component] = type("Controller", (Pid,), about | redeclared)
    return stack(made, name=name, defaults=values)


def _ratio(command: str, measured: str) -> str:
    """Return the unit of a command per measured value."""
    command, measured = (unit.replace("degC", "K") for unit in (command, measured))
    if measured == "1":
        return command
    if command == measured:
        return "1"
    return f"{command}/{measured}" if measured.isalpha() else f"{command}/({measured})"


@dataclass(frozen=True)
class _Form:
    """Shape of a PID controller with gain one.

    Attributes
    ----------
    integral_time : float or ndarray
        Seconds.
    share : float
        T_d / T_i; 0 without derivative.
    period : float
        Sample period, s.
    """

    integral_time: Any
    share: float
    period: float

    @property
    def derivative_time(self) -> Any:
        return self.share * self.integral_time

    @property
    def filter_time(self) -> Any:
        return self.derivative_time / _FILTER_RATIO

    def response(self, z: Any) -> Any:
        """Return the response from error to command, by the backward differences of `Pid`."""
        difference = 1.0 - 1.0 / z
        integral = self.period / (self.integral_time * difference)
        filtered = self.filter_time * difference + self.period
        return 1.0 + integral + self.derivative_time * difference / filtered

    def matrices(self) -> tuple[Array, Array, Array, float]:
        """Return A, B, C and D of the controller: an integral, and the filter of the derivative."""
        decay = self.filter_time / (self.filter_time + self.period)
        rate = self.derivative_time / (self.filter_time + self.period)
        step = self.period / self.integral_time
        C = np.array([[step, rate * (decay - 1.0)]])
        return np.diag([1.0, decay]), np.ones((2, 1)), C, 1.0 + step + rate


@dataclass(frozen=True)
class _Tuning:
    """Tuning of a form of controller for a plant and a phase margin.

    Attributes
    ----------
    request : DesignRequest
    share : float
        T_d / T_i.
    z, plant : ndarray of complex, shape (n,)
        Points on the unit circle, and the response of the plant there.
    """

    request: DesignRequest
    share: float
    z: Array
    plant: Array

    @classmethod
    def of(cls, request: DesignRequest, share: float) -> _Tuning:
        """Return the tuning with the response of the plant up to half the sampling rate."""
        z = np.exp(1j * np.pi * np.geomspace(_SLOWEST, 1.0, _POINTS))
        return cls(request, share, z, np.asarray(request.plant(z)))

    @property
    def period(self) -> float:
        return float(self.request.plant.dt)

    def at(self, crossover: float) -> tuple[float, _Form] | None:
        """Return gain and form of gain one and the phase margin at a crossover, Hz.

        Of two integral times the shorter is taken, which acts against loads sooner. None if the
        phase that is needed is beyond the controller.
        """
        from scipy.optimize import brentq

        omega = 2.0 * np.pi * crossover
        target, wanted = self.needed(crossover)

        def excess(lag: Any) -> Any:
            return self.turn(lag / omega, crossover) - wanted

        above = np.flatnonzero(excess(_LAGS) >= 0.0)
        if not above.size or above[0] == 0:
            return None
        low, high = _LAGS[above[0] - 1 : above[0] + 1]
        lag = brentq(excess, low, high, xtol=_EXACT)
        form = _Form(lag / omega, self.share, self.period)
        return float(np.real(target / form.response(self.point(crossover)))), form

    def point(self, frequency: float) -> complex:
        """Return the point on the unit circle of a frequency, Hz."""
        return complex(np.exp(2j * np.pi * frequency * self.period))

    def needed(self, crossover: float) -> tuple[complex, float]:
        """Return the response that the controller needs at a crossover, and its phase, radians.

        The phase is from -90 to 90 degrees: a plant that answers with the other sign needs a
        negative gain.
        """
        margin = np.exp(1j * np.radians(self.request.phase_margin - 180.0))
        target = margin / self.request.plant(self.point(crossover))
        return target, float(np.angle(target if np.real(target) > 0.0 else -target))

    def turn(self, integral_time: Any, crossover: float) -> Any:
        """Return the phase of the controller of gain one for integral times, radians."""
        form = _Form(integral_time, self.share, self.period)
        return np.angle(form.response(self.point(crossover)))

    def is_sound(self, gain: float, form: _Form) -> bool:
        """Return whether a loop is stable and has the phase margin at all crossovers."""
        size, margin = self._size_and_margin(gain * form.response(self.z) * self.plant)
        crossings = np.flatnonzero(np.diff(np.sign(size)))
        share = size[crossings] / (size[crossings] - size[crossings + 1])
        there = margin[crossings] + share * (margin[crossings + 1] - margin[crossings])
        if np.any(np.abs(there) < self.request.phase_margin - _TOLERANCE):
            return False
        return bool(np.abs(self.closed_poles(gain, form)).max() < _MARGINAL)

    def closed_poles(self, gain: float, form: _Form) -> Array:
        """Return the poles of the closed loop in the z-plane, shape (n,)."""
        plant = self.request.plant
        A, B, C, D = form.matrices()
        n = plant.nstates
        joined = np.zeros((n + len(A), n + len(A)))
        joined[:n, :n] = plant.A
        joined[:n, n:] = gain * plant.B @ C
        joined[n:, n:] = A
        driven = np.vstack([gain * D * plant.B, B])
        read = np.hstack([plant.C, gain * plant.D @ C])
        through = 1.0 + gain * D * float(plant.D[0, 0])
        return np.asarray(np.linalg.eigvals(joined - driven @ read / through))

    def _size_and_margin(self, loop: Array) -> tuple[Array, Array]:
        """Return the logarithm of the gain, and the phase above -180 degrees, of a loop."""
        return np.log(np.abs(loop)), np.degrees(np.unwrap(np.angle(-loop)))

    def peak(self, gain: float, form: _Form) -> float:
        """Return the largest sensitivity, |1 / (1 + L)|."""
        loop = gain * form.response(self.z) * self.plant
        return float(np.max(1.0 / np.abs(1.0 + loop)))

    def best(self) -> tuple[float, _Form]:
        """Return the sound tuning with the largest integral gain, and a bounded sensitivity.

        The integral of the error after a step of the load is T_i / K (Astrom, Hagglund: Advanced
        PID Control, 2006, section 4.3).

        Raises
        ------
        UserError
            If there is none.
        """
        rate = 1.0 / self.period
        crossovers = np.geomspace(_SLOWEST * rate, _FASTEST * rate, _CANDIDATES)
        tuned = [found for found in map(self.at, crossovers) if found is not None]
        least = 0.5 / np.sin(np.radians(0.5 * self.request.phase_margin))
        largest = max(_LARGEST_PEAK, _PEAK_RATIO * least)
        for gain, form in sorted(tuned, key=lambda one: one[1].integral_time / abs(one[0])):
            if self.peak(gain, form) <= largest and self.is_sound(gain, form):
                return gain, form
        raise UserError(
            f"no crossover up to {_FASTEST * rate:.4g} Hz gives a stable loop with a phase margin"
            f" of {self.request.phase_margin:g} degrees and a sensitivity of at most {largest:.3g}:"
            " ask for another phase margin, or for a shorter sample period"
        )

    def asked(self, crossover: float) -> tuple[float, _Form]:
        """Return the tuning for a crossover that is asked for, Hz.

        Raises
        ------
        UserError
            If it is out of range, or no controller makes a sound loop there.
        """
        nyquist = 0.5 / self.period
        if not 0.0 < crossover < nyquist:
            raise UserError(
                f"crossover {crossover:g} Hz: above 0 and below half the sampling rate,"
                f" {nyquist:g} Hz"
            )
        wish = f"a phase margin of {self.request.phase_margin:g} degrees at {crossover:g} Hz"
        tuned = self.at(crossover)
        if tuned is None:
            turns = np.degrees(self.turn(_LAGS / (2.0 * np.pi * crossover), crossover))
            raise UserError(
                f"{wish}: the controller would have to turn the phase by"
                f" {np.degrees(self.needed(crossover)[1]):.3g} degrees, and can by"
                f" {turns.min():.3g} to {turns.max():.3g}; ask for another margin or crossover"
            )
        if not self.is_sound(*tuned):
            raise UserError(
                f"{wish} would be of a loop that is unstable or has a smaller margin at another"
                " crossover; ask for another crossover"
            )
        return tuned


def _tune(request: DesignRequest, share: float) -> DesignedController:
    """Return a PID controller with the phase margin that is asked for.

    Parameters
    ----------
    request : DesignRequest
    share : float
        T_d / T_i.

    Raises
    ------
    UserError
        If no such controller makes a stable loop with this margin.
    """
    tuning = _Tuning.of(request, share)
    crossover = request.crossover
    gain, form = tuning.best() if crossover is None else tuning.asked(crossover)
    low, high = np.clip(request.limits, -_UNLIMITED, _UNLIMITED)
    arguments = {
        "name": "controller",
        "measured": request.measured_unit,
        "command": request.command_unit,
        "sample_period": float(form.period),
        "proportional_gain": gain,
        "integral_time": float(form.integral_time),
        "derivative_time": float(form.derivative_time),
        "filter_time": float(form.filter_time),
        "tracking_time": float(form.integral_time),
        "command_min": float(low),
        "command_max": float(high),
        "unlimited_command_start": float(request.command),
        "previous_measured_start": float(request.measured),
    }
    return DesignedController("fmus.controllers.tuning:pid", arguments)


tuned_pid = partial(_tune, share=_DERIVATIVE_SHARE)
tuned_pi = partial(_tune, share=0.0)
