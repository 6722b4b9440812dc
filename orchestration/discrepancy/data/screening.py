"""Which data a diagnosis may rest on, decided before any model is blamed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fmus.kit import Component
from fmus.kit.errors import UserError
from fmus.kit.record.compiled import CompiledModel
from orchestration.discrepancy.data.quality import judge
from orchestration.discrepancy.selection.search import Data
from orchestration.identify.noise import ORDER, segments
from orchestration.records.clock import evenly_sampled

_LASTING = 0.5  # of the record, before which an output ends too early
_FEWEST = 20  # samples without which an output tells nothing
_THIRD = 0.6745 * np.sqrt(20.0)  # median size of the third differences of white noise, over its deviation
_LOST = 0.05  # of the noise, below which thousands of samples tell nothing of a response
_HUGE = 1e30  # no measurement is that large, and its square is still a number


def trusted(cls: type[Component], data: Data, fixed: Mapping[str, float]) -> tuple[Data, list[str]]:
    """Leave out what cannot be trusted before a model is blamed; what the model shows too is no fault of the data."""
    for name, values in (*data.inputs.items(), *data.measured.items()):
        if np.abs(values[np.isfinite(values)]).max(initial=0.0) > _HUGE:
            raise UserError(f"{name}: values beyond {_HUGE:g} are no measurement")
    try:
        simulated = CompiledModel(cls).run(data.time, data.inputs, fixed, data.linear).signals
    except UserError:
        simulated = {}
    kept, findings = judge(data, {o: simulated[o] for o in data.measured if o in simulated})
    told = [finding.message for finding in sorted(findings, key=lambda f: bool(f.channel))]
    enough = {o: y for o, y in kept.measured.items() if np.isfinite(y).sum() >= _FEWEST}
    told += [f"{o}: too few samples to say anything" for o in kept.measured if o not in enough]
    if not enough:
        raise UserError("; ".join(told))
    return replace(kept, measured=enough), told


def lasting(data: Data) -> tuple[Data, list[str]]:
    """Leave out outputs that end long before the others: the part held out is the end of what all of them have."""
    ends = {o: int(np.flatnonzero(np.isfinite(y))[-1]) for o, y in data.measured.items()}
    short = [o for o, end in ends.items() if end < _LASTING * max(ends.values())]
    told = [f"{o}: ends at {data.time[ends[o]]:.6g} s, long before the others, and is not used" for o in short]
    return data.only([o for o in ends if o not in short]), told


def usable(data: Data) -> list[str]:
    """Outputs with enough samples behind each other to know their noise."""
    memory = ORDER if evenly_sampled(data.time) else 0
    lengths = {o: [b - a - memory for a, b in segments(np.isfinite(y), memory)] for o, y in data.measured.items()}
    return [o for o, length in lengths.items() if sum(length) >= _FEWEST]


def moves(cls: type[Component], data: Data, fixed: Mapping[str, float]) -> bool:
    """Whether the inputs move any output by more than is lost in its noise, as far as the model can tell.

    Held against each other are simulations with the inputs as they are and with their means; the noise is what third
    differences of the measurement show.
    """
    if not any(np.ptp(values) > 0.0 for values in data.inputs.values()):
        return False
    means = {name: np.full_like(values, values.mean()) for name, values in data.inputs.items()}
    try:
        model = CompiledModel(cls)
        runs = [model.run(data.time, inputs, fixed, data.linear).signals for inputs in (data.inputs, means)]
    except UserError:
        return True
    for output, y in data.measured.items():
        third = np.diff(y[np.isfinite(y)], 3)
        noise = float(np.median(np.abs(third))) / _THIRD if third.size else 0.0
        if float(np.sqrt(np.mean((runs[0][output] - runs[1][output]) ** 2))) > _LOST * noise:
            return True
    return False
