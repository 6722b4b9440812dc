"""Comparison of the DC motor of eq. 5.1 with the actuator under a lasting load.

The thesis reads the free integrator of eq. 5.1 as a lack of stiffness. Its actuator has a free
integrator, too (eqs. 3.7 and 5.17): both yield under a lasting load, with different time constants.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit.arrays import Array
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class DcMotor:
    """DC motor with a spool, whose armature is shorted unless a voltage is applied.

    The thesis gives no parameters; the defaults are those of a small brushed motor.

    Attributes
    ----------
    resistance : float
        Resistance of the armature, ohm.
    constant : float
        Torque per current and back-EMF per speed, N m/A.
    inertia : float
        Inertia of the rotor, kg m^2.
    spool : float
        Radius of the spool, m.
    """

    resistance: float = 2.0
    constant: float = 0.02
    inertia: float = 1e-6
    spool: float = 5e-3

    @property
    def time_constant(self) -> float:
        """Mechanical time constant R J / K^2 of eq. 5.1, in s."""
        return self.resistance * self.inertia / self.constant**2

    @property
    def damping(self) -> float:
        """Force per speed of the load with the armature shorted, in N s/m."""
        return self.constant**2 / self.resistance / self.spool**2

    def transfer_function(self) -> Any:
        """Return angle over voltage, eq. 5.1, in rad/V.

        Returns
        -------
        control.TransferFunction
        """
        import control

        return control.tf([1.0 / self.constant], [self.time_constant, 1.0, 0.0])

    def displacement(self, force: float, time: ArrayLike) -> Array:
        """Return the displacement in m at times in s after a step of force in N."""
        t = np.asarray(time, dtype=float)
        tau = self.time_constant
        return np.asarray(force / self.damping * (t - tau * (1.0 - np.exp(-t / tau))))

    def holding(self, force: float) -> tuple[float, float]:
        """Return voltage in V and power in W at standstill under a force in N."""
        current = force * self.spool / self.constant
        return self.resistance * current, self.resistance * current**2


@dataclass(frozen=True)
class Maxwell:
    """Simplified actuator of chapter 5, fig. 5-6: a spring in series with a dashpot.

    Attributes
    ----------
    instantaneous_stiffness : float
        k in N/m, of fig. 5-7.
    damping : float
        b in N s/m.
    """

    instantaneous_stiffness: float = 9100.0
    damping: float = 1.7e6

    @property
    def time_constant(self) -> float:
        """Time constant b/k in s, after which the dashpot yields more than the spring."""
        return self.damping / self.instantaneous_stiffness

    def stiffness(self, frequency: ArrayLike) -> Complex:
        """Return force per displacement in N/m at frequencies in Hz: s k b/(b s + k) of eq. 5.17.

        The charge is zero.
        """
        s = 2j * np.pi * np.asarray(frequency, dtype=float)
        return np.asarray(
            s
            * self.instantaneous_stiffness
            * self.damping
            / (self.damping * s + self.instantaneous_stiffness)
        )

    def displacement(self, force: float, time: ArrayLike) -> Array:
        """Return the displacement in m at times in s after a step of force in N."""
        return np.asarray(
            force / self.instantaneous_stiffness
            + force / self.damping * np.asarray(time, dtype=float)
        )


def figure() -> Figure:
    """Draw stiffness and displacement of motor and actuator under a lasting load."""
    load = 2.75
    time = np.logspace(-3, 3, 400)
    drawn, (upper, lower) = pictures.panels(2, f"{load:g} N on a DC motor and on an actuator")
    for name, body, color in (
        ("DC motor, shorted", DcMotor(), pictures.FITTED),
        ("PPy actuator", Maxwell(), pictures.MODEL),
    ):
        moved = body.displacement(load, time)
        upper.loglog(time, load / moved, color=color, label=name)
        lower.loglog(time, 1e3 * moved, color=color)
    upper.legend(fontsize=8)
    pictures.label(upper, "force over displacement", "N/m")
    pictures.label(lower, "displacement", "mm")
    lower.set_xlabel("time under the load [s]")
    return drawn
