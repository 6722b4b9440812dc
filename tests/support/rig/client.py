"""A client of the rig protocol of the tests' own, for those that need a session and no more."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import zmq


class Session:
    """Connects, and from then on sends what it is told at an even pace, until the context ends."""

    def __init__(
        self, endpoint: str, values: Callable[[float], Sequence[float]], client: str = "tests", step: float = 0.03
    ):
        self._endpoint, self._values, self._client, self._step = endpoint, values, client, step
        self._ends, self._began = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Session:
        self._thread.start()
        assert self._began.wait(10.0), "no session came about"
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join(10.0)

    def _run(self) -> None:
        context = zmq.Context()
        socket = context.socket(zmq.DEALER)
        socket.connect(self._endpoint)

        def ask(**fields: Any) -> Any:
            socket.send(json.dumps({"ppy": 1, **fields}).encode())
            return json.loads(socket.recv()) if socket.poll(1000) else None

        units = {"inputs": {"current": "A", "force": "N"}, "outputs": {"voltage": "V", "displacement": "m"}}
        accepted = ask(type="connect", client=self._client, time=0.0, **units)
        if accepted and accepted["type"] == "accepted":
            self._began.set()
            began, sequence = time.monotonic(), 0
            while not self._ends.wait(self._step):
                sequence += 1
                now = time.monotonic() - began
                ask(
                    type="exchange", session=accepted["session"], sequence=sequence, sent=now, seen=0.0, time=now,
                    step=self._step, values=list(self._values(now)),
                )  # fmt: skip
        context.destroy(linger=0)
