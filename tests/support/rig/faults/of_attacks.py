"""Somebody, or the system around the server, means ill."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
import zmq

from fmus.rig_proxy.protocol import LATCHED, TELEMETRY, encode
from tests.support.rig.driver import refusal
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.faults.matrix import SIGNALS
from tests.support.rig.peer import Peer, operators
from tests.support.rig.process import ROOT
from tests.support.rig.terminal import HOLD, Terminal

_PRIVATE_SHM = 'mount -t tmpfs -o size=512k tmpfs /dev/shm && exec "$@"'
_GROWTH = 20e6  # bytes of memory that the front may take for a flood: its queues are bounded


@fault(
    "numbers as 1e999, -1e999 and 1e308 in commands",
    "malformed, or beyond the limits: nothing is carried out; the session goes on",
    quick=True,
)
def infinite(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    session = bench.driver.samples[-1]["session"]
    frame = encode(
        "exchange",
        session=session,
        sequence=2**52,
        sent=0.0,
        seen=0.0,
        time=0.0,
        step=0.0,
        values=[0.125, 0.0],
    )
    with Peer(bench.server.endpoint) as peer:
        for number in (b"1e999", b"-1e999", b"1e308"):
            peer.socket.send(frame.replace(b"0.125", number))
        time.sleep(0.2)
    assert bench.status()["counts"]["malformed"] >= 2
    bench.nothing_unsafe()
    bench.observed = "two are malformed, one is of a session that is not the peer's or beyond"


@fault(
    "exchanges of an old session, sent again",
    "refused, each; nothing of them is carried out; the session goes on",
)
def replayed_session(bench: Bench) -> None:
    server = bench.serve()
    with Peer(server.endpoint, "old") as old:
        accepted = old.connect("old")
        sample = old.exchange(accepted["session"], 1, accepted["clock"], [-0.5, 0.0])
        old.ask("disconnect", session=accepted["session"])
        begun = time.monotonic()
        bench.connect()
        for sequence in range(2, 200):
            answer = old.exchange(accepted["session"], sequence, sample["clock"], [-0.5, 0.0])
            assert answer["type"] == "refused", answer
    bench.goes_on()
    assert not [c for c in server.calls() if c.time > begun and c.what.startswith("write -0.5")]
    bench.observed = "198 refused; the client served throughout"


@fault(
    "measured values alternate between a number and NaN",
    "served; no value is older than two samples; safe when the client hangs",
)
def alternating(bench: Bench) -> None:
    bench.running("read", "alternate")
    bench.pull_trigger()
    bench.driver.wait(50)
    ages = [sample["ages"][0] for sample in bench.driver.samples]
    assert max(ages) < 0.1 + bench.allowance
    _hangs_safely(bench)
    bench.observed = f"ages up to {1000 * max(ages):.0f} ms"


@fault(
    "the front has no descriptors left",
    "the client is served; safe when it hangs; operators are heard when there are some again",
    quick=True,  # nothing else holds that the front goes on
)
def no_descriptors(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    with _no_descriptors(server.process.pid) as front:
        crowd = [Peer(server.endpoint) for _ in range(5)]
        for peer in crowd:
            peer.send("status")
        bench.driver.wait(30)
        _hangs_safely(bench)
        for peer in crowd:
            peer.__exit__()
    assert front.is_running()
    bench.is_latched("no fresh command")
    bench.recovers()
    bench.observed = "served throughout; served again after the acknowledgement"


@fault(
    "the front has no descriptors left, and guard and device are killed",
    "safe all the same",
)
def no_descriptors_to_rescue(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    roles = server.roles()
    with _no_descriptors(server.process.pid):
        now = time.monotonic()
        for process in ("guard", "device"):
            os.kill(roles[process], signal.SIGKILL)
        bench.measure_from_written(bench.safe_after(now))
    bench.observed = "safe"


@contextmanager
def _no_descriptors(pid: int) -> Iterator[psutil.Process]:
    """Let a process open no more files than it has while the context lasts."""
    process = psutil.Process(pid)
    before = process.rlimit(psutil.RLIMIT_NOFILE)
    process.rlimit(psutil.RLIMIT_NOFILE, (3, before[1]))
    try:
        yield process
    finally:
        if process.is_running():
            process.rlimit(psutil.RLIMIT_NOFILE, before)


@fault(
    "the front gets no more memory (RLIMIT_AS), under a flood of long frames",
    "served on, or the front ends: safe in either case",
)
def no_memory(bench: Bench) -> None:
    server = bench.serve()
    driver = bench.connect()
    front = psutil.Process(server.process.pid)
    front.rlimit(psutil.RLIMIT_AS, (front.memory_info().vms + 2**20,) * 2)
    with Peer(server.endpoint) as peer:
        peer.socket.sndhwm = 0
        for _ in range(3000):
            peer.socket.send(b'"' + bytes(60_000))
        time.sleep(2.0)
        if server.process.poll() is None:
            driver.hang()
    bench.measure_from_written(bench.safe_after(bench.link.fresh[0]))
    ended = server.process.poll()
    bench.observed = "served on" if ended is None else f"the front ended, exit status {ended}; safe"


@fault(
    "/dev/shm is full when the device is killed",
    "the guard brings the rig to the safe state, latched",
)
def full_shared_memory(bench: Bench) -> None:
    if os.geteuid() != 0 or shutil.which("unshare") is None:
        pytest.skip("a /dev/shm of its own takes a mount, which is not permitted here")
    server = bench.serve(prefix=["unshare", "-m", "sh", "-c", _PRIVATE_SHM, "sh"])
    bench.connect()
    filler = Path(f"/proc/{server.process.pid}/root/dev/shm/filler")
    with suppress(OSError), filler.open("wb", 0) as file:
        while file.write(bytes(4096)):
            pass
    now = time.monotonic()
    os.kill(server.roles()["device"], signal.SIGKILL)
    bench.measure_from_written(bench.safe_after(now))
    bench.is_latched("ended")
    bench.recovers()
    bench.observed = "safe and latched; served again after the acknowledgement"


@fault(
    "log and state are deleted with their folders, while the server runs",
    "served on; a stop is safe at once, and holds over a restart",
)
def deleted_files(bench: Bench) -> None:
    logs, state = bench.folder / "logs", bench.folder / "state"
    logs.mkdir()
    arguments = ("Logged", "--state", state, "--log")
    server = bench.serve(*arguments, logs / "server.log")
    bench.connect()
    for folder in (logs, state):
        shutil.rmtree(folder)
    bench.goes_on(20)
    _stop(bench)
    time.sleep(0.5)  # the disk gets its time
    server.process.kill()
    bench.all_ended(server.family())
    bench.serve(*arguments, bench.folder / "other.log")
    assert bench.status()["state"] in LATCHED, "released by a restart"
    bench.observed = "served on; stopped at once; latched after the restart"


@fault(
    "the log is a pipe that nobody reads",
    "served, or one line and exit status 2, within 5 s",
)
def pipe_for_a_log(bench: Bench) -> None:
    os.mkfifo(bench.folder / "pipe")
    server = bench.launch("Logged", "--log", bench.folder / "pipe")
    until = time.monotonic() + 5.0
    while time.monotonic() < until and server.process.poll() is None:
        if any("ready: " in line for line in server.lines):
            bench.observed = "served"
            return
        time.sleep(0.01)
    assert server.process.poll() == 2, "it neither serves nor ends"
    bench.observed = server.errors().strip().replace(str(bench.folder), "")


@fault("Ctrl-S in the terminal: what is printed waits", "served on; safe when the client hangs")
def held_terminal(bench: Bench) -> None:
    server = bench.serve(terminal=Terminal())
    bench.connect()
    assert server.terminal is not None
    server.terminal.press(HOLD)
    for _ in range(20):
        assert "one client at a time" in refusal(server.endpoint)
    bench.goes_on(20)
    _hangs_safely(bench)
    bench.observed = "20 events that were to be printed; every exchange answered"


@fault(
    "300 connections that send a byte of their greeting now and then",
    "the client is served; a stop on a new connection is safe within 50 ms",
)
def slow_handshakes(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    host, _, port = server.endpoint.removeprefix("tcp://").rpartition(":")
    greeting = b"\xff" + bytes(8) + b"\x7f\x03"
    places = _listening([(host, int(port) + offset) for offset in (0, 1, 2)])
    crowd = [socket.create_connection(places[k % len(places)]) for k in range(300)]
    try:
        for byte in greeting:
            for connection in crowd:
                with suppress(OSError):  # whoever is slow may be thrown out
                    connection.send(bytes([byte]))
            bench.driver.wait(2)
        _stop(bench)
    finally:
        for connection in crowd:
            connection.close()
    bench.observed = "the client served throughout"


def _listening(places: list[tuple[str, int]]) -> list[tuple[str, int]]:
    """Those of some addresses at which somebody listens."""
    there = []
    for place in places:
        with suppress(OSError), socket.create_connection(place):
            there.append(place)
    return there


@fault(
    "a watcher that never reads, and one with 20,000 subscriptions",
    "the client is served; the front takes less than 20 MB more; a stop is safe within 50 ms",
)
def subscriptions(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    front = psutil.Process(server.process.pid)
    before = front.memory_info().rss
    place, _, port = server.endpoint.rpartition(":")
    telemetry = f"{place}:{int(port) + TELEMETRY}"
    with zmq.Context() as context, context.socket(zmq.SUB) as silent, _flooding(context) as flood:
        silent.rcvhwm = 1
        silent.subscribe(b"")
        silent.connect(telemetry)
        flood.connect(telemetry)
        for _ in range(20_000):
            flood.subscribe(os.urandom(100))
        bench.driver.wait(100)
        grown = front.memory_info().rss - before
        _stop(bench)
        context.destroy(linger=0)
    assert grown < _GROWTH, f"the front took {grown / 1e6:.0f} MB more"
    bench.observed = f"the client served throughout; {grown / 1e6:.1f} MB more"


def _flooding(context: zmq.Context[zmq.Socket[bytes]]) -> zmq.Socket[bytes]:
    flood: zmq.Socket[bytes] = context.socket(zmq.SUB)
    flood.sndhwm = 0
    flood.linger = 0
    return flood


@fault(
    "1,000 peers, each with a name of its own, come and go",
    "the client is served; descriptors and memory are as before; a stop is safe within 50 ms",
)
def many_names(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    front = psutil.Process(server.process.pid)
    before = front.memory_info().rss, front.num_fds()
    for _ in range(100):
        crowd = [Peer(server.endpoint) for _ in range(10)]
        for peer in crowd:
            peer.send("status")
        crowd[0].receive(0.5)
        for peer in crowd:
            peer.__exit__()
    _until(lambda: front.num_fds() <= before[1] + 3, "descriptors are left open")
    grown = front.memory_info().rss - before[0]
    assert grown < _GROWTH, f"the front took {grown / 1e6:.0f} MB more"
    bench.goes_on()
    _stop(bench)
    bench.observed = f"descriptors as before, {grown / 1e6:.1f} MB more"


@fault(
    "SIGCONT and SIGWINCH a thousand times a second to all processes",
    "served; safe when the client hangs",
)
def signal_storm(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    family = server.family()

    def storm() -> None:
        for pid in family:
            os.kill(pid, signal.SIGCONT)
            os.kill(pid, signal.SIGWINCH)
        time.sleep(0.002)

    with _again_and_again(storm):
        bench.goes_on(50)
        _hangs_safely(bench)
    bench.observed = f"{bench.driver.unanswered} exchanges without an answer"


@fault(
    "all processes are stopped for 3 s, and go on",
    "safe at once, latched; nothing that was under way is carried out",
)
def frozen(bench: Bench) -> None:
    server = bench.serve()
    bench.connect(reconnect=True)
    roles = server.roles()
    for pid in roles.values():
        os.kill(pid, signal.SIGSTOP)
    time.sleep(3.0)
    going_on = time.monotonic()
    for process in ("front", "guard", "device"):
        with suppress(ProcessLookupError):  # one that went on first may have ended it
            os.kill(roles[process], signal.SIGCONT)
    safe = bench.safe_after(going_on)
    bench.measure(going_on, safe, "they went on")
    time.sleep(0.5)
    commands = [c for c in server.calls() if c.time > going_on and c.what.startswith("write")]
    assert not commands, commands
    assert bench.status()["state"] in LATCHED
    bench.observed = "safe and latched; no command was carried out"


@fault(
    "a client is stopped for longer than the watchdog time, and goes on",
    "its commands are not carried out any more; latched",
)
def client_goes_on(bench: Bench) -> None:
    server = bench.serve()
    command = [sys.executable, "-m", "tests.support.rig.driver", server.endpoint]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "started\n"
        now = time.monotonic()
        client.send_signal(signal.SIGSTOP)
        safe = bench.safe_after(now)
        bench.measure_from_written(safe, bench.watchdog)
        client.send_signal(signal.SIGCONT)
        time.sleep(0.5)
        client.kill()
    bench.is_latched("no fresh command")
    bench.observed = "safe and latched; nothing was carried out afterwards"


@fault(
    "the device stutters: stopped for 30 ms of every 40 ms",
    "served, or safe and latched; safe when the client hangs",
)
def stutter(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    device = server.roles()["device"]

    def stop_and_go() -> None:
        with suppress(ProcessLookupError):
            os.kill(device, signal.SIGSTOP)
            time.sleep(0.03)
            os.kill(device, signal.SIGCONT)
        time.sleep(0.01)

    with _again_and_again(stop_and_go):
        time.sleep(1.0)
        state = bench.status()["state"]
        _hangs_safely(bench, 0.04)
    bench.observed = f"{state} for a second"


@fault(
    "acknowledgements of an earlier stop arrive after a later one",
    "refused; the later stop holds, and a client that waits for it gets nothing",
    quick=True,
)
def late_acknowledgements(bench: Bench) -> None:
    server = bench.serve()
    bench.connect(reconnect=True)
    with Peer(operators(server.endpoint)) as peer:
        earlier = _latch(peer, "earlier")
        peer.ask("acknowledge", latch=earlier)
        bench.driver.wait(3)
        _latch(peer, "later")
        bench.safe_after(time.monotonic() - 0.1)
        now = time.monotonic()
        for _ in range(50):
            peer.send("acknowledge", latch=earlier)
        answers = [peer.receive()["type"] for _ in range(50)]
    time.sleep(1.0)
    assert bench.status()["state"] in LATCHED, "released by an acknowledgement of another stop"
    assert answers == 50 * ["refused"], answers
    assert not [c for c in server.calls() if c.time > now and c.what.startswith("write")]
    bench.observed = "50 refused; the rig stayed latched"


def _latch(peer: Peer, reason: str) -> str:
    """Stop, and return the name of the latch; empty where latches have no names."""
    peer.ask("stop", reason=reason)
    return str(peer.ask("status").get("latch", ""))


@fault(
    "six failures one after another: device and guard are killed in turns",
    "safe each time, served again after each acknowledgement; no process is left over",
)
def again_and_again(bench: Bench) -> None:
    server = bench.serve()
    processes = len(server.family())
    for number in range(6):
        driver = bench.another(server.endpoint, client=f"client-{number}")
        now = time.monotonic()
        os.kill(server.roles()["device" if number % 2 else "guard"], signal.SIGKILL)
        bench.measure_from_written(bench.safe_after(now))
        driver.stop(orderly=False)
        bench.recovers()
        _until(lambda: len(server.family()) == processes, "not as many processes as before")
    bench.observed = f"{processes} processes, as at the beginning"


@fault(
    "every signal of a terminal, to every process at once",
    "each ends in the safe state in time, or is served on and safe when the client hangs",
)
def signals_to_all(bench: Bench) -> None:
    longest = 0.0
    for name in SIGNALS:
        folder = bench.folder / name
        folder.mkdir()
        with Bench(folder, bench.allowance, bench.watchdog) as one:
            server = one.serve()
            one.connect()
            now = time.monotonic()
            for pid in server.family():
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.Signals[f"SIG{name}"])
            time.sleep(one.promised)
            one.driver.hang()
            one.measure_from_written(one.safe_after(now))
            assert one.measured is not None
            longest = max(longest, one.measured)
            bound = one.promised
    bench.note(longest, bound, "last command carried out, the longest")
    bench.observed = f"{', '.join(SIGNALS)}: safe, each"


@fault("SIGKILL of all helpers that are none of the three", "served; safe when the client hangs")
def helpers_killed(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    helpers = server.family() - set(server.roles().values())
    for pid in helpers:
        os.kill(pid, signal.SIGKILL)
    bench.goes_on(50)
    _hangs_safely(bench)
    bench.observed = f"{len(helpers)} killed; served on"


@contextmanager
def _again_and_again(act: Callable[[], None]) -> Iterator[None]:
    """Do something in a thread, again and again while the context lasts."""
    over = threading.Event()

    def work() -> None:
        with suppress(ProcessLookupError):
            while not over.is_set():
                act()

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(5.0)


def _hangs_safely(bench: Bench, more: float = 0.0) -> None:
    """Let the client hang; the watchdog must work."""
    bench.driver.hang()
    bench.measure_from_fresh(bench.safe_after(bench.link.fresh[0]), more)


def _stop(bench: Bench) -> None:
    """Stop on a connection of its own, which must be safe within 50 ms."""
    now = time.monotonic()
    with Peer(operators(bench.server.endpoint)) as peer:
        peer.ask("stop", reason="tried")
    bench.note(bench.safe_after(now).time - now, 0.05, "the stop was sent")


def _until(holds: Callable[[], bool], otherwise: str, timeout: float = 10.0) -> None:
    until = time.monotonic() + timeout
    while not holds():
        assert time.monotonic() < until, otherwise
        time.sleep(0.02)
