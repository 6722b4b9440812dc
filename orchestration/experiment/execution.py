"""Execution of an experiment: everything is checked against its subject, then it runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError
from orchestration.experiment import results
from orchestration.experiment.live import Follower, Live, link_outputs
from orchestration.experiment.model import Experiment
from orchestration.experiment.preparation import Preparation, prepare
from orchestration.experiment.subjects import Subject, subject
from orchestration.fmu.isolation import Limits
from orchestration.master import Run, Stopped
from orchestration.master.reference import imbalance

if TYPE_CHECKING:
    import xarray


class UnfinishedExperiment(UserError):
    """An experiment that an FMU has stopped, or that could not keep pace.

    `result` is what has been computed of it.
    """

    def __init__(self, message: str, result: xarray.Dataset):
        super().__init__(message)
        self.result = result


def run(
    experiment: Experiment,
    where: str = "experiment",
    progress: Callable[[int, int], None] = lambda done, whole: None,
    *,
    note: Callable[[str], None] = lambda text: None,
    fits: Callable[[xarray.Dataset], None] = lambda sketch: None,
    live: Live | None = None,
    isolation: Callable[[bool], Limits | None] = lambda foreign: None,
) -> xarray.Dataset:
    """Make an experiment.

    Parameters
    ----------
    experiment : Experiment
    where : str
        Its file or name, for messages.
    progress : callable
        Called with the number of points done, and of how many.
    note : callable
        Called with a line for what else is worth knowing: repairs in a file, inputs that stay at
        their start value.
    fits : callable
        Called, before anything is computed, with a first point of the results without values; it
        may refuse them.
    live : Live, optional
        Run in real time, and what to do meanwhile. Outputs about the links of proxies are recorded
        in any case then.
    isolation : callable
        Told whether an FMU is not one of ours, gives the limits of a process beside this one for
        the run, if any.

    Returns
    -------
    xarray.Dataset
        Inputs and recorded outputs over time in the FMU's units, with all that it takes to make the
        experiment again. Of each mechanical coupling of a system the energy that it made, the
        running sign of coupling error. After an interrupt, what was computed, with the attribute
        ``complete`` 0; also when an FMU fails on its way or the run does not keep pace with real
        time, with the reason in the attribute ``failure``.

    Raises
    ------
    UserError
        If something in the experiment does not fit what it is made on, or an FMU fails before the
        first point.
    KeyboardInterrupt
        If an interrupt came before the first point.
    """
    with subject(experiment, where) as on:
        if live is not None:
            experiment = _in_real_time(experiment, on, where)
        prepared = prepare(experiment, on, where, note)
        time, signals, inputs = prepared.time, prepared.signals, prepared.inputs
        fits(
            results.dataset(
                time[:1], {name: np.zeros(1) for name in signals}, signals, set(inputs), {}
            )
        )
        follower = None if live is None else Follower(live, prepared)
        try:
            done = on.run(
                time,
                inputs,
                prepared.settings,
                prepared.wanted,
                lambda points: progress(points, time.size),
                pace=None if follower is None else follower.pace,
                isolation=isolation(on.foreign),
            )
            failure = ""
        except Stopped as stopped:
            if stopped.run.time.size == 0:
                raise
            done, failure = stopped.run, str(stopped)
        finally:
            if follower is not None:
                follower.close()
    if done.time.size == 0:
        raise KeyboardInterrupt
    return _results(prepared, done, where, note).assign_attrs(
        {"failure": failure} if failure else {}
    )


def _in_real_time(experiment: Experiment, on: Subject, where: str) -> Experiment:
    """Have links recorded, too.

    Raises
    ------
    UserError
        If the experiment is run without a master.
    """
    if experiment.master is not None and experiment.master.method == "fused":
        raise UserError(
            f"{where}: a fused system is computed at once and cannot be run in real time"
        )
    record = on.usual if experiment.record is None else experiment.record
    return experiment.model_copy(
        update={"record": list(dict.fromkeys([*record, *link_outputs(on.outputs)]))}
    )


def _results(
    prepared: Preparation, done: Run, where: str, note: Callable[[str], None]
) -> xarray.Dataset:
    """Gather what a run delivered, with measurement noise and the energy that couplings made."""
    for line in done.notes:
        note(line)
    count, noise = done.time.size, prepared.noise
    values = {name: array[:count] for name, array in prepared.inputs.items()}
    for name, array in zip(prepared.wanted, done.signals.values(), strict=True):
        if name in prepared.record:
            values[name] = array + noise[name][:count] if name in noise else array
    experiment, on = prepared.experiment, prepared.on
    extrapolation = experiment.master.extrapolation if experiment.master else 0
    for name, made in imbalance(on.couplings, done.signals, extrapolation).items():
        values[prepared.imbalances[name].name] = made.energy
        share = f"{100.0 * made.relative:.3g} % of what went through it"
        note(f"{name}: {made.energy[-1]:.3g} J made by the coupling, {share}")
    about = _about(prepared, done, where)
    return results.dataset(
        prepared.time[:count], values, prepared.signals, set(prepared.inputs), about
    )


def _about(prepared: Preparation, done: Run, where: str) -> dict[str, Any]:
    """Return all that it takes to make the experiment again."""
    on = prepared.on
    units = {name: signal.unit for name, signal in on.parameters.items()}
    numbers = {
        n: v if isinstance(v, str) else f"{v!r} {units.get(n, '')}"
        for n, v in prepared.settings.items()
    }
    return (
        results.about_pace(done.statistics.pacing)
        | results.about_experiment(prepared.experiment, where)
        | {
            "subject": on.name,
            "complete": int(done.complete),
            "wall_time": done.statistics.wall,
            "guids": json.dumps(dict(on.guids)),
            "parameters": json.dumps(numbers),
        }
    )
