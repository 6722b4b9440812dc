"""Longest time that a command is held, from when its client sent it: end to end."""

from __future__ import annotations

import time

from tests.support.rig.faults.bench import Bench, fault
from tests.support.rig.peer import Peer

_JUST = 0.03  # s, by which a message is under way for less than would make it stale
_ENDS = "zero within twice the watchdog time and what the rig promises beyond it"


def _note(bench: Bench, sent: float) -> None:
    """Note the time from when a client sent its last command; the bound is that of the rig, and
    as long as a command may have been under way besides.
    """
    safe = bench.safe_after(sent)
    assert any(c.what == "write 0.5 1.0" and c.time > sent for c in bench.server.calls()), (
        "the command that was sent last was not carried out: nothing was measured"
    )
    bench.note(safe.time - sent, bench.watchdog + bench.promised, "it was sent")


@fault("the client dies when it has sent a command", _ENDS, quick=True)
def dies_at_once(bench: Bench) -> None:
    server = bench.serve()
    with Peer(server.endpoint) as peer:
        accepted = peer.connect("dying")
        sample = peer.exchange(accepted["session"], 1, accepted["clock"], [0.25, 1.0])
        sent = time.monotonic()
        peer.exchange(accepted["session"], 2, sample["clock"], [0.5, 1.0])
    _note(bench, sent)
    bench.observed = "held for the watchdog time"


@fault("the client dies, its last command under way for nearly the watchdog time", _ENDS)
def dies_under_way(bench: Bench) -> None:
    server = bench.serve()
    late = bench.watchdog - _JUST - bench.allowance / 4
    with Peer(server.endpoint) as peer:
        accepted = peer.connect("dying")
        sample = peer.exchange(accepted["session"], 1, accepted["clock"], [0.25, 1.0])
        sent = time.monotonic()
        for sequence, pause in enumerate((late / 3, late / 3, late / 3), start=2):
            time.sleep(pause)  # those before it were under way as long
            command = [0.5, 1.0] if sequence == 4 else [0.25, 1.0]
            answer = peer.exchange(accepted["session"], sequence, sample["clock"], command)
            assert not answer["refused"], answer
    _note(bench, sent)
    bench.observed = f"its last command was under way for {1000 * late:.0f} ms"


@fault(
    "a client's first command is under way for a second, and the client is dead by then",
    "zero within the watchdog time and what the rig promises beyond it, from when it arrived: a"
    " first command may take its time",
)
def dies_before_it_begins(bench: Bench) -> None:
    server = bench.serve()
    with Peer(server.endpoint) as peer:
        accepted = peer.connect("dying")
        time.sleep(1.0)  # what the network does
        arrived = time.monotonic()
        peer.exchange(accepted["session"], 1, accepted["clock"], [0.5, 1.0])
    time.sleep(0.1)
    written = [c for c in server.calls() if c.time > arrived and c.what.startswith("write")]
    if not written:
        bench.observed = "it was not carried out"
        return
    _note(bench, arrived)
    bench.observed = "it was carried out"
