"""A figure that a notebook shows without pyplot.

Jupyter shows figures of matplotlib only after pyplot was imported, which keeps a reference to every
figure. Only this module imports matplotlib when it is loaded.
"""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure of matplotlib that a notebook shows, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        return rendered(self, "png")


def rendered(figure: Figure, kind: str) -> bytes:
    """Return a figure as the bytes of a picture in a format of matplotlib, such as ``png``."""
    figure.align_ylabels()
    file = io.BytesIO()
    figure.savefig(file, format=kind)
    return file.getvalue()
