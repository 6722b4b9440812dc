"""A controller run from sample to sample, as it is in an FMU."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.kit import Component
from fmus.kit.integrate import Integrator


def outputs(model: Component) -> dict[str, float]:
    """Outputs by name."""
    names = (output.name for output in model.layout.outputs)
    shown = (state.name for state in model.layout.discretes if state.output)
    values = dict(zip(names, map(float, model.outputs()), strict=True))
    return values | {name: float(getattr(model, name)) for name in shown}


def run(model: Component, inputs: Mapping[str, Any], count: int) -> dict[str, np.ndarray]:
    """Outputs just after each of a number of samples, with inputs that are held in between.

    Inputs are arrays, or single values.
    """
    period: Any = getattr(model, "sample_period")  # noqa: B009
    integrator = Integrator(model)
    rows = []
    for k in range(count):
        for name, values in inputs.items():
            value = values if np.ndim(values) == 0 else values[k]
            setattr(model, name, value)
        integrator.advance(k * period, period)
        rows.append(outputs(model))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
