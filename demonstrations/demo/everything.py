"""Demonstration of all tasks on an emulated rig, for ``make demo`` and ``ppy demo``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from demonstrations.demo import report as demo_report
from demonstrations.demo.report import ThesisRun
from demonstrations.emulator import EmulatedRig, Physics, RigParameters, SaturatingStrain
from fmus import COMPONENTS, component
from fmus.kit import files
from fmus.kit.build import RUNTIMES, build, host_platform
from orchestration.api import DiagnosisResult, diagnose
from orchestration.cli.commands import compare as screen_compare
from orchestration.experiment import waveforms
from orchestration.fmu import Model, find_model
from orchestration.fmu import simulation as simulate
from orchestration.identify import comparison as comparing
from orchestration.records import Source, write_record
from orchestration.reporting import console as screen
from orchestration.reporting import pictures

_MODEL = "ppy_actuator"
_STEP = 0.1
_FITTED = ["R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2"]
_UNITS = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
_SEED = 3
_SEED_HIDDEN = 7
_GROWN = 1.0  # C, at which the strain of the hidden effect saturates


def run(out: Path) -> Path:
    """Build, simulate, compare, recalibrate, diagnose, report.

    Parameters
    ----------
    out : Path
        Folder for all output.

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
        records = [
            _measure(out / f"{name}.csv", truth, _SEED + k)
            for k, name in enumerate(("record", "unseen"))
        ]
        model = models["native"]
        first = comparing.compare(
            model, comparing.read_for(model, Source.of(records[0])), {}, _FITTED, tell
        )
        tell("judging the recalibrated model on the record it has not seen")
        unseen = comparing.read_for(model, Source.of(records[1]))
        before = comparing.compare(model, unseen)
        after = comparing.compare(model, unseen, first.fit.values if first.fit else {})
        tell("drawing")
        first.plot(out / "compare.png")
    screen_compare.show(first.fit, first)
    for name, judged in after.before.items():
        print(
            f"on the unseen record: {name} {before.before[name].fit_percent:.1f} % ->"
            f" {judged.fit_percent:.1f} % fit"
        )
    print(f"\nthe same rig, but its films stop growing around {_GROWN:g} C, which no model has")
    with screen.progress() as tell:
        diagnosed = _diagnose(out, truth, tell)
    print(diagnosed)
    made = demo_report.write(
        out, demo_report.DemoResults(runs, truth, first, before, after, diagnosed, _GROWN)
    )
    print(f"report: {made}")
    return made


def _build(out: Path, tell: screen.Tell) -> dict[str, Model]:
    """Build every component as native and Python FMU; return both builds of the actuator."""
    work = [(name, runtime) for name in COMPONENTS for runtime in RUNTIMES]
    tell(f"building {len(work)} FMUs")
    for k, (name, runtime) in enumerate(work):
        contents = build(
            component(name), runtime, [host_platform()], partial(tell.done, k, len(work))
        )
        files.write(out / "fmu" / runtime / f"{name}.fmu", contents)
    models = {
        runtime: find_model(str(out / "fmu" / runtime / f"{_MODEL}.fmu")) for runtime in RUNTIMES
    }
    return {
        runtime: replace(model, name=_MODEL, cls=component(_MODEL))
        for runtime, model in models.items()
    }


def _thesis(out: Path, models: Mapping[str, Model], tell: Callable[[str], None]) -> list[ThesisRun]:
    """Simulate fig. 3-4, a square wave of current, and fig. 3-6, a staircase of loads."""
    short = simulate.grid(0.0, 60.0, _STEP)
    long = simulate.grid(0.0, 500.0, _STEP)
    cases = [
        (
            "fig_3_4",
            "Thesis fig. 3-4: ±0.9 A at 0.2 Hz",
            short,
            {"current": waveforms.square_wave(short, 0.9, 0.2)},
        ),
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
        results = {
            runtime: simulate.simulate(model, time, inputs, {}) for runtime, model in models.items()
        }
        native = results["native"]
        python = results["python"]
        difference = max(
            float(np.max(np.abs(native[o] - python[o])) / (np.max(np.abs(native[o])) or 1.0))
            for o in native
        )
        drawn = ["voltage", "displacement"] if "current" in inputs else ["displacement"]
        signals = inputs | {name: native[name] for name in drawn}
        figure = simulate.draw_signals(models["native"], time, signals, title)
        pictures.save(figure, out / f"{file}.png")
        runs.append(ThesisRun(title, out / f"{file}.png", difference))
    return runs


def _diagnose(out: Path, truth: RigParameters, tell: Callable[[str], None]) -> DiagnosisResult:
    """Diagnose a record with a hidden effect."""
    hidden = partial(SaturatingStrain, saturation=1.0 / _GROWN)
    record = _measure(out / "hidden.csv", truth, _SEED_HIDDEN, hidden)
    result = diagnose(record, _MODEL, progress=tell)
    tell("drawing the report")
    result.report(out / "diagnosis.html", f"ppy diagnose {record.name} --report diagnosis.html")
    result.plot(out / "diagnosis.png")
    return result


def _measure(
    path: Path,
    truth: RigParameters,
    seed: int,
    hidden: Callable[[RigParameters], Physics] | None = None,
) -> Path:
    """Write the measured signals of a run of the emulated rig, ten minutes at 10 Hz."""
    time = simulate.grid(0.0, 600.0, _STEP)
    current = waveforms.multilevel(time, [-0.9, -0.45, 0.0, 0.45, 0.9], (2.0, 8.0), seed)
    force = waveforms.multilevel(time, [0.5, 1.0, 1.75, 2.75], (15.0, 45.0), seed + 100)
    inputs = {"current": current, "force": force}
    write_record(
        path,
        time,
        inputs | EmulatedRig(truth, seed=seed, hidden=hidden).run(time, **inputs),
        _UNITS,
    )
    return path
