"""Page of ``ppy rig demo``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orchestration.reporting.html import Markup, Page

if TYPE_CHECKING:
    from demonstrations.demo.on_rig import RigDemoResults
    from orchestration.master import Run

_COLOURS = {"rig": "#9aa5af", "nominal": "#0b6aa2", "extended": "#c0392b"}
_LABELS = {"rig": "rig, measured", "nominal": "nominal model", "extended": "extended model"}
_SCALES = {"voltage": (1.0, "V"), "displacement": (1e3, "mm")}
_MILLI = 1e3


def write(folder: Path, results: RigDemoResults) -> Path:
    """Write the page and its picture.

    Parameters
    ----------
    folder : Path
        Folder with ``diagnosis.html``.
    results : RigDemoResults

    Returns
    -------
    Path
        ``hil.html``.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    picture = folder / "beside.png"
    _draw(picture, results.beside)
    errors = results.errors
    gains = ", ".join(
        f"{name} from {100.0 * errors['nominal'][name]:.1f} % to"
        f" {100.0 * errors['extended'][name]:.1f} %"
        for name in errors["nominal"]
    )
    page = Page(
        "The loop closed: measured, diagnosed, extended, and run beside the rig",
        f"{results.diagnosis.sentence} Beside the rig, in real time, on levels that no fit has"
        f" seen, the error goes: {gains}.",
    )
    page.picture(
        picture,
        "The rig, the nominal model and the extended one, driven alike in one run; below, what each"
        " leaves.",
    )
    page.heading("What was done")
    page.items(
        [
            (
                "An emulated rig was served in real time: its own equations, noise, and a hidden"
                " effect drawn by a seed."
            ),
            (
                "Random levels of current and force were put on it for 45 s at 30 Hz, and what it"
                " answered was recorded."
            ),
            Markup(
                'The record was diagnosed as it stands: <a href="diagnosis.html">what was found,'
                " and why</a>."
            ),
            (
                "The extended model became an FMU and ran beside the rig, with the rig's proxy and"
                " the nominal model."
            ),
            f"At the end the rig was asked what it hides: {results.hidden}.",
        ]
    )
    page.heading("How well the link did")
    page.table(["quantity", "median", "largest"], _link(results.beside))
    page.text(f"{results.beside.statistics.pacing}. All of it took {results.seconds:.0f} s.")
    page.heading("How to do it with a rig of your own")
    page.code(
        [
            (
                "ppy rig serve --backend nidaqmx --option calibration=rig.toml   # in a terminal of"
                " its own"
            ),
            (
                "ppy rig watch                                                   # in another: live"
                " view and a stop button"
            ),
            "ppy rig record --stimulus identification --out record.nc",
            "ppy diagnose record.nc --report diagnosis.html --fmu extended.fmu",
        ]
    )
    page.write(folder / "hil.html")
    return folder / "hil.html"


def _link(run: Run) -> list[list[str]]:
    """Return the rows of a table on age, round trip and missed deadlines."""
    rows = []
    for name, signal in (
        ("age of the displacement", "displacement_age"),
        ("round trip", "round_trip_time"),
    ):
        values = _MILLI * run.signals[f"rig.{signal}"]
        rows.append([name, f"{np.median(values):.3g} ms", f"{np.max(values):.3g} ms"])
    rows.append(
        ["missed deadlines of the link", "", f"{run.signals['rig.missed_deadlines'][-1]:.0f} steps"]
    )
    return rows


def _draw(path: Path, run: Run) -> None:
    """Draw measured and simulated outputs, each above the residuals of the models."""
    from matplotlib.figure import Figure

    time = run.time[1:]
    figure = Figure(figsize=(9.0, 7.2), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(2.0, 1.0, 2.0, 1.0))
    for (name, (factor, unit)), above, below in zip(
        _SCALES.items(), axes[::2], axes[1::2], strict=True
    ):
        measured = factor * run.signals[f"rig.{name}"][1:]  # before that it had not been commanded
        for member, colour in _COLOURS.items():
            values = factor * run.signals[f"{member}.{name}"][1:]
            above.plot(
                time,
                values,
                color=colour,
                lw=2.2 if member == "rig" else 1.1,
                label=_LABELS[member],
            )
            if member != "rig":
                below.plot(time, measured - values, color=colour, lw=0.9)
        above.set_ylabel(f"{name} ({unit})")
        below.set_ylabel(f"residual ({unit})")
        for axis in (above, below):
            axis.grid(alpha=0.3)
            axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize=9)
    axes[-1].set_xlabel("time (s)")
    figure.savefig(path, dpi=110)
