"""Hidden variations of springs and dashpots."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.special import lambertw

from demonstrations.emulator.physics import Array, Physics

_SHARPNESS = 6  # of the transition from slack to taut


@dataclass
class CreepSpectrum(Physics):
    """Additional creep with three time constants in geometric progression.

    The middle one has the compliance of both others together.
    """

    extra_states: ClassVar[int] = 3  # N, force of every spring
    spectral_compliance: float = 2e-5  # m/N, of all three
    middle_time: float = 20.0  # s
    time_ratio: float = 2.0

    def mechanical_length(self, state: Array, force: Any) -> Any:
        """Add the elongations of the three creep elements."""
        early, middle, late = self.own(CreepSpectrum, state)
        return (
            super().mechanical_length(state, force)
            + self.spectral_compliance * (early + 2 * middle + late) / 4
        )

    def rates(self, state: Array, current: Any, force: Any) -> list[Any]:
        """Append the rates of the forces of the springs."""
        times = self.middle_time * self.time_ratio ** np.array([-1, 0, 1])
        forces = zip(self.own(CreepSpectrum, state), times, strict=True)
        return [
            *super().rates(state, current, force),
            *((force - spring) / time for spring, time in forces),
        ]


@dataclass
class LoadDependentSpring(Physics):
    """An instantaneous spring whose compliance changes with load, by a rational function."""

    softening: float = 0.2  # relative rise of the compliance, under a load far above the middle
    middle_load: float = 1.0  # N

    def spring_length(self, state: Array, force: Any) -> Any:
        """Return (F + n F^2 / (S + |F|)) / k1."""
        more = self.softening * force * abs(force) / (self.middle_load + abs(force))
        return super().spring_length(state, force + more)


@dataclass
class ReluctantRecovery(Physics):
    """The creep dashpot has a higher viscosity in recovery, which rises with its force."""

    linear: ClassVar[bool] = False
    reluctance: float = 0.5  # relative rise of the viscosity, at most
    reluctance_force: float = 0.1  # N, at half of that rise

    def creep_drive(self, state: Array, force: Any) -> Any:
        """Return the force on the dashpot, reduced in recovery."""
        drive = super().creep_drive(state, force)
        back = np.maximum(-drive, 0.0)
        return drive / (1 + self.reluctance * back / (back + self.reluctance_force))


@dataclass
class YieldingFlow(Physics):
    """A viscoplastic dashpot with a yield load: Bingham's law, regularised after Papanastasiou.

    Its force is ``F = y + Fy (1 - exp(-y/f))`` with the viscous force ``y``.
    """

    linear: ClassVar[bool] = False
    yield_load: float = 0.6  # N
    rounding: float = 0.03  # N

    def flow_drive(self, force: Any) -> Any:
        """Return the viscous part of a load, by Lambert's function."""
        load = np.abs(super().flow_drive(force))
        f = self.rounding
        excess = (load - self.yield_load) / f
        viscous = f * (excess + np.real(lambertw(self.yield_load / f * np.exp(-excess))))
        return np.sign(force) * viscous


@dataclass
class SaggingFilm(Physics):
    """Additional compliance below a preload, until the film is taut."""

    sag: float = 0.5  # additional compliance without load, relative to the spring's
    taut_load: float = 0.7  # N

    def spring_length(self, state: Array, force: Any) -> Any:
        """Add the elongation by the smaller of load and preload, with a smooth transition."""
        smaller = force / (1 + abs(force / self.taut_load) ** _SHARPNESS) ** (1 / _SHARPNESS)
        return super().spring_length(state, force + self.sag * smaller)
