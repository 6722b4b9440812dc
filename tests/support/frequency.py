"""Records of linear systems by SciPy, and their frequency responses in closed form.

Inputs are held between samples. Nothing here is of the code that is tested.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import signal

from orchestration.records import Record

STEP = 0.1
R1, R2, C = 0.43, 2.35, 2.70
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6


def impedance(frequency):
    """The thesis, eq. 3.9, over frequency in Hz; ohm."""
    s = 2j * np.pi * frequency
    return (R1 * R2 * C * s + R2) / ((R1 + R2) * C * s + 1.0)


def held_impedance(frequency):
    """The same for a current that is held: the capacitor goes to its end by an exponential."""
    z = np.exp(2j * np.pi * frequency * STEP)
    pole = np.exp(-STEP / ((R1 + R2) * C))
    direct = R1 * R2 / (R1 + R2)
    return direct + (R2 - direct) * (1.0 - pole) / (z - pole)


def stiffness(frequency):
    """Storage and loss (N/m) of Burgers' model, from the compliances of Findley, Lai and Onaran."""
    w = 2.0 * np.pi * frequency
    storage = 1.0 / K1 + K2 / (K2**2 + (B2 * w) ** 2)
    loss = 1.0 / (B1 * w) + B2 * w / (K2**2 + (B2 * w) ** 2)
    whole = storage**2 + loss**2
    return storage / whole, loss / whole


def held_compliance(frequency):
    """Displacement over force (m/N) of Burgers' model for a force that is held."""
    z = np.exp(2j * np.pi * frequency * STEP)
    pole = np.exp(-STEP * K2 / B2)
    return 1.0 / K1 + STEP / B1 / (z - 1.0) + (1.0 - pole) / K2 / (z - pole)


def _followed(numerator, denominator, values):
    b, a, _ = signal.cont2discrete((numerator, denominator), STEP, "zoh")
    return signal.lfilter(b.ravel(), a, values)


def voltage(current):
    """Return the voltage (V) of the circuit, from rest."""
    return _followed([R1 * R2 * C, R2], [(R1 + R2) * C, 1.0], current)


def displacement(force):
    """Return the elongation (m) of Burgers' model, from rest."""
    dashpots = np.polymul([B1, 0.0], [B2, K2])
    elongations = np.polyadd(dashpots / K1, np.polyadd([B2, K2], [B1, 0.0]))
    return _followed(elongations, dashpots, force)


def square(size, period=10.0, amplitude=0.9):
    """Return a square wave of so many samples."""
    time = STEP * np.arange(size)
    return np.where((time + 1e-9) % period < 0.5 * period - 1e-9, amplitude, -amplitude)


def prbs(random, order=6, clock=2, count=8):
    """Return a maximum length sequence, held for some samples, so many times."""
    state = random.integers(0, 2, order)
    state[0] = 1
    bits = 2.0 * signal.max_len_seq(order, state=state)[0] - 1.0
    return np.tile(np.repeat(bits, clock), count)


def multisine(random, size, count=1, first=1, by=1):
    """Return sines of random phases at some lines up to a quarter of the rate, so many times."""
    lines = np.arange(first, size // 4, by)
    spectrum = np.zeros(size // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * random.random(lines.size))
    wave = np.fft.irfft(spectrum, size)
    return np.tile(wave / wave.std(), count)


def noisy(random, values, share):
    """Return values with white noise of a share of their standard deviation."""
    return values + share * values.std() * random.normal(size=values.size)


def recorded(units, name="made.csv", **signals):
    """Return a record of signals over equal steps."""
    size = len(next(iter(signals.values())))
    return Record(STEP * np.arange(size), signals, units, Path(name))
