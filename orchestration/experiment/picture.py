"""Picture of the result of an experiment: a panel for every signal, or a work loop."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.experiment import execution, work_loop
from orchestration.experiment.model import WorkLoopTable
from orchestration.experiment.reading import read
from orchestration.experiment.results import ExperimentResult, displayed
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.experiment.work_loop import Cycle, TrackedLoop

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
        return draw_loops(loops, title)
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


def draw_loops(
    loops: Mapping[str, TrackedLoop],
    title: str = "Work loops: the last cycle, and figures of each",
) -> Figure:
    """Draw the last cycle of loops, the loop of fig. 5-9, and error, work and energy of all cycles.

    Parameters
    ----------
    loops : Mapping of str to TrackedLoop
        By mode, with the same reference.
    title : str, optional
    """
    figure, axes = pictures.mosaic(
        [["loop", "thesis"], ["loop", "thesis"], ["error", "energy"], ["work", "energy"]], title
    )
    _draw_thesis_loop(axes["thesis"])
    reference = next(iter(loops.values())).loop
    closed = np.append(np.arange(reference.length.size), 0)
    axes["loop"].plot(
        1e3 * reference.length[closed], reference.force[closed], "k--", label="reference"
    )
    for mode, tracked in loops.items():
        last = tracked.time >= tracked.time[-1] - tracked.loop.period
        force = tracked.loop.force_at(tracked.time[last])
        axes["loop"].plot(1e3 * tracked.length[last], force, label=mode)
        _draw_cycles([axes[name] for name in ("error", "work", "energy")], tracked.cycles())
    axes["loop"].set_xlabel("length [mm]")
    axes["loop"].legend(fontsize=8)
    pictures.logarithmic_values(axes["error"])
    pictures.label(axes["loop"], "force", "N")
    pictures.label(axes["error"], "error, rms", "um")
    pictures.label(axes["work"], "work taken up", "uJ")
    pictures.label(axes["energy"], "electrical energy", "J")
    return figure


def _draw_thesis_loop(axis: Axes) -> None:
    """Draw the experiment of fig. 5-9 with and without its current, as it is printed."""
    for name, settings in {"with current": [], "without": ["inputs.current.amplitude=0"]}.items():
        result = execution.run(read("fig_5_9", settings))
        force = result["tension"].values
        axis.plot(1e3 * result["length_change"].values, force, label=f"fig. 5-9, {name}")
    axis.set_xlabel("length change [mm]")
    axis.legend(fontsize=8)
    pictures.label(axis, "tension", "N")


def _draw_cycles(axes: Sequence[Any], cycles: Sequence[Cycle]) -> None:
    """Draw error, work and electrical energy of a mode over the cycles."""
    numbers = np.arange(1, len(cycles) + 1)
    (line,) = axes[0].plot(numbers, [1e6 * cycle.error for cycle in cycles], "o-")
    about_rest = [1e6 * cycle.error_about_rest for cycle in cycles]
    axes[0].plot(numbers, about_rest, ":", color=line.get_color())
    axes[1].plot(numbers, [1e6 * cycle.work for cycle in cycles], "o-")
    axes[2].plot(numbers, [cycle.electrical_energy for cycle in cycles], "o-")
    for axis in axes:
        axis.set_xlabel("cycle")
        pictures.whole_numbers(axis)
