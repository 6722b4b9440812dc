"""Picture of the result of an experiment: a panel for every signal, or a work loop."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import xarray

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.experiment import work_loop
from orchestration.experiment.model import WorkLoopTable
from orchestration.experiment.results import ExperimentResult, displayed
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.experiment.work_loop import TrackedLoop

_MOST_PANELS = 16  # more are too small to read


@draw.register(ExperimentResult)
def draw_experiment(data: ExperimentResult) -> Figure:
    """Draw every signal over time, or over the signal that the experiment names.

    Variants of a signal share a panel. A work loop has a picture of its own.

    Raises
    ------
    UserError
        If the data are a part of a result.
    """
    if "experiment" not in data.attrs or "time" not in data.dims:
        raise UserError("this is a part of an experiment, of which there is no picture")
    title = data.attrs["title"] + ("" if data.attrs["complete"] else " (incomplete)")
    loops = tracked(data)
    if loops:
        return work_loop.picture(loops, title)
    over = data.attrs["over"]
    signals = _variants_of_signals(data)
    names = list(signals)[:_MOST_PANELS]
    figure, panels = pictures.panels(max(1, len(names)), title)
    across, unit = displayed(data[over])
    for panel, name in zip(panels, names, strict=False):
        for variant in signals[name]:
            _draw_signal(panel, across, data[variant], over)
        first = data[signals[name][0]]  # all variants have its type and unit
        pictures.fit_values(panel, first.attrs.get("type") == "boolean")
        pictures.label(panel, name, displayed(first)[1])
    panels[-1].set_xlabel(pictures.with_unit(over.replace("_", " "), unit))
    return figure


def _variants_of_signals(data: xarray.Dataset) -> dict[str, list[str]]:
    """Return, for each signal, its names in a result: one for each variant."""
    signals: dict[str, list[str]] = {}
    for name, array in data.items():
        if name != data.attrs["over"]:
            signals.setdefault(array.attrs.get("signal", name), []).append(str(name))
    return signals


def _draw_signal(panel: Axes, across: Array, signal: xarray.DataArray, over: str) -> None:
    """Draw a signal, with a legend if it is of a variant."""
    is_stepped = signal.role == "input" and over == "time"
    values, _ = displayed(signal)
    variant = signal.attrs.get("variant")
    panel.plot(
        across,
        values,
        color=None if variant else pictures.MODEL,
        drawstyle="steps-post" if is_stepped else "default",
        label=variant,
    )
    if variant:
        panel.legend(fontsize=8)


def caption(data: xarray.Dataset) -> str:
    """Return the caption of the picture of a result."""
    if tracked(data):
        return (
            "Last cycle of each run, the thesis's loop, and figures of every cycle; dotted: error"
            " about the rest length."
        )
    count = len(_variants_of_signals(data))
    more = f" (the first {_MOST_PANELS} of {count})" if count > _MOST_PANELS else ""
    return f"inputs and recorded outputs{more}"


def tracked(data: xarray.Dataset) -> dict[str, TrackedLoop]:
    """Return the work loops of a result by variant; none without a table or a whole cycle."""
    table = json.loads(data.attrs["experiment"]).get("work_loop")
    if table is None or data.time[-1] < table["period"]:
        return {}
    return work_loop.tracked_loops(data, WorkLoopTable(**table))
