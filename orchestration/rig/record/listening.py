"""Passive record of a rig: what its server publishes, while others command it or nobody does."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from math import inf, nan
from time import monotonic
from typing import Any

import numpy as np
import zmq

from fmus.kit.arrays import Array
from fmus.kit.interrupt import Interrupt
from fmus.rig_proxy import ProtocolError, decode, protocol
from orchestration.experiment.live import Moment
from orchestration.rig.endpoint import Endpoint
from orchestration.rig.record.driving import RecordingObserver

# s between two rows that are a gap: the server publishes at least every 0.2 s
LONGEST_SILENCE = 0.5
_LOOK = 100  # ms


def listen(
    remote: Endpoint,
    rig: Mapping[str, Any],
    duration: float,
    interrupt: Interrupt,
    observer: RecordingObserver,
) -> tuple[Array, str]:
    """Record what a rig's server publishes.

    Parameters
    ----------
    remote : Endpoint
    rig : Mapping
        The message ``status`` of its server.
    duration : float
        In s; infinity to go on until an interrupt.
    interrupt : Interrupt
    observer : RecordingObserver

    Returns
    -------
    rows : ndarray, shape (m, 1 + number of inputs + 2 * number of outputs)
        Clock of the rig in s, inputs as applied, outputs as measured and their ages in s; NaN where
        the rig has no value.
    failure : str
        Reason for an early end; empty without one, or after an interrupt.
    """
    rows: list[list[float]] = []
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    try:
        socket = context.socket(zmq.SUB)
        remote.connect(socket, remote.telemetry)
        socket.subscribe(b"")
        failure = _receive(socket, rig, duration, interrupt, observer, rows)
    finally:
        context.destroy(linger=0)
    width = 1 + len(rig["inputs"]) + 2 * len(rig["outputs"])
    return np.array(rows).reshape(-1, width), failure


def _receive(
    socket: zmq.Socket[bytes],
    rig: Mapping[str, Any],
    duration: float,
    interrupt: Interrupt,
    observer: RecordingObserver,
    rows: list[list[float]],
) -> str:
    """Append rows until the end; return the reason for an early one."""
    began = heard = monotonic()
    is_told = False  # of the present silence
    gaps = 0
    while not interrupt.pressed and monotonic() - began < duration:
        message = _next(socket)
        silent = monotonic() - heard
        if silent > LONGEST_SILENCE and not is_told:
            is_told = True
            gaps += 1
            observer.alarm(f"nothing was heard of the rig for {silent:.1f} s; the record waits")
        if message is None:
            continue
        heard = monotonic()
        is_told = False
        if [*message["inputs"]] != [*rig["inputs"]] or [*message["outputs"]] != [*rig["outputs"]]:
            return "the rig's server has other signals now"
        row = [message["clock"], *_cells(message)]
        if rows and row[0] < rows[-1][0] - LONGEST_SILENCE:
            return "the rig's server is another one now, with another clock"
        if not rows or row[0] > rows[-1][0]:
            rows.append(row)
            time = row[0] - rows[0][0]
            observer.add(time, row[1:])
            observer.look(Moment(time, duration, 0.0, gaps, {}, observer.trouble()))
    return ""


def _next(socket: zmq.Socket[bytes]) -> dict[str, Any] | None:
    """Return the next message of telemetry; None if there is none for a moment."""
    if socket.poll(_LOOK):
        with suppress(ProtocolError):
            return decode(socket.recv(), {"telemetry": protocol.REPLIES["telemetry"]})
    return None


def _cells(message: Mapping[str, Any]) -> list[float]:
    """Return inputs, outputs and ages of a message."""
    cells = []
    for key in ("inputs", "outputs", "ages"):
        for value in message[key].values():
            is_number = isinstance(value, int | float) and abs(value) < inf
            cells.append(float(value) if is_number else nan)
    return cells
