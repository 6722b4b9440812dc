"""Everything once, on an embedded default: what ``make demo`` and ``ppy demo`` run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus import COMPONENTS, component
from fmus.kit import files, units
from fmus.kit.build import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.units import shown, shown_difference
from orchestration.api.diagnosis import DiagnosisResult, diagnose
from orchestration.cli import compare as screen_compare
from orchestration.experiment import waveforms
from orchestration.fmu import simulate
from orchestration.fmu.model import Model, find_model
from orchestration.identify import comparison as comparing
from orchestration.records import write_record
from orchestration.reporting import console as screen
from orchestration.reporting.page import Markup, Page
from orchestration.rig.emulator.emulator import EmulatedRig, Physics, RigParameters
from orchestration.rig.emulator.hidden_coupling import SaturatingStrain

Array = NDArray[np.float64]
_MODEL = "ppy_actuator"
_STEP = 0.1
_FITTED = ["R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2"]
_UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
_SEED, _SEED_HIDDEN = 3, 7
_GROWN = 1.0  # C, around which the films stop growing where an effect is hidden
_DIGITS = 4


@dataclass(frozen=True)
class _Run:
    """An experiment of the thesis, simulated with both builds."""

    title: str
    picture: Path
    difference: float


def run(out: Path) -> Path:
    """Build, simulate, compare, recalibrate, diagnose, report.

    Parameters
    ----------
    out : Path
        Folder for everything made.

    Returns
    -------
    Path
        The report.

    Raises
    ------
    UserError
        If there is no compiler or the folder cannot be written.
    """
    with screen.progress() as tell:
        models = _build(out, tell)
        runs = _thesis(out, models, tell)
        truth = RigParameters().scattered(_SEED)
        tell("an emulated rig, its parameters off nominal, is measured twice for ten minutes")
        records = [_measure(out / f"{name}.csv", truth, _SEED + k) for k, name in enumerate(("record", "unseen"))]
        model = models["native"]
        first = comparing.compare(model, comparing.read_for(model, records[0]), {}, _FITTED, tell)
        tell("judging the recalibrated model on the record it has not seen")
        unseen = comparing.read_for(model, records[1])
        before = comparing.compare(model, unseen)
        after = comparing.compare(model, unseen, first.fit.values if first.fit else {})
        tell("drawing")
        comparing.plot(first, out / "compare.png")
    screen_compare.show(first)
    for name, judged in after.before.items():
        print(f"on the unseen record: {name} {before.before[name].fit_percent:.1f} % -> {judged.fit_percent:.1f} % fit")
    print(f"\nthe same rig, but its films stop growing around {_GROWN:g} C, and no model was told")
    with screen.progress() as tell:
        diagnosed = _diagnose(out, truth, tell)
    print(diagnosed)
    report = _report(out, runs, truth, first, before, after, diagnosed)
    print(f"report: {report}")
    return report


def _build(out: Path, tell: Callable[[str], None]) -> dict[str, Model]:
    """Build every component both ways for this machine; return the force-driven actuator's two builds."""
    for name in COMPONENTS:
        for runtime in RUNTIMES:
            contents = build(component(name), runtime, [host_platform()], progress=tell)
            files.write(out / "fmu" / runtime / f"{name}.fmu", contents)
    models = {runtime: find_model(str(out / "fmu" / runtime / f"{_MODEL}.fmu")) for runtime in RUNTIMES}
    return {runtime: replace(model, name=_MODEL, cls=component(_MODEL)) for runtime, model in models.items()}


def _thesis(out: Path, models: Mapping[str, Model], tell: Callable[[str], None]) -> list[_Run]:
    """Fig. 3-4, a current square wave, and fig. 3-6, a staircase of loads, simulated by both builds."""
    short = simulate.grid(0.0, 60.0, _STEP)
    long = simulate.grid(0.0, 500.0, _STEP)
    cases = [
        ("fig_3_4", "Thesis fig. 3-4: ±0.9 A at 0.2 Hz", short, {"current": waveforms.square_wave(short, 0.9, 0.2)}),
        (
            "fig_3_6",
            "Thesis fig. 3-6: loads from 0.5 N to 2.75 N",
            long,
            {"force": waveforms.force_staircase(long, period=50.0)},
        ),
    ]
    runs = []
    for file, title, time, inputs in cases:
        tell(title)
        results = {runtime: simulate.simulate(model, time, inputs, {}) for runtime, model in models.items()}
        native, python = results["native"], results["python"]
        difference = max(
            float(np.max(np.abs(native[o] - python[o])) / (np.max(np.abs(native[o])) or 1.0)) for o in native
        )
        drawn = ["voltage", "displacement"] if "current" in inputs else ["displacement"]
        signals = inputs | {name: native[name] for name in drawn}
        simulate.plot(out / f"{file}.png", models["native"], time, signals, title)
        runs.append(_Run(title, out / f"{file}.png", difference))
    return runs


def _diagnose(out: Path, truth: RigParameters, tell: Callable[[str], None]) -> DiagnosisResult:
    """Hide an effect in a record and let a diagnosis find it."""
    hidden = partial(SaturatingStrain, saturation=1.0 / _GROWN)
    record = _measure(out / "hidden.csv", truth, _SEED_HIDDEN, hidden)
    result = diagnose(record, _MODEL, progress=tell)
    tell("drawing the report")
    result.report(out / "diagnosis.html", f"ppy diagnose {record.name} --report diagnosis.html")
    result.plot(out / "diagnosis.png")
    return result


def _measure(
    path: Path, truth: RigParameters, seed: int, hidden: Callable[[RigParameters], Physics] | None = None
) -> Path:
    """Let the emulated rig run for ten minutes at 10 Hz and write what its instruments show."""
    time = simulate.grid(0.0, 600.0, _STEP)
    current = waveforms.multilevel(time, [-0.9, -0.45, 0.0, 0.45, 0.9], (2.0, 8.0), seed)
    force = waveforms.multilevel(time, [0.5, 1.0, 1.75, 2.75], (15.0, 45.0), seed + 100)
    inputs = {"current": current, "force": force}
    write_record(path, time, inputs | EmulatedRig(truth, seed=seed, hidden=hidden).run(time, **inputs), _UNITS)
    return path


def _report(
    out: Path,
    runs: list[_Run],
    truth: RigParameters,
    first: comparing.Comparison,
    before: comparing.Comparison,
    after: comparing.Comparison,
    diagnosed: DiagnosisResult,
) -> Path:
    gains = ", ".join(
        f"{name} from {before.before[name].fit_percent:.1f} % to {judged.fit_percent:.1f} %"
        for name, judged in after.before.items()
    )
    errors = ", ".join(
        f"{name} from {100.0 * error:.1f} % to {100.0 * diagnosed.gain.after[name]:.1f} %"
        for name, error in diagnosed.gain.before.items()
    )
    page = Page(
        "What a diagnosis and a recalibration gain",
        f"An effect was hidden. {diagnosed.sentence} With it, the error on data that no fit has seen goes: {errors}.",
    )
    page.heading("A cause found")
    page.text(
        f"An emulated rig whose films stop growing around a charge of {_GROWN:g} C, in a form of its own. No model was "
        "told: the simulation was held against what the instruments show. All parameters were refitted first; the "
        "picture is of the last third of the record, which no fit has seen."
    )
    page.picture(
        out / "diagnosis.png", "Measured, refitted and extended simulation of what gained most, and residuals."
    )
    page.text(Markup('<a href="diagnosis.html">The whole diagnosis</a>: evidence, parameters, what is left.'))
    page.heading("Parameters off nominal, recalibrated")
    page.text(f"Another record, with nothing hidden. On data it has not seen, the fit rises: {gains}.")
    page.text(
        "Ten minutes at 10 Hz from an emulated rig: own equations, own integrator, instrument noise of "
        f"{units.convert(EmulatedRig.voltage_noise, 'V', 'mV'):g} mV and "
        f"{units.convert(EmulatedRig.displacement_noise, 'm', 'um'):g} µm, and parameters that differ from nominal. "
        "The model sees only the CSV file."
    )
    page.picture(out / "compare.png", "Record, nominal and recalibrated simulation, each output above its residual.")
    page.heading("Parameters")
    page.table(
        ["parameter", "nominal", "fitted", "95 % from", "to", "the rig's own", "inside"],
        _parameters(first, truth),
    )
    page.text("A 95 % interval misses the truth once in twenty; of eight, one or more miss in a third of all records.")
    page.items(first.fit.warnings if first.fit else [])
    page.heading("Fit per output")
    rows = _outputs("recalibrated on", first.before, first.after or {}, first.model)
    rows += _outputs("unseen", before.before, after.before, first.model)
    page.table(["record", "output", "fit before", "fit after", "RMS before", "RMS after", "residual after"], rows)
    page.heading("Two experiments of the thesis")
    for run in runs:
        agreement = "Python and native FMU give the same values to the last digit."
        if run.difference > 0.0:
            agreement = f"Python and native FMU differ by at most {run.difference:.1e} of the largest value."
        page.picture(run.picture, f"{run.title}. {agreement}")
    page.heading("How to reproduce")
    fitted = ",".join(_FITTED)
    page.code(
        [
            "ppy demo",
            "ppy diagnose hidden.csv --report diagnosis.html",
            f"ppy compare record.csv --model ppy_actuator --fit {fitted} --plot compare.png",
        ]
    )
    page.write(out / "report.html")
    return out / "report.html"


def _parameters(comparison: comparing.Comparison, truth: RigParameters) -> list[list[str]]:
    true, rows = asdict(truth), []
    for name, e in comparison.fit.estimates.items() if comparison.fit else ():
        signal, (low, high) = comparison.model.parameters[name], e.interval
        texts = [shown(x, signal, _DIGITS) for x in (e.nominal, e.value, low, high, true[name])]
        rows.append([name, *texts, "yes" if low <= true[name] <= high else "no"])
    return rows


def _outputs(
    label: str, before: Mapping[str, comparing.Judgement], after: Mapping[str, comparing.Judgement], model: Model
) -> list[list[str]]:
    rows = []
    for name, b in before.items():
        a, signal = after[name], model.outputs[name]
        white = a.whiteness.summary() if a.whiteness else "too short to judge"
        fits = [f"{b.fit_percent:.1f} %", f"{a.fit_percent:.1f} %"]
        errors = [shown_difference(x.rms, signal, _DIGITS) for x in (b, a)]
        rows.append([label, name, *fits, *errors, white])
    return rows
