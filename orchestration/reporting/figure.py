"""A figure that a notebook shows without pyplot.

Jupyter shows figures of matplotlib only after pyplot was imported, which keeps a reference to every
figure. Only this module imports matplotlib when it is loaded.
"""

from __future__ import annotations

import io
import warnings

from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter

from fmus.kit import quoting

_LONGEST, LONGEST_AT_TICK = 160, 44  # characters of a line


class ShownFigure(Figure):
    """A figure of matplotlib that a notebook shows, with or without pyplot.

    Its texts are drawn as they are: a name may have the $ that begins a formula.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw the figure; the powers of ten at an axis are its only formulas."""
        for text in self.findobj(Text):
            text.set_parse_math(False)
            text.set_text("\n".join(map(shown, text.get_text().split("\n"))))
        for axes in self.axes:
            for axis in (axes.xaxis, axes.yaxis):
                if isinstance(axis.get_major_formatter(), LogFormatter):
                    for label in axis.get_ticklabels(which="both"):
                        label.set_parse_math(True)
        super().draw(renderer)

    def _repr_png_(self) -> bytes:
        return rendered(self, "png")


def shown(text: str, longest: int = _LONGEST) -> str:
    """Return a text of bounded length, of printable characters."""
    return quoting.visible(text if len(text) <= longest else f"{text[:longest]} …", keep="\n")


def rendered(figure: Figure, kind: str) -> bytes:
    """Return a figure as the bytes of a picture in a format of matplotlib, such as ``png``."""
    figure.align_ylabels()
    file = io.BytesIO()
    with warnings.catch_warnings():
        # a box stands for a character that the font does not have
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(file, format=kind)
    return file.getvalue()
