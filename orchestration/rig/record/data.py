"""A record of a rig as the results of an experiment are: signals with units and names, and how it came about."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from orchestration.experiment import results
from orchestration.experiment.about import about_experiment, about_pace
from orchestration.fmu.signal import Signal
from orchestration.rig.record.drive import Recorded
from orchestration.rig.record.plan import Plan

if TYPE_CHECKING:
    import xarray


def units(planned: Plan) -> dict[str, str]:
    """Signals of a record in their order, and their units: inputs, outputs, and the age of each output."""
    return {**planned.inputs, **planned.outputs, **{f"{name}_age": "s" for name in planned.outputs}}


def sketch(planned: Plan) -> xarray.Dataset:
    """Return a first point without values, to see whether a file's format can hold such a record."""
    return results.dataset(
        planned.time[:1], {n: np.zeros(1) for n in units(planned)}, _signals(planned), (), {}
    )


def dataset(planned: Plan, recorded: Recorded, where: str, endpoint: str) -> xarray.Dataset:
    """Gather a record.

    Parameters
    ----------
    planned : Plan
    recorded : Recorded
    where : str
        File or name of the experiment.
    endpoint : str
        Of the rig's server.

    Returns
    -------
    xarray.Dataset
        Inputs, outputs and the ages of outputs over time, with the attributes of results of ``ppy run``, as far as
        there are any without a model.
    """
    count = len(recorded.inputs)
    columns = np.hstack([recorded.inputs, recorded.outputs, recorded.ages]).T
    about = (
        about_experiment(planned.experiment, where)
        | about_pace(recorded.pacing)
        | _about_rig(planned, endpoint)
    )
    about |= {
        "complete": int(count == planned.time.size and not recorded.failure),
        "over": about["over"] if about["over"] in units(planned) else "time",
        "wall_time": float(planned.time[count - 1]),
    }
    if recorded.failure:
        about["failure"] = recorded.failure
    values = dict(zip(units(planned), columns, strict=True))
    return results.dataset(
        planned.time[:count], values, _signals(planned), set(planned.inputs), about
    )


def _about_rig(planned: Plan, endpoint: str) -> dict[str, Any]:
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


def _signals(planned: Plan) -> dict[str, Signal]:
    described = dict.fromkeys(planned.inputs, "As applied to the rig")
    described |= dict.fromkeys(planned.outputs, "As measured at the rig")
    described |= {f"{name}_age": f"Age of {name} when the rig sent it" for name in planned.outputs}
    return {
        n: Signal(n, "real", unit, unit, 0.0, -inf, inf, described[n])
        for n, unit in units(planned).items()
    }
