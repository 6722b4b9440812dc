"""Execution of an experiment on its subject, after all checks."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, error_context
from orchestration.experiment import results, work_loop
from orchestration.experiment.live import Follower, Live, admitted, first_open_loop, link_outputs
from orchestration.experiment.model import Experiment
from orchestration.experiment.preparation import Preparation, prepare
from orchestration.experiment.subjects import Subject, open_subject
from orchestration.experiment.variants import Obtain, Remarked, compute_anew, kept_variants
from orchestration.fmu.isolation import Limits
from orchestration.master import Run, Statistics, Stopped
from orchestration.master.reference import imbalance
from orchestration.reporting import option

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.results import ExperimentResult

_SMALLEST_WORK = 1e-9  # J in a cycle that is remarked on; the trapezoidal rule leaves less


class UnfinishedExperiment(UserError):
    """Error of an experiment that stopped early: an FMU failed, or it could not keep pace.

    `result` has the part that was computed.
    """

    def __init__(self, message: str, result: ExperimentResult):
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
    folder: Path | None = None,
) -> ExperimentResult:
    """Run an experiment, with all its variants.

    Parameters
    ----------
    experiment : Experiment
    where : str
        File or name of the experiment, for messages.
    progress : callable
        Called with the number of computed points and the number of all points.
    note : callable
        Called with one line for each remark: repairs in a file, inputs that stay at their start
        value.
    fits : callable
        Called before the run with results of a single point, all zero; raises `UserError` if they
        cannot be written.
    live : Live, optional
        Options of a run in real time.
    isolation : callable
        Returns, given True if an FMU is not one of ours, the limits of the process in which the
        run is isolated; None for a run in this process.
    folder : Path, optional
        Folder of a journal that keeps each finished variant, so that an interrupted experiment
        can be resumed. Only for experiments with variants.

    Returns
    -------
    ExperimentResult
        Inputs and recorded outputs over time in the FMU's units, with all settings that repeat
        the experiment, and the outputs about the links of proxies. Outputs of variants are named
        ``variant.output``. For each mechanical coupling of a system there is the energy that it
        made, a measure of the coupling error. The attribute ``complete`` is 0 for a part of a
        run: after an interrupt, and, with the reason in the attribute ``failure``, when an FMU
        failed, a rig refused a command or was lost, or the run did not keep pace with real time.
        Variants are all complete.

    Raises
    ------
    UserError
        If the experiment does not fit its subject, a folder is given without variants, or an FMU
        fails before the first point or in a variant.
    KeyboardInterrupt
        If an interrupt came before the first point, or in a variant.
    """
    if experiment.variants and live is not None:
        raise UserError(f"{where}: variants run one after another, not in real time")
    if folder is not None and not experiment.variants:
        raise UserError(
            f"{option('folder', str(folder))} keeps variants that are done, and {where} has none"
        )
    calls = _Calls(progress, note, fits, isolation)
    with open_subject(experiment, where) as subject:
        for line in subject.notes:
            note(line)
        if not experiment.variants:
            return _run_one(experiment, subject, where, calls, live)
        with kept_variants(folder, experiment) as kept:
            return _run_variants(experiment, subject, where, calls, kept)


class _Calls(NamedTuple):
    """Functions that a run calls; see `run`."""

    progress: Callable[[int, int], None]
    note: Callable[[str], None]
    fits: Callable[[xarray.Dataset], None]
    isolation: Callable[[bool], Limits | None]


def _run_one(
    experiment: Experiment,
    subject: Subject,
    where: str,
    calls: _Calls,
    live: Live | None = None,
    obtain: Obtain = compute_anew,
) -> ExperimentResult:
    """Run an experiment without variants, unless `obtain` has its result in a journal."""
    if live is not None:
        with error_context(where):
            _refuse_fused(experiment)
            experiment = live.tuner.added_to(experiment, subject)
    prepared = prepare(_record_links(experiment, subject), subject, where, calls.note)
    if live is not None:
        prepared = live.tuner.begin(prepared)
    calls.fits(_first_point(prepared))
    paced = None if live is None else admitted(live, prepared)

    def compute() -> Remarked:
        ran, failure = _run_prepared(
            prepared, paced, calls.progress, calls.isolation(subject.foreign)
        )
        if ran.time.size == 0:
            raise KeyboardInterrupt
        data, remarks = _make_result(prepared, ran, where)
        if live is not None and live.tuner.changes:
            data = data.assign_attrs(tuning=json.dumps(live.tuner.changes))
        return data.assign_attrs({"failure": failure} if failure else {}), remarks

    result, remarks = obtain(prepared, compute, partial(_restore, prepared, where))
    for line in remarks:
        calls.note(line)
    return result


def _run_variants(
    experiment: Experiment,
    subject: Subject,
    where: str,
    calls: _Calls,
    kept: Callable[[int], Obtain],
) -> ExperimentResult:
    """Run the variants of an experiment, one after another.

    Raise UserError for a variant that failed, and KeyboardInterrupt for one that was interrupted,
    as a result has all variants or none.
    """
    runs = {}
    for number, (name, settings) in enumerate(experiment.variants.items()):
        here = f"{where}: {name}"
        changes = {"parameters": {**experiment.parameters, **settings}, "variants": {}}
        of_variant = _calls_of_variant(calls, name, number, len(experiment.variants))
        variant = experiment.model_copy(update=changes)
        runs[name] = _run_one(variant, subject, here, of_variant, obtain=kept(number))
        if "failure" in runs[name].attrs:
            raise UserError(f"{here}: {runs[name].attrs['failure']}")
        if not runs[name].attrs["complete"]:
            raise KeyboardInterrupt
    data = results.side_by_side(runs, experiment, where)
    if experiment.work_loop:
        for line in work_loop.overtaken(work_loop.tracked_loops(data, experiment.work_loop)):
            calls.note(line)
    return data


def _calls_of_variant(calls: _Calls, name: str, number: int, count: int) -> _Calls:
    """Return the calls of one of several variants with equally many points."""
    return calls._replace(
        progress=lambda done, whole: calls.progress(number * whole + done, count * whole),
        note=lambda line: calls.note(f"{name}: {line}"),
    )


def _first_point(prepared: Preparation) -> ExperimentResult:
    """Return results of one point, all zero, with which a file format is tested."""
    signals = prepared.signals
    zeros = {name: np.zeros(1) for name in signals}
    return results.dataset(prepared.time[:1], zeros, signals, set(prepared.inputs), {})


def _run_prepared(
    prepared: Preparation,
    live: Live | None,
    progress: Callable[[int, int], None],
    isolation: Limits | None,
) -> tuple[Run, str]:
    """Run a prepared experiment; return the run and why it stopped early, empty if it did not.

    A run that stopped before its first point raises its error.
    """
    follower = None if live is None else Follower(live, prepared)
    try:
        ran = prepared.subject.run(
            prepared.time,
            prepared.inputs,
            prepared.settings,
            prepared.wanted,
            lambda points: progress(points, prepared.time.size),
            pace=None if follower is None else follower.pace,
            isolation=isolation,
        )
    except Stopped as stopped:
        if stopped.run.time.size == 0:
            raise
        return stopped.run, str(stopped)
    finally:
        if follower is not None:
            follower.close()
    return _cut_at_open_loop(ran)


def _cut_at_open_loop(ran: Run) -> tuple[Run, str]:
    """Cut a run off at the first point at which a loop over a rig is open.

    Returns the run and the reason, empty if no loop opened. A run in real time has stopped there
    already; one that waits for its rigs is cut afterwards.
    """
    opening = first_open_loop(ran.time.tolist(), ran.signals)
    if opening is None:
        return ran, ""
    last, reason = opening
    kept = slice(last + 1)
    signals = {name: values[kept] for name, values in ran.signals.items()}
    return replace(ran, time=ran.time[kept], signals=signals, complete=False), reason


def _refuse_fused(experiment: Experiment) -> None:
    """Raise UserError if the system is fused, for then there are no steps to pace."""
    if experiment.master is not None and experiment.master.method == "fused":
        raise UserError("a fused system is computed at once and cannot be run in real time")


def _record_links(experiment: Experiment, subject: Subject) -> Experiment:
    """Return the experiment with the link outputs of proxies among the recorded ones.

    They show which of the recorded values came from the rig.
    """
    record = subject.recorded_by_default if experiment.record is None else experiment.record
    return experiment.model_copy(
        update={"record": list(dict.fromkeys([*record, *link_outputs(subject.outputs)]))}
    )


def _make_result(prepared: Preparation, ran: Run, where: str) -> Remarked:
    """Return the result of a run, with the energies that couplings made, and remarks on the run.

    Remarks are those of the run, on limits that were exceeded, and on energies of couplings.
    """
    # the run names signals `member.variable`, in the order of those wanted
    delivered = dict(zip(prepared.wanted, ran.signals.values(), strict=True))
    energies, energy_remarks = _coupling_energies(prepared, ran)
    count = ran.time.size  # fewer than were prepared if the run was stopped
    values = {name: array[:count] for name, array in prepared.inputs.items()}
    limit_remarks = prepared.limits.remarks(
        prepared.time[:count], {**values, **delivered}, prepared.settings
    )
    values |= _add_noise(prepared, delivered) | energies
    data = results.dataset(
        prepared.time[:count],
        values,
        prepared.signals,
        set(prepared.inputs),
        _attributes(prepared, ran, where),
    )
    return data, [*ran.notes, *limit_remarks, *energy_remarks, *_unpaid_work(prepared, data)]


def _unpaid_work(prepared: Preparation, data: ExperimentResult) -> Iterator[str]:
    """Yield a remark if the charge does work in a cycle that no current pays for."""
    table = prepared.experiment.work_loop
    if table is None or table.coupling is None or data.time[-1] < table.period:
        return
    reaction, reciprocal, alpha = (
        float(prepared.settings.get(name, prepared.subject.parameters[name].start))
        for name in table.coupling.parameters.values()
    )
    work, paid = work_loop.works_of_charge(data, table, reaction - reciprocal * alpha)
    if abs(work - paid) <= _SMALLEST_WORK:
        return
    told = f"{1e6 * (work - paid):.3g} uJ of it are paid for by no current"
    if paid > work:
        told = f"the current pays {1e6 * (paid - work):.3g} uJ more than that"
    yield f"the charge does {1e6 * work:.3g} uJ of work on the load in the last cycle; {told}"


def _restore(
    prepared: Preparation, where: str, values: Signals, seconds: float
) -> ExperimentResult:
    """Return the result of a whole run from the signals and the wall time in s of a journal."""
    effort = Statistics({}, 0, 0, 0, seconds)
    about = _attributes(prepared, Run(prepared.time, {}, {}, True, "", effort, {}), where)
    return results.dataset(prepared.time, values, prepared.signals, set(prepared.inputs), about)


def _add_noise(prepared: Preparation, delivered: Signals) -> dict[str, Array]:
    """Return the outputs to be recorded, with simulated measurement noise added."""
    measured = {}
    for name, array in delivered.items():
        if name not in prepared.record:  # wanted for the energy of a coupling, or for a limit
            continue
        noise = prepared.noise.get(name)
        measured[name] = array if noise is None else array + noise[: array.size]
    return measured


def _coupling_energies(prepared: Preparation, ran: Run) -> tuple[dict[str, Array], list[str]]:
    """Return the energy (n,) in J that each mechanical coupling made, and a remark on each."""
    master = prepared.experiment.master
    extrapolation = master.extrapolation if master else 0
    energies = {}
    remarks = []
    for name, error in imbalance(prepared.subject.couplings, ran.signals, extrapolation).items():
        energies[prepared.imbalances[name].name] = error.energy
        share = f"{100.0 * error.relative:.3g} % of the energy through it"
        remarks.append(f"{name}: {error.energy[-1]:.3g} J made by the coupling, {share}")
    return energies, remarks


def _attributes(prepared: Preparation, ran: Run, where: str) -> dict[str, Any]:
    """Return the attributes of a result, with which its experiment can be repeated."""
    subject = prepared.subject
    units = {name: signal.unit for name, signal in subject.parameters.items()}
    parameters = {}
    for name, value in prepared.settings.items():
        if isinstance(value, str):
            parameters[name] = value
        else:
            parameters[name] = f"{value!r} {units.get(name, '')}".removesuffix(" 1")
    return (
        results.about_pace(ran.statistics.pacing)
        | results.about_experiment(prepared.experiment, where)
        | {
            "subject": subject.name,
            "complete": int(ran.complete),
            "wall_time": ran.statistics.wall,
            "guids": json.dumps(dict(subject.guids)),
            "parameters": json.dumps(parameters),
        }
    )
