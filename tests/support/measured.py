"""Inputs and measured outputs of one model over time."""

from __future__ import annotations

from typing import NamedTuple

from fmus.kit.arrays import Array
from orchestration.records.quality import Channels


class Measured(NamedTuple):
    """A record, SI; NaN in an output is a gap."""

    time: Array
    inputs: dict[str, Array]
    outputs: dict[str, Array]

    @property
    def channels(self) -> Channels:
        """The channels in which faults are looked for."""
        return Channels(self.time, self.inputs, self.outputs)
