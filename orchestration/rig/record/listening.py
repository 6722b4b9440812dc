"""Passive record of a rig: what its server publishes, while others command it or nobody does."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from time import monotonic
from typing import Any

import numpy as np
import zmq

from fmus.kit.arrays import Array
from fmus.kit.interrupt import Interrupt
from fmus.rig_proxy import decode, protocol
from orchestration.experiment.live import Moment
from orchestration.rig.endpoint import Endpoint
from orchestration.rig.record.driving import RecordingObserver

# s between two rows that are a gap: the server publishes at least every 0.2 s
LONGEST_SILENCE = 0.5
_LOOK = 100  # ms
_TELEMETRY = {"telemetry": protocol.REPLIES["telemetry"]}


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
        the rig has no value. Empty without any.
    failure : str
        Reason for an early end; empty without one, or after an interrupt.
    """
    rows: list[list[float]] = []
    began = heard = monotonic()
    silences = 0
    is_told = False  # of the present silence
    failure = ""
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.linger = 0
        remote.connect(socket, remote.telemetry)
        socket.subscribe(b"")
        while not failure and not interrupt.pressed and monotonic() - began < duration:
            if not socket.poll(_LOOK):
                silent = monotonic() - heard
                if silent > LONGEST_SILENCE and not is_told:
                    is_told = True
                    silences += 1
                    observer.alarm(
                        f"nothing was heard of the rig for {silent:.1f} s; the record waits"
                    )
                continue
            heard = monotonic()
            is_told = False
            try:
                message = decode(socket.recv(), _TELEMETRY)
                row = _row(message)
            except (ValueError, TypeError, OverflowError):  # of somebody else, or another version
                continue
            last = rows[-1][0] if rows else -inf
            if [*message["inputs"], *message["outputs"]] != [*rig["inputs"], *rig["outputs"]]:
                failure = "the rig's server has other signals now"
            elif row[0] < last - LONGEST_SILENCE:
                failure = "the rig's server is another one now, with another clock"
            elif row[0] > last:
                rows.append(row)
                time = row[0] - rows[0][0]
                observer.add(time, row[1:])
                observer.look(Moment(time, duration, 0.0, silences, {}, observer.trouble()))
    return np.array(rows), failure


def _row(message: Mapping[str, Any]) -> list[float]:
    """Return clock, inputs, outputs and ages of a message, NaN where it has no value."""
    signals = [*message["inputs"].values(), *message["outputs"].values()]
    cells = [message["clock"], *signals, *message["ages"].values()]
    row: list[float] = np.array(cells, dtype=float).tolist()
    return row
