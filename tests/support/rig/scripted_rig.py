"""Answers to a client, each a function that a test replaces by a worse one: late, repeated, cut, or
not even a message.

No more than what the native proxy asks for; a rig that behaves is in
:mod:`tests.support.rig.small_rig`.
"""

from __future__ import annotations

import heapq
import itertools
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import zmq

Message = dict[str, Any]
Reply = tuple[float, Message | bytes]  # a delay in s, and what is sent then


class ScriptedRig:
    """A rig whose every value is the first command, or in lockstep the integral of it.

    Attributes
    ----------
    requests : list of dict
        All that came in.
    peers : set of bytes
        Names of the connections that they came by.
    answer, exchanged : callable
        Any request to replies, and an exchange of the present session; replaced by tests.
    """

    def __init__(self, outputs: int, mode: str = "real-time", watchdog: float = 0.2):
        self.outputs, self.mode, self.watchdog = outputs, mode, watchdog
        self.requests: list[Message] = []
        self.peers: set[bytes] = set()
        self.sessions = 0
        self.integral, self.newest = 0.0, 0.0
        self.answer: Callable[[Message], list[Reply]] = self.replies
        self.exchanged: Callable[[Message], list[Reply]] = lambda request: [
            (0.0, self.sample(request))
        ]

    def replies(self, request: Message) -> list[Reply]:
        """Answer as the protocol wants it."""
        match request["type"]:
            case "connect":
                self.sessions += 1
                return [(0.0, self.accepted())]
            case "exchange" if request["session"] == self.session:
                return self.exchanged(request)
            case "exchange":
                return [(0.0, message("refused", reason="no such session"))]
            case "disconnect":
                return [(0.0, message("disconnected"))]
        return []

    @property
    def session(self) -> str:
        return f"session-{self.sessions}"

    def accepted(self, **changes: Any) -> Message:
        """Accept a session."""
        fields = {
            "session": self.session,
            "clock": time.monotonic() + 1000.0,
            "mode": self.mode,
            "period": 0.01,
            "watchdog": self.watchdog,
            "limits": {"current": {"min": -1.0, "max": 1.0, "rate": None}},
            "values": [0.0] * self.outputs,
            "ages": [0.001] * self.outputs,
        }
        return message("accepted", **(fields | changes))

    def sample(self, request: Message, **changes: Any) -> Message:
        """Answer an exchange."""
        self.newest = request["values"][0]
        self.integral += request["step"] * self.newest
        value = self.integral if self.mode == "lockstep" else self.newest
        fields = {
            "session": request["session"],
            "sequence": request["sequence"],
            "sent": request["sent"],
            "clock": time.monotonic() + 1000.0,
            "values": [value] * self.outputs,
            "ages": [0.001] * self.outputs,
            "state": "running",
            "reason": "",
            "refused": [],
        }
        return message("sample", **(fields | changes))

    def exchanges(self) -> list[Message]:
        """Exchanges that came in."""
        return [request for request in self.requests if request["type"] == "exchange"]

    def said(self, kind: str) -> bool:
        """Return True if a request of that type came in."""
        return any(request["type"] == kind for request in self.requests)


def message(kind: str, **fields: Any) -> Message:
    """A message of version 2."""
    return {"ppy": 2, "type": kind, **fields}


@contextmanager
def served(rig: ScriptedRig, endpoint: str = "tcp://127.0.0.1:*", **options: Any) -> Iterator[str]:
    """Serve a rig on a ROUTER in a thread; gives the endpoint. `options` are those of the ZeroMQ
    socket.
    """
    context = zmq.Context()
    router = context.socket(zmq.ROUTER)
    router.linger = 0
    for name, value in options.items():
        setattr(router, name, value)
    router.bind(endpoint)
    over = threading.Event()
    thread = threading.Thread(target=_serve, args=(rig, router, over), daemon=True)
    thread.start()
    try:
        yield router.last_endpoint.decode()
    finally:
        over.set()
        thread.join(5.0)
        router.close()
        context.term()


def _serve(rig: ScriptedRig, router: Any, over: threading.Event) -> None:
    waiting: list[tuple[float, int, bytes, bytes]] = []
    count = itertools.count()
    while not over.is_set():
        soonest = waiting[0][0] - time.monotonic() if waiting else 0.01
        if router.poll(max(0, min(10, int(soonest * 1e3)))):
            peer, frame = router.recv_multipart()
            request = json.loads(frame)
            rig.requests.append(request)
            rig.peers.add(peer)
            for delay, reply in rig.answer(request):
                content = reply if isinstance(reply, bytes) else json.dumps(reply).encode()
                heapq.heappush(waiting, (time.monotonic() + delay, next(count), peer, content))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, peer, content = heapq.heappop(waiting)
            router.send_multipart([peer, content])
