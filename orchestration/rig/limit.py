"""What a signal of a rig may be."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Limit:
    """Hard limits of one signal, SI.

    Attributes
    ----------
    min, max : float
        Inclusive.
    rate : float
        Largest change per second.
    """

    min: float = -inf
    max: float = inf
    rate: float = inf
