"""A data acquisition device that is not there.

A mock, for no driver of NI can be installed here: an interpreter of the library ``nidaqmx`` stands
for the driver, as in that library's own tests. Everything above it is the real library. What it is
not told to do it refuses.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from nidaqmx._base_interpreter import BaseInterpreter
from nidaqmx.constants import AcquisitionType, LineGrouping, ReadRelativeTo, WDTTaskAction
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError
from nidaqmx.utils import unflatten_channel_string

# attributes, by the numbers of the driver's header
(
    TASK_NAME,
    READ_CHANNELS,
    BYTES_OF_LINES,
    AI_SAMPLE_MODES,
    RELATIVE_TO,
    OFFSET,
    OVERWRITE,
    EXPIRED,
    WRITTEN_CHANNELS,
) = (
    0x1276,
    0x217B,
    0x217C,
    0x2FDC,
    0x190A,
    0x190B,
    0x1211,
    0x21A8,
    0x217E,
)


LINES = [f"{name}/port0/line{number}" for name in ("Dev1", "Dev2") for number in range(8)]


@dataclass
class Job:
    """A task of the driver."""

    kind: str = ""
    channels: list[str] = field(default_factory=list)
    ranges: list[tuple[float, float]] = field(default_factory=list)
    terminals: list[int] = field(default_factory=list)
    running: bool = False
    rate: float | None = None
    attributes: dict[int, int] = field(default_factory=dict)
    states: dict[str, float] = field(default_factory=dict)
    timeout: float = 0.0
    resets: int = 0


class Device:
    """Volts at its inputs and outputs, and everything that can be wrong with it.

    ``failing`` maps a call of the driver to the error code that it then returns.
    """

    def __init__(self, has_watchdog: bool, has_clock: bool):
        self.has_watchdog, self.has_clock = has_watchdog, has_clock
        self.inputs: dict[str, float] = {}
        self.outputs: dict[str, float] = {}
        self.lines: dict[str, bool] = {}
        self.beats: list[tuple[str, bool]] = []  # line and level, in order
        self.jobs: dict[int, Job] = {}
        self.failing: dict[str, int] = {}
        self.resets = 0
        self._expired = False

    def watchdog(self) -> Job:
        return next(job for job in self.jobs.values() if job.kind == "watchdog")

    def expire(self) -> None:
        """Let the watchdog's time run out."""
        self._expired = True
        self.outputs |= self.watchdog().states


class Interpreter(BaseInterpreter):
    """The driver's calls."""

    def __init__(self, device: Device):
        self.device = device
        self._handles = itertools.count(1)

    def _fail(self, call: str) -> None:
        if call in self.device.failing:
            code = self.device.failing[call]
            raise DaqError("Something is wrong.\n\nDevice: Dev1", code)

    def create_task(self, session_name):
        self._fail("create_task")
        self.device.jobs[handle := next(self._handles)] = Job()
        return handle, True

    def clear_task(self, task):
        del self.device.jobs[task]

    def start_task(self, task):
        self._fail("start_task")
        self.device.jobs[task].running = True

    def stop_task(self, task):
        self.device.jobs[task].running = False

    def task_control(self, task, action):
        if self.device.jobs[task].kind == "watchdog" and not self.device.has_watchdog:
            raise DaqError(
                "Watchdog Timer is not supported on this device.",
                DAQmxErrors.WATCHDOG_TIMER_NOT_SUPPORTED,
            )

    def create_ai_voltage_chan(
        self, task, physical_channel, name, terminal_config, low, high, units, scale
    ):
        self._fail("create_ai_voltage_chan")
        job = self.device.jobs[task]
        job.kind = "in"
        job.channels.append(physical_channel)
        job.ranges.append((low, high))
        job.terminals.append(terminal_config)

    def create_ao_voltage_chan(self, task, physical_channel, name, low, high, units, scale):
        job = self.device.jobs[task]
        job.kind = "out"
        job.channels.append(physical_channel)
        job.ranges.append((low, high))

    def cfg_samp_clk_timing(self, task, rate, source, active_edge, sample_mode, samps_per_chan):
        assert self.device.has_clock
        assert sample_mode == AcquisitionType.CONTINUOUS.value
        self.device.jobs[task].rate = rate

    def read_analog_f64(self, task, num_samps_per_chan, timeout, fill_mode, read_array):
        self._fail("read_analog_f64")
        job = self.device.jobs[task]
        assert job.running
        if (
            job.rate is not None
        ):  # otherwise old samples would come, and at last the buffer run over
            assert job.attributes[RELATIVE_TO] == ReadRelativeTo.MOST_RECENT_SAMPLE.value
            assert job.attributes[OFFSET] == -1
            assert OVERWRITE in job.attributes
        read_array[:] = [self.device.inputs[channel] for channel in job.channels]
        return read_array, 1

    def create_di_chan(self, task, lines, name, line_grouping):
        assert line_grouping == LineGrouping.CHAN_PER_LINE.value
        self._add_line(task, "lines in", lines)

    def create_do_chan(self, task, lines, name, line_grouping):
        self._add_line(task, "line out", lines)

    def _add_line(self, task, kind, line):
        self._fail("create_line")
        assert line in LINES
        job = self.device.jobs[task]
        job.kind = kind
        job.channels.append(line)

    def read_digital_lines(self, task, num_samps_per_chan, timeout, fill_mode, read_array):
        self._fail("read_digital_lines")
        job = self.device.jobs[task]
        assert job.running
        read_array[:] = [self.device.lines[line] for line in job.channels]
        return read_array, 1, 1

    def write_digital_lines(
        self, task, num_samps_per_chan, auto_start, timeout, data_layout, write_array
    ):
        self._fail("write_digital_lines")
        (level,) = np.ravel(write_array).tolist()
        self.device.beats.append((self.device.jobs[task].channels[0], level))
        return 1

    def write_analog_f64(
        self, task, num_samps_per_chan, auto_start, timeout, data_layout, write_array
    ):
        self._fail("write_analog_f64")
        if self.device._expired:
            raise DaqError("Watchdog expired.", DAQmxErrors.WRITE_FAILED_BECAUSE_WATCHDOG_EXPIRED)
        job = self.device.jobs[task]
        volts = np.ravel(write_array).tolist()
        for value, (low, high) in zip(volts, job.ranges, strict=True):
            assert low <= value <= high
        self.device.outputs |= dict(zip(job.channels, volts, strict=True))
        return 1

    def create_watchdog_timer_task_ex(self, device_name, session_name, timeout):
        others = [job for job in self.device.jobs.values() if job.kind]
        assert not others, "the driver cannot reserve a watchdog while other tasks are reserved"
        self.device.jobs[handle := next(self._handles)] = Job("watchdog", timeout=timeout)
        return handle, True

    def cfg_watchdog_ao_expir_states(
        self, task, channel_names, expir_state_array, output_type_array
    ):
        names = unflatten_channel_string(channel_names)
        self.device.jobs[task].states = dict(zip(names, expir_state_array.tolist(), strict=True))

    def control_watchdog_task(self, task, action):
        if action == WDTTaskAction.CLEAR_EXPIRATION.value:
            self.device._expired = False
        elif self.device._expired:
            raise DaqError(
                "Cannot reset an expired watchdog.", DAQmxErrors.CANT_RESET_EXPIRED_WATCHDOG
            )
        else:
            self.device.jobs[task].resets += 1

    def get_watchdog_attribute_bool(self, task, lines, attribute):
        assert attribute == EXPIRED
        assert self.device.jobs[task].running
        return self.device._expired

    def reset_device(self, device_name):
        self._fail("reset_device")
        self.device.resets += 1
        self.device.outputs = dict.fromkeys(self.device.outputs, 0.0)

    def get_task_attribute_string(self, task, attribute):
        assert attribute == TASK_NAME
        return f"task {task}"

    def get_read_attribute_uint32(self, task, attribute):
        if attribute == BYTES_OF_LINES:
            return 1
        assert attribute == READ_CHANNELS
        return len(self.device.jobs[task].channels)

    def get_write_attribute_uint32(self, task, attribute):
        assert attribute == WRITTEN_CHANNELS
        return len(self.device.jobs[task].channels)

    def set_read_attribute_int32(self, task, attribute, value):
        self.device.jobs[task].attributes[attribute] = value

    def get_device_attribute_int32_array(self, device_name, attribute):
        assert attribute == AI_SAMPLE_MODES
        return [AcquisitionType.FINITE.value] + [
            AcquisitionType.CONTINUOUS.value
        ] * self.device.has_clock


def _refuses(name: str) -> Callable[..., Any]:
    def refuse(*arguments: Any, **named: Any) -> Any:
        raise NotImplementedError(f"the emulated driver has no {name}")

    return refuse


for _name in sorted(Interpreter.__abstractmethods__):
    setattr(Interpreter, _name, _refuses(_name))
Interpreter.__abstractmethods__ = frozenset()


def install(
    monkeypatch: pytest.MonkeyPatch, has_watchdog: bool = False, has_clock: bool = True
) -> Device:
    """Put a device in the driver's place."""
    device = Device(has_watchdog, has_clock)
    interpreter = Interpreter(device)
    monkeypatch.setattr("nidaqmx.utils._select_interpreter", lambda *_, **__: interpreter)
    return device
