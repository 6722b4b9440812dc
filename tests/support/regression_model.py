"""A model that is a linear regression, so that what evidence there is for an effect can be written
down beforehand.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from fmus.kit import Component, Effect, Input, Output, Parameter
from fmus.kit.arrays import Array
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset
from orchestration.discrepancy.data.dataset import Dataset

COUNT, STEP, GAIN, SPREAD = 1000, 0.1, 2.0, 0.1


class Amplifier(Component):
    """What goes in, times a gain."""

    name = "amplifier"
    gain = Parameter(GAIN, "1", min=1e-6, max=1e6, doc="gain")
    signal = Input("V", doc="what goes in")

    def amplified(self):
        """Proportional."""
        return self.gain * self.signal

    @Output("V")
    def shown(self):
        """What comes out."""
        return self.amplified()


OFFSET = force_offset(Amplifier, "amplified", unit="V")
OTHERS = [
    make(Amplifier, "amplified", "signal", unit="V")
    for make in (coulomb_friction, asymmetric_friction, cubic_stiffness)
]


ASYMMETRY = OTHERS[1]


def shaped(name: str, shape: Callable[[Any], Any]) -> type[Effect]:
    """An effect: some of a function of the signal more, in volts."""

    def amplified(self: Any) -> Any:
        return super(made, self).amplified() + getattr(self, name) * shape(self.signal)

    amplified.__doc__ = "Add it."
    declared = Parameter(0.0, "V", min=-1e3, max=1e3, nominal=0.1, doc="how much of it")
    made = type(
        name.title(),
        (Effect,),
        {
            "__doc__": "More of a shape.",
            "__module__": __name__,
            "id": name,
            "assumption": "nothing is added",
            "neutral": name,
            name: declared,
            "amplified": amplified,
        },
    )
    return made


def offset_record(ratio: float, seed: int) -> Dataset:
    """A record in which an offset is worth a given likelihood ratio, exactly.

    With noise that is orthogonal to the constant and to the input, least squares leaves a mean
    square s^2 with the offset c and s^2 + c^2 without, so that twice the logarithm of the
    likelihood ratio is n ln(1 + c^2 / s^2). The noise is otherwise as Gaussian as its quantiles, in
    an order drawn at random, and orthogonal to what any of the other effects does, too.
    """
    signal, noise = _drawn(seed)
    offset = np.sqrt(np.mean(noise**2) * np.expm1(ratio / COUNT))
    return Dataset(
        STEP * np.arange(COUNT), {"signal": signal}, {"shown": GAIN * signal + offset + noise}
    )


def divided_record(ratio: float, gap: float, seed: int) -> Dataset:
    """A record in which an offset is worth a likelihood ratio, and the asymmetry, instead of it, a
    gap less.

    What is added to the noise lies in the plane of the two; a projection p on either direction is
    worth n ln(S / (S - p^2)) of the sum of squares S.
    """
    signal, noise = _drawn(seed)
    one, other = np.ones(COUNT) / np.sqrt(COUNT), np.abs(signal) / np.linalg.norm(signal)
    across = other - (one @ other) * one
    across /= np.linalg.norm(across)

    def added(angle: float) -> Array:
        """What is worth the ratio along the first direction: p^2 (S - p^2)^-1 is given."""
        share = np.expm1(ratio / COUNT)
        along = np.sqrt(share * (noise @ noise) / (1.0 - share * np.tan(angle) ** 2))
        return np.asarray(along * (one + np.tan(angle) * across))

    def missed(angle: float) -> float:
        residual = noise + added(angle)
        total = residual @ residual
        worth = [COUNT * np.log(total / (total - (residual @ d) ** 2)) for d in (one, other)]
        return float(worth[0] - worth[1] - gap)

    angle = brentq(missed, 0.0, 0.5 * np.arccos(one @ other))
    shown = GAIN * signal + noise + added(angle)
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


def asymmetric_record(ratio: float, seed: int, varying: bool) -> Dataset:
    """A record in which the asymmetry is worth a likelihood ratio, in noise that is Gaussian as a
    whole.

    It is of one size, or of the size of the signal, so that it is largest where the asymmetry acts
    most.
    """
    signal, noise = _drawn(seed)
    if varying:
        noise = (
            SPREAD
            * np.abs(signal)
            * np.random.default_rng(seed).permutation(np.resize([-1.0, 1.0], COUNT))
        )
    known = np.column_stack([signal, np.abs(signal)])
    noise = noise - known @ np.linalg.lstsq(known, noise)[0]
    strength = np.sqrt(np.mean(noise**2) / np.mean(signal**2) * np.expm1(ratio / COUNT))
    shown = GAIN * signal + strength * np.abs(signal) + noise
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


def _drawn(seed: int) -> tuple[Array, Array]:
    """An input, and noise that is orthogonal to whatever the model or an effect makes of it."""
    rng = np.random.default_rng(seed)
    signal = rng.permutation(norm.ppf((np.arange(COUNT) + 0.5) / COUNT))
    noise = rng.permutation(SPREAD * norm.ppf((np.arange(COUNT) + 0.5) / COUNT))
    known = np.column_stack([np.ones(COUNT), signal, np.abs(signal), signal**3, np.tanh(signal)])
    return signal, noise - known @ np.linalg.lstsq(known, noise)[0]
