"""Results of an experiment as sentences, as tables of figures, and as a page."""

from __future__ import annotations

import json

import xarray

from orchestration.experiment.picture import caption, tracked
from orchestration.experiment.results import ExperimentResult, displayed
from orchestration.reporting import draw, make_page
from orchestration.reporting.html import Page

CYCLE_COLUMNS = (
    "run",
    "cycle",
    "error, rms",
    "about rest length",
    "work taken up",
    "electrical energy",
    "largest current",
    "largest voltage",
)


def state(data: xarray.Dataset) -> str:
    """Return a line with the subject, the number of points and the duration of the run."""
    last = float(data.time[-1])
    whole = float(data.attrs["duration"])
    reached = f"{whole:g} s" if data.attrs["complete"] else f"incomplete, {last:g} s of {whole:g} s"
    return f"{data.attrs['subject']}: {data.time.size} points, {reached}"


def pace(data: xarray.Dataset) -> str:
    """Return a line with the missed deadlines and the largest lag of a run in real time."""
    about = data.attrs
    late = f"the latest by {1e3 * about['worst_lag']:.3g} ms at {about['worst_lag_at']:g} s"
    return (
        f"real time: {about['missed_deadlines']} of {about['deadlines']} deadlines missed, {late}"
    )


def cycles(data: xarray.Dataset) -> list[tuple[str, ...]]:
    """Return the figures of each cycle of work loops as texts with units; an empty list without.

    Returns
    -------
    list of tuple of str
        One row for each cycle, with the columns `CYCLE_COLUMNS`.
    """
    return [
        (
            variant,
            str(number),
            f"{1e6 * cycle.error:.3g} um",
            f"{1e6 * cycle.error_about_rest:.3g} um",
            f"{1e6 * cycle.work:.4g} uJ",
            f"{cycle.electrical_energy:.3g} J",
            f"{cycle.largest_current:.3g} A",
            f"{cycle.largest_voltage:.3g} V",
        )
        for variant, loop in tracked(data).items()
        for number, cycle in enumerate(loop.cycles(), start=1)
    ]


def extremes(data: xarray.Dataset) -> list[tuple[str, ...]]:
    """Return name, smallest, largest and last value of every signal as texts with units."""
    rows = []
    for name in data:
        values, unit = displayed(data[name])
        texts = (
            f"{x:.6g}" + ("" if unit == "1" else f" {unit}")
            for x in (values.min(), values.max(), values[-1])
        )
        rows.append((str(name), *texts))
    return rows


@make_page.register(ExperimentResult)
def experiment_page(data: ExperimentResult, command: str = "") -> Page:
    """Make the page of a result: picture, figures, settings, and the experiment as JSON.

    `command` is not shown, as the experiment repeats the result.
    """
    about = data.attrs
    made = Page(about["title"], state(data))
    if about["source"]:
        made.text(about["source"])
    made.figure(draw(data), caption(data))
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
    experiment = json.loads(about["experiment"])
    made.heading("How")
    made.items(
        [
            f"step {about['step']:g} s, {about['runtime']} build, seed {about['seed']}",
            *(f"{key}: {value}" for key, value in experiment.get("master", {}).items()),
            *([pace(data)] if "deadlines" in about else []),
            f"{about['wall_time']:.3g} s of computing, {about['created']}, {about['versions']}",
            *(f"{name}: {guid}" for name, guid in json.loads(about["guids"]).items()),
        ]
    )
    made.heading("The experiment")
    made.code(json.dumps(experiment, indent=2, ensure_ascii=False).splitlines())
    return made
