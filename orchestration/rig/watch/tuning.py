"""Thread that asks the run beside a rig for its tunable parameters, and feeds pages with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from fmus.kit import UserError
from orchestration.rig.watch.feed import Feed

_EVERY = 0.5  # s between two questions


@contextmanager
def parameters_fed(parameters: Callable[[], Mapping[str, Any]], feed: Feed) -> Iterator[None]:
    """Feed pages with the parameters of a run while the context lasts; with none without a run.

    Parameters
    ----------
    parameters : callable
        Returns what is known of each, by name; raises UserError if no run answers.
    feed : Feed
    """
    ends = Event()

    def ask() -> None:
        while not ends.wait(_EVERY):
            try:
                feed.take_parameters(parameters())
            except UserError:
                feed.take_parameters({})

    thread = Thread(target=ask, name="parameters", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()
