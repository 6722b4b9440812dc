"""Burgers parameters read off the creep after a step load, eqs. 3.1 to 3.3: where a fit can start.

The three equations leave one parameter of four open: they give k1, b1 and the ratio b2/k2. What closes them is the
elongation that the Kelvin element has in the end, F0/k2: the line of the steady creep, drawn back to the step, passes
there above the elongation at once (Findley, Lai, Onaran: Creep and Relaxation of Nonlinear Viscoelastic Materials,
1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit.errors import UserError
from orchestration.identify.graphical.signals import over_time

Array = NDArray[np.float64]
_TAIL = 1.0 / 3.0  # of the record under load, from which the steady creep is read
_ONCE = 0.01  # of it, from which the elongation at once is read
_FEWEST = 3  # samples that a line is drawn through
_STEADY = 0.05  # of the step, which a load may vary by before and after it
_ROUNDING = 1e-9  # of the largest elongation: what is below is zero but for rounding
_SETTLED = (
    4.0  # time constants that have to pass before a creep is steady: 2 % of the transient are left
)


@dataclass(frozen=True)
class CreepReading:
    """Burgers parameters as they are read off a step load.

    Attributes
    ----------
    k1, k2 : float
        Stiffness of the Maxwell spring and of the Kelvin spring, N/m.
    b1, b2 : float
        Damping of the Maxwell dashpot and of the Kelvin dashpot, N s/m.
    time_constant : float
        b2/k2 in seconds.
    load : float
        The step in N.
    held : float
        Seconds for which it stays.
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
        """The four parameters by name, SI, as a fit starts from them."""
        return {"k1": self.k1, "b1": self.b1, "k2": self.k2, "b2": self.b2}


def read_creep(time: ArrayLike, force: ArrayLike, displacement: ArrayLike) -> CreepReading:
    """Read Burgers parameters off a record with one step of the load (thesis, section 3.1.2).

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    force : array_like, shape (n,)
        N: one level, then another. A sample of the new level is the first under load.
    displacement : array_like, shape (n,)
        m, at rest before the step.

    Returns
    -------
    CreepReading
        With a warning if the load was not held for long enough, so that eq. 3.3 takes creep that ends for flow.

    Raises
    ------
    UserError
        If the signals do not fit together or are not finite, the force is not one step, or what follows it is not the
        creep of a Burgers body: at once, then ever slower, and flowing in the end.
    """
    t, f, x = over_time(time, force=force, displacement=displacement)
    step, load = _step(f)
    since = t[step:] - t[step]
    rise = np.sign(load) * (x[step:] - x[:step].mean())
    load = abs(load)
    held = float(since[-1])
    first, tail = since <= _ONCE * held, since >= (1.0 - _TAIL) * held
    first[:_FEWEST] = True
    if first.sum() + tail.sum() > since.size:
        raise UserError(
            f"record of {since.size} samples under load: too few to tell creep from what is at once"
        )
    at_once = float(np.polyfit(since[first], rise[first], 1)[1])  # eq. 3.2
    flow, drawn_back = (float(c) for c in np.polyfit(since[tail], rise[tail], 1))  # eq. 3.3
    delayed = drawn_back - at_once
    least = _ROUNDING * float(np.abs(rise).max())
    for name, length in (
        ("does not elongate at once", at_once),
        ("does not flow in the end", flow * held),
        ("does not creep towards its flow", delayed),
    ):
        if not length > least:
            raise UserError(
                f"displacement: {name} under the step of {load:g} N at {t[step]:g} s; a Burgers body would"
            )
    missing = (
        drawn_back + flow * since - rise
    )  # F0/k2 exp(-t/tau): its integral is F0/k2 tau, whatever the noise
    time_constant = float(np.trapezoid(missing, since)) / delayed
    if not time_constant > 0.0:
        raise UserError(
            f"displacement: does not creep ever slower after the step of {load:g} N at {t[step]:g} s"
        )
    k2 = load / delayed
    settled = (1.0 - _TAIL) * held / time_constant
    unsettled = (
        f"the line of eq. 3.3 begins {settled:.1f} time constants of {time_constant:.3g} s after the step, and should "
        f"after {_SETTLED:g}: creep that would end counts as flow, and b1 is too small"
    )
    return CreepReading(
        load / at_once,
        load / flow,
        k2,
        time_constant * k2,
        time_constant,
        load,
        held,
        (unsettled,) if settled < _SETTLED else (),
    )


def _step(force: Array) -> tuple[int, float]:
    """First sample of the new level, and the step."""
    at = int(np.argmax(np.abs(np.diff(force)))) + 1
    before, after = force[:at], force[at:]
    load = float(after.mean() - before.mean())
    varies = max(np.ptp(before), np.ptp(after))
    if load == 0.0 or varies > _STEADY * abs(load):
        raise UserError(
            f"force: a level before and another after one step are needed; about sample {at} it changes by "
            f"{load:.3g} N, and elsewhere by up to {varies:.3g} N"
        )
    return at, load
