"""The constants of the program of a sampled member."""

from __future__ import annotations

from collections.abc import Collection

from fmus.kit import Component
from fmus.kit.symbolic import trace


def program_constants(cls: type[Component], measured: Collection[str]) -> list[str]:
    """Return parameters that sampled laws alone depend on, where no measured output shows them.

    Whoever programs a controller knows them exactly; fitted, they make up for what drives the
    plant wrongly. An output that depends on a discrete state without delay shows them.

    Parameters
    ----------
    cls : type[Component]
    measured : collection of str
        Outputs.
    """
    graph = trace(cls)
    layout = cls.layout
    shown = {d.name for d in layout.discretes if d.output}
    of_discretes = graph.depends(graph.outputs, graph.discretes)
    shown |= {o.name for o, found in zip(layout.outputs, of_discretes, strict=True) if found}
    if not shown.isdisjoint(measured):
        return []
    continuous, sampled = (
        {k for column in laws for row in graph.depends(column, graph.parameters) for k in row}
        for laws in ((graph.rates, graph.outputs), graph.updates)
    )
    return [layout.parameters[k].name for k in sorted(sampled - continuous)]
