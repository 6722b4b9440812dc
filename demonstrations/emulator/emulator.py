"""Emulated rig: an actuator with measurement noise and, as an option, a hidden effect.

It shares no code with the models, so that it is an independent reference: its laws and its own
integrator are in :mod:`demonstrations.emulator.physics`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from demonstrations.emulator.physics import Physics, RigParameters, propagate

__all__ = ["EmulatedRig", "Physics", "RigParameters"]

Array = NDArray[np.float64]


@dataclass
class EmulatedRig:
    """An actuator on a bench, with sensors that have noise and, as an option, quantisation.

    Every run starts from rest, with new noise. Rigs with equal arguments give the same runs.

    Parameters
    ----------
    parameters : RigParameters
    seed : int
        Seed of the noise.
    voltage_noise, displacement_noise : float
        Standard deviations (V, m).
    noise_colour : float
        Lag-one correlation of the noise, which is AR(1).
    initial_charge : float
        C.
    voltage_resolution, displacement_resolution : float
        Size of a converter count (V, m); zero means no quantisation.
    hidden : callable, optional
        Returns the physics for parameters: a subclass of `Physics`, or a `functools.partial` of
        one.

    Attributes
    ----------
    truth : dict of str to ndarray, shape (n,)
        Noise-free signals of the last run: voltage and displacement at the sensors, both
        displacements of the actuator, charge.
    """

    parameters: RigParameters = field(default_factory=RigParameters)
    seed: int = 0
    voltage_noise: float = 4e-3
    displacement_noise: float = 3e-6
    noise_colour: float = 0.0
    initial_charge: float = 0.0
    voltage_resolution: float = 0.0
    displacement_resolution: float = 0.0
    hidden: Callable[[RigParameters], Physics] | None = None

    def __post_init__(self) -> None:
        if not -1 < self.noise_colour < 1:
            raise ValueError(f"noise_colour = {self.noise_colour!r}: must lie between -1 and 1")
        for name in (
            "voltage_noise",
            "displacement_noise",
            "voltage_resolution",
            "displacement_resolution",
        ):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} = {getattr(self, name)!r}: must be finite and at least 0")
        self.physics = (self.hidden or Physics)(self.parameters)
        self.truth: dict[str, Array] = {}
        self._random = np.random.default_rng(self.seed)

    def run(self, time: ArrayLike, current: ArrayLike, force: ArrayLike) -> dict[str, Array]:
        """Return the measured outputs for inputs that are constant from sample to sample.

        Parameters
        ----------
        time : array_like, shape (n,)
            Seconds, strictly increasing.
        current, force : array_like, shape (n,) or scalar
            A and N, tension positive.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            ``voltage`` (V) and ``displacement`` (m) with noise and quantisation.

        Raises
        ------
        ValueError
            If a signal is not finite, has the wrong length, or time does not increase.
        """
        t = np.asarray(time, dtype=float)
        if t.ndim != 1 or t.size == 0 or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
            raise ValueError("time must be a finite, strictly increasing, non-empty vector (s)")
        signals = [np.asarray(signal, dtype=float) for signal in (current, force)]
        if any(
            signal.shape not in ((), t.shape) or not np.all(np.isfinite(signal))
            for signal in signals
        ):
            raise ValueError(
                "current (A) and force (N) must be finite, each a scalar or as long as time"
                f" ({t.size})"
            )
        inputs = np.array([np.broadcast_to(signal, t.shape) for signal in signals])
        start = np.zeros(self.physics.order)
        start[0] = self.initial_charge
        run = propagate(self.physics, t, inputs, start)
        strain = self.physics.electrochemical_length(self.physics.active_charge(run.state))
        self.truth = self.physics.sensed(run, t) | {
            "charge": run.state[0],
            "electrochemical_displacement": strain,
            "mechanical_displacement": self.physics.mechanical_length(run.state, inputs[1]),
        }
        return {
            "voltage": self._measure(
                self.truth["voltage"], self.voltage_noise, self.voltage_resolution
            ),
            "displacement": self._measure(
                self.truth["displacement"], self.displacement_noise, self.displacement_resolution
            ),
        }

    def _measure(self, signal: Array, deviation: float, resolution: float) -> Array:
        """Add stationary AR(1) noise, then round to whole converter counts."""
        white = self._random.standard_normal(signal.size)
        # the first draw already has the stationary variance
        white[1:] *= np.sqrt(1 - self.noise_colour**2)
        noisy = signal + deviation * self._colour(white)
        return np.round(noisy / resolution) * resolution if resolution > 0 else noisy

    def _colour(self, white: Array) -> Array:
        if not self.noise_colour:
            return white
        from scipy.signal import lfilter  # half a second to load

        return np.asarray(lfilter([1.0], [1.0, -self.noise_colour], white))
