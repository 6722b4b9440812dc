"""Requests of an operator to a rig's server: status, emergency stop, and release after a stop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import monotonic, sleep
from typing import Any

import zmq

from fmus.kit import UserError, quoting
from fmus.rig_proxy import protocol
from orchestration.rig.endpoint import Endpoint

_LOOK = 0.1  # s between two questions whether the rig is ready again
_SOON = 0.01  # s between two questions whether it is safe
_REPLIES = {kind: protocol.REPLIES[kind] for kind in ("status", "refused")}
_PATIENCE = 1.0  # s that the answer to the last of them has at least


def ask(
    remote: Endpoint,
    kind: str,
    timeout: float = 2.0,
    *,
    replies: Mapping[str, Any] = _REPLIES,
    server: str = "ppy rig serve",
    **fields: Any,
) -> dict[str, Any]:
    """Send one message of an operator, on a connection of its own, and wait for the answer.

    Nothing is left behind: a request that was not answered does not reach the server later.

    Parameters
    ----------
    remote : Endpoint
    kind : {"status", "stop", "acknowledge"}
    timeout : float
        Longest wait, in s.
    replies : Mapping
        Fields of each answer that is taken, ``refused`` among them.
    server : str
        The program that should answer.
    **fields
        ``reason`` of a ``stop``, ``latch`` of an ``acknowledge``.

    Returns
    -------
    dict of str to object
        The message ``status``, or the one that `replies` has in its place.

    Raises
    ------
    UserError
        If there is no answer in time, or the server refuses.
    """
    context = zmq.Context()
    try:
        socket = context.socket(zmq.DEALER)
        remote.connect(socket, remote.operators)
        socket.send(protocol.encode(kind, key=remote.local_key, **fields))
        until = monotonic() + timeout
        while (remaining := until - monotonic()) > 0.0:
            if not socket.poll(round(1000 * remaining)):
                continue
            try:
                message = protocol.decode(socket.recv(), dict(replies))
            except protocol.ProtocolError:
                continue
            if message["type"] != "refused":
                return message
            reason = quoting.line(message["reason"])
            raise UserError(f"{remote.requests} refuses: {reason}")
    finally:
        context.destroy(linger=0)
    keys = ", without keys" if remote.keys is None else ", with these keys"
    raise UserError(
        f"no answer within {timeout:g} s from {remote.requests}{keys}; is `{server}` running,"
        " or do the keys not match?"
    )


def stop(remote: Endpoint, reason: str, timeout: float = 2.0) -> dict[str, Any]:
    """Stop the rig, and wait until its safe state is confirmed or known not to be reached.

    Parameters
    ----------
    remote : Endpoint
    reason : str
    timeout : float
        Longest wait, in s.

    Returns
    -------
    dict of str to object
        The message ``status``; its state is still ``stopping`` if neither is known in time.

    Raises
    ------
    UserError
        If there is no answer in time.
    """
    until = monotonic() + timeout
    answer = ask(remote, "stop", timeout, reason=reason)
    return _wait_while(remote, answer, lambda now: now["state"] == protocol.STOPPING, _SOON, until)


def acknowledge(remote: Endpoint, latch: str, timeout: float = 5.0) -> dict[str, Any]:
    """Release the latch of the safe state, and wait until the rig can be used again.

    Parameters
    ----------
    remote : Endpoint
    latch : str
        Name of the latch that is meant; any other one stays closed. Or that of an alarm, which is
        acknowledged at once.
    timeout : float
        Longest wait, in s; a device that failed is opened again meanwhile.

    Returns
    -------
    dict of str to object
        The message ``status``; it still has a latch if the rig could not be used in time.

    Raises
    ------
    UserError
        If there is no answer in time, or another latch is closed.
    """
    until = monotonic() + timeout
    answer = ask(remote, "acknowledge", timeout, latch=latch)
    return _wait_while(remote, answer, lambda now: now["latch"] == latch, _LOOK, until)


def open_alarms(answer: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the alarms in a status that are neither acknowledged nor shelved.

    Parameters
    ----------
    answer : Mapping of str to object
        The message ``status``, of a server that need not have such a list.
    """
    return [
        alarm
        for alarm in answer.get("alarms", [])
        if not (alarm["acknowledged"] or alarm["shelved"])
    ]


def _wait_while(
    remote: Endpoint,
    answer: dict[str, Any],
    waits: Callable[[Mapping[str, Any]], bool],
    pause: float,
    until: float,
) -> dict[str, Any]:
    """Ask for the status until `waits` is False of it or the time is up; return the last one."""
    while waits(answer) and monotonic() + pause < until:
        sleep(pause)
        answer = ask(remote, "status", max(_PATIENCE, until - monotonic()))
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
    parts = [_summarise_state(answer) + (f": {answer['reason']}" if answer["reason"] else "")]
    alarms = open_alarms(answer)
    parts += [f"ALARM {one['name']} ({one['severity']}): {one['text']}" for one in alarms]
    if answer["alarm"] and not alarms:
        parts.append(f"ALARM: {answer['alarm']}")
    if answer["latch"]:
        parts.append(f"latch {answer['latch']}")
    if answer["client"]:
        operator = answer.get("operator")  # which a server that is not ours need not name
        parts.append(f"client {answer['client']}{f' of {operator}' if operator else ''}")
    if answer.get("acknowledged"):
        parts.append(f"acknowledged by {answer['acknowledged']}")
    parts.append(
        f"{answer['mode']}, period {answer['period']:.4g} s, watchdog {answer['watchdog']:g} s"
    )
    parts += [f"{number} {kind}" for kind, number in answer["counts"].items() if number]
    return quoting.line("; ".join(parts))  # reasons and names may be a stranger's


def _summarise_state(answer: Mapping[str, Any]) -> str:
    state: str = answer["state"]
    if state == protocol.NOT_REACHED:
        return "THE SAFE STATE WAS NOT REACHED"
    reached = answer["reached"]
    if state == protocol.SAFE and reached is not None:
        # a server that is not ours need not say whether it is
        verified = "" if answer.get("verified", True) else "; commanded safe, not verified"
        return f"{state} (reached after {1000 * reached:.0f} ms{verified})"
    return state
