"""Listens to a rig's server: its telemetry, and a few times a second its status."""

from __future__ import annotations

import threading
from contextlib import suppress
from time import monotonic

import zmq

from fmus.rig_proxy import protocol
from orchestration.rig.endpoint import Endpoint
from orchestration.rig.watch.feed import Feed

_ASKING = 0.3  # s between two requests for the status
_TURN = 0.1  # s between two looks at whether contact was lost
_AT_ONCE = 200  # messages of one socket before the other has its turn
_END = 5.0  # s that the thread has to end


class Listener:
    """A thread that feeds pages with what a rig's server says; a context, in which it listens.

    Parameters
    ----------
    remote : Endpoint
    feed : Feed
    """

    def __init__(self, remote: Endpoint, feed: Feed):
        self._remote, self._feed = remote, feed
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig telemetry", daemon=True)

    def __enter__(self) -> Listener:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join(_END)

    def _run(self) -> None:
        context = zmq.Context()
        telemetry, requests = context.socket(zmq.SUB), context.socket(zmq.DEALER)
        requests.immediate = True  # no queue of requests for a server that is not there
        self._remote.connect(telemetry, self._remote.telemetry)
        self._remote.connect(requests, self._remote.requests)
        telemetry.subscribe(b"")
        poller, following = zmq.Poller(), monotonic()
        for socket in (telemetry, requests):
            poller.register(socket, zmq.POLLIN)
        while not self._ends.is_set():
            if (now := monotonic()) >= following:
                following = now + _TURN  # not connected yet, unless
                with suppress(zmq.Again):
                    requests.send(protocol.encode("status"), zmq.DONTWAIT)
                    following = now + _ASKING
            for socket, _ in poller.poll(round(1000 * _TURN)):
                self._take(socket)
            self._feed.look()
        context.destroy(linger=0)

    def _take(self, socket: zmq.Socket[bytes]) -> None:
        for _ in range(_AT_ONCE):
            try:
                frame = socket.recv(zmq.DONTWAIT)
            except zmq.Again:
                return
            with suppress(protocol.ProtocolError):
                message = protocol.decode(frame, protocol.REPLIES)
                if message["type"] == "telemetry":
                    self._feed.telemetry(message)
                elif message["type"] == "status":
                    self._feed.status(message)
