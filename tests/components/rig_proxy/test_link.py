"""The client's end of the protocol against a small rig that shares no code with it: keys, garbage,
lateness.
"""

from __future__ import annotations

import threading
import time

import pytest
import zmq

from fmus.kit import UserError
from fmus.rig_proxy import protocol
from fmus.rig_proxy.link import Link, LinkError
from orchestration.rig.keys import make_keys
from tests.support.rig.scripted_rig import ScriptedRig, served
from tests.support.rig.small_rig import INPUTS, OUTPUTS, SmallRig, free_port


@pytest.fixture
def closing():
    """Close links that a test leaves open."""
    links: list[Link] = []
    yield links
    for link in links:
        link.close()


@pytest.fixture
def router():
    """Return a ROUTER that answers as a test wants it to."""
    context = zmq.Context()
    yield context.socket(zmq.ROUTER)
    context.destroy(linger=0)


@pytest.fixture
def linked(closing):
    def make(endpoint, *more, **named) -> Link:
        closing.append(Link(endpoint, INPUTS, OUTPUTS, *more, **named))
        return closing[-1]

    return make


def test_a_session_from_begin_to_end(linked):
    with SmallRig(period=0.002) as rig:
        link = linked(rig.endpoint, client="the test")
        accepted = link.connect(0.0, 1.0)
        assert (accepted["mode"], rig.client) == ("real-time", "the test")
        link.exchange([1.0, 2.0], 0.0, 0.1, 1.0)
        time.sleep(0.01)
        sample = link.exchange([1.0, 2.0], 0.1, 0.1, 1.0)
        assert sample["values"] == pytest.approx([0.6, 1.8e-4])
        assert [m["sequence"] for m in rig.of_type("exchange")] == [1, 2]
        assert 0.0 < link.round_trip_time < 1.0
        link.disconnect()
        assert rig.state == "idle"


def test_a_rig_is_reached_by_ipv6(closing):
    with served(ScriptedRig(1), "tcp://[::1]:*", ipv6=True) as endpoint:
        closing.append(Link(endpoint, {"current": "A"}, {"voltage": "V"}))
        assert closing[-1].connect(0.0, 2.0)["session"] == "session-1"


def test_keys_let_in_and_others_get_nothing(linked, tmp_path):
    server, client = make_keys(tmp_path / "keys")
    _, stranger = make_keys(tmp_path / "others")
    with SmallRig(keys=server) as rig:
        linked(rig.endpoint, client).connect(0.0, 2.0)
        rig.state, rig.session = "idle", ""
        heard = len(rig.heard)
        for keys, said in ((stranger, "with these keys"), (None, "without keys")):
            begin = time.monotonic()
            with pytest.raises(LinkError, match=rf"no answer within 0\.3 s from .*, {said}; "):
                linked(rig.endpoint, keys).connect(0.0, 0.3)
            assert time.monotonic() - begin < 1.0
        assert len(rig.heard) == heard


def test_a_key_file_that_is_none_is_told(linked, tmp_path):
    with pytest.raises(UserError, match=r"missing\.toml"):
        linked("tcp://127.0.0.1:5570", tmp_path / "missing.toml")


def test_garbage_from_the_other_side_is_passed_over(linked, router):
    """A peer that sends everything but what is asked for; in the end it answers."""
    junk = [
        b"",
        b"\xff\xfe",
        b"{}",
        b"[]",
        b'{"ppy": 2}',
        b'{"ppy": 3, "type": "accepted"}',
        protocol.encode("disconnected"),
        b'{"ppy":2,"type":"accepted","session":1}',
        b"[" * 50_000,
    ]
    port = router.bind_to_random_port("tcp://127.0.0.1")
    good = {
        "session": "s",
        "clock": 1.0,
        "mode": "real-time",
        "period": 0.1,
        "watchdog": 1.0,
        "limits": {},
        "ages": [0.0, 0.0],
    }

    def answer() -> None:
        identity, _ = router.recv_multipart()
        for frame in junk:
            router.send_multipart([identity, frame])
        router.send_multipart(
            [identity, protocol.encode("accepted", **good, values=[1.0])]
        )  # one value too few
        router.send_multipart([identity, protocol.encode("accepted", **good, values=[1.0, 2.0])])

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        assert linked(f"tcp://127.0.0.1:{port}").connect(0.0, 2.0)["values"] == [1.0, 2.0]
    finally:
        thread.join()


def test_a_peer_that_floods_does_not_hold_us(linked, router):
    port = router.bind_to_random_port("tcp://127.0.0.1")
    ends = threading.Event()

    def flood() -> None:
        identity, _ = router.recv_multipart()
        while not ends.is_set():
            try:
                router.send_multipart([identity, protocol.encode("disconnected")], zmq.DONTWAIT)
            except zmq.ZMQError:
                time.sleep(1e-4)

    thread = threading.Thread(target=flood)
    thread.start()
    begin = time.monotonic()
    try:
        with pytest.raises(LinkError, match="no answer"):
            linked(f"tcp://127.0.0.1:{port}").connect(0.0, 0.3)
        assert time.monotonic() - begin < 2.0
    finally:
        ends.set()
        thread.join()


def test_a_late_answer_is_found_later_and_never_taken_for_a_new_one(linked, router):
    port = router.bind_to_random_port("tcp://127.0.0.1")
    link = linked(f"tcp://127.0.0.1:{port}")
    sample = {
        "session": "s",
        "clock": 2.0,
        "ages": [0.0, 0.0],
        "state": "running",
        "reason": "",
        "refused": [],
    }
    link.accepted = {"session": "s", "clock": 1.0}
    assert link.exchange([0.0, 0.0], 0.0, 0.1, 0.01) is None
    identity, _ = router.recv_multipart()
    sent = time.monotonic() - 0.5

    def answer(sequence: int, value: float) -> None:
        reply = protocol.encode(
            "sample", **sample, sequence=sequence, sent=sent, values=[value, 0.0]
        )
        router.send_multipart([identity, reply])

    answer(1, 1.0)
    time.sleep(0.05)
    assert link.late()["values"][0] == 1.0
    assert link.round_trip_time == pytest.approx(0.55, abs=0.2)
    time.sleep(0.2)
    assert link.round_trip_time == pytest.approx(0.55, abs=0.2), "all is answered"
    assert link.exchange([0.0, 0.0], 0.1, 0.1, 0.01) is None
    answer(1, 9.0)  # once more, after a newer one was asked for
    answer(7, 9.0)  # nobody has asked for that
    time.sleep(0.05)
    assert link.late() is None
    time.sleep(0.8)
    assert link.round_trip_time > 0.8, "no answer is no fast one"
    timer = threading.Timer(0.05, answer, (2, 2.0))
    timer.start()
    assert link.exchange([0.0, 0.0], 0.2, 0.1, 0.3) is None
    timer.join()
    assert link.late()["values"][0] == 2.0, "though it came while another was waited for"
    assert link.late() is None


def test_nobody_there(linked):
    begin = time.monotonic()
    with pytest.raises(LinkError, match="is `ppy rig serve` running, or do the keys not match"):
        linked(f"tcp://127.0.0.1:{free_port()}").connect(0.0, 0.2)
    assert time.monotonic() - begin < 1.0


def test_a_session_that_the_server_does_not_know_ends(linked):
    with SmallRig() as rig:
        link = linked(rig.endpoint)
        link.connect(0.0, 1.0)
        rig.session = "another"
        with pytest.raises(LinkError, match="no such session"):
            link.exchange([0.0, 0.0], 0.0, 0.1, 1.0)
        assert link.session == ""
