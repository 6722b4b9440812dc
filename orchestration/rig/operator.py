"""What an operator may ask of a rig's server: its status, an emergency stop, and the release after one."""

from __future__ import annotations

from time import monotonic
from typing import Any

import zmq

from fmus.kit.errors import UserError
from fmus.rig_proxy import protocol
from orchestration.rig.endpoint import Endpoint


def ask(remote: Endpoint, kind: str, timeout: float = 2.0, **fields: Any) -> dict[str, Any]:
    """Send one message of an operator, on a connection of its own, and wait for the answer.

    Nothing is left behind: a request that was not answered does not reach the server later.

    Parameters
    ----------
    remote : Endpoint
    kind : {"status", "stop", "acknowledge"}
    timeout : float
        Longest wait, in s.
    **fields
        ``reason``, for ``stop``.

    Returns
    -------
    dict of str to object
        The message ``status``.

    Raises
    ------
    UserError
        If there is no answer in time.
    """
    context = zmq.Context()
    try:
        socket = context.socket(zmq.DEALER)
        remote.connect(socket, remote.requests)
        socket.send(protocol.encode(kind, **fields))
        until = monotonic() + timeout
        while (left := until - monotonic()) > 0.0:
            if socket.poll(round(1000 * left)):
                try:
                    message = protocol.decode(socket.recv(), protocol.REPLIES)
                except protocol.ProtocolError:
                    continue
                if message["type"] == "status":
                    return message
    finally:
        context.destroy(linger=0)
    keys = "" if remote.keys is None else ", with these keys"
    raise UserError(f"no answer within {timeout:g} s from {remote.requests}{keys}; is `ppy rig serve` running?")
