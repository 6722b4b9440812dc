"""Page of ``ppy demo``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from demonstrations.emulator import EmulatedRig, RigParameters
from fmus.kit import units
from fmus.kit.units import format_difference, format_value
from orchestration.api import DiagnosisResult
from orchestration.identify import Comparison
from orchestration.identify import comparison as work
from orchestration.reporting.html import Markup, Page

_DIGITS = 4


@dataclass(frozen=True)
class ThesisRun:
    """Experiment of the thesis, simulated with both builds.

    Attributes
    ----------
    title : str
    picture : Path
    difference : float
        Largest difference of the two builds over the largest value.
    """

    title: str
    picture: Path
    difference: float


@dataclass(frozen=True)
class DemoResults:
    """Results of the demonstration.

    Attributes
    ----------
    runs : sequence of ThesisRun
    truth : RigParameters
        Parameters of the emulated rig.
    recalibrated : Comparison
        Comparison with the first record, to which the model is fitted.
    before, after : Comparison
        Comparisons of the nominal and the recalibrated model with the validation record.
    diagnosis : DiagnosisResult
        Diagnosis of the record with a hidden effect.
    saturation : float
        Charge in C at which the strain of that effect saturates.
    """

    runs: Sequence[ThesisRun]
    truth: RigParameters
    recalibrated: Comparison
    before: Comparison
    after: Comparison
    diagnosis: DiagnosisResult
    saturation: float


def write(folder: Path, results: DemoResults) -> Path:
    """Write the report into the folder of the pictures.

    Parameters
    ----------
    folder : Path
        Folder with ``diagnosis.png`` and ``compare.png``.
    results : DemoResults

    Returns
    -------
    Path
        ``report.html``.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    page = Page(
        "What a diagnosis and a recalibration gain",
        f"An effect was hidden, and this was found: {results.diagnosis.sentence}",
    )
    _cause(page, folder, results)
    _recalibration(page, folder, results)
    _thesis(page, results.runs)
    _how_to_reproduce(page, results)
    page.write(folder / "report.html")
    return folder / "report.html"


def _cause(page: Page, folder: Path, results: DemoResults) -> None:
    page.heading("A cause found")
    page.text(
        f"An emulated rig whose films stop growing around a charge of {results.saturation:g} C, in"
        " a form of its own. No model was told: the simulation was held against what the"
        " instruments show. All parameters were refitted first; errors are of the last third of the"
        " record, which no fit has seen."
    )
    page.picture(
        folder / "diagnosis.png",
        "The part held out of the output whose error falls most, above the residuals.",
    )
    page.text(
        Markup('<a href="diagnosis.html">The whole diagnosis</a>: evidence, parameters, residuals.')
    )


def _recalibration(page: Page, folder: Path, results: DemoResults) -> None:
    first = results.recalibrated
    before = results.before
    after = results.after
    gains = ", ".join(
        f"{name} from {before.before[name].fit_percent:.1f} % to {judged.fit_percent:.1f} %"
        for name, judged in after.before.items()
    )
    page.heading("Parameters off nominal, recalibrated")
    page.text(
        f"Another record, with nothing hidden. On data it has not seen, the fit rises: {gains}."
    )
    page.text(
        "Ten minutes at 10 Hz from an emulated rig: own equations, own integrator, instrument"
        f" noise of {units.convert(EmulatedRig.voltage_noise, 'V', 'mV'):g} mV and"
        f" {units.convert(EmulatedRig.displacement_noise, 'm', 'um'):g} µm, and parameters that"
        " differ from nominal. The model sees only the CSV file."
    )
    page.picture(
        folder / "compare.png",
        "Record, nominal and recalibrated simulation, each output above its residual.",
    )
    page.heading("Parameters")
    columns = ["parameter", "nominal", "fitted", "95 % from", "to", "the rig's own", "inside"]
    page.table(columns, _parameters(first, results.truth))
    page.text(
        "A 95 % interval misses the truth once in twenty; of eight, one or more miss in a third of"
        " all records."
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
            agreement = (
                f"Python and native FMU differ by at most {run.difference:.1e} of the largest"
                " value."
            )
        page.picture(run.picture, f"{run.title}. {agreement}")


def _how_to_reproduce(page: Page, results: DemoResults) -> None:
    fit = results.recalibrated.fit
    page.heading("How to reproduce")
    page.code(
        [
            "ppy demo",
            "ppy diagnose hidden.csv --report diagnosis.html",
            (
                "ppy compare record.csv --model ppy_actuator --fit"
                f" {','.join(fit.estimates if fit else ())} --plot compare.png"
            ),
        ]
    )


def _parameters(comparison: Comparison, truth: RigParameters) -> list[list[str]]:
    own = asdict(truth)
    rows = []
    for name, estimate in comparison.fit.estimates.items() if comparison.fit else ():
        signal = comparison.model.parameters[name]
        low, high = estimate.interval
        values = (estimate.nominal, estimate.value, low, high, own[name])
        texts = [format_value(value, signal, _DIGITS) for value in values]
        rows.append([name, *texts, "yes" if low <= own[name] <= high else "no"])
    return rows


def _outputs(
    label: str,
    comparison: Comparison,
    before: Mapping[str, work.GoodnessOfFit],
    after: Mapping[str, work.GoodnessOfFit],
) -> list[list[str]]:
    rows = []
    for name, first in before.items():
        last = after[name]
        signal = comparison.model.outputs[name]
        white = last.whiteness.summary() if last.whiteness else "too short to judge"
        fits = [f"{goodness.fit_percent:.1f} %" for goodness in (first, last)]
        errors = [format_difference(goodness.rms, signal, _DIGITS) for goodness in (first, last)]
        rows.append([label, name, *fits, *errors, white])
    return rows
