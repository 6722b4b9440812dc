"""A server in lockstep in a thread of this process, so that a test can make it wrong."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.server import front as module
from orchestration.rig.server.front import EventLoop, ReceivedSignals
from orchestration.rig.server.latch_file import LatchKeeper
from orchestration.rig.server.lockstep import LockstepRig
from orchestration.rig.server.request_handler import RequestHandler
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.sockets import opened
from tests.support.rig import backends


class Silent:
    """A log that nobody reads."""

    def tell(self, text, kind=""):
        pass


@contextmanager
def served():
    """Serve, and give the endpoint."""
    settings = ServerSettings(f"{backends.__file__}:Stepped", lockstep=True, port=0, no_keys=True)
    signals = ReceivedSignals()
    with opened(settings) as sockets:
        rig = LockstepRig(settings)
        handler = RequestHandler(rig, settings.period, Silent(), LatchKeeper())
        loop = EventLoop(sockets, handler, Silent(), signals)
        thread = threading.Thread(target=loop.run, daemon=True)
        thread.start()
        try:
            yield read_endpoint(sockets.endpoint())
        finally:
            signals.ending = "the test"
            thread.join(10.0)
            rig.close()


@pytest.fixture
def server(monkeypatch):
    """Return a function that begins to serve."""
    # the garbage of the tests is their own
    monkeypatch.setattr(module, "Collector", lambda: SimpleNamespace(collect=lambda now: None))
    return served
