"""NI-DAQmx backend on a device that is emulated behind the real library: volts by calibration.

The last test wants a device: ``PPY_NIDAQMX_DEVICE`` names one whose outputs may be set to zero.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest
from nidaqmx.constants import TerminalConfiguration
from nidaqmx.error_codes import DAQmxErrors

from fmus.kit.errors import UserError
from fmus.kit.registry import presets
from orchestration.rig.backends.backend import Backend
from orchestration.rig.backends.registry import device_names, open_backend
from tests.support.rig import daqmx

ZERO = {"Dev1/ao0": 0.0, "Dev1/ao1": 0.0}


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> daqmx.Device:
    device = daqmx.install(monkeypatch)
    device.inputs = {"Dev1/ai0": 0.5, "Dev1/ai1": 1.0, "Dev1/ai2": -0.25, "Dev1/ai3": 0.0}
    return device


def opened(**options: str) -> Backend:
    return open_backend("nidaqmx", options)


def test_its_devices_are_that_of_the_option_and_those_of_channels(tmp_path: Path) -> None:
    assert device_names("nidaqmx", {}) == ("NI device dev1",)
    assert device_names("nidaqmx", {"device": "DEV2"}) == ("NI device dev2",)
    text = presets()["thesis"].read_text(encoding="utf-8")
    path = tmp_path / "rig.toml"
    path.write_text(text.replace('"ao0"', '"cDAQ1Mod2/ao0"'), encoding="utf-8")
    assert device_names("nidaqmx", {"calibration": str(path)}) == (
        "NI device cdaq1mod2",
        "NI device dev1",
    )


def test_volts_are_what_the_calibration_says(device: daqmx.Device) -> None:
    rig = opened()
    assert dict(rig.read()) == pytest.approx(
        {
            "force_measured": 1.1125,
            "displacement": 5.08e-3,
            "voltage": -0.25,
            "stand_displacement": 0.0,
        }
    )
    rig.write({"current": -0.7, "force": 1.95})
    assert device.outputs == pytest.approx({"Dev1/ao1": -0.7, "Dev1/ao0": 1.5})
    inputs = next(job for job in device.jobs.values() if job.kind == "in")
    assert inputs.terminals[:2] == [
        TerminalConfiguration.DIFF.value,
        TerminalConfiguration.RSE.value,
    ]
    assert inputs.ranges[0] == (-2.0, 9.95)
    rig.close()
    assert device.jobs == {}


LINES = """
[rig]
rate = 30
watchdog = 0.2
heartbeat = "port0/line7"

[inputs.current]
channel = "ao1"
gain = 1
unit = "A"
range = [-1, 1]
date = 2026-11-29

[outputs.voltage]
channel = "ai2"
gain = 2
unit = "V"
range = [-10, 10]
date = 2026-11-29

[outputs.interlock]
channel = "port0/line1"
gain = 1
unit = "1"
range = [0, 1]
date = 2026-11-29

[outputs.door]
channel = "Dev2/port0/line0"
gain = -1
offset = 1
unit = "1"
range = [0, 1]
date = 2026-11-29
"""


def with_lines(folder: Path, text: str = LINES) -> Backend:
    path = folder / "lines.toml"
    path.write_text(text, encoding="utf-8")
    return opened(calibration=str(path))


def test_digital_lines_are_read_beside_volts(device: daqmx.Device, tmp_path: Path) -> None:
    rig = with_lines(tmp_path)
    for interlock, door in ((True, False), (False, True)):
        device.lines = {"Dev1/port0/line1": interlock, "Dev2/port0/line0": not door}
        expected = {"voltage": -0.5, "interlock": float(interlock), "door": float(door)}
        assert dict(rig.read()) == expected
    path = str(tmp_path / "lines.toml")
    assert device_names("nidaqmx", {"calibration": path}) == ("NI device dev1", "NI device dev2")
    device.failing["read_digital_lines"] = -200220
    with pytest.raises(UserError, match=r"^Dev1 cannot be read: Something is wrong"):
        rig.read()
    rig.close()
    assert all(map(math.isnan, rig.read().values()))
    assert device.jobs == {}


def test_a_heartbeat_sets_its_line(device: daqmx.Device, tmp_path: Path) -> None:
    rig = with_lines(tmp_path)
    assert device.beats == []
    for level in (True, False, True):
        rig.heartbeat(level)
    line = "Dev1/port0/line7"
    assert device.beats == [(line, True), (line, False), (line, True)]
    device.failing["write_digital_lines"] = -200220
    with pytest.raises(UserError, match=r"^Dev1 cannot set its heartbeat: Something is wrong"):
        rig.heartbeat(False)
    rig.close()
    rig.heartbeat(True)  # a device that is closed has none
    assert len(device.beats) == 3
    without = opened()
    without.heartbeat(True)
    assert len(device.beats) == 3
    without.close()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"port0/line7"', '"ao0"', "heartbeat = 'ao0': a digital line is wanted, such as port0/l"),
        ('"ao1"', '"port0/line2"', "current: channel = 'port0/line2': a digital line can be meas"),
        ('unit = "1"', 'unit = "V"', "interlock: unit = 'V': a digital line has the unit 1"),
    ],
)
def test_wrong_lines_are_told(
    device: daqmx.Device, tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(UserError, match=message):
        with_lines(tmp_path, LINES.replace(old, new, 1))
    assert device.jobs == {}


def test_opening_and_closing_change_no_output(device: daqmx.Device) -> None:
    opened().close()
    assert device.outputs == {}


@pytest.mark.parametrize(
    ("has_clock", "timing", "rate"), [(True, "hardware", 30.0), (False, "software", None)]
)
def test_the_device_samples_by_its_own_clock_where_it_can(
    monkeypatch: pytest.MonkeyPatch, has_clock: bool, timing: str, rate: float | None
) -> None:
    device = daqmx.install(monkeypatch, has_clock=has_clock)
    device.inputs = dict.fromkeys((f"Dev1/ai{k}" for k in range(4)), 1.0)
    rig = opened()
    assert rig.timing == timing  # type: ignore[attr-defined]
    assert next(job for job in device.jobs.values() if job.kind == "in").rate == rate
    assert rig.read()["voltage"] == 1.0
    rig.close()


def test_a_broken_wire_is_no_value(device: daqmx.Device) -> None:
    device.inputs["Dev1/ai0"] = 10.4
    rig = opened()
    assert math.isnan(rig.read()["force_measured"])
    assert rig.read()["voltage"] == -0.25
    rig.close()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"current": 1.4, "force": 0.0},
            "current = 1.4 A: the range of ao1 allows -1.3 … 1.3 A only",
        ),
        ({"current": 0.1}, "command force = missing: must be a finite number"),
        ({"current": math.nan, "force": 0.0}, "command current = nan: must be a finite number"),
    ],
)
def test_what_cannot_be_commanded_changes_nothing(
    device: daqmx.Device, values: dict[str, float], message: str
) -> None:
    rig = opened()
    rig.write({"current": 0.5, "force": 0.0})
    before = dict(device.outputs)
    with pytest.raises(UserError, match=message):
        rig.write(values)
    assert device.outputs == before
    rig.close()


def test_safe_and_close_work_at_any_time_and_twice(device: daqmx.Device) -> None:
    rig = opened()
    rig.safe()
    assert device.outputs == ZERO
    rig.write({"current": 1.0, "force": 1.0})
    rig.safe()
    rig.safe()
    assert device.outputs == ZERO
    rig.close()
    rig.safe()
    rig.close()
    with pytest.raises(UserError, match="it is closed"):
        rig.write({"current": 1.0, "force": 1.0})


def test_a_device_that_does_not_take_safe_values_is_reset(device: daqmx.Device) -> None:
    rig = opened()
    rig.write({"current": 1.0, "force": 1.3})
    device.failing["write_analog_f64"] = -50405
    with pytest.raises(
        UserError,
        match=r"Dev1 was reset, because it did not take safe values: Something is wrong\.",
    ):
        rig.safe()
    assert device.resets == 1
    assert device.outputs == ZERO
    rig.safe()
    rig.close()


def test_a_device_without_a_watchdog_is_told(device: daqmx.Device) -> None:
    rig = opened()
    note = rig.watchdog  # type: ignore[attr-defined]
    assert note.startswith(
        "none: Dev1 refuses one (Watchdog Timer is not supported on this device."
    )
    assert note.endswith("its outputs stay as they are if this computer stops")
    rig.write({"current": 1.0, "force": 1.0})
    rig.close()


def test_the_devices_watchdog_has_the_safe_volts(monkeypatch: pytest.MonkeyPatch) -> None:
    device = daqmx.install(monkeypatch, has_watchdog=True)
    rig = opened()
    assert device.watchdog().states == ZERO
    assert device.watchdog().timeout == pytest.approx(0.4)  # twice the rig's own
    assert not device.watchdog().running  # nothing to guard before the first command
    for _ in range(4):
        rig.write({"current": 1.0, "force": 1.0})
    assert device.watchdog().running
    assert device.watchdog().resets == 3
    device.expire()
    assert device.outputs == ZERO
    with pytest.raises(UserError, match="Dev1 cannot be written: Cannot reset an expired watchdog"):
        rig.write({"current": 1.0, "force": 1.0})
    rig.safe()  # which unlocks it
    assert device.resets == 0
    rig.write({"current": 0.5, "force": 0.0})
    assert device.outputs["Dev1/ao1"] == 0.5
    rig.close()
    assert device.jobs == {}


@pytest.mark.parametrize("call", ["create_task", "create_ai_voltage_chan", "start_task"])
def test_a_device_that_cannot_be_opened_is_let_go(device: daqmx.Device, call: str) -> None:
    device.failing[call] = -200220
    with pytest.raises(
        UserError, match=r"^backend nidaqmx: Dev1 cannot be opened: Something is wrong\. [^\n]*$"
    ):
        opened()
    assert device.jobs == {}


def test_an_error_of_the_driver_is_one_line(device: daqmx.Device) -> None:
    rig = opened()
    device.failing["read_analog_f64"] = DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE.value
    with pytest.raises(UserError, match=r"^Dev1 cannot be read: [^\n]*-200284[^\n]*$"):
        rig.read()
    rig.close()


def test_without_a_driver_it_says_so() -> None:
    with pytest.raises(
        UserError, match="Dev1 cannot be opened: Could not find an installation of NI-DAQmx"
    ):
        opened(timing="software")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"timing": "sometimes"}, "option timing = 'sometimes'"),
        (
            {"timeout": "60"},
            "option timeout = '60': must be a number of seconds above 0, at most 10",
        ),
        ({"device": "Dev1/ao0"}, "the name of a device is wanted"),
        ({"calibration": "thesis_generator"}, "current is a signal of an instrument"),
    ],
)
def test_wrong_options_are_told(
    device: daqmx.Device, options: dict[str, str], message: str
) -> None:
    with pytest.raises(UserError, match=message):
        opened(**options)


@pytest.mark.device
@pytest.mark.skipif(
    "PPY_NIDAQMX_DEVICE" not in os.environ, reason="PPY_NIDAQMX_DEVICE names no device of NI-DAQmx"
)
def test_a_real_device_is_read_and_goes_to_zero() -> None:
    rig = opened(device=os.environ["PPY_NIDAQMX_DEVICE"])
    try:
        assert set(rig.read()) == set(rig.outputs)
        rig.write(dict.fromkeys(rig.inputs, 0.0))
    finally:
        rig.safe()
        rig.close()
