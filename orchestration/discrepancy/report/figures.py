"""The figures of a report: a record and its simulations over time, and what the residual looks like.

The spectrum is of the residual itself, beside the estimated noise; the autocorrelation is of what remains once the
colour of that noise is taken off. Both have the band in which 99 % of noise would be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.stats import chi2, norm

from fmus.kit import units
from fmus.kit.units import shown, unit_of_differences
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.report.typography import pretty
from orchestration.discrepancy.residuals.spectrum import (
    flattening_gain,
    flattening_pole,
    local_level,
)
from orchestration.fmu.model import Model
from orchestration.identify.metrics import rms
from orchestration.identify.noise.model import Noise
from orchestration.reporting import pictures
from orchestration.reporting.page import Markup, escaped
from orchestration.reporting.plots import MOST, Boundary, Panel, Trace, stacked

Array = NDArray[np.float64]
NOMINAL, REFITTED, EXTENDED = "nominal", "refitted", "extended"
COLOURS = {NOMINAL: "#7fb0d0", REFITTED: pictures.MODEL, EXTENDED: pictures.FITTED}
_HOURS = 7200.0  # seconds beyond which time is told in hours
_SPREAD = (
    1000.0  # longest over shortest step from which on time is drawn logarithmic, as in creep tests
)
_OVER, _RESIDUAL, _INPUT, _SIDE = 190, 110, 56, 210  # heights of panels, pixels
_PIECES = 8  # into which a residual is cut for its spectrum, half overlapping; more if it is long
_LONGEST_PIECE = 4096
_OVERLAP = (
    1.0 / 36.0
)  # squared correlation of two neighbouring pieces, half overlapping, under Hann's window
_NEIGHBOURS = 41  # frequencies that tell how strong the noise is about one of them
_LAGS = 40
_LEAST = 0.25  # autocorrelation that is always shown, so that small ones look small
_LONGEST = 36  # characters of a name above a panel, which must fit on a phone
_TAIL = 0.005  # on either side of a band
_FAR = 10.0  # times the residual of the best model, beyond which one hides what matters
_CLOSER = 8  # part of what is held out that is looked at closely


@dataclass(frozen=True)
class ShownModel:
    """A model that is shown beside the measurement.

    Attributes
    ----------
    label : {"nominal", "refitted", "extended"}
        With the values it came with; with all of them fitted; with the named effects laid over it too.
    model : FittedCandidate
    """

    label: str
    model: FittedCandidate

    @property
    def colour(self) -> str:
        """That of all its lines."""
        return COLOURS[self.label]


def over_time(
    model: Model,
    data: Dataset,
    runs: Sequence[ShownModel],
    simulated: Mapping[str, Mapping[str, Array]],
    parts: tuple[int, str, str] | None,
) -> tuple[dict[str, Any], str, dict[str, list[float] | None]]:
    """Measured and simulated outputs, what is between them, and the inputs, above one time axis.

    Parameters
    ----------
    model : Model
        For units.
    data : Dataset
    runs : sequence of ShownModel
    simulated : Mapping
        Outputs, SI, by the label of the run and the name.
    parts : tuple of int, str and str, or None
        The sample at which a second part begins, and what the two are.

    Returns
    -------
    figure : dict
    caption : str
    views : dict of str to range of the time axis
    """
    time, unit = readable(data.time)
    between = ~data.within  # runs, where nothing is drawn
    steps = np.diff(time)
    logarithmic = bool(steps.max() > _SPREAD * steps.min())
    panels, held = [], []
    for output, y in data.measured.items():
        signal = model.outputs[output]
        over, residuals = (
            [
                Trace(
                    "measured",
                    time,
                    _display(y, signal),
                    {"color": pictures.MEASURED, "width": 3.5},
                )
            ],
            [],
        )
        for run in runs:
            values = np.where(between, np.nan, simulated[run.label][output])
            style = {"color": run.colour, "width": 1.5}
            nominal = run.label == NOMINAL
            residual = y - values
            style |= {"dash": "dot"} if nominal else {}
            # beside an effect the nominal model is there to be switched on: it may be far off, and hides what matters
            hidden = {"visible": "legendonly"}
            over.append(
                Trace(
                    run.label,
                    time,
                    _display(values, signal),
                    style,
                    hidden if nominal and len(runs) > 2 else {},
                )
            )
            far = nominal and (
                len(runs) > 2 or rms(residual) > _FAR * rms(y - simulated[runs[-1].label][output])
            )
            residual = units.convert(residual, signal.unit, unit_of_differences(signal))
            residuals.append(
                Trace(
                    run.label,
                    time,
                    residual,
                    {"color": run.colour, "width": 1},
                    hidden if far else {},
                )
            )
        panels += [Panel(_titled(output, signal.display), _OVER, over)]
        panels += [
            Panel(
                _titled("measured − simulated", unit_of_differences(signal)), _RESIDUAL, residuals
            )
        ]
    for name, values in data.inputs.items():
        signal = model.inputs[name]
        line = Trace(
            "",
            time,
            _display(np.where(between, np.nan, values), signal),
            {"color": "#4a5763", "width": 1, "shape": "hv"},
        )
        if np.ptp(values) > 0.0:
            panels.append(Panel(_titled(name, signal.display), _INPUT, [line]))
        else:
            held.append(f"{name} stays at {shown(values[0], signal)}")
    caption = "Drag to zoom, double-click to see all again; click a name to hide it or to show it."
    caption += f" {'; '.join(held)}." if held else ""
    caption += (
        " Records are drawn one after the other; each begins at its mark." if data.several else ""
    )
    if len(time) > MOST:
        caption += f" Of {-(-2 * len(time) // MOST)} samples in a row, the smallest and the largest are drawn."
    views: dict[str, list[float] | None] = {}
    boundary = None
    if parts:
        first, before, after = parts
        boundary = Boundary(float(time[first]), before, after)
        views["whole record"] = None
        for text, last in (
            (after, len(time) - 1),
            (f"{after}, closer", first + (len(time) - first) // _CLOSER),
        ):
            ends = time[[first, last]]
            views[text] = (np.log10(ends) if logarithmic else ends).tolist()
    starts = [(float(time[run.first]), run.label) for run in data.several]
    return stacked(panels, f"time [{unit}]", logarithmic, boundary, starts), caption, views


def of_residual(
    unit: tuple[str, str],
    step: float,
    present: NDArray[np.bool_],
    noise: Noise,
    runs: Sequence[ShownModel],
    output: str,
    lines: Sequence[float],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Spectra of residuals, and autocorrelations of what the noise leaves of them.

    Parameters
    ----------
    unit : tuple of str
        Of the residuals, and the one to show.
    step : float
        Seconds between samples.
    present : ndarray of bool, shape (n,)
        Where something was measured; m of them.
    noise : Noise
        Of the best model.
    runs : sequence of ShownModel
        The best one last.
    output : str
    lines : sequence of float
        Frequencies to be marked, Hz.

    Returns
    -------
    spectra, correlations : dict
        Figures.
    """
    across, along = [], []
    count = 1
    for run in runs:
        residual = units.convert(run.model.fit.residual[output], *unit)
        line = {"color": run.colour, "width": 1.5}
        frequency, density = spectrum(residual, step)
        across.append(Trace(run.label, frequency, density, line))
        white = noise.whiten(residual, present)
        count = len(white)
        values = autocorrelation(white)
        dots = {"mode": "lines+markers", "marker": {"size": 4, "color": run.colour}}
        along.append(Trace(run.label, np.arange(1.0, 1.0 + len(values)), values, line, dots))
    # the last one is the best; its spectrum tells the noise
    ends = band(residual, frequency, density, step)
    filled = {"fill": "tonexty", "fillcolor": "rgba(154,165,175,0.3)", "hoverinfo": "skip"}
    none = {"width": 0, "color": "#9aa5af"}
    noisy = [
        Trace("", frequency, ends[0], none, {"hoverinfo": "skip"}),
        Trace("99 % of such noise", frequency, ends[1], none, filled),
    ]
    extremes = [1.1 * float(pick(trace.y)) for trace in along for pick in (np.min, np.max)]
    span = (min(*extremes, -_LEAST), max(*extremes, _LEAST))
    within = float(norm.ppf(1.0 - _TAIL)) / np.sqrt(count)
    marks = [(frequency, f"{frequency:.3g} Hz") for frequency in lines]
    density_panel = Panel(
        _titled("density", f"{unit[1]}/√Hz"), _SIDE, noisy + across, logarithmic=True
    )
    correlation = Panel(
        "autocorrelation, whitened", _SIDE, along, band=(-within, within), span=span
    )
    return stacked([density_panel], "frequency [Hz]", True, marks=marks), stacked(
        [correlation], "lag [samples]"
    )


def spectrum(residual: Array, step: float) -> tuple[Array, Array]:
    """Frequency (Hz) and amplitude density (unit of the residual per root Hz), each (m,); without the mean."""
    frequency, power = welch(residual, 1.0 / step, nperseg=_piece(len(residual)))
    return frequency[1:-1], np.sqrt(power[1:-1])


def _piece(samples: int) -> int:
    """Length of the pieces into which a residual is cut for its spectrum."""
    return min(2 * samples // (_PIECES + 1), _LONGEST_PIECE)


def band(residual: Array, frequency: Array, density: Array, step: float) -> tuple[Array, Array]:
    """Range in which 99 % of the spectra of noise like this are, at each frequency by itself.

    How strong the noise is, a running median of the spectrum tells, which a line does not move; one real pole levels
    red noise before.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    frequency, density : ndarray, shape (m,)
        Its spectrum.
    step : float

    Returns
    -------
    low, high : ndarray, shape (m,)
    """
    gain = flattening_gain(flattening_pole(residual), frequency, step) ** 2
    half = _piece(len(residual)) // 2
    pieces = len(residual) // half - 1
    freedom = 2.0 * pieces / (1.0 + 2.0 * (1.0 - 1.0 / pieces) * _OVERLAP)
    low, middle, high = (float(chi2.ppf(share, freedom)) for share in (_TAIL, 0.5, 1.0 - _TAIL))
    level = local_level(density**2 * gain, _NEIGHBOURS) / gain
    return np.sqrt(level * low / middle), np.sqrt(level * high / middle)


def autocorrelation(innovation: Array) -> Array:
    """Autocorrelation at lags from 1 to 40, or to a quarter of the samples if that is less."""
    centred = innovation - innovation.mean()
    lags = range(1, min(_LAGS, len(innovation) // 4) + 1)
    return np.array([centred[k:] @ centred[:-k] for k in lags]) / (float(centred @ centred) or 1.0)


def readable(time: Array) -> tuple[Array, str]:
    """Time in hours if it is long, and the unit."""
    unit = "h" if time[-1] - time[0] > _HOURS else "s"
    return units.convert(time, "s", unit), unit


def _display(values: Array, signal: Any) -> Array:
    shown_values: Array = units.convert(values, signal.unit, signal.display)
    return shown_values


def _titled(name: str, unit: str) -> Markup:
    half = (_LONGEST - 1) // 2
    text = name.replace("_", " ")
    text = text if len(text) <= _LONGEST else f"{text[:half]}…{text[-half:]}"
    return escaped(text) if unit == "1" else Markup(f"{escaped(text)} [{pretty(unit)}]")
