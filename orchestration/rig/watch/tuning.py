"""Thread that asks the run beside a rig for its tunable parameters, and feeds pages with them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from fmus.kit import UserError
from orchestration.rig.watch.feed import Feed

_EVERY = 0.5  # s between two questions


class ParameterPoll:
    """A thread that asks for parameters; a context manager.

    Parameters
    ----------
    parameters : callable
        Returns what is known of each, by name; raises UserError if no run answers.
    feed : Feed
    """

    def __init__(self, parameters: Callable[[], Mapping[str, Any]], feed: Feed):
        self._parameters = parameters
        self._feed = feed
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="parameters", daemon=True)

    def __enter__(self) -> ParameterPoll:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ends.wait(_EVERY):
            try:
                self._feed.take_parameters(self._parameters())
            except UserError:
                self._feed.take_parameters({})
