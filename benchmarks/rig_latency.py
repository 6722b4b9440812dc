"""Latency of a rig's server: ``python -m benchmarks.rig_latency``.

Of exchanges beside a bare ZeroMQ echo, and of a stop beside floods. A client sends at fixed times,
to the server and to an echo in a process of its own, in turns whose order changes from one time to
the next, so that both meet the same machine, which is quiet or has other processes to run. A
message is timed from sending it to having its answer.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import zmq
from numpy.typing import NDArray

from fmus.rig_proxy.protocol import OPERATOR, REPLIES, decode, encode
from orchestration.rig.server.scheduling import Deadlines
from tests.support.rig.driver import INPUTS, OUTPUTS
from tests.support.rig.floods import CASES, flooded_server, stop_times
from tests.support.rig.process import Server

from . import machine
from .tables import Cell, Table, Topic

PAGE = Path(__file__).resolve().parent.parent / "docs" / "rig-latency.md"
RATES = (30, 100, 1000)  # Hz
CROWDS = (0, 4)  # busy processes beside
SERVER = "rig server"
ECHO = "bare echo"
TARGET = 2.0  # of the echo's p99
_PERCENTILES = (50.0, 99.0, 99.9)
_PATIENCE = 1000  # ms for an answer


def measure(
    seconds: float = 60.0, rates: Sequence[int] = RATES, crowds: Sequence[int] = CROWDS
) -> Topic:
    """Measure at several rates.

    Parameters
    ----------
    seconds : float
        How long at each.
    rates : sequence of int
        Exchanges per second, and samples of the rig.
    crowds : sequence of int
        Numbers of busy processes beside.

    Returns
    -------
    Topic
    """
    rows: list[list[Cell]] = []
    for crowd in crowds:
        for rate in rates:
            with _busy(crowd, 10.0 * seconds):
                rows += [[crowd, *row] for row in _at(rate, seconds)]
    columns = ["busy processes beside", "rate, Hz", "who", "exchanges"]
    columns += [*(f"p{p:g}, us" for p in _PERCENTILES), "longest, us"]
    columns += [f"p{p:g}, ratio" for p in _PERCENTILES]
    columns += ["client's deadlines missed", "rig's deadlines missed"]
    return Topic(
        "Round trip of an exchange on loopback",
        [
            (
                f"{seconds:g} s at each rate. The ratio is that to the echo; the target for p99 is"
                f" {TARGET:g}. A deadline of the client is missed when both answers took longer"
                " than a period; one of the rig when it took its sample a period late."
            ),
            Table(columns, rows),
        ],
    )


def measure_stops(number: int = 200) -> Topic:
    """Measure how long a stop takes beside floods of hostile peers.

    Parameters
    ----------
    number : int
        Stops beside each flood, every one on a connection of its own.

    Returns
    -------
    Topic
    """
    ports = {0: "clients'", OPERATOR: "operators'"}
    rows = [["none", "", *_stops("", 0, number)]]
    rows += [[kind, ports[offset], *_stops(kind, offset, number)] for kind, offset in CASES]
    columns = ["flood", "at the port", *(f"p{p:g}, ms" for p in _PERCENTILES), "longest, ms"]
    return Topic(
        "A stop beside a flood",
        [
            (
                f"{number} stops beside each kind of flood of `tests/support/rig/floods.py`, which"
                " takes what it can get of the same cores; from the first byte of a stop's own"
                " connection to the answer. The aim is 50 ms."
            ),
            Table(columns, rows),
        ],
    )


def _stops(kind: str, offset: int, number: int) -> list[Cell]:
    """Return percentiles of the times of stops, and the longest, in ms."""
    with (
        tempfile.TemporaryDirectory() as folder,
        flooded_server(kind, offset, Path(folder)) as remote,
    ):
        times = 1e3 * np.array(stop_times(remote, number))
    return [*map(float, np.percentile(times, _PERCENTILES)), float(times[-1])]


@contextmanager
def _busy(number: int, longest: float) -> Iterator[None]:
    """Have busy processes run beside while the context lasts, for a bounded time in any case."""
    command = f"import time\nuntil = time.monotonic() + {longest}\n"
    command += "while time.monotonic() < until: pass"
    with ExitStack() as beside:
        for _ in range(number):
            process = beside.enter_context(subprocess.Popen([sys.executable, "-c", command]))
            beside.callback(process.kill)
        yield


def _echo(pipe: Any) -> None:
    """Send back whatever comes, to whom it came from."""
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
    with (
        tempfile.TemporaryDirectory() as folder,
        Server(
            Path(folder), "Logged", "--rate", rate, "--watchdog", 5, options={"log": "/dev/null"}
        ) as server,
    ):
        server.wait_ready()
        with zmq.Context() as context:
            client = _Client(context, server.endpoint, f"tcp://127.0.0.1:{here.recv()}")
            times, missed = client.run(rate, seconds)
            late = client.ask("status")["counts"]["missed"]
            client.ask("disconnect", session=client.session)
            client.close()
    here.send(None)
    echo.join(5.0)
    found = {name: np.percentile(1e6 * values, _PERCENTILES) for name, values in times.items()}
    ratios = found[SERVER] / found[ECHO]
    return [
        [
            rate,
            SERVER,
            len(times[SERVER]),
            *map(float, found[SERVER]),
            1e6 * float(times[SERVER].max()),
            *map(float, ratios),
            missed,
            late,
        ],
        [
            rate,
            ECHO,
            len(times[ECHO]),
            *map(float, found[ECHO]),
            1e6 * float(times[ECHO].max()),
            1.0,
            1.0,
            1.0,
            "",
            "",
        ],
    ]


class _Client:
    """Both ends that are compared, each on a socket of its own."""

    def __init__(self, context: zmq.Context[Any], server: str, echo: str) -> None:
        self._sockets = {}
        for name, endpoint in ((SERVER, server), (ECHO, echo)):
            self._sockets[name] = socket = context.socket(zmq.DEALER)
            socket.linger = 0
            socket.routing_id = b"latency"
            socket.rcvtimeo = _PATIENCE
            socket.connect(endpoint)
        who = {"client": "latency", "instance": "latency"}
        accepted = self.ask("connect", **who, inputs=INPUTS, outputs=OUTPUTS, time=0.0)
        self.session = accepted["session"]
        self._seen = accepted["clock"]
        self._sequence = 0

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        socket = self._sockets[SERVER]
        socket.send(encode(kind, **fields))
        return decode(socket.recv(), REPLIES)

    def run(self, rate: int, seconds: float) -> tuple[dict[str, NDArray[np.float64]], int]:
        """Exchange at a rate; the first tenth, a second at most, does not count."""
        number = round(rate * seconds)
        warm = min(rate, round(0.1 * rate * seconds))
        times = {name: np.empty(number) for name in self._sockets}
        turns = [list(self._sockets), list(self._sockets)[::-1]]
        gc.disable()
        deadlines = Deadlines(1 / rate, monotonic())
        missed = 0
        for k in range(-warm, number):
            deadlines.advance(monotonic())
            sleep(max(0.0, deadlines.next - monotonic()))
            if k == 0:
                missed = deadlines.missed
            frame = self._frame()
            for name in turns[k % 2]:
                took = _timed(self._sockets[name], frame, self._learn if name == SERVER else None)
                if k >= 0:
                    times[name][k] = took
        gc.enable()
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

    def _learn(self, frame: bytes) -> None:
        sample = decode(frame, REPLIES)
        if sample["state"] != "running" or sample["refused"]:
            raise RuntimeError(f"the rig does not run: {sample}")
        self._seen = sample["clock"]

    def close(self) -> None:
        for socket in self._sockets.values():
            socket.close(linger=0)


def _timed(socket: Any, frame: bytes, then: Callable[[bytes], None] | None) -> float:
    begun = monotonic()
    socket.send(frame)
    answer = socket.recv()
    took = monotonic() - begun
    if then is not None:
        then(answer)
    return took


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rig_latency", description=__doc__)
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="at each rate; the page is written for 60 only"
    )
    parser.add_argument("--out", type=Path, help="page to write; default docs/rig-latency.md")
    chosen = parser.parse_args(arguments)
    parts = [
        "# Latency of the rig's server\n\nWritten by `python -m benchmarks.rig_latency`.",
        str(machine.describe()),
        str(measure(chosen.seconds)),
        str(measure_stops(max(20, round(200 * chosen.seconds / 60.0)))),
    ]
    print("\n\n".join(parts[1:]))
    page = chosen.out or (PAGE if chosen.seconds >= 60.0 else None)
    if page is not None:
        page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
