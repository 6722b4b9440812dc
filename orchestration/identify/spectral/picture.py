"""Bode and Nyquist diagrams of measured frequency responses and those of a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Mask
from orchestration.identify.spectral.response import Interval, Response
from orchestration.identify.spectral.result import FrequencyResponse
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SINGLE = 60  # lines up to which each is drawn by itself
_MARGIN = 1.5  # factor beyond the frequencies, and magnitudes that are seen
_MODEL: dict[str, Any] = {"color": pictures.MODEL, "lw": 1.2, "label": "model"}
_RECORD: dict[str, Any] = {"color": pictures.FITTED, "label": "record, 95 %"}


@draw.register(FrequencyResponse)
def draw_frequency_response(result: FrequencyResponse) -> Figure:
    """Draw Bode and Nyquist diagram of every response with 95 % bands, and the model's."""
    title = f"{result.source} against {result.model}" if result.model else result.source
    return draw_responses([*result.responses.values()], title)


def draw_responses(responses: Sequence[Response], title: str) -> Figure:
    """Draw every response: magnitude above phase, the complex plane to the right."""
    rows = [
        row
        for k in range(len(responses))
        for row in ([f"magnitude {k}", f"plane {k}"], [f"phase {k}", f"plane {k}"])
    ]
    figure, axes = pictures.mosaic(rows, title)
    for k, response in enumerate(responses):
        above = axes[f"magnitude {k}"]
        below = axes[f"phase {k}"]
        every = np.ones(response.frequency.shape, dtype=bool)
        _draw_over_frequency(above, response.frequency, response.magnitude, every)
        _draw_over_frequency(below, response.frequency, response.phase, response.seen)
        if response.model is not None:
            above.plot(response.frequency, np.abs(response.model), **_MODEL)
            turned = np.where(response.seen, response.model_phase, np.nan)
            below.plot(response.frequency, turned, **_MODEL)
        _scale_bode_axes(above, below, response)
        _draw_nyquist(axes[f"plane {k}"], response)
    return figure


def _draw_over_frequency(axis: Axes, frequency: Any, interval: Interval, drawn: Mask) -> None:
    """Draw a quantity with its interval: line by line if they are few, else as a band."""
    axis.set_xscale("log")
    # before anything is drawn, as a single frequency makes no scale of itself
    axis.set_xlim(frequency.min() / _MARGIN, frequency.max() * _MARGIN)
    value, low, high = (np.where(drawn, ends, np.nan) for ends in interval)
    if frequency.size <= _SINGLE:
        ends = [value - low, high - value]
        axis.errorbar(frequency, value, ends, fmt="o", ms=3, lw=1, capsize=2, **_RECORD)
        return
    axis.plot(frequency, value, color=pictures.FITTED, lw=0.8)
    axis.fill_between(frequency, low, high, alpha=0.3, lw=0, **_RECORD)


def _scale_bode_axes(above: Axes, below: Axes, response: Response) -> None:
    """Scale and name the axes of a Bode diagram; points lost in noise do not set the scale."""
    above.set_yscale("log")
    seen = np.abs(response.values[response.seen])
    if seen.size:
        above.set_ylim(seen.min() / _MARGIN, seen.max() * _MARGIN)
    above.sharex(below)
    above.tick_params(labelbottom=False)
    above.set_title(response.name, loc="left")
    pictures.label(above, "magnitude", response.unit)
    pictures.label(below, "phase", "deg")
    below.set_xlabel("frequency [Hz]")
    above.legend(fontsize=8)


def _draw_nyquist(axis: Axes, response: Response) -> None:
    """Draw the complex plane: values that are seen, the circles of their regions, the model."""
    from matplotlib.collections import EllipseCollection

    values = response.values[response.seen]
    widths = 2.0 * response.radius[response.seen]
    axis.plot(values.real, values.imag, "o", ms=3, color=pictures.FITTED)
    circles = EllipseCollection(
        widths,
        widths,
        np.zeros(widths.size),
        units="xy",
        offsets=np.column_stack([values.real, values.imag]),
        offset_transform=axis.transData,
        facecolor="none",
        edgecolor=pictures.FITTED,
        linewidth=0.6,
        alpha=0.5,
    )
    # a large circle is cut off, rather than all others made small
    axis.add_collection(circles, autolim=False)
    if response.model is not None:
        axis.plot(response.model.real, response.model.imag, ".-", ms=3, **_MODEL)
    axis.margins(0.2)
    axis.locator_params(axis="x", nbins=5)
    parts = ("storage", "loss") if response.is_stiffness else ("real part", "imaginary part")
    axis.set_xlabel(pictures.with_unit(parts[0], response.unit))
    axis.set_ylabel(pictures.with_unit(parts[1], response.unit))
    axis.set_aspect("equal", adjustable="datalim")
