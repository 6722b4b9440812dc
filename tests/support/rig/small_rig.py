"""A whole rig server of the tests' own: state, limits, watchdog, telemetry and keys, all as the
protocol wants them.

Written from ``docs/reference/protocol.md``, it shares with the project nothing but the key file. In
a thread (:class:`SmallRig`), or as a process that can be killed (:func:`small_rig_process`).
Answers that the protocol does not allow are the affair of :mod:`tests.support.rig.scripted_rig`.
"""

from __future__ import annotations

import itertools
import json
import math
import random
import socket
import subprocess
import sys
import threading
import time
import tomllib
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import zmq
from zmq.auth.thread import ThreadAuthenticator

from tests.support.rig.process import module_process

INPUTS, OUTPUTS = {"current": "A", "force": "N"}, {"voltage": "V", "displacement": "m"}
LIMITS = {
    "current": {"min": -1.3, "max": 1.3, "rate": None},
    "force": {"min": 0.0, "max": 3.0, "rate": None},
    "voltage": {"min": -1.0, "max": 1.0, "rate": None},
}

STATUS = {
    "mode": "real-time",
    "state": "idle",
    "reason": "",
    "client": "",
    "inputs": INPUTS,
    "outputs": OUTPUTS,
    "limits": LIMITS,
    "period": 0.05,
    "watchdog": 1.0,
}
"""Of a rig at rest, as far as a recording needs it."""

OPERATORS = ("stop", "acknowledge", "status")  # what an operator may send
ALL = ("connect", "exchange", "disconnect", "stop", "status")  # and a client

LEVELS = """
title = "Levels"
component = "ppy_actuator"
duration = "{duration} s"
step = "{step} s"
record = ["voltage", "displacement"]
seed = 3

[inputs]
force = "1 N"

[inputs.current]
kind = "multilevel"
levels = ["-0.9 A", "0 A", "0.5 A", "1.2 A"]
dwell = ["{step} s", "{step} s"]
"""


def gains(inputs: Mapping[str, float], now: float) -> dict[str, float]:
    """Outputs that follow at once: whoever pairs an input with the output of another moment is
    found out.
    """
    return {
        "voltage": 0.6 * inputs["current"],
        "displacement": 1e-4 * inputs["force"] - 2e-5 * inputs["current"],
    }


# Below the ports that systems hand out by themselves, so that no other socket gets one of three
# between this moment and that in which a process, seconds later, binds them.
_THREES = itertools.cycle(random.SystemRandom().sample(range(12000, 32000, 4), 5000))


def free_port() -> int:
    """A port that is free, and so are the two above it."""
    for port in itertools.islice(_THREES, 5000):
        with socket.socket() as first, socket.socket() as second, socket.socket() as third:
            try:
                for offset, held in enumerate((first, second, third)):
                    held.bind(("127.0.0.1", port + offset))
            except OSError:
                continue
            return port
    raise RuntimeError("no three free ports")


class SmallRig:
    """A rig server in a thread.

    `heard` is every request, `applied` every pair of a clock and the inputs that were applied from
    then on. A test may set `answers`, `publishes`, `measures` to False, or change `state`,
    `reason`, `latch`, `alarm`, `client`, `period`, at any time; what is in `then`, by number, is
    done before that exchange is answered. The safe state takes `settling` s; where that is longer
    than `bound`, it is `not reached`, and becomes `safe` late. Telemetry says of `unknown` inputs
    that nobody knows them, gives `read_back` as it is, and is under way for `transit` s.
    """

    def __init__(
        self,
        port: int | None = None,
        plant: Callable[[Mapping[str, float], float], Mapping[str, float]] = gains,
        inputs: Mapping[str, str] = INPUTS,
        outputs: Mapping[str, str] = OUTPUTS,
        limits: Mapping[str, Any] = LIMITS,
        period: float = 0.02,
        watchdog: float = 1.0,
        keys: Path | None = None,
        mode: str = "real-time",
    ):
        self.port = free_port() if port is None else port
        self.endpoint = f"tcp://127.0.0.1:{self.port}"
        self.plant, self.inputs, self.outputs, self.limits = plant, inputs, outputs, limits
        self.period, self.watchdog, self.keys, self.mode = period, watchdog, keys, mode
        self.state, self.reason, self.client, self.session = "idle", "", "", ""
        self.latch, self.alarm, self.reached, self.instance = "", "", None, ""
        self.settling, self.bound = 0.0, 0.2
        self.unknown: set[str] = set()
        self.read_back: dict[str, float | None] = {}
        self.transit = 0.0  # s
        self._under_way: deque[tuple[float, bytes]] = deque()
        self.clock_ahead = 0.0  # s: of this rig's clock, which is nobody else's
        self._latched: float | None = None
        self.answers = self.publishes = self.measures = True
        self.heard: list[dict[str, Any]] = []
        self.then: dict[int, Callable[[], object]] = {}
        self.applied: list[tuple[float, dict[str, float]]] = []
        self._commands = dict.fromkeys(inputs, 0.0)
        self._order: tuple[list[str], list[str]] = ([], [])
        self._values: dict[str, float | None] = dict.fromkeys(outputs)
        self._measured, self._last = 0.0, 0
        self._fresh: float | None = None  # when the newest command of the session came
        self._ends, self._ready = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> SmallRig:
        self._thread.start()
        assert self._ready.wait(10.0), "the small rig did not come up"
        return self

    def __exit__(self, *error: object) -> None:
        self._ends.set()
        self._thread.join(10.0)
        assert not self._thread.is_alive()

    def of_type(self, kind: str) -> list[dict[str, Any]]:
        """Requests of a type."""
        return [message for message in list(self.heard) if message["type"] == kind]

    def safe(self, reason: str) -> None:
        """Go to the safe state, latched."""
        now = self._latched = time.monotonic()
        self.latch, self.reason, self.reached = f"{now:.6f}", reason, None
        self.state = "stopping"
        self._settle(now, now)

    def acknowledge(self) -> None:
        """Release the latch, and clear the alarm."""
        self.state, self.reason, self.session, self.client = "idle", "", "", ""
        self.latch, self.alarm, self.instance = "", "", ""
        self.reached = self._latched = None

    def _settle(self, now: float, latched: float) -> None:
        """Go on towards the safe state."""
        taken = now - latched
        if taken >= self.settling:
            self.state, self.reached = "safe", taken
            self._commands = dict.fromkeys(self.inputs, 0.0)
        elif taken > self.bound:
            self.state, self.alarm = "not reached", f"not safe within {self.bound:g} s"

    # --- what runs in the thread
    # -------------------------------------------------------------------------------

    def _run(self) -> None:
        context, authenticator = zmq.Context(), None
        router, publisher = context.socket(zmq.ROUTER), context.socket(zmq.PUB)
        operators = context.socket(zmq.ROUTER)
        if self.keys is not None:
            table = tomllib.loads(self.keys.read_text())
            authenticator = ThreadAuthenticator(context)
            authenticator.start()
            authenticator.configure_curve_callback("*", _Allowed(table["clients"]))
            for each in (router, publisher, operators):
                each.curve_server = True
                each.curve_publickey = table["public_key"].encode()
                each.curve_secretkey = table["secret_key"].encode()
        for offset, each in enumerate((router, publisher, operators)):
            each.linger = 0
            each.bind(f"tcp://127.0.0.1:{self.port + offset}")
        poller = zmq.Poller()
        poller.register(router, zmq.POLLIN)
        poller.register(operators, zmq.POLLIN)
        self._ready.set()
        following = time.monotonic()
        while not self._ends.is_set():
            now = time.monotonic()
            if now >= following:
                following = max(following + self.period, now)
                self._sample(publisher, now)
            for each, _ in poller.poll(max(0, min(20, math.ceil(1000.0 * (following - now))))):
                self._answer(each, each.recv_multipart(), OPERATORS if each is operators else ALL)
        if authenticator is not None:
            authenticator.stop()
        context.destroy(linger=0)

    def _sample(self, publisher: Any, now: float) -> None:
        if (
            self.state == "running"
            and self._fresh is not None
            and now - self._fresh > self.watchdog
            and self.mode == "real-time"
        ):
            self.safe(f"no command for {self.watchdog:g} s")
        if self._latched is not None and self.state in ("stopping", "not reached"):
            self._settle(now, self._latched)
        if not self.applied or self.applied[-1][1] != self._commands:
            self.applied.append((now, dict(self._commands)))
        if self.measures:
            self._values, self._measured = dict(self.plant(self._commands, now)), now
        if self.publishes:
            self._publish(publisher, now)

    def _publish(self, publisher: Any, now: float) -> None:
        message = {
            "ppy": 2,
            "type": "telemetry",
            **self._condition(now),
            "inputs": {**self._commands, **dict.fromkeys(self.unknown)},
            "read_back": self.read_back,
            "outputs": self._values,
            "ages": dict.fromkeys(self.outputs, now - self._measured),
            "command_age": None if self._fresh is None else now - self._fresh,
            "refused": [],
        }
        self._under_way.append((now + self.transit, json.dumps(message).encode()))
        while self._under_way and self._under_way[0][0] <= now:
            publisher.send(self._under_way.popleft()[1])

    def _answer(self, router: Any, frames: list[bytes], taken: tuple[str, ...]) -> None:
        if frames[0].startswith(b"\0"):
            return  # a peer that has not said its name
        message = json.loads(frames[-1])
        if message["type"] not in taken:
            return
        self.heard.append(message)
        reply = getattr(self, f"_{message['type']}")(message)
        if self.answers and reply is not None:
            router.send_multipart([frames[0], json.dumps({"ppy": 2, **reply}).encode()])

    def _about(self) -> dict[str, Any]:
        return {
            "mode": self.mode,
            "period": self.period,
            "watchdog": self.watchdog,
            "limits": self.limits,
        }

    def _condition(self, now: float) -> dict[str, Any]:
        return {
            "state": self.state,
            "reason": self.reason,
            "latch": self.latch,
            "reached": self.reached,
            "alarm": self.alarm,
            "clock": now + self.clock_ahead,
            "client": self.client,
        }

    def _newest(self, now: float) -> dict[str, Any]:
        names = self._order[1]
        if self.mode == "lockstep":  # what follows a command at once is its client's to see
            self._values, self._measured = dict(self.plant(self._commands, now)), now
        age = [None if self._values[name] is None else now - self._measured for name in names]
        clock = now + self.clock_ahead
        return {"clock": clock, "values": [self._values[name] for name in names], "ages": age}

    def _connect(self, message: dict[str, Any]) -> dict[str, Any]:
        wanted = (message["inputs"], message["outputs"])
        if self.latch:
            return {"type": "refused", "reason": f"the rig is {self.state}: {self.reason}"}
        if self.session and self.instance != message["instance"]:
            return {"type": "refused", "reason": f"the rig serves {self.client}"}
        if wanted[0] != dict(self.inputs) or any(
            self.outputs.get(n) != u for n, u in wanted[1].items()
        ):
            return {"type": "refused", "reason": "other signals or units"}
        self._order = (list(wanted[0]), list(wanted[1]))
        now = time.monotonic()
        self.state, self.client, self.session = "running", message["client"], f"{now:.6f}"
        self.instance, self._fresh, self._last = message["instance"], None, 0
        return {"type": "accepted", "session": self.session, **self._about(), **self._newest(now)}

    def _exchange(self, message: dict[str, Any]) -> dict[str, Any] | None:
        self.then.get(message["sequence"], lambda: None)()
        if message["session"] != self.session:
            return {"type": "refused", "reason": "no such session"}
        if message["sequence"] <= self._last:
            return None
        now, self._last, refused = time.monotonic(), message["sequence"], []
        if self.state == "running":
            self._fresh = now
            for name, value in zip(self._order[0], message["values"], strict=True):
                limit = self.limits.get(name, {"min": None, "max": None})
                if (limit["min"] is not None and value < limit["min"]) or (
                    limit["max"] is not None and value > limit["max"]
                ):
                    refused.append(f"{name} = {value:g} is beyond its limit")
                else:
                    self._commands = {**self._commands, name: value}
        return {
            "type": "sample",
            "session": self.session,
            "sequence": self._last,
            "sent": message["sent"],
            "state": self.state,
            "reason": self.reason,
            "refused": refused,
            **self._newest(now),
        }

    def _disconnect(self, message: dict[str, Any]) -> dict[str, Any]:
        if message["session"] == self.session:
            self.session, self.client, self.instance = "", "", ""
            self.state = "idle" if self.state == "running" else self.state
            self._commands = dict.fromkeys(self.inputs, 0.0)
        return {"type": "disconnected"}

    def _stop(self, message: dict[str, Any]) -> dict[str, Any]:
        self.safe(message["reason"])
        return self._status(message)

    def _acknowledge(self, message: dict[str, Any]) -> dict[str, Any]:
        if message["latch"] != self.latch:
            return {"type": "refused", "reason": f"the present latch is {self.latch!r}"}
        self.acknowledge()
        return self._status(message)

    def _status(self, message: dict[str, Any]) -> dict[str, Any]:
        return {
            "type": "status",
            **self._condition(time.monotonic()),
            "inputs": self.inputs,
            "outputs": self.outputs,
            **self._about(),
            "counts": {"malformed": 0, "late": 0, "repeated": 0},
        }


class _Allowed:
    def __init__(self, clients: list[dict[str, str]]):
        self._clients = {client["key"].encode() for client in clients}

    def callback(self, domain: str, key: bytes) -> bool:
        return key in self._clients  # as Z85


def small_rig_process(port: int, *keys: Path) -> AbstractContextManager[subprocess.Popen[str]]:
    """Serve in a process of its own, for a test to kill."""
    return module_process(__name__, port, *keys)


def main() -> None:
    """Serve until killed; says ``ready`` when the sockets are there."""
    keys = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    with SmallRig(int(sys.argv[1]), keys=keys):
        print("ready", flush=True)
        threading.Event().wait()


if __name__ == "__main__":
    main()
