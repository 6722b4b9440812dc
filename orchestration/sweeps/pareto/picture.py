"""Picture of a Pareto front."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.reporting import draw, pictures
from orchestration.sweeps.pareto.front import Front

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draw.register(Front)
def draw_front(front: Front) -> Figure:
    """Draw the front with the nominal model, and the parameters along the front."""
    name, *others = front.objectives
    parameters = list(front.parameters)[: 6 - len(others)]
    figure, axes = pictures.panels(len(others) + len(parameters), front.model, name)
    label = f"{name.replace('_', ' ')} [{front.display[name]}]".removesuffix(" [1]")
    axes[-1].set_xlabel(label)
    points = [front.shown(one, values) for one, values in front.by_objective(front.values.T)]
    nominal = [front.shown(one, value) for one, value in front.by_objective(front.nominal)]
    for axis, other in zip(axes, others, strict=False):
        axis.plot(*points, ".-", color=pictures.MODEL, label="front")
        axis.plot(*nominal, "x", color=pictures.FITTED, label="as it is")
        axis.legend()
        pictures.label(axis, other, front.display[other])
    for axis, parameter in zip(axes[len(others) :], parameters, strict=True):
        values = front.shown(parameter, front.parameters[parameter])
        axis.plot(points[0], values, ".-", color=pictures.MODEL)
        pictures.label(axis, parameter, front.display[parameter])
    return figure
