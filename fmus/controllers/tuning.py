"""Tuning of a PID controller of any signals by the phase margin of its sampled loop.

Not part of the FMU; the libraries that it needs are imported where they are used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit.effects import stack
from fmus.kit.registry import DesignedController, DesignRequest
from fmus.kit.units import quotient

from .pid import Pid

if TYPE_CHECKING:
    from fmus.kit.arrays import Array

_DERIVATIVE_SHARE = 0.25  # T_d / T_i, the largest for which the zeros of the controller are real
_FILTER_RATIO = 10.0  # T_d / T_f; Astrom, Hagglund: Advanced PID Control, section 3.3, have 2 to 20
_LARGEST_PEAK = 2.0  # of the sensitivity; same, section 4.6, with 1.2 to 2
_PEAK_RATIO = 1.25  # of the largest sensitivity to the least one that a phase margin allows
_MARGINS = (60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0)  # degrees, tried where none is asked for
_FASTEST = 0.1  # crossover over sampling rate; Astrom, Wittenmark: Computer-Controlled Systems, 5.5
_SLOWEST = 1e-6  # the same
_CANDIDATES = 150  # crossovers that are tried where none is asked for
_POINTS = 6000  # of a frequency response, between which its phase hardly changes
_LAGS = np.geomspace(1e-3, 1e4, 600)  # omega T_i, for the phases that a controller can have
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
    units = {"N": measured, "V": command, "V/N": quotient(command, measured)}
    return in_units(Pid, units, name, values)


def in_units(
    controller: type[Component], units: Mapping[str, str], name: str, values: Mapping[str, float]
) -> type[Component]:
    """Make a controller of other signals.

    Parameters
    ----------
    controller : type[Component]
    units : Mapping of str to str
        SI units in place of those of its variables.
    name : str
        Name of the FMU.
    values : Mapping of str to float
        Values of parameters and start values, SI.
    """
    redeclared = {
        variable.name: replace(variable, unit=units.get(variable.unit, variable.unit), display="")
        for variable in controller.layout.variables
        if variable.name not in controller.layout.start_parameters
    }
    title = (controller.__doc__ or "").partition(" of ")[0]
    about = {
        "name": name,
        "__doc__": f"{title} of signals in {', '.join(units.values())}.",
        "__module__": controller.__module__,
        "presets": {},
    }
    made: type[Component] = type("Controller", (controller,), about | redeclared)
    return stack(made, name=name, defaults=values)


def _law(integral_time: Any, share: float, s: Any) -> Any:
    """Return the transfer function of a PID controller of gain one.

    Parameters
    ----------
    integral_time : float or ndarray
        T_i.
    share : float
        T_d / T_i; 0 without derivative.
    s : complex, ndarray or control.TransferFunction
        Backward difference ``(1 - 1/z) / h``, or the variable s, with the time unit of T_i.
    """
    derivative = share * integral_time * s
    return 1.0 + 1.0 / (integral_time * s) + derivative / (derivative / _FILTER_RATIO + 1.0)


@dataclass(frozen=True)
class _Tuning:
    """Tuning of a PID controller for a plant and a phase margin.

    Attributes
    ----------
    request : DesignRequest
    share : float
        T_d / T_i; 0 without derivative.
    """

    request: DesignRequest
    share: float

    @property
    def margin(self) -> float:
        """Phase margin that is asked for, degrees."""
        assert self.request.phase_margin is not None
        return self.request.phase_margin

    @property
    def period(self) -> float:
        """Sample period, s."""
        return float(self.request.plant.dt)

    def difference(self, z: Any) -> Any:
        """Return the backward difference at points of the z-plane, 1/s."""
        return (1.0 - 1.0 / z) / self.period

    def needed(self, crossover: float) -> tuple[float, complex, complex]:
        """Return omega, s / omega, and the response that the controller needs at a crossover."""
        omega = 2.0 * np.pi * crossover
        z = np.exp(1j * omega * self.period)
        margin = np.exp(1j * np.radians(self.margin - 180.0))
        return omega, self.difference(z) / omega, complex(margin / self.request.plant(z))

    def at(self, crossover: float) -> tuple[float, float] | None:
        """Return the gain and the integral time, s, that make a crossover, Hz, with the margin.

        The gain is real where the product of the law and its needed value's conjugate is: this is
        a polynomial in ``omega T_i``. Of several times the shortest is taken, which acts against
        loads soonest. None if the phase that is needed is beyond the controller.
        """
        omega, s, needed = self.needed(crossover)
        lagging = np.poly1d([self.share / _FILTER_RATIO * s, 1.0])
        law = np.poly1d([1.0, 1.0 / s]) * lagging + np.poly1d([self.share * s, 0.0, 0.0])
        turned = law * np.poly1d(np.conj(needed * lagging.coeffs))
        roots = np.roots(np.imag(turned.coeffs))
        times = roots[np.isreal(roots) & (np.real(roots) > 0.0)].real
        if not times.size:
            return None
        shortest = float(times.min())
        return float(np.real(needed / _law(shortest, self.share, s))), shortest / omega

    @cached_property
    def _grid(self) -> tuple[Array, Array]:
        """Backward difference and response of the plant up to half the sampling rate."""
        z = np.exp(1j * np.pi * np.geomspace(_SLOWEST, 1.0, _POINTS))
        return self.difference(z), np.asarray(self.request.plant(z))

    @property
    def _sign(self) -> float:
        """Sign of the gain of the plant, behind its integrators."""
        s, plant = (one[:2] for one in self._grid)
        integrators = np.rint(np.log(np.abs(plant[0] / plant[1])) / np.log(np.abs(s[1] / s[0])))
        return float(np.sign(np.real(plant[0] * 1j**integrators)))

    def _loop(self, gain: float, integral_time: float) -> Array:
        s, plant = self._grid
        return np.asarray(gain * _law(integral_time, self.share, s) * plant)

    def peak(self, gain: float, integral_time: float) -> float:
        """Return the largest sensitivity, |1 / (1 + L)|."""
        return float(1.0 / np.abs(1.0 + self._loop(gain, integral_time)).min())

    def is_sound(self, gain: float, integral_time: float) -> bool:
        """Return whether a loop is stable and has the phase margin at all crossovers."""
        import control

        loop = self._loop(gain, integral_time)
        crossings = np.flatnonzero(np.diff(np.abs(loop) > 1.0))
        margins = np.abs(np.degrees(np.angle(-loop[crossings])))
        if np.any(margins < self.margin - _TOLERANCE):
            return False
        s = self.difference(control.tf([1.0, 0.0], [1.0], self.period))
        controller = control.ss(gain * _law(integral_time, self.share, s))
        closed = control.feedback(self.request.plant * controller, 1)
        return bool(np.abs(closed.poles()).max() < _MARGINAL)

    def best(self) -> tuple[float, float]:
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
        least = 0.5 / np.sin(np.radians(0.5 * self.margin))
        largest = max(_LARGEST_PEAK, _PEAK_RATIO * least)
        for one in sorted(tuned, key=lambda one: one[1] / abs(one[0])):
            if self.peak(*one) <= largest and self.is_sound(*one):
                return one
        raise UserError(
            f"no crossover up to {_FASTEST * rate:.4g} Hz gives a stable loop with a phase margin"
            f" of {self.margin:g} degrees and a sensitivity of at most {largest:.3g}:"
            " ask for another phase margin, or for a shorter sample period"
        )

    def asked(self, crossover: float) -> tuple[float, float]:
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
        tuned = self.at(crossover)
        if tuned is not None and self.is_sound(*tuned):
            return tuned
        _, s, needed = self.needed(crossover)
        turns = np.degrees(np.angle(_law(_LAGS, self.share, s)))
        turn = np.degrees(np.angle(self._sign * needed))
        raise UserError(
            f"no stable loop has a phase margin of {self.margin:g} degrees at"
            f" {crossover:g} Hz and at its other crossovers: the controller would have to turn the"
            f" phase by {turn:.3g} degrees, and can by {turns.min():.3g} to {turns.max():.3g}; ask"
            " for another margin or crossover"
        )


def _strongest(request: DesignRequest, share: float) -> tuple[float, float]:
    """Return the best tuning of all margins that are tried where none is asked for.

    Raises
    ------
    UserError
        If there is none.
    """
    found = []
    refusals = []
    for margin in _MARGINS:
        try:
            found.append(_Tuning(replace(request, phase_margin=margin), share).best())
        except UserError as error:
            refusals.append(error)
    if not found:
        raise refusals[0]
    return max(found, key=lambda one: abs(one[0]) / one[1])


def _tune(request: DesignRequest, share: float) -> DesignedController:
    """Return a PID controller with the phase margin that is asked for.

    Without one it is that of the largest integral gain, or with a crossover the smallest.

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
    crossover = request.crossover
    if request.phase_margin is None and crossover is None:
        gain, integral_time = _strongest(request, share)
    else:
        margin = request.phase_margin or _MARGINS[0]
        tuning = _Tuning(replace(request, phase_margin=margin), share)
        gain, integral_time = tuning.best() if crossover is None else tuning.asked(crossover)
    low, high = np.clip(request.limits, -_UNLIMITED, _UNLIMITED)
    arguments = {
        "name": "controller",
        "measured": request.measured.unit,
        "command": request.command.unit,
        "sample_period": float(request.plant.dt),
        "proportional_gain": gain,
        "integral_time": integral_time,
        "derivative_time": share * integral_time,
        "filter_time": share * integral_time / _FILTER_RATIO,
        "tracking_time": integral_time,
        "command_min": float(low),
        "command_max": float(high),
        "unlimited_command_start": request.command.value,
        "previous_measured_start": request.measured.value,
    }
    signals = {"measured": request.measured.name}
    limits = ("command_min", "command_max")
    return DesignedController("fmus.controllers.tuning:pid", arguments, signals, limits=limits)


tuned_pid = partial(_tune, share=_DERIVATIVE_SHARE)
tuned_pi = partial(_tune, share=0.0)
