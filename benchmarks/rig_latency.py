"""Latency of a rig's server: ``python -m benchmarks.rig_latency``.

A client sends at fixed times, to the server and to a bare ZeroMQ echo in a process of its own, in
turns whose order changes from one time to the next, so that both meet the same machine, which is
quiet or has other processes to run. A message is timed from sending it to having its answer. And
stops are timed during floods.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import zmq

from fmus.rig_proxy import local_key
from fmus.rig_proxy.protocol import OPERATOR, REPLIES, decode, encode
from orchestration.rig.server.scheduling import Deadlines
from tests.support.rig.driver import INPUTS, OUTPUTS
from tests.support.rig.floods import CASES, flooded_server, stop_times
from tests.support.rig.process import Server

from .tables import DOCS, Cell, Table, Topic, publish
from .timing import Times

PAGE = DOCS / "rig-latency.md"
RATES = (30, 100, 1000)  # Hz
CROWDS = (0, 4)  # other processes that are busy
SERVER = "rig server"
ECHO = "bare echo"
_PERCENTILES = (50.0, 99.0, 99.9, 100.0)
_NAMES = ("p50", "p99", "p99.9", "longest")


def exchanges(seconds: float = 60.0) -> Topic:
    """Time exchanges at several rates, each for some seconds."""
    rows: list[list[Cell]] = []
    for crowd in CROWDS:
        for rate in RATES:
            with _busy(crowd, 10.0 * seconds):
                rows += [[crowd, *row] for row in _at(rate, seconds)]
    columns = ["other busy processes", "rate, Hz", "", "exchanges", *(f"{n}, us" for n in _NAMES)]
    columns += [f"{name}, ratio" for name in _NAMES]
    columns += ["client's deadlines missed", "rig's deadlines missed"]
    text = (
        f"{seconds:g} s at each rate. The ratio is that to the echo; the target for p99 is 2. A"
        " deadline of the client is missed when both answers took longer than a period; one of the"
        " rig when it took its sample a period late."
    )
    return Topic("Round trip of an exchange on loopback", [text, Table(columns, rows)])


def stops(number: int = 200) -> Topic:
    """Time stops beside busy processes and during floods, each on a connection of its own."""
    ports = {0: "clients'", OPERATOR: "operators'"}
    rows: list[list[Cell]] = []
    for crowd in CROWDS:
        with _busy(crowd, 600.0):
            rows.append([crowd, "none", "", *_stops("", 0, number)])
    rows += [[0, kind, ports[offset], *_stops(kind, offset, number)] for kind, offset in CASES]
    text = (
        f"{number} stops each, from the first byte of a stop's own connection to the answer."
        " Without a flood the target for p99 is 20 ms. A flood of `tests/support/rig/floods.py`"
        " takes all that it can get of the same cores; the aim during one is 50 ms."
    )
    columns = ["other busy processes", "flood", "at the port", *(f"{name}, ms" for name in _NAMES)]
    return Topic("A stop", [text, Table(columns, rows)])


def _stops(kind: str, offset: int, number: int) -> list[float]:
    """Return percentiles of the times of stops, ms."""
    with (
        tempfile.TemporaryDirectory() as folder,
        flooded_server(kind, offset, Path(folder)) as remote,
    ):
        times = 1e3 * np.array(stop_times(remote, number))
    return np.percentile(times, _PERCENTILES).tolist()


@contextmanager
def _busy(number: int, longest: float) -> Iterator[None]:
    """Have processes compute while the context lasts, for a bounded time in any case."""
    command = f"import time\nuntil = time.monotonic() + {longest}\n"
    command += "while time.monotonic() < until: pass"
    with ExitStack() as opened:
        for _ in range(number):
            process = opened.enter_context(subprocess.Popen([sys.executable, "-c", command]))
            opened.callback(process.kill)
        yield


def _echo(pipe: Any) -> None:
    """Send every message back to its sender."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as socket:
        socket.linger = 0
        pipe.send(socket.bind_to_random_port("tcp://127.0.0.1"))
        gc.disable()
        while not pipe.poll(0):
            if socket.poll(100):
                while socket.poll(0):
                    socket.send_multipart(socket.recv_multipart())


def _at(rate: int, seconds: float) -> list[list[Cell]]:
    here, there = multiprocessing.get_context("spawn").Pipe()
    echo = multiprocessing.get_context("spawn").Process(target=_echo, args=(there,), daemon=True)
    echo.start()
    options = ("Logged", "--rate", rate, "--watchdog", 5)
    with (
        tempfile.TemporaryDirectory() as folder,
        Server(Path(folder), *options, options={"log": "/dev/null"}) as server,
        zmq.Context() as context,
    ):
        server.wait_ready()
        client = _Client(context, server.endpoint, f"tcp://127.0.0.1:{here.recv()}")
        times, missed = client.run(rate, round(seconds * rate))
        late = client.ask("status")["counts"]["missed"]
        client.ask("disconnect", session=client.session)
        client.close()
    here.send(None)
    echo.join(5.0)
    found = {
        name: 1e6 * np.percentile(values, _PERCENTILES) for name, values in times.seconds.items()
    }
    deadlines: dict[str, list[Cell]] = {SERVER: [missed, late], ECHO: ["", ""]}
    return [
        [
            rate,
            name,
            len(times.seconds[name]),
            *figures.tolist(),
            *(figures / found[ECHO]).tolist(),
            *deadlines[name],
        ]
        for name, figures in found.items()
    ]


class _Client:
    """Both ends that are compared, each on a socket of its own."""

    def __init__(self, context: zmq.Context[Any], server: str, echo: str) -> None:
        self._sockets = {}
        for name, endpoint in ((SERVER, server), (ECHO, echo)):
            self._sockets[name] = socket = context.socket(zmq.DEALER)
            socket.linger = 0
            socket.routing_id = b"latency"
            socket.rcvtimeo = 1000  # ms
            socket.connect(endpoint)
        names = {"client": "latency", "instance": "latency", "key": local_key.read(server)}
        accepted = self.ask("connect", **names, inputs=INPUTS, outputs=OUTPUTS, time=0.0)
        self.session = accepted["session"]
        self._seen = accepted["clock"]
        self._sequence = 0

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        socket = self._sockets[SERVER]
        socket.send(encode(kind, **fields))
        return decode(socket.recv(), REPLIES)

    def run(self, rate: int, number: int) -> tuple[Times, int]:
        """Exchange at a rate; a tenth, a second at most, goes before and does not count."""
        warm = min(rate, number // 10)
        seconds = {name: np.empty(number + warm) for name in self._sockets}
        names = list(self._sockets)
        gc.disable()
        deadlines = Deadlines(1 / rate, monotonic())
        missed = 0
        for k in range(number + warm):
            deadlines.advance(monotonic())
            sleep(max(0.0, deadlines.next - monotonic()))
            if k == warm:
                missed = deadlines.missed
            frame = self._frame()
            for name in names[k % 2 :] + names[: k % 2]:
                seconds[name][k] = self._exchange(name, frame)
        gc.enable()
        times = Times({name: values[warm:] for name, values in seconds.items()})
        return times, deadlines.missed - missed

    def _frame(self) -> bytes:
        self._sequence += 1
        return encode(
            "exchange",
            session=self.session,
            sequence=self._sequence,
            sent=monotonic(),
            seen=self._seen,
            time=0.0,
            step=0.0,
            values=[0.5, 1.0],
        )

    def _exchange(self, name: str, frame: bytes) -> float:
        begin = monotonic()
        self._sockets[name].send(frame)
        answer = self._sockets[name].recv()
        seconds = monotonic() - begin
        if name == SERVER:
            sample = decode(answer, REPLIES)
            if sample["state"] != "running" or sample["refused"]:
                raise RuntimeError(f"the rig does not run: {sample}")
            self._seen = sample["clock"]
        return seconds

    def close(self) -> None:
        for socket in self._sockets.values():
            socket.close(linger=0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig_latency", description=__doc__)
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="at each rate; the page is written for 60 only"
    )
    parser.add_argument("--out", type=Path, help="page to write; default docs/rig-latency.md")
    chosen = parser.parse_args(arguments)
    number = max(20, round(200 * chosen.seconds / 60.0))
    head = "# Latency of the rig's server\n\nWritten by `python -m benchmarks.rig_latency`."
    page = chosen.out or (PAGE if chosen.seconds >= 60.0 else None)
    publish(head, [exchanges(chosen.seconds), stops(number)], page)


if __name__ == "__main__":
    main()
