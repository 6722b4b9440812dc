"""Burgers parameters from the creep after a step load, as start values of a fit.

Eqs. 3.1 to 3.3 of the thesis give three of four parameters: k1, b1 and the ratio b2/k2. The fourth
equation is that of the final elongation of the Kelvin element, F0/k2, by which the line of the
steady creep is above the immediate elongation at the step (Findley, Lai, Onaran: Creep and
Relaxation of Nonlinear Viscoelastic Materials, 1976). F0 is the step, as the elements of k1, k2 and
b2 are at rest under the load before it; the dashpot of b1 flows under the whole load at any time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from demonstrations.graphical.signals import over_time
from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask

_TAIL = 1.0 / 3.0  # last part of the record under load, that of the steady creep
_ONCE = 0.01  # first part of that record, that of the immediate elongation
_FEWEST = 3  # samples for a line
_STEADY = 0.05  # of the step: largest variation of the load before and after it
_ROUNDING = 1e-9  # of the largest elongation, as zero
_SETTLED = 4.0  # time constants until creep is steady, with 2 % of the transient remaining


@dataclass(frozen=True)
class CreepReading:
    """Burgers parameters from the creep after a step load.

    Attributes
    ----------
    k1, k2 : float
        Stiffness of the Maxwell spring and of the Kelvin spring, N/m.
    b1, b2 : float
        Damping of the Maxwell dashpot and of the Kelvin dashpot, N s/m.
    time_constant : float
        b2/k2 in seconds.
    load : float
        Size of the step of the load in N.
    held : float
        Time under load in seconds.
    warnings : tuple of str
    """

    k1: float
    b1: float
    k2: float
    b2: float
    time_constant: float
    load: float
    held: float
    warnings: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """The four parameters by name, SI."""
        return {"k1": self.k1, "b1": self.b1, "k2": self.k2, "b2": self.b2}


def read_creep(time: ArrayLike, force: ArrayLike, displacement: ArrayLike) -> CreepReading:
    """Return Burgers parameters from a record with one step of the load (thesis, section 3.1.2).

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    force : array_like, shape (n,)
        N: one level, then another, from the first sample under load on.
    displacement : array_like, shape (n,)
        m; the creep under a load before the step has ended, so that it only flows.

    Returns
    -------
    CreepReading
        With a warning if the time under load is too short, so that eq. 3.3 takes creep for flow.

    Raises
    ------
    UserError
        If the signals do not fit together or are not finite, the force is not one step or nothing
        is held after it, or the displacement is not the creep of a Burgers body: immediate
        elongation, slower and slower creep, and flow in the end.
    """
    creep = _under_load(time, force, displacement)
    duration = float(creep.since[-1])
    immediate = _immediate_elongation(creep)
    flow, intercept = _steady_creep(creep)
    creep.check_positive(immediate, "does not elongate at once")
    creep.check_positive(np.sign(creep.held) * flow * duration, "does not flow in the end")
    b1 = creep.held / flow
    # elongation is counted from the mean before the step, after which it flowed on until the step
    flowed = (creep.held - creep.load) / b1 * creep.rested
    delayed = intercept - immediate
    immediate -= flowed
    creep.check_positive(delayed, "does not creep towards its flow")
    # F0/k2 exp(-t/tau), whose integral F0/k2 tau is robust to noise
    transient = intercept + flow * creep.since - creep.elongation
    time_constant = float(np.trapezoid(transient, creep.since)) / delayed
    if not time_constant > 0.0:
        raise UserError(f"displacement: does not creep ever slower after the step of {creep.step}")
    k2 = creep.load / delayed
    return CreepReading(
        k1=creep.load / immediate,
        b1=b1,
        k2=k2,
        b2=time_constant * k2,
        time_constant=time_constant,
        load=creep.load,
        held=duration,
        warnings=_warnings(duration, time_constant),
    )


@dataclass(frozen=True)
class _UnderLoad:
    """Part of a record after the step of the load.

    Attributes
    ----------
    since : ndarray, shape (n,)
        Seconds since the step.
    elongation : ndarray, shape (n,)
        m, in the direction of the step, from the mean before it.
    load : float
        Size of the step, N.
    held : float
        Load after the step, N in its direction.
    rested : float
        Time from the samples before the step to it, mean, s.
    step : str
        Description of the step for messages.
    """

    since: Array
    elongation: Array
    load: float
    held: float
    rested: float
    step: str

    @property
    def is_immediate(self) -> Mask:
        """True for the samples (n,) of the immediate elongation."""
        chosen = self.since <= _ONCE * float(self.since[-1])
        chosen[:_FEWEST] = True
        return chosen

    @property
    def is_steady(self) -> Mask:
        """True for the samples (n,) of the steady creep."""
        return np.asarray(self.since >= (1.0 - _TAIL) * float(self.since[-1]))

    def check_positive(self, length: float, fault: str) -> None:
        """Raise UserError if an elongation is, but for rounding, not above zero."""
        if not length > _ROUNDING * float(np.abs(self.elongation).max()):
            raise UserError(
                f"displacement: {fault} under the step of {self.step}; a Burgers body would"
            )


def _under_load(time: ArrayLike, force: ArrayLike, displacement: ArrayLike) -> _UnderLoad:
    """Return the part of a record after the step of the load; UserError if it is too short."""
    t, f, x = over_time(time, force=force, displacement=displacement)
    step, load, held = _step(f)
    creep = _UnderLoad(
        since=t[step:] - t[step],
        elongation=np.sign(load) * (x[step:] - x[:step].mean()),
        load=abs(load),
        held=np.sign(load) * held,
        rested=float(t[step] - t[:step].mean()),
        step=f"{abs(load):g} N at {t[step]:g} s",
    )
    # each sample is of one of the two parts at most
    if creep.is_immediate.sum() + creep.is_steady.sum() > creep.since.size:
        raise UserError(
            f"record of {creep.since.size} samples under load: too few to tell creep from what is"
            " at once"
        )
    return creep


def _step(force: Array) -> tuple[int, float, float]:
    """Return the first sample of the new level, the step, and the load after it in N."""
    first = int(np.argmax(np.abs(np.diff(force)))) + 1
    before = force[:first]
    after = force[first:]
    held = float(after.mean())
    load = held - float(before.mean())
    varies = max(np.ptp(before), np.ptp(after))
    if load == 0.0 or varies > _STEADY * abs(load):
        raise UserError(
            f"force: a level before and another after one step are needed; about sample {first} it"
            f" changes by {load:.3g} N, and elsewhere by up to {varies:.3g} N"
        )
    if abs(held) <= _STEADY * abs(load):
        raise UserError(
            f"force: {held:.3g} N after a step of {load:.3g} N: under no load nothing flows, so"
            " that b1 cannot be read"
        )
    return first, load, held


def _immediate_elongation(creep: _UnderLoad) -> float:
    """Return the elongation at the step (eq. 3.2), from a line through the first part."""
    chosen = creep.is_immediate
    return float(np.polyfit(creep.since[chosen], creep.elongation[chosen], 1)[1])


def _steady_creep(creep: _UnderLoad) -> tuple[float, float]:
    """Return slope and intercept of a line through the last part (eq. 3.3)."""
    chosen = creep.is_steady
    slope, intercept = np.polyfit(creep.since[chosen], creep.elongation[chosen], 1)
    return float(slope), float(intercept)


def _warnings(duration: float, time_constant: float) -> tuple[str, ...]:
    """Return a warning if the time under load, in s, was too short."""
    begin = (1.0 - _TAIL) * duration / time_constant
    if begin >= _SETTLED:
        return ()
    return (
        f"the line of eq. 3.3 begins {begin:.1f} time constants of {time_constant:.3g} s after"
        f" the step, and should after {_SETTLED:g}: creep that would end counts as flow, and b1 is"
        " too small",
    )
