"""A peer that sends whatever it likes, over ZeroMQ."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from uuid import uuid4

import zmq

from fmus.rig_proxy.protocol import OPERATOR, encode
from tests.support.rig.backends import Logged

INPUTS, OUTPUTS = Logged.inputs, Logged.outputs


def operators(endpoint: str) -> str:
    """Return the endpoint of operators at a server that has its requests at another one."""
    place, _, port = endpoint.rpartition(":")
    return f"{place}:{int(port) + OPERATOR}"


class Peer:
    """A connection of its own under a name of its own.

    Parameters
    ----------
    endpoint : str
    name : str
        Its routing id; default is one by chance.
    """

    def __init__(self, endpoint: str, name: str = "") -> None:
        self._context = zmq.Context()
        self.socket = self._context.socket(zmq.DEALER)
        self.socket.linger = 0
        self.socket.routing_id = (name or f"peer-{uuid4().hex[:16]}").encode()
        self.socket.connect(endpoint)

    def send(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        self.socket.send(encode(kind, **fields))

    def receive(self, timeout: float = 5.0) -> Any:
        """Take the next answer; None without one."""
        return json.loads(self.socket.recv()) if self.socket.poll(1000 * timeout) else None

    def ask(self, kind: str, **fields: Any) -> Any:
        """Send a message and take the next answer."""
        self.send(kind, **fields)
        answer = self.receive()
        assert answer is not None, f"no answer to {kind}"
        return answer

    def connect(
        self,
        client: str,
        inputs: Mapping[str, str] = INPUTS,
        outputs: Mapping[str, str] = OUTPUTS,
    ) -> Any:
        """Ask for a session."""
        return self.ask(
            "connect", client=client, instance=client, inputs=inputs, outputs=outputs, time=0.0
        )

    def exchange(self, session: str, sequence: int, seen: float, values: list[float]) -> Any:
        """Command, as a client does."""
        return self.ask(
            "exchange",
            session=session,
            sequence=sequence,
            sent=0.0,
            seen=seen,
            time=0.0,
            step=0.02,
            values=values,
        )

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.destroy(linger=0)
