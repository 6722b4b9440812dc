"""Modbus backend against the server of pymodbus; what it holds is looked at by frames of hand."""

from __future__ import annotations

import math
import struct
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.backends import Backend, device_names, open_backend
from tests.support.rig.modbus_device import CALIBRATION, Device, line_device, tcp_device

COILS, HOLDING = 1, 3  # functions of the standard that read them
ZERO = {"current": 0.0, "flow": 0.0, "turns": 0.0, "valve": 0.0}


@pytest.fixture
def device() -> Iterator[Device]:
    with tcp_device() as one:
        yield one


@pytest.fixture
def calibration(tmp_path: Path) -> Callable[..., str]:
    """Write the file with changes to its text."""

    def write(*changes: tuple[str, str]) -> str:
        text = CALIBRATION
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "device.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


@pytest.fixture
def rig(device: Device, calibration: Callable[..., str]) -> Iterator[Backend]:
    backend = open_backend("modbus", {"calibration": calibration(), "port": device.port})
    yield backend
    backend.close()


def check(rig: Backend) -> None:
    """Compare what was there before with the words that the device was given."""
    before = {"current": -2.5, "flow": 0.75, "turns": -70000.0, "valve": 0.0}
    assert dict(rig.read_back()) == pytest.approx(before), "opening changes nothing"
    values = dict(rig.read())
    assert values["temperature"] == pytest.approx(273.15 - 25.0)
    assert math.isnan(values["level"]), "40000 is beyond its range"
    assert values["door"] == 1.0
    command = {"current": 3.14, "flow": 1.5, "turns": 65538.0, "valve": 1.0}
    rig.write(command)
    assert dict(rig.read_back()) == command


def test_numbers_are_those_in_the_registers(rig: Backend, device: Device) -> None:
    check(rig)
    assert device.look(HOLDING, 0, 1) == struct.pack(">h", 314)
    assert device.look(HOLDING, 10, 2) == struct.pack(">f", 1.5)
    assert device.look(HOLDING, 20, 2) == struct.pack(">HH", 2, 1)
    assert device.look(COILS, 1, 1) == b"\1"


@pytest.mark.real_time
@pytest.mark.skipif(sys.platform == "win32", reason="a pseudo-terminal needs POSIX")
def test_a_device_on_a_line_is_the_same(calibration: Callable[..., str]) -> None:
    with line_device() as device:
        patient = calibration(("watchdog = 0.4", "watchdog = 5.0"))
        given = {"calibration": patient, "port": device.port, "parity": "N", "timeout": "2"}
        backend = open_backend("modbus", given)
        check(backend)
        backend.safe()
        assert backend.read_back()["current"] == 0.5
        backend.close()


def test_safe_values_are_written_at_any_time(rig: Backend, device: Device) -> None:
    rig.write(ZERO | {"flow": 1.0})
    rig.safe()
    rig.safe()
    assert device.look(HOLDING, 0, 1) == struct.pack(">h", 50)
    assert device.look(HOLDING, 10, 2) == bytes(4)
    rig.close()
    rig.safe()
    rig.close()
    with pytest.raises(UserError, match="is closed"):
        rig.read()


def test_safe_values_arrive_over_a_new_connection(rig: Backend, device: Device) -> None:
    rig.write(ZERO)
    rig._client.socket.close()  # type: ignore[attr-defined]
    rig.safe()
    assert device.look(HOLDING, 0, 1) == struct.pack(">h", 50)


def test_what_is_beyond_a_range_is_not_written(rig: Backend, device: Device) -> None:
    with pytest.raises(UserError, match="current = 20 A: the range of holding 0 int16 allows"):
        rig.write(ZERO | {"flow": 1.0, "current": 20.0})
    assert device.look(HOLDING, 10, 2) == struct.pack(">f", 0.75)


def test_a_device_that_has_gone_is_waited_for_no_longer_than_its_timeout(
    rig: Backend, device: Device
) -> None:
    device.end()
    began = time.monotonic()
    with pytest.raises(UserError, match=r"tcp://.*: read_input_registers input 0 int16: no answer"):
        rig.read()
    assert time.monotonic() - began < 2 * 0.1 + 0.5  # half a second for a busy machine


def test_a_register_that_the_device_does_not_have_is_told(
    device: Device, calibration: Callable[..., str]
) -> None:
    path = calibration(("input 30", "input 31"))
    backend = open_backend("modbus", {"calibration": path, "port": device.port})
    with pytest.raises(UserError, match=r"read_input_registers input 31 uint16: refused: [^\n]*2"):
        backend.read()
    backend.close()


def test_a_channel_that_is_no_place_is_told(calibration: Callable[..., str]) -> None:
    path = calibration(("holding 0 int16", "input 0 int16"))
    with pytest.raises(UserError, match="current: channel = 'input 0 int16': coil or holding"):
        open_backend("modbus", {"calibration": path, "port": "tcp://127.0.0.1:1"})


@pytest.mark.parametrize(
    ("option", "value", "reason"),
    [
        ("port", "tcp://127.0.0.1:1", "port = 'tcp://127.0.0.1:1': no connection within 0.1 s"),
        ("port", "/dev/none", "port = '/dev/none': no connection within 0.1 s"),
        ("timeout", "0.3", "option timeout = '0.3': must be .* at most 0.2"),
        ("unit", "x", "option unit = 'x': must be a whole number"),
        ("parity", "X", "option parity = 'X'"),
    ],
)
def test_an_option_that_is_wrong_is_told(
    calibration: Callable[..., str], option: str, value: str, reason: str
) -> None:
    given = {"calibration": calibration(), "port": "/dev/none"} | {option: value}
    with pytest.raises(UserError, match=reason):
        open_backend("modbus", given)


def test_a_device_has_one_name_whatever_the_name_of_its_host(tmp_path: Path) -> None:
    (named,) = device_names("modbus", {"calibration": "", "port": "tcp://127.0.0.1:502"})
    assert named == "Modbus 127.0.0.1:502 unit 1"
    assert device_names("modbus", {"calibration": "", "port": "tcp://localhost:502"}) == (named,)
    (tmp_path / "link").symlink_to("/dev/null")
    ports = ("/dev/null", str(tmp_path / "link"))
    names = {device_names("modbus", {"calibration": "", "port": port}) for port in ports}
    assert len(names) == 1
