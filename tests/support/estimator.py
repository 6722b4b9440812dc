"""Records of the emulated rig for the degradation estimator, and the impedance of its circuit."""

import numpy as np

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from orchestration.experiment.waveforms import square_wave

R1, R2, C, PERIOD = 0.43, 2.35, 2.70, 0.1  # ohm, ohm, F, s: typed in from table 3-1
OMEGA = 0.628  # rad/s
LEAST_SQUARES = {"instrumental_variable": 0.0, "maximum_trace": 1e15}


def square(duration, amplitude=0.9, frequency=0.2, period=PERIOD):
    return square_wave(period * np.arange(round(duration / period)), amplitude, frequency)


def measured(current, noise=0.0, seed=0, **options):
    time = PERIOD * np.arange(len(current))
    rig = EmulatedRig(RigParameters(), seed=seed, voltage_noise=noise, **options)
    return rig.run(time, current, np.zeros_like(time))["voltage"]


def impedance(r1, r2, c, omega=OMEGA):
    """R2 in parallel with R1 and C in series."""
    branch = r1 + 1 / (1j * omega * c)
    return np.abs(r2 * branch / (r2 + branch))
