"""Faults of messages: a cable that loses, delays, doubles, swaps and damages them, repeatably.

It also writes down when it handed a fresh command to the server, from which the time to the safe
state is measured. Faults of the bytes below are in :mod:`tests.support.rig.relay`.
"""

from __future__ import annotations

import heapq
import itertools
import json
import math
import random
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import zmq

LIMITS = ((-1.3, 1.3), (0.0, 3.0))  # of the commands of tests.support.rig.backends
Treatment = Callable[[bytes, random.Random], list[tuple[float, bytes]]]


def clean(frame: bytes, chance: random.Random) -> list[tuple[float, bytes]]:
    """Hand on at once."""
    return [(0.0, frame)]


def dropping(share: float) -> Treatment:
    """Lose a share of the messages."""
    return lambda frame, chance: [] if chance.random() < share else [(0.0, frame)]


def delaying(least: float, most: float) -> Treatment:
    """Hold each message for a time in s; those behind it may overtake it."""
    return lambda frame, chance: [(chance.uniform(least, most), frame)]


def doubling(frame: bytes, chance: random.Random) -> list[tuple[float, bytes]]:
    """Hand on twice, the second time up to 30 ms later."""
    return [(0.0, frame), (chance.uniform(0.0, 0.03), frame)]


def damaging(share: float) -> Treatment:
    """Change up to three bytes in a share of the messages."""

    def treat(frame: bytes, chance: random.Random) -> list[tuple[float, bytes]]:
        if chance.random() >= share:
            return [(0.0, frame)]
        damaged = bytearray(frame)
        for _ in range(chance.randint(1, 3)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        return [(0.0, bytes(damaged))]

    return treat


class BadLink:
    """A forwarder in a thread of its own.

    Attributes
    ----------
    treatment : callable
        Done to every message in either direction; may be changed at any time.
    fresh : list of float
        Times at which a command that is new, within its limits and not too long under way was
        handed to the server, in s of the monotonic clock.
    """

    def __init__(
        self,
        server: str,
        watchdog: float = 0.2,
        limits: Sequence[tuple[float, float]] = LIMITS,
    ) -> None:
        self.treatment: Treatment = clean
        self.fresh: list[float] = []
        self.carried = 0
        self._server, self._chance = server, random.Random(0)
        self._watchdog = watchdog
        self._limits = limits
        self._sequences: dict[str, int] = {}
        self._backs: dict[bytes, Any] = {}  # connections to the server, by client
        # messages under way: when each is due, its number, whose it is, and where it goes
        self._waiting: list[tuple[float, int, bytes, bytes, bool, bool]] = []
        self._numbers = itertools.count()
        self._context = zmq.Context()
        self._front = self._context.socket(zmq.ROUTER)
        self._front.linger = 0
        self._front.router_handover = 1  # a client may come again under its name
        port = self._front.bind_to_random_port("tcp://127.0.0.1")
        self.endpoint = f"tcp://127.0.0.1:{port}"
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        poller = zmq.Poller()
        poller.register(self._front, zmq.POLLIN)
        while not self._ending.is_set():
            left = min(self._waiting[0][0] - time.monotonic(), 0.02) if self._waiting else 0.02
            for socket, _ in poller.poll(max(0, math.ceil(1000 * left))):
                if socket is self._front:
                    self._take_from_client(poller)
                else:
                    self._take_from_server(socket)
            self._hand_on_what_is_due()
        for back in self._backs.values():
            back.close(linger=0)

    def _take_from_client(self, poller: zmq.Poller) -> None:
        peer, frame = self._front.recv_multipart()
        if peer not in self._backs:
            self._backs[peer] = back = self._context.socket(zmq.DEALER)
            back.linger = 0
            back.routing_id = b"link-" + peer.hex().encode()
            back.connect(self._server)
            poller.register(back, zmq.POLLIN)
        self._delay(peer, frame, upward=True)

    def _take_from_server(self, socket: Any) -> None:
        peer = next(name for name, back in self._backs.items() if back is socket)
        self._delay(peer, socket.recv(), upward=False)

    def _delay(self, peer: bytes, frame: bytes, *, upward: bool) -> None:
        for delay, changed in self.treatment(frame, self._chance):
            due, counts = time.monotonic() + delay, upward and changed == frame
            message = (due, next(self._numbers), peer, changed, upward, counts)
            heapq.heappush(self._waiting, message)

    def _hand_on_what_is_due(self) -> None:
        while self._waiting and self._waiting[0][0] <= time.monotonic():
            _, _, peer, frame, upward, counts = heapq.heappop(self._waiting)
            if upward:
                self._hand_on(self._backs[peer], [frame], counts)
            else:
                self._hand_on(self._front, [peer, frame], counts)

    def _hand_on(self, socket: Any, frames: list[bytes], counts: bool) -> None:
        self.carried += 1
        now = time.monotonic()
        try:
            socket.send_multipart(frames, zmq.NOBLOCK)
        except zmq.ZMQError:
            return
        if counts and self._is_fresh(frames[0], now):
            self.fresh.append(now)

    def _is_fresh(self, frame: bytes, now: float) -> bool:
        try:
            message = json.loads(frame)
            session, sequence, values = message["session"], message["sequence"], message["values"]
            new = sequence > self._sequences.get(session, 0)
            new = new and now - message["seen"] <= self._watchdog
            fits = all(
                low <= value <= high
                for value, (low, high) in zip(values, self._limits, strict=True)
            )
        except (ValueError, KeyError, TypeError):
            return False
        if new:
            self._sequences[session] = sequence
        return new and fits

    def close(self) -> None:
        """End the thread and let go of the sockets."""
        self._ending.set()
        self._thread.join(10.0)
        self._front.close(linger=0)
        self._context.destroy(linger=0)
