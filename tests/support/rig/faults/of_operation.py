"""Faults by operators and by the system around the server."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import zmq

from orchestration.rig.keys import add_client, make_keys
from tests.support.rig.driver import refusal
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.process import ROOT

_JUMPS = Path(__file__).with_name("clock_jumps.c")


@fault(
    "ppy rig stop",
    "safe within a period, latched, with the reason; goes on after the acknowledgement",
    quick=True,
)
def stopped(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    now = time.monotonic()
    printed = _ppy("stop", "--endpoint", server.endpoint, "--reason", "smoke")
    bench.measure_from_written(bench.safe_after(now))
    assert re.match(r"safe \(reached after [0-9.]+ m?s\): stopped: smoke", printed), printed
    bench.is_latched("stopped: smoke")
    latch = bench.status()["latch"]
    assert "idle" in _ppy("acknowledge", "--endpoint", server.endpoint, "--latch", latch)
    assert (
        json.loads(_ppy("status", "--json", "-", "--endpoint", server.endpoint))["state"] == "idle"
    )
    bench.observed = printed.partition(";")[0]


def _ppy(*arguments: str) -> str:
    command = [sys.executable, "-m", "orchestration.cli", "rig", *arguments]
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=30, check=True
    ).stdout


@fault("SIGUSR1", "safe within a period, latched; goes on after the acknowledgement", quick=True)
def signalled(bench: Bench) -> None:
    server = bench.serve()
    bench.connect()
    now = time.monotonic()
    server.send(signal.SIGUSR1)
    bench.measure_from_written(bench.safe_after(now))
    server.wait_line("SAFE STATE: stopped: SIGUSR1")
    bench.is_latched("SIGUSR1")
    bench.recovers()
    bench.observed = "safe: stopped: SIGUSR1"


@fault(
    "the wall clock jumps by an hour, to and fro", "nothing: no decision depends on it", quick=True
)
def wall_clock(bench: Bench) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler, "no C compiler here"
    library = bench.folder / "clock_jumps.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, _JUMPS, "-ldl"], check=True)
    environment = {"LD_PRELOAD": str(library)}
    hour = (
        "import time; seen = [time.sleep(0.01) or time.time() for _ in range(30)]; print(max(seen)"
        " - min(seen) > 1800)"
    )
    done = subprocess.run(
        [sys.executable, "-c", hour], env={**os.environ, **environment}, capture_output=True
    )
    assert done.stdout == b"True\n", "the clock does not jump"
    server = bench.serve(environment=environment)
    driver = bench.connect()
    driver.wait(100)
    assert {sample["state"] for sample in driver.samples} == {"running"}
    assert max(sample["ages"][0] for sample in driver.samples) < 0.1 + bench.allowance
    driver.hang()
    bench.measure_from_fresh(server.wait_call("safe", bench.link.fresh[0]))
    bench.observed = (
        f"{len(driver.samples)} exchanges while it jumped every 0.1 s; safe in time when the client"
        " hung"
    )


@fault(
    "no key", "gets nothing, not even a refusal; told in the log; who has one is served", quick=True
)
def no_key(bench: Bench) -> None:
    _keys(bench, None)
    bench.observed = (
        "no answer to either socket; turned away, in the log; the client with a key was served"
    )


@fault(
    "a wrong key",
    "gets nothing, not even a refusal; told in the log; who has one is served",
    quick=True,
)
def wrong_key(bench: Bench) -> None:
    folder = bench.folder / "stranger"
    make_keys(folder)
    stranger = add_client(folder, "stranger")
    ours = bench.folder / "keys"
    make_keys(ours)
    text = stranger.read_text()
    theirs, wanted = (
        _value(path.read_text(), "server_key") for path in (stranger, ours / "rig-client.toml")
    )
    stranger.write_text(
        text.replace(theirs, wanted)
    )  # it knows the server's public key, and is not known there
    _keys(bench, stranger)
    bench.observed = "no answer; turned away, in the log; the client with a key was served"


def _value(text: str, key: str) -> str:
    return next(line.split('"')[1] for line in text.splitlines() if line.startswith(key))


def _keys(bench: Bench, credentials: Path | None) -> None:
    folder = bench.folder / "keys"
    if not folder.exists():
        make_keys(folder)
    server = bench.serve("Logged", "--keys", folder / "rig-server.toml")
    reason = refusal(server.endpoint, credentials, 1.0)
    assert "no answer within" in reason, reason
    if credentials is None:
        host, _, port = server.endpoint.rpartition(":")
        with zmq.Context() as context, context.socket(zmq.SUB) as watcher:
            watcher.linger = 0
            watcher.subscribe(b"")
            watcher.connect(f"{host}:{int(port) + 1}")
            assert not watcher.poll(500), "telemetry without a key"
    server.wait_line("a peer was turned away")
    driver = bench.another(server.endpoint, credentials=folder / "rig-client.toml")
    assert driver.samples[-1]["state"] == "running"


@fault("the disk is full while the log is written", "served on; the log goes on at the terminal")
def disk_full(bench: Bench) -> None:
    server = bench.serve("Logged", "--log", "/dev/full")
    bench.connect()
    bench.goes_on(20)
    server.wait_line("--log /dev/full is not written any more")
    assert bench.driver.unanswered == 0
    bench.observed = "one line; every exchange answered"


@fault("nobody reads what the server prints", "served on: it never waits for a terminal")
def nobody_reads(bench: Bench) -> None:
    read, write = os.pipe()
    os.set_blocking(write, False)
    try:
        while True:
            os.write(write, bytes(65536))
    except BlockingIOError:
        os.set_blocking(write, True)
    server = bench.serve("Logged", stdout=write)
    bench.connect()
    for _ in range(20):
        assert "one client at a time" in refusal(server.endpoint)
    bench.goes_on(20)
    os.close(read)
    os.close(write)
    bench.observed = "20 events that were to be printed; every exchange answered"
