"""Charts of a report: a record with its simulations over time, and residuals.

The spectrum is of the residual itself, beside the estimated noise; the autocorrelation is of what
remains once the colour of that noise is taken off. Both have the band in which 99 % of noise would
be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from fmus.kit import units
from fmus.kit.arrays import Array, Mask
from fmus.kit.titles import capitalised, in_words
from fmus.kit.units import format_value, unit_of_differences
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.report.wording import EXTENDED, NOMINAL, REFITTED
from orchestration.discrepancy.residuals import flattening_gain, flattening_pole, spectral_level
from orchestration.fmu import Model
from orchestration.identify import chi_squared_quantile
from orchestration.identify.noise import Noise
from orchestration.reporting import pictures
from orchestration.reporting.html import (
    MOST,
    Boundary,
    Markup,
    Panel,
    Trace,
    escaped,
    format_quantities,
    stacked,
)

COLOURS = {NOMINAL: "#7fb0d0", REFITTED: pictures.MODEL, EXTENDED: pictures.FITTED}
_HOURS = 7200.0  # seconds from which on time is shown in hours
# ratio of the longest to the shortest step from which on time is drawn logarithmic, as in creep
# tests
_SPREAD = 1000.0
_OUTPUT_HEIGHT = 190  # pixels, as all heights
_RESIDUAL_HEIGHT = 110
_INPUT_HEIGHT = 56
_NOISE_HEIGHT = 210  # of spectrum and autocorrelation
_PIECES = 8  # into which a residual is cut for its spectrum, half overlapping; more if it is long
_LONGEST_PIECE = 4096
# squared correlation of two neighbouring pieces, half overlapping, under Hann's window
_OVERLAP = 1.0 / 36.0
_NEIGHBOURS = 41  # frequencies that tell how strong the noise is about one of them
_LAGS = 40
_LEAST_SPAN = 0.25  # autocorrelation that is always shown, so that small ones look small
_LONGEST_TITLE = 36  # characters of a name above a panel, which must fit on a phone
_TAIL = 0.005  # probability on either side of a band
_CLOSER = 8  # part of what is held out that is looked at closely
_FEWEST = 50  # samples of it that are worth a chart of their own


@dataclass(frozen=True)
class ShownModel:
    """A model that is shown beside the measurement.

    Attributes
    ----------
    label : {"as it is", "parameters refitted", "with the effect"}
        With the values it came with; with all of them fitted; with the named effects laid over it
        too.
    model : FittedCandidate
    """

    label: str
    model: FittedCandidate

    @property
    def colour(self) -> str:
        """Colour of all its lines."""
        return COLOURS[self.label]


@dataclass(frozen=True)
class SimulatedModel(ShownModel):
    """A model that is shown, and its outputs over the record that it is shown beside.

    Attributes
    ----------
    simulated : Mapping of str to ndarray, shape (n,)
        SI.
    """

    simulated: Mapping[str, Array]

    def where(self, mask: Mask) -> SimulatedModel:
        """Return the model with its outputs at some of the samples."""
        return replace(self, simulated={o: values[mask] for o, values in self.simulated.items()})


class Parts(NamedTuple):
    """The two parts of a record.

    Attributes
    ----------
    boundary : int
        Sample at which the second begins.
    before, after : str
        What they are.
    """

    boundary: int
    before: str
    after: str


class Chart(NamedTuple):
    """A chart of a page, and the words below it."""

    drawn: Markup
    caption: str


def plot_over_time(
    model: Model,
    data: Dataset,
    models: Sequence[SimulatedModel],
    parts: Parts | None = None,
) -> Chart:
    """Draw measured and simulated outputs, their difference, and the inputs above one time axis.

    Parameters
    ----------
    model : Model
        For units.
    data : Dataset
    models : sequence of SimulatedModel
    parts : Parts, optional
    """
    time, unit = readable_time(data.time)
    steps = np.diff(time)
    is_logarithmic = bool(steps.max() > _SPREAD * steps.min())
    panels = []
    for output in data.measured:
        panels.append(_output_panel(model, data, models, output))
        panels.append(_residual_panel(model, data, models, output))
    panels += _input_panels(model, data)
    boundary = None
    if parts is not None:
        boundary = Boundary(float(time[parts.boundary]), parts.before, parts.after)
    starts = [(float(time[run.first]), run.label) for run in data.several]
    drawn = stacked(panels, f"time [{unit}]", is_logarithmic, boundary, starts)
    return Chart(drawn, _caption(model, data))


def plot_closer(
    model: Model,
    data: Dataset,
    models: Sequence[SimulatedModel],
    boundary: int,
) -> Chart | None:
    """Draw the beginning of what follows a boundary, in which single samples can be told apart.

    Parameters
    ----------
    model, data, models
        See `plot_over_time`.
    boundary : int
        First sample that is shown.

    Returns
    -------
    Chart or None
        None where so few samples follow that the whole shows them.
    """
    count = (len(data.time) - boundary) // _CLOSER
    if count < _FEWEST or data.several:
        return None
    window = np.arange(len(data.time))
    near = (window >= boundary) & (window < boundary + count)
    part = [shown.where(near) for shown in models]
    drawn, _ = plot_over_time(model, data.where(near), part)
    return Chart(drawn, f"The first {count} samples of that, closer.")


def _output_panel(
    model: Model, data: Dataset, models: Sequence[SimulatedModel], output: str
) -> Panel:
    """Draw an output as it was measured, and as every model simulates it."""
    time, _ = readable_time(data.time)
    signal = model.outputs[output]
    measured = in_display_unit(data.measured[output], signal)
    traces = [Trace("measured", time, measured, pictures.MEASURED, 3.5)]
    for shown_model in models:
        values = _within_runs(data, shown_model.simulated[output])
        traces.append(_line(shown_model, time, in_display_unit(values, signal)))
    return Panel(_panel_title(output, signal.display), _OUTPUT_HEIGHT, traces)


def _residual_panel(
    model: Model, data: Dataset, models: Sequence[SimulatedModel], output: str
) -> Panel:
    """Draw the difference between the measurement and every model."""
    time, _ = readable_time(data.time)
    signal = model.outputs[output]
    unit = unit_of_differences(signal)
    y = data.measured[output]
    traces = []
    for shown_model in models:
        residual = y - _within_runs(data, shown_model.simulated[output])
        traces.append(_line(shown_model, time, units.convert(residual, signal.unit, unit)))
    return Panel(_panel_title("measured − simulated", unit), _RESIDUAL_HEIGHT, traces)


def _line(shown: ShownModel, time: Array, values: Array) -> Trace:
    """Return the line of a model; the nominal one may be far off, and must not hide the others."""
    is_nominal = shown.label == NOMINAL
    return Trace(
        shown.label, time, values, shown.colour, dashed=is_nominal, makes_room=not is_nominal
    )


def _input_panels(model: Model, data: Dataset) -> list[Panel]:
    """Draw every input that moves."""
    time, _ = readable_time(data.time)
    panels = []
    for name, values in data.inputs.items():
        if np.ptp(values) > 0.0:
            signal = model.inputs[name]
            shown = in_display_unit(_within_runs(data, values), signal)
            line = Trace("", time, shown, "#4a5763", 1.0, stepped=True)
            panels.append(Panel(_panel_title(name, signal.display), _INPUT_HEIGHT, [line]))
    return panels


def _within_runs(data: Dataset, values: Array) -> Array:
    """Return values with NaN between runs, where nothing is drawn."""
    return np.where(~data.within, np.nan, values)


def _caption(model: Model, data: Dataset) -> str:
    """Return which inputs stay constant, and how the record was thinned out."""
    caption = "Above the outputs, below each what the models leave, then the inputs that move."
    constant = [
        f"{in_words(name)} stays at {format_value(values[0], model.inputs[name])}"
        for name, values in data.inputs.items()
        if not np.ptp(values) > 0.0
    ]
    if constant:
        caption += f" {capitalised('; '.join(constant))}."
    if data.several:
        caption += " Records are drawn one after the other; each begins at its mark."
    samples = len(data.time)
    if samples > MOST:
        caption += (
            f" Of {-(-2 * samples // MOST)} samples in a row, the smallest and the largest are"
            " drawn."
        )
    return caption


@dataclass(frozen=True)
class ShownResidual:
    """The residual of an output under one model.

    Attributes
    ----------
    label, colour : str
        Of the model.
    values : ndarray, shape (n,)
        In the unit it is shown in.
    """

    label: str
    colour: str
    values: Array


def shown_residuals(
    models: Sequence[ShownModel], output: str, unit: str, display: str
) -> list[ShownResidual]:
    """Return the residuals of an output, where the models were fitted.

    Parameters
    ----------
    models : sequence of ShownModel
    output : str
    unit, display : str
        Unit of the residuals, and the one to show.
    """
    residuals = []
    for shown_model in models:
        values = units.convert(shown_model.model.fit.residual[output], unit, display)
        residuals.append(ShownResidual(shown_model.label, shown_model.colour, values))
    return residuals


def plot_spectra(
    residuals: Sequence[ShownResidual], step: float, unit: str, lines: Sequence[float]
) -> Markup:
    """Draw amplitude spectra of residuals.

    Parameters
    ----------
    residuals : sequence of ShownResidual
        That of the best model last; its spectrum tells the noise.
    step : float
        Seconds between samples.
    unit : str
        Of the residuals.
    lines : sequence of float
        Frequencies to be marked, Hz.
    """
    traces = []
    for residual in residuals:
        frequency, density = amplitude_spectrum(residual.values, step)
        traces.append(Trace(residual.label, frequency, density, residual.colour))
    best, best_spectrum = residuals[-1], traces[-1]
    low, high = noise_band(best.values, best_spectrum.x, best_spectrum.y, step)
    band = Trace("99 % of such noise", best_spectrum.x, high, "#d9dde1", low=low)
    title = _panel_title("density", f"{unit}/√Hz")
    panel = Panel(title, _NOISE_HEIGHT, [band, *traces], logarithmic=True)
    marks = [(frequency, f"{frequency:.3g} Hz") for frequency in lines]
    return stacked([panel], "frequency [Hz]", True, marks=marks)


def plot_autocorrelations(
    residuals: Sequence[ShownResidual], present: Mask, noise: Noise
) -> Markup:
    """Draw autocorrelations of residuals, once the colour of the noise is taken off.

    Parameters
    ----------
    residuals : sequence of ShownResidual
        That of the best model last.
    present : ndarray of bool, shape (n,)
        Where something was measured.
    noise : Noise
        Of the best model.
    """
    traces = []
    count = 1
    for residual in residuals:
        white = noise.whiten(residual.values, present)
        count = len(white)
        values = autocorrelation(white)
        lags = np.arange(1.0, 1.0 + len(values))
        traces.append(Trace(residual.label, lags, values, residual.colour))
    extremes = [1.1 * float(pick(trace.y)) for trace in traces for pick in (np.min, np.max)]
    span = (min(*extremes, -_LEAST_SPAN), max(*extremes, _LEAST_SPAN))
    within = float(ndtri(1.0 - _TAIL)) / np.sqrt(count)
    panel = Panel(
        "autocorrelation, whitened", _NOISE_HEIGHT, traces, band=(-within, within), span=span
    )
    return stacked([panel], "lag [samples]")


def amplitude_spectrum(residual: Array, step: float) -> tuple[Array, Array]:
    """Estimate the amplitude density of a residual by Welch's method, without the mean.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    step : float
        Seconds between samples.

    Returns
    -------
    frequency : ndarray, shape (m,)
        Hz.
    density : ndarray, shape (m,)
        Unit of the residual per root Hz.
    """
    from scipy.signal import welch  # half a second to load, which only a report takes

    frequency, power = welch(residual, 1.0 / step, nperseg=_piece_length(len(residual)))
    return frequency[1:-1], np.sqrt(power[1:-1])


def _piece_length(samples: int) -> int:
    """Return the length of the pieces into which a residual is cut for its spectrum."""
    return min(2 * samples // (_PIECES + 1), _LONGEST_PIECE)


def noise_band(
    residual: Array, frequency: Array, density: Array, step: float
) -> tuple[Array, Array]:
    """Estimate the range in which 99 % of the spectra of such noise are, at each frequency.

    How strong the noise is, a running median of the spectrum tells, which a line does not move; one
    real pole levels red noise before.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    frequency, density : ndarray, shape (m,)
        Its spectrum.
    step : float
        Seconds between samples.

    Returns
    -------
    low, high : ndarray, shape (m,)
    """
    gain = flattening_gain(flattening_pole(residual), frequency, step) ** 2
    half = _piece_length(len(residual)) // 2
    pieces = len(residual) // half - 1
    freedom = 2.0 * pieces / (1.0 + 2.0 * (1.0 - 1.0 / pieces) * _OVERLAP)
    low, middle, high = (
        chi_squared_quantile(share, freedom) for share in (_TAIL, 0.5, 1.0 - _TAIL)
    )
    level = spectral_level(density**2 * gain, _NEIGHBOURS) / gain
    return np.sqrt(level * low / middle), np.sqrt(level * high / middle)


def autocorrelation(innovation: Array) -> Array:
    """Return the autocorrelation at lags from 1 to 40, or to a quarter of the samples if less.

    Parameters
    ----------
    innovation : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (m,)
        Zero throughout if the innovation is constant.
    """
    centred = innovation - innovation.mean()
    lags = range(1, min(_LAGS, len(innovation) // 4) + 1)
    return np.array([centred[k:] @ centred[:-k] for k in lags]) / (float(centred @ centred) or 1.0)


def readable_time(time: Array) -> tuple[Array, str]:
    """Return time in hours if it is long, and its unit.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    """
    unit = "h" if time[-1] - time[0] > _HOURS else "s"
    return units.convert(time, "s", unit), unit


def in_display_unit(values: Array, signal: Any) -> Array:
    """Return values of a signal in the unit it is shown in."""
    converted: Array = units.convert(values, signal.unit, signal.display)
    return converted


def _panel_title(name: str, unit: str) -> Markup:
    """Return a name, shortened in its middle if it is long, with its unit."""
    text = name.replace("_", " ")
    if len(text) > _LONGEST_TITLE:
        half = (_LONGEST_TITLE - 1) // 2
        text = f"{text[:half]}…{text[-half:]}"
    return escaped(text) if unit == "1" else Markup(f"{escaped(text)} [{format_quantities(unit)}]")
