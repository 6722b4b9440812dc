"""Claims: a server that cannot start is told in its own line; what a backend is, is read without
opening it; processes are told apart by their parents.

That a rig is served and driven is tried in `tests/end_to_end/test_rig_commission.py`.
"""

from __future__ import annotations

from hashlib import sha256
from math import inf

import pytest

from fmus.kit import UserError
from orchestration.plugins.commission import served
from orchestration.plugins.commission.served import Device, ServedRig, read_device
from tests.support.rig.process import BACKENDS

EMULATOR = Device("emulator", {}, (), {}, False)


def test_a_backend_is_read_without_opening_it(tmp_path):
    log = tmp_path / "log"
    device = read_device(f"{BACKENDS}:Beating", {"log": str(log), "trigger": "t"})
    digest = sha256(BACKENDS.read_bytes()).hexdigest()
    assert device.facts["SHA-256 of backends.py"] == digest
    assert device.has_heartbeat
    assert device.names
    assert not log.exists()
    assert not read_device("emulator", {}).has_heartbeat
    with pytest.raises(UserError, match="no option 'speed'"):
        read_device("emulator", {"speed": "2"})


def test_a_server_that_cannot_start_says_why():
    with pytest.raises(UserError, match=r"ppy rig serve: error: --rate 0: allowed are"):
        ServedRig(EMULATOR, ["--rate", "0", "--port", "0"], 0.1, lambda question: None)


class Process:
    def __init__(self, pid, parent, command="from multiprocessing.spawn import spawn_main"):
        self.pid, self._parent, self._command = pid, parent, command

    def ppid(self):
        return self._parent

    def cmdline(self):
        return ["python", "-c", self._command]


@pytest.mark.parametrize(
    ("numbers", "roles"),
    [
        ((11, 12, 13), {"front": 10, "guard": 11, "device": 13, "standby": 12}),
        ((11, 13), {}),  # without a standby
        ((11, 12), {}),  # without a device
    ],
)
def test_processes_are_told_apart_by_their_parents(monkeypatch, numbers, roles):
    """11 and 12 are guards, of which 11 has the device; 14 is a helper of Python's own."""
    parents = {11: 10, 12: 10, 13: 11}
    family = [Process(14, 10, "from multiprocessing.resource_tracker import main")]
    family += [Process(number, parents[number]) for number in numbers]

    class Front(Process):
        def __init__(self, pid):
            super().__init__(pid, 1)

        def children(self, recursive):
            return family

    monkeypatch.setattr(served.psutil, "Process", Front)
    rig = ServedRig.__new__(ServedRig)
    rig._server = Front(10)
    assert {role: process.pid for role, process in rig.processes().items()} == roles


def ramped(rate, elapsed, monkeypatch):
    rig = ServedRig.__new__(ServedRig)
    rig.limits = {"current": {"rate": rate}}
    rig.commands, rig.targets, rig._taken = {"current": 0.0}, {"current": -1.0}, 5.0
    monkeypatch.setattr(served, "monotonic", lambda: 5.0 + elapsed)
    return rig._next()["current"]


def test_commands_are_within_the_limits_of_their_rates(monkeypatch):
    assert -0.1 <= ramped(1.0, 0.1, monkeypatch) < -0.09
    assert ramped(inf, 0.1, monkeypatch) == -1.0
    assert ramped(100.0, 0.1, monkeypatch) == -1.0


def test_a_server_that_has_ended_is_waited_for_no_longer(tmp_path):
    rig = ServedRig.__new__(ServedRig)
    rig._server, rig._output = Process(10, 1), tmp_path / "server.log"
    rig._output.write_text("ready\nended: smoke\n")
    rig._server.poll = lambda: 1
    with pytest.raises(UserError, match="the server has ended: ended: smoke"):
        rig.turn()
