"""Record of a rig as a dataset: signals with units, names and the conditions of measurement."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array
from orchestration.experiment import results
from orchestration.experiment.results import about_experiment, about_pace
from orchestration.fmu import Signal
from orchestration.rig.record.driving import RecordedRun
from orchestration.rig.record.listening import LONGEST_SILENCE
from orchestration.rig.record.planning import RecordingPlan

if TYPE_CHECKING:
    import xarray

    from orchestration.rig.archive import Archive


def units(inputs: Mapping[str, str], outputs: Mapping[str, str]) -> dict[str, str]:
    """Return the units of a record's signals in their order: inputs, outputs, ages of outputs."""
    return {**inputs, **outputs, **{f"{name}_age": "s" for name in outputs}}


def empty_dataset(planned: RecordingPlan) -> xarray.Dataset:
    """Return a dataset of one point of zeros, to check that a file's format can hold the record."""
    zeros = {name: np.zeros(1) for name in units(planned.inputs, planned.outputs)}
    signals = _signals(planned.inputs, planned.outputs)
    return _described(results.dataset(planned.time[:1], zeros, signals, (), {}), planned)


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
        "over": about["over"]
        if about["over"] in units(planned.inputs, planned.outputs)
        else "time",
        "wall_time": float(planned.time[count - 1]),
    }
    if recorded.failure:
        about["failure"] = recorded.failure
    values = dict(zip(units(planned.inputs, planned.outputs), rows.T, strict=True))
    data = results.dataset(
        planned.time[:count],
        values,
        _signals(planned.inputs, planned.outputs),
        set(planned.inputs),
        about,
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


def heard_dataset(
    status: Mapping[str, Any], rows: Array, failure: str, endpoint: str
) -> xarray.Dataset:
    """Return what was heard of a rig, which others may have commanded, as a dataset.

    Parameters
    ----------
    status : Mapping
        The message ``status`` of its server.
    rows : ndarray, shape (n, 1 + number of signals)
        Clock in s, inputs, outputs and ages of these, as `listen` returns them.
    failure : str
        Reason for an early end; empty without one.
    endpoint : str
        Address of the rig's server.

    Returns
    -------
    xarray.Dataset
        As `archived_dataset`; incomplete with a failure, or a gap in which nothing was heard.
    """
    gaps = int(np.sum(np.diff(rows[:, 0]) > LONGEST_SILENCE))
    about = {"subject": f"the rig at {endpoint}, heard", "gaps": gaps, "failure": failure}
    return _observed(status, status["period"], rows, about)


def archived_dataset(archive: Archive, begin: float, end: float) -> xarray.Dataset:
    """Return a part of an archive as a dataset.

    Parameters
    ----------
    archive : Archive
    begin, end : float
        Wall times in s since 1970.

    Returns
    -------
    xarray.Dataset
        Inputs as applied, outputs and ages of these from time 0 on. The attribute ``rate`` is the
        usual number of rows in a second, ``start`` the time of the first on the rig's clock in s,
        ``began`` that in UTC, ``gaps`` how many there are.

    Raises
    ------
    UserError
        If there is nothing in this span, or several runs of a server.
    """
    table = archive.rows("samples", begin, end)
    rig = archive.rig(begin, end)
    names = ["time", *units(rig["inputs"], rig["outputs"])]
    rows = np.array([table[name].to_numpy() for name in names]).T
    first, last = (table["wall"][k].as_py() for k in (0, -1))
    gaps = len(archive.gaps(first.timestamp(), last.timestamp()))
    subject = f"the rig of {rig['host']}, archived"
    about = {"subject": subject, "began": first.isoformat(), "gaps": gaps, "failure": ""}
    return _observed(rig, 1.0 / rig["rate"], rows, about)


def _observed(
    rig: Mapping[str, Any], period: float, rows: Array, about: Mapping[str, Any]
) -> xarray.Dataset:
    """Return rows of a rig that was not driven as a dataset that begins at time 0."""
    clock, *values = rows.T
    named = dict(zip(units(rig["inputs"], rig["outputs"]), values, strict=True))
    steps = np.diff(clock)
    more = {
        **about,
        "title": about["subject"],
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "period": period,
        "watchdog": rig["watchdog"],
        "limits": json.dumps(rig["limits"]),
        "complete": int(not about["gaps"] and not about["failure"]),
        "start": float(clock[0]),
        "rate": float(1.0 / np.median(steps)) if steps.size else 0.0,
    }
    signals = _signals(rig["inputs"], rig["outputs"])
    return results.dataset(clock - clock[0], named, signals, set(rig["inputs"]), more)


def _signals(inputs: Mapping[str, str], outputs: Mapping[str, str]) -> dict[str, Signal]:
    """Return the descriptions of a record's signals by name."""
    described = dict.fromkeys(inputs, "As applied to the rig")
    described |= dict.fromkeys(outputs, "As measured at the rig")
    described |= {f"{name}_age": f"Age of {name} when the rig sent it" for name in outputs}
    return {
        n: Signal(n, "real", unit, unit, 0.0, -inf, inf, described[n])
        for n, unit in units(inputs, outputs).items()
    }
