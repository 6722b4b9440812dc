"""Record of a rig as a dataset: signals with units, names and the conditions of measurement."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestration.experiment import results
from orchestration.experiment.results import about_experiment, about_pace
from orchestration.fmu import Signal
from orchestration.rig.record.driving import RecordedRun
from orchestration.rig.record.planning import RecordingPlan

if TYPE_CHECKING:
    import xarray


def units(planned: RecordingPlan) -> dict[str, str]:
    """Return the units of a record's signals in their order: inputs, outputs, ages of outputs."""
    return {**planned.inputs, **planned.outputs, **{f"{name}_age": "s" for name in planned.outputs}}


def empty_dataset(planned: RecordingPlan) -> xarray.Dataset:
    """Return a dataset of one point of zeros, to check that a file's format can hold the record."""
    zeros = {name: np.zeros(1) for name in units(planned)}
    sketch = results.dataset(planned.time[:1], zeros, _signals(planned), (), {})
    return _described(sketch, planned)


def dataset(
    planned: RecordingPlan, recorded: RecordedRun, where: str, endpoint: str
) -> xarray.Dataset:
    """Return a record as a dataset.

    Parameters
    ----------
    planned : RecordingPlan
    recorded : RecordedRun
    where : str
        File or name of the experiment.
    endpoint : str
        Address of the rig's server.

    Returns
    -------
    xarray.Dataset
        Inputs, outputs and the ages of outputs over time, with the attributes of results of ``ppy
        run``, as far as there are any without a model. A record is complete if no row lacks a
        value; ``gaps`` is the number of rows that do. A variable has the attributes that the rig
        states about its signal, such as ``standard_uncertainty``.
    """
    count = len(recorded.inputs)
    rows = np.hstack([recorded.inputs, recorded.outputs, recorded.ages])
    gaps = int(np.isnan(rows).any(axis=1).sum())
    about = (
        about_experiment(planned.experiment, where)
        | about_pace(recorded.pacing)
        | _about_rig(planned, endpoint)
    )
    about |= {
        "complete": int(count == planned.time.size and not recorded.failure and not gaps),
        "gaps": gaps,
        "over": about["over"] if about["over"] in units(planned) else "time",
        "wall_time": float(planned.time[count - 1]),
    }
    if recorded.failure:
        about["failure"] = recorded.failure
    values = dict(zip(units(planned), rows.T, strict=True))
    data = results.dataset(
        planned.time[:count], values, _signals(planned), set(planned.inputs), about
    )
    return _described(data, planned)


def _described(data: xarray.Dataset, planned: RecordingPlan) -> xarray.Dataset:
    """Return a dataset whose variables have what the rig states about them, too."""
    for name, stated in planned.attributes.items():
        if name in data:
            data[name].attrs = {**stated, **data[name].attrs}
    return data


def _about_rig(planned: RecordingPlan, endpoint: str) -> dict[str, Any]:
    """Return the attributes of a record that describe the rig."""
    limits: Mapping[str, Any] = planned.limits
    return {
        "subject": f"the rig at {endpoint}",
        "period": planned.period,
        "watchdog": planned.watchdog,
        "max_age": planned.max_age,
        "limits": json.dumps(limits),
        "guids": "{}",
        "parameters": "{}",
    }


def _signals(planned: RecordingPlan) -> dict[str, Signal]:
    """Return the descriptions of a record's signals by name."""
    described = dict.fromkeys(planned.inputs, "As applied to the rig")
    described |= dict.fromkeys(planned.outputs, "As measured at the rig")
    described |= {f"{name}_age": f"Age of {name} when the rig sent it" for name in planned.outputs}
    return {
        n: Signal(n, "real", unit, unit, 0.0, -inf, inf, described[n])
        for n, unit in units(planned).items()
    }
