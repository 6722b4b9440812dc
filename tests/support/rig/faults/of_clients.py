"""The client fails, or means ill."""

from __future__ import annotations

import json
import subprocess
import sys
import time

from fmus.rig_proxy.protocol import MAX_FRAME, VERSION, encode
from tests.support.rig.bad_link import BadLink
from tests.support.rig.driver import INPUTS, OUTPUTS, refusal, usual
from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.peer import Peer
from tests.support.rig.process import ROOT


@fault("SIGKILL of the client", "the safe state by the watchdog, latched", quick=True)
def client_killed(bench: Bench) -> None:
    server = bench.serve()
    bench.link = BadLink(server.endpoint, watchdog=bench.watchdog)
    command = [sys.executable, "-m", "tests.support.rig.driver", bench.link.endpoint]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        assert client.stdout.readline() == "started\n"
        client.kill()
    bench.measure_from_fresh(server.wait_call("safe", bench.link.fresh[0]))
    bench.link.close()
    server.wait_line("SAFE STATE: no fresh command")
    bench.is_latched("no fresh command")
    bench.recovers()
    bench.observed = "safe and latched; served another client after the acknowledgement"


@fault("the client hangs", "the safe state by the watchdog, latched")
def client_hangs(bench: Bench) -> None:
    bench.serve()
    driver = bench.connect()
    driver.hang()
    bench.measure_from_fresh(bench.safe_after(bench.link.fresh[0]))
    bench.server.wait_line("SAFE STATE: ")
    bench.is_latched("no fresh command")
    bench.observed = "safe and latched"


@fault("the client disconnects", "the safe state at once, no latch")
def client_disconnects(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    bench.driver.stop()
    bench.measure_from_fresh(bench.safe_after(bench.link.fresh[0]))
    assert bench.status()["state"] == "idle"
    assert refusal(bench.server.endpoint) == ""
    bench.observed = "safe and idle; the next client is accepted"


@fault("the client's own clock jumps", "nothing: its times are only sent back to it")
def client_clock_jumps(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    jumping = [time.monotonic() + jump for jump in (-1e6, 1e6, 0.0)]
    with Peer(bench.server.endpoint) as peer:
        for sent in jumping:
            assert peer.ask("status")["state"] == "running"
            peer.send(
                "exchange",
                session="none",
                sequence=1,
                sent=sent,
                seen=0.0,
                time=0.0,
                step=0.02,
                values=[0, 0],
            )
            assert peer.receive()["type"] == "refused"
    bench.driver.stop()
    with Peer(bench.server.endpoint) as peer:
        accepted = peer.connect("jumping")
        seen = accepted["clock"]
        for sequence, sent in enumerate(30 * jumping, start=1):
            sample = peer.ask(
                "exchange",
                session=accepted["session"],
                sequence=sequence,
                sent=sent,
                seen=seen,
                time=-sent,
                step=0.02,
                values=usual(sequence),
            )
            assert (sample["state"], sample["sent"], sample["refused"]) == ("running", sent, [])
            seen = sample["clock"]
        peer.ask("disconnect", session=accepted["session"])
    bench.observed = "90 exchanges with jumps by 1e6 s answered, each with its own time"


@fault(
    "a client of another protocol version",
    "dropped, counted and told; the session goes on",
    quick=True,
)
def wrong_version(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    with Peer(bench.server.endpoint) as peer:
        peer.socket.send(
            encode("status").replace(b'"ppy":%d' % VERSION, b'"ppy":%d' % (VERSION + 1))
        )
        assert peer.receive(0.2) is None
    bench.goes_on()
    bench.server.wait_line(f"dropped protocol version {VERSION + 1}; this is version {VERSION}")
    assert bench.status()["counts"]["malformed"] == 1
    bench.observed = "no answer, one line in the log, 1 malformed"


@fault("a second client", "refused, with the reason; the first goes on", quick=True)
def second_client(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    assert "one client at a time" in refusal(bench.server.endpoint)
    bench.goes_on()
    bench.server.wait_line("refused: the rig serves driver")
    bench.observed = "refused: one client at a time"


@fault("a client with other names or units", "refused, with the name and what the rig has")
def misfits(bench: Bench) -> None:
    bench.serve()
    with Peer(bench.server.endpoint) as peer:
        wrong = [
            ({"current": "mA", "force": "N"}, OUTPUTS),
            ({"current": "A"}, OUTPUTS),
            (INPUTS, {"voltag": "V"}),
        ]
        reasons = [peer.connect("x", inputs, outputs)["reason"] for inputs, outputs in wrong]
    assert [
        "mA" in reasons[0],
        "force is missing" in reasons[1],
        "did you mean voltage" in reasons[2],
    ] == 3 * [True]
    assert not [call for call in bench.server.calls() if call.what.startswith("write")]
    bench.observed = "; ".join(reasons)


@fault(
    "10,000 malformed frames",
    "dropped, counted, a line a second at most; the session goes on",
    quick=True,
)
def malformed(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    session = bench.driver.samples[-1]["session"]
    good = {
        "ppy": VERSION,
        "type": "exchange",
        "session": session,
        "sequence": 10**9,
        "sent": 0.0,
        "seen": 0.0,
        "time": 0.0,
        "step": 0.0,
        "values": [0.1, 0.1],
    }
    frames = [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b"null",
        json.dumps({"ppy": VERSION}).encode(),
        json.dumps({"ppy": VERSION, "type": []}).encode(),
        5000 * b"[",
        encode("sample"),
        encode("status")[:-1],
        json.dumps({**good, "sent": 10**400}).encode(),
        *(
            json.dumps({**good, **bad}).encode()
            for bad in (
                {"values": [0.1]},
                {"values": [0.1, None]},
                {"values": "no"},
                {"sequence": -1},
                {"sequence": 1.5},
                {"seen": True},
                {"values": [float("nan"), 0.0]},
                {"values": [float("inf"), 0.0]},
            )
        ),
    ]
    with Peer(bench.server.endpoint) as peer:
        peer.socket.sndhwm = 0
        for k in range(10_000):
            peer.socket.send(frames[k % len(frames)])
            if k % 100 == 0:
                peer.socket.send_multipart([b"", b"two frames"])
        _wait_for_malformed(bench, 10_100)
    bench.goes_on()
    lines = [line for line in bench.server.lines if " dropped " in line]
    assert 1 <= len(lines) < 10, lines
    bench.observed = f"10,100 counted, {len(lines)} lines in the log, the client served throughout"


def _wait_for_malformed(bench: Bench, number: int, timeout: float = 20.0) -> None:
    until = time.monotonic() + timeout
    while (counted := bench.status()["counts"]["malformed"]) < number:
        assert time.monotonic() < until, (
            f"{counted} malformed frames were counted, {number} were sent"
        )
        time.sleep(0.02)
    assert counted == number


@fault(
    "oversized frames: 65,537 bytes, 1 MB, 50 MB",
    "dropped or cut off with their connection; the session goes on",
)
def oversized(bench: Bench) -> None:
    bench.serve()
    bench.connect()
    with Peer(bench.server.endpoint) as peer:
        for size in (MAX_FRAME + 1, 1_000_000):
            peer.socket.send(b" " * size)
        _wait_for_malformed(bench, 2)
        peer.socket.send(b" " * 50_000_000)
        time.sleep(0.3)
    assert bench.status()["counts"]["malformed"] == 2
    bench.goes_on()
    bench.server.wait_line("dropped a frame of 65537 bytes; 65536 are allowed")
    bench.observed = "2 counted, the third cut off; the client served throughout"


@fault(
    "commands beyond the limits",
    "refused and reported; the last good one goes on, then the watchdog",
    quick=True,
)
def beyond_limits(bench: Bench) -> None:
    server = bench.serve()
    driver = bench.connect(values=lambda number: [0.5, 1.0])
    driver.values = lambda number: [1.31, 1.0]
    safe = bench.safe_after(bench.link.fresh[0])
    bench.measure_from_fresh(safe)
    assert {call.what for call in server.calls() if call.what.startswith("write")} == {
        "write 0.5 1.0"
    }
    refused = [
        sample["refused"]
        for sample in driver.samples
        if sample["refused"] and sample["state"] == "running"
    ]
    assert all(
        sentences == ["current 1.31 A is above 1.3 A; 0.5 A goes on"] for sentences in refused
    )
    assert len(refused) > bench.watchdog / 0.02 / 2
    server.wait_line("refused: current 1.31 A is above 1.3 A")
    bench.is_latched("no fresh command")
    bench.observed = f"{refused[0][0]}; safe after {len(refused)} of them"


@fault("a command that changes too fast", "refused and reported; the last good one goes on")
def too_fast(bench: Bench) -> None:
    server = bench.serve(options={"rate": 2.0})
    driver = bench.connect(values=lambda number: [0.5 if number % 20 == 10 else 0.0, 1.0])
    driver.wait(20)
    refused = [sentence for sample in driver.samples for sentence in sample["refused"]]
    assert refused
    assert "faster than 2 A/s" in refused[0]
    assert {call.what for call in server.calls() if call.what.startswith("write")} == {
        "write 0.0 1.0"
    }
    bench.goes_on()
    bench.observed = refused[0]


@fault("a command that was under way for too long", "refused and reported as stale", quick=True)
def replayed(bench: Bench) -> None:
    server = bench.serve()
    with Peer(server.endpoint) as peer:
        accepted = peer.connect("slow")
        sample = peer.exchange(accepted["session"], 1, accepted["clock"], [0.0, 0.0])
        time.sleep(bench.watchdog / 2)
        again = peer.exchange(accepted["session"], 2, sample["clock"], [0.0, 0.0])
        assert not again["refused"]
        time.sleep(bench.watchdog / 2 + 0.02)
        for sequence, seen, part in (
            (3, sample["clock"], "was under way for"),
            (4, 1e12, "more of the rig's time than there was"),
        ):
            late = peer.exchange(accepted["session"], sequence, seen, [0.5, 1.0])
            assert part in late["refused"][0]
        peer.ask("disconnect", session=accepted["session"])
    assert not [call for call in server.calls() if call.what.startswith("write 0.5")]
    bench.observed = "refused, nothing was written"
