"""Claims: only who has the key of a run moves its parameters; whatever else comes is refused in a
line or ignored, and every change is in a log that shows what was altered later.
"""

from __future__ import annotations

import json

import pytest
import zmq

from fmus.kit import UserError
from fmus.rig_proxy import local_key, protocol
from orchestration.rig.server import verify
from orchestration.rig.tuning import request_tuning, tuning_socket

STATE = {"K": {"value": 1.0, "target": 2.0, "unit": "1", "min": None, "max": 9.0, "doc": "gain"}}


class Tuned:
    """Stands for a run; `moves` has what was asked for."""

    def __init__(self):
        self.moves = []

    def move(self, name, value, slew, by):
        if value > 9.0:
            raise UserError(f"{name} = {value:g}: allowed is ≤ 9")
        self.moves.append((name, value, slew))
        return f"{name} to {value:g} by {by.partition(' ')[0]}"

    def state(self):
        return STATE


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "state"))
    tuned = Tuned()
    with tuning_socket(tuned, 0, tmp_path / "run.log") as address:
        tuned.address, tuned.folder = address, tmp_path
        yield tuned


def test_its_user_moves_a_parameter_and_the_log_says_so(run):
    assert request_tuning(run.address, "parameters") == STATE
    assert request_tuning(run.address, "tune", name="K", value=2, slew=0.5) == STATE
    assert run.moves == [("K", 2.0, 0.5)]


def test_the_log_is_chained(run, tmp_path, monkeypatch):
    with tuning_socket(Tuned(), 0, tmp_path / "other.log") as address:
        request_tuning(address, "tune", name="K", value=2, slew=None)
    log = tmp_path / "other.log"
    assert "K to 2 by " in log.read_text()
    assert verify([log]) == 2
    log.write_text(log.read_text().replace("K to 2", "K to 3"))
    with pytest.raises(UserError):
        verify([log])


def test_a_stranger_looks_and_moves_nothing(run, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(run.folder / "stranger"))
    monkeypatch.setenv("LOCALAPPDATA", str(run.folder / "stranger"))
    assert request_tuning(run.address, "parameters") == STATE
    with pytest.raises(UserError, match="refuses: tune needs the key of this server"):
        request_tuning(run.address, "tune", name="K", value=2, slew=None)
    assert run.moves == []


def test_what_the_run_refuses_is_told(run):
    with pytest.raises(UserError, match="refuses: K = 10: allowed is ≤ 9"):
        request_tuning(run.address, "tune", name="K", value=10, slew=None)


@pytest.mark.parametrize(
    "frame",
    [
        b"",
        b"GET / HTTP/1.1",
        b"{}",
        json.dumps({"ppy": 2, "type": "stop", "reason": ""}).encode(),
        json.dumps({"ppy": 2, "type": "tune", "name": "K", "value": "2", "slew": None}).encode(),
        json.dumps({"ppy": 2, "type": "tune", "name": "K", "value": True, "slew": None}).encode(),
        json.dumps({"ppy": 2, "type": "tune", "name": 3, "value": 2, "slew": None}).encode(),
        json.dumps({"ppy": 2, "type": "tune", "name": "K", "value": 10**400}).encode(),
    ],
)
def test_rubbish_is_refused_and_the_next_request_served(run, frame):
    key = local_key.read(run.address)
    with zmq.Context() as context, context.socket(zmq.DEALER) as socket:
        socket.linger = 0
        socket.connect(run.address)
        socket.send(frame.replace(b'"ppy"', f'"key": "{key}", "ppy"'.encode()))
        assert socket.poll(2000)
        assert protocol.decode(socket.recv(), protocol.REPLIES)["type"] == "refused"
    assert run.moves == []
    assert request_tuning(run.address, "parameters") == STATE


def test_a_port_that_is_taken_is_told(run):
    port = int(run.address.rpartition(":")[2])
    words = rf"cannot listen at 127\.0\.0\.1:{port}: .*; --tuning-port chooses another one"
    with pytest.raises(UserError, match=words), tuning_socket(Tuned(), port, None):
        pass


def test_nobody_answers():
    words = "no answer within 0.4 s from .*is `ppy run --tunable` running"
    with pytest.raises(UserError, match=words):
        request_tuning("tcp://127.0.0.1:1", "parameters")
    with pytest.raises(UserError, match="--run 'nowhere': write tcp://HOST:PORT"):
        request_tuning("nowhere", "parameters")
