"""Results of an experiment as a sentence, a table of extremes, a picture, a page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import xarray

from fmus.kit.arrays import Array
from fmus.kit.storage import scratch
from orchestration.experiment import results, work_loop
from orchestration.experiment.model import WorkLoopTable
from orchestration.reporting import Page, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.experiment.work_loop import TrackedLoop

_MOST_PANELS = 16  # more in one picture are not looked at
CYCLE_COLUMNS = (
    "run",
    "cycle",
    "error, rms",
    "work taken up",
    "electrical energy",
    "largest current",
    "largest voltage",
)


def state(data: xarray.Dataset) -> str:
    """Say in a sentence what was run and whether it came to its end."""
    last = float(data.time[-1])
    whole = float(data.attrs["duration"])
    reached = f"{whole:g} s" if data.attrs["complete"] else f"incomplete, {last:g} s of {whole:g} s"
    return f"{data.attrs['subject']}: {data.time.size} points, {reached}"


def pace(data: xarray.Dataset) -> str:
    """Say in a sentence how well a run in real time kept pace."""
    about = data.attrs
    late = f"the latest by {1e3 * about['worst_lag']:.3g} ms at {about['worst_lag_at']:g} s"
    return (
        f"real time: {about['missed_deadlines']} of {about['deadlines']} deadlines missed, {late}"
    )


def figure(data: xarray.Dataset) -> Figure:
    """Draw every signal in display units, over time or over the signal that it names.

    Variants share a panel. A work loop has a picture of its own.
    """
    title = data.attrs["title"] + ("" if data.attrs["complete"] else " (incomplete)")
    loops = _tracked(data)
    if loops:
        return work_loop.picture(loops, title)
    over = data.attrs["over"]
    signals = _variants_of_signals(data)
    names = list(signals)[:_MOST_PANELS]
    drawn, panels = pictures.panels(max(1, len(names)), title)
    across, unit = results.displayed(data[over])
    for panel, name in zip(panels, names, strict=False):
        for variant in signals[name]:
            _draw_signal(panel, across, data[variant], over)
        pictures.fit_values(panel, data[signals[name][0]].attrs.get("type") == "boolean")
        pictures.label(panel, name, results.displayed(data[signals[name][0]])[1])
    panels[-1].set_xlabel(over.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"))
    return drawn


def _variants_of_signals(data: xarray.Dataset) -> dict[str, list[str]]:
    """Return by signal the names under which it is in a result; more than one of variants."""
    signals: dict[str, list[str]] = {}
    for name, array in data.items():
        if name != data.attrs["over"]:
            signals.setdefault(array.attrs.get("signal", name), []).append(str(name))
    return signals


def _draw_signal(panel: Axes, across: Array, signal: xarray.DataArray, over: str) -> None:
    """Draw a signal, with its name if it is that of a variant."""
    held = signal.role == "input" and over == "time"
    values, _ = results.displayed(signal)
    variant = signal.attrs.get("variant")
    panel.plot(
        across,
        values,
        color=None if variant else pictures.MODEL,
        drawstyle="steps-post" if held else "default",
        label=variant and pictures.plain(variant),
    )
    if variant:
        panel.legend(fontsize=8)


def _caption(data: xarray.Dataset) -> str:
    """Return the words under the picture of a result."""
    if _tracked(data):
        return "Last cycle of each run, the thesis's loop, and figures of every cycle."
    count = len(_variants_of_signals(data))
    more = f" (the first {_MOST_PANELS} of {count})" if count > _MOST_PANELS else ""
    return f"inputs and recorded outputs{more}"


def _tracked(data: xarray.Dataset) -> dict[str, TrackedLoop]:
    """Return the loops of an experiment on one, as far as whole cycles were run."""
    table = json.loads(data.attrs["experiment"]).get("work_loop")
    if table is None or data.time[-1] < table["period"]:
        return {}
    return work_loop.tracked_loops(data, WorkLoopTable(**table))


def cycles(data: xarray.Dataset) -> list[tuple[str, ...]]:
    """Return the figures of each cycle of a work loop as texts with units; none if it is no loop.

    Returns
    -------
    list of tuple of str
        As `CYCLE_COLUMNS` has them.
    """
    return [
        (
            variant,
            str(number),
            f"{1e6 * cycle.error:.3g} um",
            f"{1e6 * cycle.work:.4g} uJ",
            f"{cycle.electrical_energy:.3g} J",
            f"{cycle.largest_current:.3g} A",
            f"{cycle.largest_voltage:.3g} V",
        )
        for variant, loop in _tracked(data).items()
        for number, cycle in enumerate(loop.cycles(), start=1)
    ]


def plot(data: xarray.Dataset, path: Path) -> None:
    """Write a picture, or a page with one if the name ends in ``.html``.

    Raises
    ------
    UserError
        If the file cannot be written, or the ending is no picture format.
    """
    if path.suffix.lower() == ".html":
        page(data, path)
    else:
        pictures.save(figure(data), path)


def extremes(data: xarray.Dataset) -> list[tuple[str, ...]]:
    """Return name, smallest, largest and last value of every signal as texts with units."""
    rows = []
    for name in data:
        values, unit = results.displayed(data[name])
        texts = (
            f"{x:.6g}" + ("" if unit == "1" else f" {unit}")
            for x in (values.min(), values.max(), values[-1])
        )
        rows.append((str(name), *texts))
    return rows


def page(data: xarray.Dataset, path: Path) -> None:
    """Write one page: what was run, how, the picture, the figures.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    about = data.attrs
    made = Page(about["title"], state(data))
    if about["source"]:
        made.text(about["source"])
    with scratch.folder("page") as folder:
        picture = folder / "signals.png"
        pictures.save(figure(data), picture)
        made.picture(picture, _caption(data))
    loops = cycles(data)
    if loops:
        made.heading("Cycles")
        made.table(CYCLE_COLUMNS, loops)
    made.heading("Signals")
    meanings = {str(name): array.long_name for name, array in data.items()}
    made.table(
        ("signal", "smallest", "largest", "last", "meaning"),
        [(*row, meanings[row[0]]) for row in extremes(data)],
    )
    made.heading("Parameters that were set")
    parameters = json.loads(about["parameters"])
    if parameters:
        made.table(("parameter", "value"), [(name, value) for name, value in parameters.items()])
    else:
        made.text("None: every parameter has its default.")
    made.heading("How")
    master = json.loads(about["experiment"]).get("master", {})
    made.items(
        [
            f"step {about['step']:g} s, {about['runtime']} build, seed {about['seed']}",
            *(f"{key}: {value}" for key, value in master.items()),
            *([pace(data)] if "deadlines" in about else []),
            f"{about['wall_time']:.3g} s of computing, {about['created']}, {about['versions']}",
            *(f"{name}: {guid}" for name, guid in json.loads(about["guids"]).items()),
        ]
    )
    made.heading("The experiment")
    made.code(
        json.dumps(json.loads(about["experiment"]), indent=2, ensure_ascii=False).splitlines()
    )
    made.write(path)
