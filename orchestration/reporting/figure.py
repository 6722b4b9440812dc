"""A figure that a notebook shows by itself.

Jupyter shows figures of matplotlib only where pyplot was imported, which holds a figure of its own
for every one that is drawn. Apart from this module nothing needs matplotlib to be loaded.
"""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure of matplotlib that a notebook shows, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        return rendered(self, "png")


def rendered(figure: Figure, kind: str) -> bytes:
    """Return a figure as a picture of a format that matplotlib knows."""
    figure.align_ylabels()
    drawn = io.BytesIO()
    figure.savefig(drawn, format=kind)
    return drawn.getvalue()
