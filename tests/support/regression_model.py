"""A model that is a linear regression, so that what evidence there is for an effect can be written down beforehand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from fmus.kit import Component, Input, Output, Parameter
from fmus.kit.generic import asymmetric_friction, coulomb_friction, cubic_stiffness, force_offset
from orchestration.discrepancy.data.dataset import Dataset

Array = NDArray[np.float64]
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
OTHERS = [make(Amplifier, "amplified", "signal", unit="V")
          for make in (coulomb_friction, asymmetric_friction, cubic_stiffness)]  # fmt: skip


def offset_record(ratio: float, seed: int) -> Dataset:
    """A record in which an offset is worth a given likelihood ratio, exactly.

    With noise that is orthogonal to the constant and to the input, least squares leaves a mean square s^2 with the
    offset c and s^2 + c^2 without, so that twice the logarithm of the likelihood ratio is n ln(1 + c^2 / s^2). The
    noise is otherwise as Gaussian as its quantiles, in an order drawn at random, and orthogonal to what any of the
    other effects does, too.
    """
    rng = np.random.default_rng(seed)
    signal = rng.permutation(norm.ppf((np.arange(COUNT) + 0.5) / COUNT))
    noise = rng.permutation(SPREAD * norm.ppf((np.arange(COUNT) + 0.5) / COUNT))
    known = np.column_stack([np.ones(COUNT), signal, np.abs(signal), signal**3, np.tanh(signal)])
    noise -= known @ np.linalg.lstsq(known, noise)[0]
    offset = np.sqrt(np.mean(noise**2) * np.expm1(ratio / COUNT))
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": GAIN * signal + offset + noise})
