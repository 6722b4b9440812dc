"""A record by listening has a row for each message, NaN without a value, and says why it ended."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from math import inf, isnan

import numpy as np
import pytest
import zmq

from fmus.kit.interrupt import Interrupt
from fmus.rig_proxy import encode
from orchestration.rig.endpoint import Endpoint
from orchestration.rig.record.data import heard_dataset
from orchestration.rig.record.driving import RecordingObserver
from orchestration.rig.record.listening import listen

RIG = {
    "inputs": {"current": "A"},
    "outputs": {"voltage": "V"},
    "period": 0.01,
    "watchdog": 0.2,
    "limits": {},
}


def telemetry(clock, current=0.5, voltage=1.0, age=0.002, name="current"):
    state = {"state": "running", "reason": "", "client": "driver", "latch": "", "reached": None}
    return encode(
        "telemetry",
        **state,
        alarm="",
        verified=True,
        clock=clock,
        inputs={name: current},
        read_back={},
        outputs={"voltage": voltage},
        ages={"voltage": age},
        command_age=None,
        refused=[],
    )


@contextmanager
def published(*messages, pause=0.0):
    """A publisher that sends messages as soon as somebody has subscribed."""
    with zmq.Context() as context, context.socket(zmq.XPUB) as socket:
        socket.linger = 0
        port = socket.bind_to_random_port("tcp://127.0.0.1")

        def publish():
            socket.recv()
            for message in messages:
                socket.send(message)
                time.sleep(pause)

        thread = threading.Thread(target=publish)
        thread.start()
        yield Endpoint("", f"tcp://127.0.0.1:{port}", "")
        thread.join()


def heard(*messages, duration=0.4, pause=0.0):
    alarms = []
    journal = []
    observer = RecordingObserver(
        lambda time, cells: journal.append(time), lambda moment: None, lambda: "", alarms.append
    )
    with published(*messages, pause=pause) as remote:
        rows, failure = listen(remote, RIG, duration, Interrupt(), observer)
    return rows, failure, alarms, journal


def test_each_message_is_a_row_once_and_what_has_no_value_is_not_a_number():
    first, second = telemetry(10.0), telemetry(10.1, current=None, voltage=None, age=None)
    rows, failure, _, journal = heard(first, b"no message", first, second)
    np.testing.assert_array_equal(rows[0], [10.0, 0.5, 1.0, 0.002])
    assert rows[1, 0] == 10.1
    assert all(isnan(cell) for cell in rows[1, 1:])
    assert failure == ""
    assert journal == pytest.approx([0.0, 0.1])
    data = heard_dataset(RIG, rows, failure, "tcp://rig:1")
    assert list(data) == ["current", "voltage", "voltage_age"]
    assert data.attrs["rate"] == pytest.approx(10.0)
    assert (data.attrs["complete"], data.attrs["gaps"], data.attrs["start"]) == (1, 0, 10.0)


def test_another_server_ends_the_record():
    _, failure, _, _ = heard(telemetry(10.0), telemetry(3.0), duration=inf)
    assert failure == "the rig's server is another one now, with another clock"
    _, failure, _, _ = heard(telemetry(10.0), telemetry(10.1, name="force"), duration=inf)
    assert failure == "the rig's server has other signals now"


def test_a_silence_is_told_once_and_is_a_gap():
    rows, failure, alarms, _ = heard(telemetry(1.0), telemetry(2.0), pause=0.8, duration=1.2)
    assert [alarm.split(" for")[0] for alarm in alarms] == ["nothing was heard of the rig"]
    assert failure == ""
    data = heard_dataset(RIG, rows, failure, "tcp://rig:1")
    assert (data.attrs["complete"], data.attrs["gaps"]) == (0, 1)


def test_nothing_heard_is_no_row():
    rows, failure, _, _ = heard(duration=0.1)
    assert not rows.size
    assert failure == ""
