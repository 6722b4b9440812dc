"""Chapter 5, the stance phase: fig. 5-8 as prescribed, and as a foot on a ground makes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmus.foot import gait
from orchestration.experiment import read, run
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLORS = dict(zip(gait.ACTUATORS, ("tab:blue", "tab:red", "tab:cyan", "tab:orange"), strict=True))


def figure() -> Figure:
    """Draw lengths and ground reactions over the stance, prescribed (left) and made (right)."""
    printed = run(read("fig_5_8"))
    made = run(read("foot_stance"))
    wanted = gait.length_changes(printed.time.values)
    drawing, axes = pictures.mosaic(
        (("wanted", "moved"), ("given", "reaction")), "Fig. 5-8: prescribed, and on a ground"
    )
    for name, color in _COLORS.items():
        length = made[f"foot.{name}_length_change"].values
        axes["wanted"].plot(printed.time, 1e3 * wanted[name], color=color, label=name)
        axes["moved"].plot(made.time, 1e3 * (length - length[0]), color=color, label=name)
    axes["given"].plot(printed.time, -printed.toe_force_x, color="black", label="on the toe")
    for part, color in (("heel", "tab:green"), ("ball", "tab:purple")):
        axes["reaction"].plot(made.time, made[f"foot.{part}_pressure"], color=color, label=part)
    total = -made["foot.ground_force_x"]
    axes["reaction"].plot(made.time, total, color="black", linestyle=":", label="all")
    for name, axis in axes.items():
        axis.set_xlabel("time [s]")
        axis.legend(fontsize=8)
        lengths = name in ("wanted", "moved")
        pictures.label(axis, *(("length change", "mm") if lengths else ("ground reaction", "N")))
    return drawing
