"""Rules of the protocol that can be tried from outside, in the words of its page.

A rule is tried with a rig that is idle, commands zero, and raises if it does not hold.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic, sleep
from typing import Any, NamedTuple

import zmq

from fmus.rig_proxy import IDLE, LATCHED, RUNNING, SAFE, ProtocolError, decode, encode, protocol
from tests.support.rig.conformance.probe import (
    QUIET,
    BrokenError,
    ConformancePeer,
    ConformanceSession,
    NotTriedError,
    Probe,
)

_MALFORMED = {
    "no JSON": [b"\xff\xfe"],
    "no object": [b"[]"],
    "another version": [b'{"ppy":1,"type":"status"}'],
    "an unknown type": [b'{"ppy":2,"type":"shutdown"}'],
    "a missing field": [b'{"ppy":2,"type":"stop"}'],
    "a number that is none": [b'{"ppy":2,"type":"disconnect","session":NaN}'],
    "more than 65,536 bytes": [encode("stop", reason="x" * 65536)],
    "two frames": [encode("stop", reason="two frames"), encode("status")],
}
_TELEMETRY_TIME = 2.0  # s that it is listened to
_TELEMETRY_RATES = (4.0, 31.0)  # messages a second; 5 to 30 with the last one of the time in doubt


class Rule(NamedTuple):
    """A rule, and the function that tries it."""

    text: str
    check: Callable[[Probe], None]


RULES: list[Rule] = []


def rule(text: str) -> Callable[[Callable[[Probe], None]], Callable[[Probe], None]]:
    """Register a function that tries a rule."""

    def register(check: Callable[[Probe], None]) -> Callable[[Probe], None]:
        RULES.append(Rule(text, check))
        return check

    return register


def _must(holds: Any, seen: str) -> None:
    if not holds:
        raise BrokenError(seen)


# -- who is listened to
# --------------------------------------------------------------------------------------------------


def _version_1(body: bytes) -> bytes:
    """Return what a peer of ZMTP 1.0 says (RFC 13): a name and a message of less than 255 bytes."""
    return b"".join(bytes([len(part) + 1, 0]) + part for part in (b"ppy-1", body))


def _version_2(body: bytes) -> bytes:
    """Return what a DEALER of ZMTP 2.0 says (RFC 15)."""
    frames = b"".join(bytes([0, len(part)]) + part for part in (b"ppy-2", body))
    return b"\xff" + 7 * b"\0" + b"\x01\x7f\x01\x05" + frames


def _post(body: bytes) -> bytes:
    """Return a request of a page in a browser, whose P a peer of ZMTP 1.0 takes for a length."""
    return b"POST / HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)


@rule("what is no ZMTP 3, such as a browser, is turned away at each socket")
def _turns_others_away(probe: Probe) -> None:
    stop = encode("stop", reason="from no ZMTP 3")
    for address in (probe.remote.requests, probe.remote.telemetry, probe.remote.operators):
        for what, made in (("1.0", _version_1), ("2.0", _version_2), ("of HTTP", _post)):
            closed = probe.raw(address, made(stop))
            _must(closed, f"{address} keeps a connection {what} open")
    _must(probe.status()["state"] == IDLE, "the rig is stopped by one of them")


@rule("a peer that has not said its name is not listened to")
def _ignores_unnamed_peers(probe: Probe) -> None:
    for address in (probe.remote.requests, probe.remote.operators):
        peer = probe.peer(address, has_name=False)
        peer.send(encode("stop", reason="from nobody"))
        _must(peer.receive(QUIET) is None, f"{address} answers it")
    _must(probe.status()["state"] == IDLE, "the rig is stopped by it")


@rule("the operators' socket takes no connect, the clients' no acknowledge")
def _keeps_sockets_apart(probe: Probe) -> None:
    operator = probe.peer(probe.remote.operators)
    operator.send(encode("connect", **probe.signals()))
    _must(operator.receive(QUIET) is None, "connect is answered at the operators' socket")
    latch = probe.operator.ask("stop", reason="conformance")["latch"]
    client = probe.peer()
    client.send(encode("acknowledge", latch=latch))
    _must(client.receive(QUIET) is None, "acknowledge is answered at the clients' socket")
    _must(probe.status()["latch"] == latch, "a client has released the latch")


@rule("a malformed message is dropped and counted, and not answered")
def _drops_malformed_messages(probe: Probe) -> None:
    before = probe.status()["counts"]["malformed"]
    peer = probe.peer()
    for what, frames in _MALFORMED.items():
        peer.send(*frames)
        _must(peer.receive(QUIET) is None, f"{what} is answered")
    after = probe.status()
    _must(after["state"] == IDLE, "one of them is carried out")
    counted = after["counts"]["malformed"] - before
    _must(counted == len(_MALFORMED), f"{counted} of {len(_MALFORMED)} are counted")


# -- sessions
# --------------------------------------------------------------------------------------------------


def _is_refused(peer: ConformancePeer, fields: dict[str, Any], what: str) -> None:
    answer = peer.ask("connect", **fields)
    _must(answer["type"] == "refused", f"{what} is answered by {answer['type']}")
    _must(answer["reason"], f"{what} is refused without a reason")


@rule("a connect that does not fit is refused with a reason")
def _refuses_misfits(probe: Probe) -> None:
    fields = probe.signals()
    peer = probe.peer()
    inputs = fields["inputs"]
    outputs = fields["outputs"]
    unknown = {**outputs, "no such signal": "m"}
    _is_refused(peer, fields | {"outputs": unknown}, "an unknown output")
    for name in inputs:
        others = {key: unit for key, unit in inputs.items() if key != name}
        _is_refused(peer, fields | {"inputs": others}, f"a connect without {name}")
        other_unit = {**inputs, name: "another unit"}
        _is_refused(peer, fields | {"inputs": other_unit}, f"another unit of {name}")
    _must(probe.status()["state"] == IDLE, "one of them has a session")


@rule("one client at a time: another one is refused, of the same name too, and the first goes on")
def _serves_one_client(probe: Probe) -> None:
    session = probe.session()
    for sequence in (1, 2):
        _is_refused(probe.peer(), probe.signals(), "another instance of the same name")
        answer = session.exchange(sequence)
        _must(not answer["refused"], f"the first is refused then: {answer['refused']}")
    _must(probe.status()["client"] == "conformance", "status does not name the client")


@rule("until its first exchange an instance may connect again if it missed the answer")
def _lets_an_instance_connect_again(probe: Probe) -> None:
    first = probe.session()
    again = ConformanceSession(probe, probe.peer(), first.fields)
    _must(not again.exchange(1)["refused"], "its command is refused")


@rule("the first exchange may come later than the watchdog time after accepted")
def _lets_the_first_exchange_wait(probe: Probe) -> None:
    session = probe.session()
    sleep(2 * probe.about["watchdog"] + 0.1)
    refused = session.exchange(1)["refused"]
    _must(not refused, f"it is refused: {refused}")


@rule("a sample brings back sequence and sent, and has a value and an age for each output")
def _answers_an_exchange(probe: Probe) -> None:
    session = probe.session()
    for sequence in (1, 2, 5):
        sent = 1000.0 + sequence
        answer = session.exchange(sequence, sent=sent)
        came_back = (answer["session"], answer["sequence"], answer["sent"])
        _must(came_back == (session.accepted["session"], sequence, sent), f"it has {came_back}")
        _must(answer["state"] == RUNNING, f"its state is {answer['state']}")
        sizes = {len(answer["values"]), len(answer["ages"])}
        _must(sizes == {len(probe.about["outputs"])}, f"it has {sizes} values and ages")
        for value, age in zip(answer["values"], answer["ages"], strict=True):
            _must((value is None) == (age is None), f"value {value} has age {age}")


@rule("a sequence number is not taken twice, and never goes back")
def _takes_a_sequence_once(probe: Probe) -> None:
    session = probe.session()
    session.exchange(3)
    for sequence in (3, 2):
        session.peer.send(session.message(sequence))
        _must(session.peer.receive(QUIET) is None, f"{sequence} after 3 is answered")
        session.exchange(3 + 4 - sequence)  # in time, that the watchdog stays quiet


@rule("a command that was under way for longer than the watchdog time is refused")
def _refuses_stale_commands(probe: Probe) -> None:
    if probe.is_lockstep:
        raise NotTriedError("the server is in lockstep")
    session = probe.session()
    clock = session.exchange(1)["clock"]
    old = session.exchange(2, seen=clock - 10 * probe.about["watchdog"])
    _must(old["refused"], "a command whose seen is old is carried out")
    ahead = session.exchange(3, seen=clock + 100.0)
    _must(ahead["refused"], "a command whose seen is ahead of the clock is carried out")


@rule("an exchange of a session that is not the present one is refused")
def _refuses_other_sessions(probe: Probe) -> None:
    session = probe.session()
    other = probe.peer()
    other.send(session.message(1, session="no such session"))
    answer = other.receive()
    _must(answer is not None and answer["type"] == "refused", f"it is answered by {answer}")
    _must(not session.exchange(1)["refused"], "the present session is refused")


@rule("disconnect ends its own session and no other one, and is answered")
def _ends_a_session(probe: Probe) -> None:
    session = probe.session()
    session.exchange(1)
    answer = probe.peer().ask("disconnect", session="no such session")
    _must(answer["type"] == "disconnected", f"a foreign one is answered by {answer['type']}")
    _must(not session.exchange(2)["refused"], "a foreign one has ended the session")
    own = session.peer.ask("disconnect", session=session.accepted["session"])
    _must(own["type"] == "disconnected", f"it is answered by {own['type']}")
    now = probe.status()
    _must((now["state"], now["client"]) == (IDLE, ""), f"the state is {now['state']} then")


@rule("a command beyond a limit is refused, and none of its values is carried out")
def _refuses_what_is_beyond_limits(probe: Probe) -> None:
    if not probe.beyond_limits:
        raise NotTriedError("it was not allowed (--beyond-limits)")
    names = list(probe.about["inputs"])
    limited = [k for k, n in enumerate(names) if _high(probe, n) is not None]
    if not limited:
        raise NotTriedError("no input has a largest value")
    session = probe.session()
    for sequence, k in enumerate(limited, 1):
        values = probe.zero()
        values[k] = _high(probe, names[k]) + 1.0
        refused = session.exchange(sequence, values=values)["refused"]
        _must(refused, f"{names[k]} = {values[k]:g} is carried out")


def _high(probe: Probe, name: str) -> Any:
    return probe.about["limits"].get(name, {}).get("max")


# -- the safe state
# --------------------------------------------------------------------------------------------------


@rule("without a fresh command for the watchdog time the rig goes safe, latched, and says why")
def _watches_its_client(probe: Probe) -> None:
    if probe.is_lockstep:
        raise NotTriedError("the server is in lockstep")
    session = probe.session()
    session.exchange(1)
    now = probe.wait(lambda state: state["state"] == SAFE, "not safe")
    _must(now["latch"] and now["reason"], f"latch {now['latch']!r}, reason {now['reason']!r}")
    _must(now["reached"] is not None, "it does not say how long that took")
    answer = session.exchange(2)
    _must(answer["refused"], "it still takes commands")
    _must(answer["state"] in LATCHED, f"the sample says {answer['state']}")
    _is_refused(probe.peer(), probe.signals(), "a connect to a latched rig")


@rule("every stop is another latch, and an acknowledgement releases the one that it names alone")
def _releases_what_is_named(probe: Probe) -> None:
    latches = [probe.operator.ask("stop", reason="the same")["latch"] for _ in range(2)]
    _must(all(latches) and latches[0] != latches[1], f"two stops have latches {latches}")
    for latch in (latches[0], ""):
        answer = probe.operator.ask("acknowledge", latch=latch)
        _must(answer["type"] == "refused", f"{latch!r} is answered by {answer['type']}")
        _must(latches[1] in answer["reason"], "the refusal does not name the present latch")
    probe.wait(lambda state: state["state"] == SAFE, "not safe")
    probe.operator.ask("acknowledge", latch=latches[1])
    now = probe.wait(lambda state: state["state"] == IDLE, "not idle")
    _must(not now["latch"] and not now["reason"], "there is still a latch")


@rule("a client may stop as well, and a session does not outlive an acknowledgement")
def _ends_sessions_by_acknowledgements(probe: Probe) -> None:
    session = probe.session()
    session.exchange(1)
    latch = session.peer.ask("stop", reason="by the client")["latch"]
    probe.wait(lambda state: state["state"] == SAFE, "not safe")
    probe.operator.ask("acknowledge", latch=latch)
    probe.wait(lambda state: state["state"] == IDLE, "not idle")
    session.peer.send(session.message(2))
    answer = session.peer.receive()
    _must(answer is not None and answer["type"] == "refused", f"it is answered by {answer}")


# -- telemetry
# --------------------------------------------------------------------------------------------------


@rule("telemetry is published 5 to 30 times a second, with what is applied")
def _publishes_telemetry(probe: Probe) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as watcher:
        probe.remote.connect(watcher, probe.remote.telemetry)
        watcher.subscribe(b"")
        if not watcher.poll(round(1000 * _TELEMETRY_TIME)):
            raise BrokenError(f"nothing in {_TELEMETRY_TIME:g} s")
        watcher.recv()
        begun = monotonic()
        number = 0
        while (left := begun + _TELEMETRY_TIME - monotonic()) > 0:
            if watcher.poll(max(1, round(1000 * left))):
                _check_telemetry(probe, watcher.recv())
                number += 1
    low, high = _TELEMETRY_RATES
    rate = number / _TELEMETRY_TIME
    _must(low <= rate <= high, f"{rate:g} messages a second")


def _check_telemetry(probe: Probe, frame: bytes) -> None:
    try:
        told = decode(frame, protocol.REPLIES)
    except ProtocolError as error:
        raise BrokenError(f"the server publishes {error}") from error
    for kind in ("inputs", "outputs"):
        wanted = set(probe.about[kind])
        _must(set(told[kind]) == wanted, f"{kind} are {sorted(told[kind])}")
