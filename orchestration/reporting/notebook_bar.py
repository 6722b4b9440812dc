"""Progress of long work below the cell of a notebook."""

from __future__ import annotations

import sys
from time import monotonic
from typing import Any

from fmus.kit import quoting

_INTERVAL = 0.1  # s between two updates


def in_kernel() -> bool:
    """Return whether this process is the kernel of a notebook."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class NotebookBar:
    """Display of the current step and its progress, which is empty after the end.

    Parameters
    ----------
    step : str
    """

    def __init__(self, step: str):
        from IPython.display import display

        self._text = step
        self._latest = 0.0
        self._display: Any = display({"text/plain": step}, raw=True, display_id=True)

    def __call__(self, text: str) -> None:
        """Begin a step."""
        self._text = text
        self._show("", text)

    def done(self, part: int, whole: int, text: str = "") -> None:
        """Report the number of finished parts of the step, and perhaps a name of the next one."""
        self._text = text or self._text
        if monotonic() > self._latest + _INTERVAL:
            count = f"{self._text} ({part:,} of {whole:,})"
            self._show(f'<progress max="{whole}" value="{part}"></progress> ', count)

    def finish(self) -> None:
        """End the display."""
        self._display.update({"text/plain": ""}, raw=True)

    def _show(self, element: str, text: str) -> None:
        self._latest = monotonic()
        shown = {"text/html": f"{element}{quoting.html(text)}", "text/plain": text}
        self._display.update(shown, raw=True)
