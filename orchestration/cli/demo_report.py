"""The page that ``ppy demo`` ends with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from fmus.kit import units
from fmus.kit.units import shown, shown_difference
from orchestration.api.diagnosed import DiagnosisResult
from orchestration.identify.comparison import Comparison, GoodnessOfFit
from orchestration.reporting.page import Markup, Page
from orchestration.rig.emulator.emulator import EmulatedRig, RigParameters

_DIGITS = 4


@dataclass(frozen=True)
class ThesisRun:
    """An experiment of the thesis, simulated with both builds.

    Attributes
    ----------
    title : str
    picture : Path
    difference : float
        Largest difference of the two builds, over the largest value.
    """

    title: str
    picture: Path
    difference: float


@dataclass(frozen=True)
class Results:
    """What the demonstration yields.

    Attributes
    ----------
    runs : sequence of ThesisRun
    truth : RigParameters
        Of the emulated rig.
    recalibrated : Comparison
        With a fit to the first record.
    before, after : Comparison
        Of the nominal and the recalibrated model with the record that no fit has seen.
    diagnosis : DiagnosisResult
        Of the record in which an effect is hidden.
    saturation : float
        Charge in C around which the films stop growing in that record.
    """

    runs: Sequence[ThesisRun]
    truth: RigParameters
    recalibrated: Comparison
    before: Comparison
    after: Comparison
    diagnosis: DiagnosisResult
    saturation: float


def write(folder: Path, results: Results) -> Path:
    """Write the report beside the pictures.

    Parameters
    ----------
    folder : Path
        Where ``diagnosis.png`` and ``compare.png`` are.
    results : Results

    Returns
    -------
    Path
        ``report.html``.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    diagnosis = results.diagnosis
    errors = ", ".join(
        f"{name} from {100.0 * error:.1f} % to {100.0 * diagnosis.gain.after[name]:.1f} %"
        for name, error in diagnosis.gain.before.items()
    )
    page = Page(
        "What a diagnosis and a recalibration gain",
        f"An effect was hidden. {diagnosis.sentence} With it, the error on data that no fit has seen goes: {errors}.",
    )
    _cause(page, folder, results)
    _recalibration(page, folder, results)
    _thesis(page, results.runs)
    _how_to_reproduce(page, results)
    page.write(folder / "report.html")
    return folder / "report.html"


def _cause(page: Page, folder: Path, results: Results) -> None:
    page.heading("A cause found")
    page.text(
        f"An emulated rig whose films stop growing around a charge of {results.saturation:g} C, in a form of its own. "
        "No model was told: the simulation was held against what the instruments show. All parameters were refitted "
        "first; the picture is of the last third of the record, which no fit has seen."
    )
    page.picture(
        folder / "diagnosis.png",
        "Measured, refitted and extended simulation of what gained most, and residuals.",
    )
    page.text(
        Markup('<a href="diagnosis.html">The whole diagnosis</a>: evidence, parameters, residuals.')
    )


def _recalibration(page: Page, folder: Path, results: Results) -> None:
    first, before, after = results.recalibrated, results.before, results.after
    gains = ", ".join(
        f"{name} from {before.before[name].fit_percent:.1f} % to {judged.fit_percent:.1f} %"
        for name, judged in after.before.items()
    )
    page.heading("Parameters off nominal, recalibrated")
    page.text(
        f"Another record, with nothing hidden. On data it has not seen, the fit rises: {gains}."
    )
    page.text(
        "Ten minutes at 10 Hz from an emulated rig: own equations, own integrator, instrument noise of "
        f"{units.convert(EmulatedRig.voltage_noise, 'V', 'mV'):g} mV and "
        f"{units.convert(EmulatedRig.displacement_noise, 'm', 'um'):g} µm, and parameters that differ from nominal. "
        "The model sees only the CSV file."
    )
    page.picture(
        folder / "compare.png",
        "Record, nominal and recalibrated simulation, each output above its residual.",
    )
    page.heading("Parameters")
    columns = ["parameter", "nominal", "fitted", "95 % from", "to", "the rig's own", "inside"]
    page.table(columns, _parameters(first, results.truth))
    page.text(
        "A 95 % interval misses the truth once in twenty; of eight, one or more miss in a third of all records."
    )
    page.items(first.fit.warnings if first.fit else [])
    page.heading("Fit per output")
    rows = _outputs("recalibrated on", first, first.before, first.after or {})
    rows += _outputs("unseen", first, before.before, after.before)
    page.table(
        [
            "record",
            "output",
            "fit before",
            "fit after",
            "RMS before",
            "RMS after",
            "residual after",
        ],
        rows,
    )


def _thesis(page: Page, runs: Sequence[ThesisRun]) -> None:
    page.heading("Two experiments of the thesis")
    for run in runs:
        agreement = "Python and native FMU give the same values to the last digit."
        if run.difference > 0.0:
            agreement = f"Python and native FMU differ by at most {run.difference:.1e} of the largest value."
        page.picture(run.picture, f"{run.title}. {agreement}")


def _how_to_reproduce(page: Page, results: Results) -> None:
    fit = results.recalibrated.fit
    page.heading("How to reproduce")
    page.code(
        [
            "ppy demo",
            "ppy diagnose hidden.csv --report diagnosis.html",
            f"ppy compare record.csv --model ppy_actuator --fit {','.join(fit.estimates if fit else ())} "
            "--plot compare.png",
        ]
    )


def _parameters(comparison: Comparison, truth: RigParameters) -> list[list[str]]:
    true, rows = asdict(truth), []
    for name, e in comparison.fit.estimates.items() if comparison.fit else ():
        signal, (low, high) = comparison.model.parameters[name], e.interval
        texts = [shown(x, signal, _DIGITS) for x in (e.nominal, e.value, low, high, true[name])]
        rows.append([name, *texts, "yes" if low <= true[name] <= high else "no"])
    return rows


def _outputs(
    label: str,
    comparison: Comparison,
    before: Mapping[str, GoodnessOfFit],
    after: Mapping[str, GoodnessOfFit],
) -> list[list[str]]:
    rows = []
    for name, b in before.items():
        a, signal = after[name], comparison.model.outputs[name]
        white = a.whiteness.summary() if a.whiteness else "too short to judge"
        fits = [f"{b.fit_percent:.1f} %", f"{a.fit_percent:.1f} %"]
        errors = [shown_difference(x.rms, signal, _DIGITS) for x in (b, a)]
        rows.append([label, name, *fits, *errors, white])
    return rows
