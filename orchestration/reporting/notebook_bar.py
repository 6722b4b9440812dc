"""Progress of long work below the cell of a notebook."""

from __future__ import annotations

import sys
from time import monotonic
from typing import Any

from fmus.kit import quoting

_INTERVAL = 0.1  # s between two updates
_SHORT = 1.0  # s of work that shows nothing


def in_kernel() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class NotebookBar:
    """Display of the current step and its progress, which is empty after the end.

    A notebook cannot be told to forget an output, so that short work has none.

    Parameters
    ----------
    step : str
    """

    def __init__(self, step: str):
        self._text = step
        self._next = monotonic() + _SHORT
        self._display: Any = None

    def __call__(self, text: str) -> None:
        """Begin a step."""
        self._text = text
        self._show("", text)

    def done(self, part: int, whole: int, text: str = "") -> None:
        """Report the number of finished parts of the step, and perhaps a name of the next one."""
        self._text = text or self._text
        count = f"{self._text} ({part:,} of {whole:,})"
        self._show(f'<progress max="{whole}" value="{part}"></progress> ', count)

    def finish(self) -> None:
        """End the display."""
        if self._display is not None:
            self._display.update({"text/plain": ""}, raw=True)

    def _show(self, element: str, text: str) -> None:
        if monotonic() < self._next:
            return
        from IPython.display import display

        self._next = monotonic() + _INTERVAL
        shown = {"text/html": f"{element}{quoting.html(text)}", "text/plain": text}
        if self._display is None:
            self._display = display(shown, raw=True, display_id=True)
        else:
            self._display.update(shown, raw=True)
