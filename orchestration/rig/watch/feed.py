"""What pages are told: the last minute of samples, what happened, and whether the rig is in contact."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping
from time import monotonic, time
from typing import Any

from fmus.rig_proxy.protocol import REAL_TIME

MINUTE = 60.0  # s of samples that are kept for a page that is opened later
SILENCE = 0.7  # s without a sign of life after which contact is lost, so that a page says so within a second
_PERIODS = 3.0  # of the rig, without a sample, where that is longer
_SAMPLES = 2000  # a minute of 30 a second, and some
_ITEMS = 4000  # that a page may be behind, before it misses some
_EVENTS = 100
_AGAIN = 5.0  # s in which the same refusal is told once
_LONGEST = 500  # characters of a text
_MOST = 64  # signals
_OVERTAKEN = 1.0  # s on the rig's clock; a step back that is larger is another server's clock


class Feed:
    """Gathers what is heard of the rig, and hands it to pages; any thread may call it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._items: deque[tuple[int, dict[str, Any]]] = deque(maxlen=_ITEMS)
        self._serial = 0
        self._rig: dict[str, Any] = {}
        self._samples: deque[dict[str, Any]] = deque(maxlen=_SAMPLES)
        self._events: deque[dict[str, Any]] = deque(maxlen=_EVENTS)
        self._contact = {"server": False, "samples": False}
        self._state: tuple[str, str, str] | None = None
        self._clock = -math.inf
        self._heard = self._sampled = -math.inf
        self._refused: dict[str, float] = {}

    def status(self, message: Mapping[str, Any]) -> None:
        """Take what the server answered: what the rig is, and its state."""
        rig = {
            "mode": _text(message["mode"]),
            "period": message["period"],
            "watchdog": message["watchdog"],
            "inputs": _texts(message["inputs"]),
            "outputs": _texts(message["outputs"]),
            "limits": {_text(name): _numbers(limit) for name, limit in _few(message["limits"])},
        }
        with self._changed:
            self._heard = monotonic()
            if rig != self._rig:
                self._rig = rig
                self._add({"kind": "rig", **rig})
            self._observe(message)
            self._judge()

    def telemetry(self, message: Mapping[str, Any]) -> None:
        """Take a sample that the server published."""
        now = monotonic()
        refused = [_text(line) for line in message["refused"][:_MOST]]
        sample = {
            "kind": "sample",
            "at": now,
            "inputs": _numbers(message["inputs"]),
            "outputs": _numbers(message["outputs"]),
            "ages": _numbers(message["ages"]),
            "command_age": _number(message.get("command_age")),
        }
        with self._changed:
            self._heard = self._sampled = now
            self._samples.append(sample)
            self._add(sample)
            self._observe(message)
            for line in refused:
                if now - self._refused.get(line, -math.inf) > _AGAIN:
                    self._event("refused", f"refused: {line}")
                    self._refused = {line: now} | dict(list(self._refused.items())[:_MOST])
            self._judge()

    def look(self) -> None:
        """See whether contact was lost; to be called a few times a second."""
        with self._changed:
            self._judge()

    def event(self, kind: str, text: str) -> None:
        """Tell pages that something happened."""
        with self._changed:
            self._event(kind, text)

    def everything(self) -> tuple[int, list[dict[str, Any]]]:
        """Return what a page needs that has just been opened, and the number of the newest item."""
        with self._changed:
            first = monotonic() - MINUTE
            items = [{"kind": "rig", **self._rig}] if self._rig else []
            items += [{"kind": "contact", **self._contact}, *self._events]
            items += [self._state_item(*self._state)] if self._state else []
            return self._serial, items + [
                sample for sample in self._samples if sample["at"] >= first
            ]

    def since(self, serial: int, timeout: float) -> tuple[int, list[dict[str, Any]]]:
        """Wait for items that are newer than a number.

        Parameters
        ----------
        serial : int
            Of the newest one that the page has.
        timeout : float
            Longest wait, in s.

        Returns
        -------
        tuple of int and list of dict
            Number of the newest item, and the items; none if nothing happened.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._serial > serial, timeout)
            return self._serial, [item for number, item in self._items if number > serial]

    def _add(self, item: dict[str, Any]) -> None:
        self._serial += 1
        self._items.append((self._serial, item))
        self._changed.notify_all()

    def _event(self, kind: str, text: str) -> None:
        event = {"kind": "event", "what": kind, "when": time(), "text": text[:_LONGEST]}
        self._events.append(event)
        self._add(event)

    def _observe(self, message: Mapping[str, Any]) -> None:
        """Take the rig's state, unless the message was overtaken on its way, and tell a change."""
        if self._clock - _OVERTAKEN < message["clock"] < self._clock:
            return
        self._clock = message["clock"]
        state = (_text(message["state"]), _text(message["reason"]), _text(message["client"]))
        if state != self._state:
            self._state = state
            self._add(self._state_item(*state))
            name, reason, client = state
            self._event(
                name,
                " · ".join(part for part in (name, reason, client and f"client {client}") if part),
            )

    @staticmethod
    def _state_item(state: str, reason: str, client: str) -> dict[str, Any]:
        return {"kind": "state", "state": state, "reason": reason, "client": client}

    def _judge(self) -> None:
        now = monotonic()
        patience = SILENCE
        if (
            self._rig.get("mode") == REAL_TIME
        ):  # in lockstep there are samples when the client wants them
            patience = max(SILENCE, _PERIODS * self._rig["period"])
        samples = now - self._sampled < patience or self._rig.get("mode", REAL_TIME) != REAL_TIME
        contact = {"server": now - self._heard < SILENCE, "samples": samples}
        if contact == self._contact:
            return
        was, self._contact = self._contact, contact
        self._add({"kind": "contact", **contact})
        if contact["server"] != was["server"]:
            self._event(
                "contact", "contact with the rig's server" if contact["server"] else "contact lost"
            )
        elif contact["server"]:
            self._event(
                "contact",
                "samples arrive" if samples else "the server answers, but no samples arrive",
            )


def _text(value: Any) -> str:
    return str(value)[:_LONGEST]


def _few(mapping: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    return list(mapping.items())[:_MOST]


def _texts(mapping: Mapping[Any, Any]) -> dict[str, str]:
    return {_text(name): _text(value) for name, value in _few(mapping)}


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and abs(value) < 1e300 else None


def _numbers(mapping: Mapping[Any, Any]) -> dict[str, float | None]:
    return {_text(name): _number(value) for name, value in _few(mapping)}
