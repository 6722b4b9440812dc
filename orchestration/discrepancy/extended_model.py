"""The extended model of a diagnosis as a component and an FMU, and its gain on validation data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from fmus.kit import Component, Effect, UserError, files, stack
from fmus.kit.arrays import Array
from fmus.kit.build import build, build_cached, relaxed_assumption
from fmus.kit.declare import ParameterDeclaration, summary
from fmus.kit.effects import made_by, made_with, stacked_with, unstack
from fmus.kit.record import with_knots
from fmus.kit.sensors import transport_delay
from fmus.kit.units import format_value
from orchestration.discrepancy.candidates import FittedCandidate, label
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.data import Dataset, ValidationData
from orchestration.discrepancy.validation import validation_parameters
from orchestration.fmu import Fmu
from orchestration.fmu.simulation import simulate_instance
from orchestration.identify.noise import WHITENESS_SAMPLES, Noise, Whiteness, whiteness
from orchestration.identify.uncertainty import Estimate
from orchestration.records.runs import join_records
from orchestration.reporting import option


@dataclass(frozen=True)
class ExtensionGain:
    """The error of an extended model's FMU on unseen data, against the base model's FMU.

    Attributes
    ----------
    before, after : dict of str to float
        Normalised RMS error where nothing was fitted, of the refitted base and of the extended
        model, by output.
    whiteness : dict of str to Whiteness or None
        Of the innovations after, by output; None where too little was measured to tell.
    base, extended : dict of str to ndarray, shape (n,)
        Simulated outputs over all of ``validation.data``, SI.
    """

    before: dict[str, float]
    after: dict[str, float]
    whiteness: dict[str, Whiteness | None]
    base: dict[str, Array]
    extended: dict[str, Array]


def extended_component(diagnosis: Diagnosis, record: str) -> type[Component]:
    """Return the best model of a diagnosis as a component with fitted defaults, start values too.

    Parameters
    ----------
    diagnosis : Diagnosis
    record : str
        The file that was fitted to; only its name is used.

    Returns
    -------
    type[Component]
        Its remark, and so the FMU's description and documentation, tells what was added and fitted.

    Raises
    ------
    UserError
        If the record does not move any input, so that nothing was diagnosed.
    """
    if diagnosis.inconclusive:
        raise UserError(f"{record}: no input moves, so that there is nothing to make an FMU of")
    best = diagnosis.final
    defaults = fitted_defaults(best)
    made = _with_fine_delays(best.candidate.cls, defaults)
    made.remark = "\n".join(_remarks(diagnosis, record, defaults))
    return made


def _with_fine_delays(cls: type[Component], defaults: Mapping[str, float]) -> type[Component]:
    """Return a model with fitted defaults, the registers of its delays as fine as these allow.

    A fit reads a delayed output at earlier instants and needs none; those of a search reach far.
    """
    base, effects = unstack(cls)
    finer = []
    for effect in effects:
        sampling = made_with(effect).get("sampling")
        delay = defaults.get(effect.neutral, 0.0)
        if sampling and delay > 0.0 and made_by(effect) is transport_delay:
            finer.append(transport_delay(base, effect.output, sampling.holding(delay)))
        else:
            finer.append(effect)
    given = {**stacked_with(cls), **defaults}
    return stack(base, *finer, name=f"{cls.name}_fitted", defaults=given)


def fitted_defaults(best: FittedCandidate) -> dict[str, float]:
    """Return the fitted values that differ from the defaults of their parameters, by name, SI.

    Start values are among them; of several records, those of the first.
    """
    values = best.problem.runs[0].values(best.parameters)
    parameters = best.candidate.cls.layout.parameters
    return {p.name: _allowed(values[p.name], p) for p in parameters if values[p.name] != p.start}


def _allowed(value: float, declared: ParameterDeclaration) -> float:
    """Clip a value to its range, which it may have left by rounding when it was at an end."""
    return min(max(float(value), declared.min), declared.max)


def _remarks(diagnosis: Diagnosis, record: str, defaults: Mapping[str, float]) -> list[str]:
    """Tell in plain words what a model is made of: one statement to a line."""
    best = diagnosis.selection.best.candidate
    cls = diagnosis.selection.base.candidate.cls
    base = cls.name
    remarks = [f"Fitted to {Path(record).name.encode(errors='backslashreplace').decode()}"]
    remarks += [
        f"Added to {base}: {label(effect)}, {_meaning(cls, effect)}" for effect in best.effects
    ]
    if not best.effects:
        remarks.append(f"Nothing was added to {base}: only its parameters were fitted")
    if diagnosis.alternatives:
        others = ", ".join(diagnosis.alternatives)
        remarks.append(f"On this record it cannot be told apart from {others}")
    if not diagnosis.explained:
        remarks.append("It does not account for all that the record shows")
    remarks += _parameter_remarks(diagnosis, defaults)
    return remarks


def _parameter_remarks(diagnosis: Diagnosis, defaults: Mapping[str, float]) -> list[str]:
    """Tell the value of every parameter that was fitted or given, with its interval."""
    first = diagnosis.final.problem.runs[0]
    remarks = []
    for p in diagnosis.selection.best.candidate.cls.layout.parameters:
        fitted = diagnosis.estimates.get(p.name, diagnosis.estimates.get(first.own(p.name)))
        if fitted is not None:
            value = format_value(defaults.get(p.name, p.start), p)
            remarks.append(f"{p.name} = {value} ({_interval(fitted, p)})")
        elif p.name in defaults:
            remarks.append(f"{p.name} = {format_value(defaults[p.name], p)} (given, not fitted)")
    return remarks


def _interval(fitted: Estimate, declared: ParameterDeclaration) -> str:
    """Tell the interval of an estimate in words."""
    low, high = fitted.interval
    if not (isfinite(low) and isfinite(high)):
        return "not determined by the record"
    return f"95 % interval {format_value(low, declared)} … {format_value(high, declared)}"


def _meaning(cls: type[Component], effect: type[Effect]) -> str:
    """Tell what an effect does, and what the model assumes in place of that."""
    what = summary(effect).replace("``", "")
    words, number = relaxed_assumption(cls, effect)
    where = f" ({number})" if number else ""
    return f"{what}; {words}{where}" if words else f"{what}{where}"


def fmu_paths(path: Path, records: Iterable[Path]) -> dict[str, Path]:
    """Return the files of both builds: ``F.fmu`` of the native one, ``F.python.fmu`` of the other.

    Parameters
    ----------
    path : Path
        ``F.fmu``.
    records : iterable of Path
        Files that must not be overwritten.

    Returns
    -------
    dict of str to Path
        By runtime.

    Raises
    ------
    UserError
        If the name is not that of an FMU, or one of them is a record or a folder.
    """
    if path.suffix != ".fmu":
        raise UserError(f"{option('fmu', str(path))}: the name of an FMU ends in .fmu")
    places = {"native": path, "python": path.with_suffix(".python.fmu")}
    kept = [record for record in records if record.exists()]
    for place in places.values():
        given_as = option("fmu", str(place))
        if place.is_dir():
            raise UserError(f"{given_as}: this is a folder")
        if place.exists() and any(place.samefile(record) for record in kept):
            raise UserError(f"{given_as}: this is the record itself; it will not be overwritten")
    return places


def export(
    cls: type[Component],
    path: Path,
    records: Iterable[Path] = (),
    platforms: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Path]:
    """Build a component for both runtimes, then write both FMUs.

    Parameters
    ----------
    cls : type[Component]
    path, records
        See :func:`fmu_paths`.
    platforms : sequence of str, optional
        FMI platforms; default is every one that a compiler here can serve.
    progress : callable
        Told what is being done.

    Returns
    -------
    list of Path
        The native FMU and the Python one.

    Raises
    ------
    UserError
        If a destination is refused or cannot be written, or a build fails; then no FMU is left half
        written.
    """
    places = fmu_paths(path, records)
    contents = {
        place: build(cls, runtime, platforms, progress) for runtime, place in places.items()
    }
    for place, made in contents.items():
        files.write(place, made)
    return list(places.values())


def measure_gain(diagnosis: Diagnosis, fmu: Path, runtime: str = "native") -> ExtensionGain:
    """Run the extended model's FMU, and that of the refitted base, over the data held out.

    Both run with what was fitted to the other data: the defaults of the extended model's FMU have
    seen all of them.

    Parameters
    ----------
    diagnosis : Diagnosis
    fmu : Path
        The FMU that :func:`export` wrote.
    runtime : {"native", "python"}
        Build of the base model.

    Returns
    -------
    ExtensionGain

    Raises
    ------
    UserError
        If an FMU cannot be run over the data.
    """
    validation = diagnosis.validation
    best = diagnosis.selection.best
    base = diagnosis.selection.base
    refitted = base.candidate.cls
    before = _run(
        build_cached(refitted, runtime),
        refitted,
        validation_parameters(validation, base),
        validation.data,
    )
    after = _run(fmu, best.candidate.cls, validation_parameters(validation, best), validation.data)
    white = {
        output: _whiteness(noise, validation, output, after[output])
        for output, noise in best.fit.noise.items()
        if output in validation.data.measured
    }
    return ExtensionGain(
        before=validation.nrmse(before),
        after=validation.nrmse(after),
        whiteness=white,
        base=before,
        extended=after,
    )


def _whiteness(
    noise: Noise, validation: ValidationData, output: str, simulated: Array
) -> Whiteness | None:
    """Test the innovations on unseen data; None if there are too few to tell."""
    measured = validation.data.measured[output]
    present = np.isfinite(measured) & validation.judged
    innovation = noise.whiten((measured - simulated)[present], present)
    return whiteness(innovation) if len(innovation) >= WHITENESS_SAMPLES else None


def _run(
    path: Path, cls: type[Component], values: Mapping[str, float], data: Dataset
) -> dict[str, Array]:
    """Simulate the data held out, every run from its first sample on."""
    parts = []
    for run, part in zip(data.runs, data.by_run().values(), strict=True):
        own = run.values(values)
        with Fmu(path, {p.name: _allowed(own[p.name], p) for p in cls.layout.parameters}) as fmu:
            fmu.start(float(part.time[0]))
            moving = part.inputs if data.linear is True else data.linear or ()
            time, inputs, at = with_knots(part.time, part.inputs, moving)
            simulated = simulate_instance(fmu, time, inputs, list(data.measured), linear=moving)
            parts.append({o: signal[at] for o, signal in simulated.items()})
    return {
        o: join_records(len(data.time), data.runs, [part[o] for part in parts])
        for o in data.measured
    }
