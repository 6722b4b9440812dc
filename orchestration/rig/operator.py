"""Requests of an operator to a rig's server: status, emergency stop, and release after a stop."""

from __future__ import annotations

from collections.abc import Mapping
from time import monotonic, sleep
from typing import Any

import zmq

from fmus.kit import UserError
from fmus.rig_proxy import protocol
from orchestration.rig.endpoint import Endpoint

_LOOK = 0.1  # s between two questions whether the rig is ready again


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
        remote.connect(socket, remote.operators)
        socket.send(protocol.encode(kind, **fields))
        until = monotonic() + timeout
        while (remaining := until - monotonic()) > 0.0:
            if not socket.poll(round(1000 * remaining)):
                continue
            try:
                message = protocol.decode(socket.recv(), protocol.REPLIES)
            except protocol.ProtocolError:
                continue
            if message["type"] == "status":
                return message
    finally:
        context.destroy(linger=0)
    keys = ", without keys" if remote.keys is None else ", with these keys"
    raise UserError(
        f"no answer within {timeout:g} s from {remote.requests}{keys}; is `ppy rig serve` running?"
    )


def acknowledge(remote: Endpoint, timeout: float = 5.0) -> dict[str, Any]:
    """Release the latch of the safe state, and wait until the rig can be used again.

    Parameters
    ----------
    remote : Endpoint
    timeout : float
        Longest wait, in s; a device that failed is opened again meanwhile.

    Returns
    -------
    dict of str to object
        The message ``status``; its state is still ``safe`` if the rig could not be used in time.

    Raises
    ------
    UserError
        If there is no answer in time.
    """
    until = monotonic() + timeout
    answer = ask(remote, "acknowledge", timeout)
    while answer["state"] == protocol.SAFE and monotonic() + _LOOK < until:
        sleep(_LOOK)
        answer = ask(remote, "status", max(_LOOK, until - monotonic()))
    return answer


def summarise_status(answer: Mapping[str, Any]) -> str:
    """Summarise the status of a rig in one line.

    Parameters
    ----------
    answer : Mapping of str to object
        The message ``status``.

    Returns
    -------
    str
    """
    parts = [answer["state"] + (f": {answer['reason']}" if answer["reason"] else "")]
    if answer["client"]:
        parts.append(f"client {answer['client']}")
    parts.append(
        f"{answer['mode']}, period {answer['period']:.4g} s, watchdog {answer['watchdog']:g} s"
    )
    parts += [f"{number} {kind}" for kind, number in answer["counts"].items() if number]
    return "; ".join(parts)
