"""Backend of a National Instruments device, through NI-DAQmx: analog channels and digital lines.

Inputs are sampled by the device's own clock where it has one for them, and a read takes the newest
sample; otherwise a read converts at once, as digital lines are always read. Outputs are written at
once: a buffer in front of them would delay commands. Where the device has a watchdog timer it takes
the outputs to their safe volts if this computer stops; where it has none, `watchdog` says so, and
the outputs stay as they are when the computer has stopped.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress

import nidaqmx
import numpy as np
from nidaqmx.constants import (
    AcquisitionType,
    LineGrouping,
    OverwriteMode,
    ReadRelativeTo,
    TaskMode,
    TerminalConfiguration,
    WatchdogAOExpirState,
)
from nidaqmx.errors import DaqError, Error
from nidaqmx.stream_readers import AnalogMultiChannelReader, DigitalMultiChannelReader
from nidaqmx.stream_writers import AnalogMultiChannelWriter, DigitalSingleChannelWriter
from nidaqmx.system import Device
from nidaqmx.system.watchdog import AOExpirationState, WatchdogTask

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.plugins.calibrated import Calibrated
from orchestration.plugins.calibration import MeasuredChannel, read_calibration
from orchestration.rig.signals import one_of, seconds

_TERMINALS = {
    "default": TerminalConfiguration.DEFAULT,
    "differential": TerminalConfiguration.DIFF,
    "referenced": TerminalConfiguration.RSE,
    "non-referenced": TerminalConfiguration.NRSE,
}
# with or without the device; a line is of a port: Dev1/ai0, ai0, Dev1/port0/line1, port0/line1
_PLACE = re.compile(r"(?:(?!port\d+/)([^/]+)/)?(?:[^/]+|(port\d+/line\d+))")
# times the rig's watchdog, after which the device's acts: the rig's has to have failed first
_LATER = 2.0
_BUFFER = 10  # s of samples that the driver keeps
_LEAST_BUFFER = 1000  # samples
_CALIBRATION = "thesis"
_DEVICE = "Dev1"  # as NI MAX names the first one


class NiDaqmx(Calibrated):
    """The channels of a device that a calibration lists; opening it changes no output.

    Parameters
    ----------
    calibration : str
        A file, or the name of one that ships.
    device : str
        Name of the device in NI MAX; also that of the device of channels that name none.
    timing : {"auto", "hardware", "software"}
        Whether inputs are sampled by the device's clock; auto asks the device.
    timeout : str
        s, of every call of the driver that can wait.

    Attributes
    ----------
    watchdog : str
        Description of the watchdog timer, or of why there is none.
    timing : str
        ``hardware`` or ``software``.

    Raises
    ------
    UserError
        If an option or the calibration is wrong, the driver is not installed, or it refuses.
    """

    def __init__(
        self,
        calibration: str = _CALIBRATION,
        device: str = _DEVICE,
        timing: str = "auto",
        timeout: str = "1",
    ) -> None:
        super().__init__(calibration)
        self._timeout = seconds("timeout", timeout, 10.0)
        one_of("timing", timing, ("auto", "hardware", "software"))
        self._check(calibration, device)
        self._name = device
        self._tasks: list[nidaqmx.Task] = []
        self._watchdog_task: WatchdogTask | None = None
        self._armed = False
        self._reader: AnalogMultiChannelReader | None = None
        self._writer: AnalogMultiChannelWriter | None = None
        self._line_reader: DigitalMultiChannelReader | None = None
        self._beat_writer: DigitalSingleChannelWriter | None = None
        measured = self._measured_channels.values()
        self._analog = [one for one in measured if not _is_line(one.channel)]
        self._lines = [one for one in measured if _is_line(one.channel)]
        self._samples = np.full(len(self._analog), math.nan)
        self._levels = np.zeros(len(self._lines), bool)
        try:
            with _errors_in_one_line(f"{device} cannot be opened"):
                self._device = Device(device)
                # before other tasks, which keep it from being reserved
                self.watchdog = self._open_watchdog()
                self._open_outputs()
                self.timing = self._open_inputs(timing)
                self._open_lines()
        except BaseException:
            self.close()
            raise

    @classmethod
    def devices(
        cls, calibration: str = _CALIBRATION, device: str = _DEVICE, **options: str
    ) -> list[str]:
        """Return the device, and those of channels that have a device of their own."""
        channels = read_calibration(calibration)
        places = [one.channel for one in (*channels.inputs.values(), *channels.outputs.values())]
        found = [_PLACE.fullmatch(place) for place in (*places, channels.heartbeat)]
        named = {match[1] for match in found if match} - {None}
        return sorted({f"NI device {name.lower()}" for name in (device, *named)})

    def _check(self, calibration: str, device: str) -> None:
        """Refuse signals of instruments, wrong lines, and a name that is not that of a device."""
        for channel in (*self._command_channels.values(), *self._measured_channels.values()):
            where = f"{calibration}: {channel.name}"
            if channel.instrument:
                raise UserError(f"{where} is a signal of an instrument, not of this device")
            if not _is_line(channel.channel):
                continue
            if channel.name in self.inputs:
                raise UserError(
                    f"{where}: channel = {channel.channel!r}: a digital line can be measured only"
                )
            if channel.si != "1":
                raise UserError(f"{where}: unit = {channel.unit!r}: a digital line has the unit 1")
        line = self._calibration.heartbeat
        if line and not _is_line(line):
            raise UserError(
                f"{calibration}: [rig] heartbeat = {line!r}: a digital line is wanted, such as"
                " port0/line7"
            )
        if not device or "/" in device:
            raise UserError(
                f"option device = {device!r}: the name of a device is wanted, such as Dev1"
            )

    def _physical_channel(self, channel: str) -> str:
        """Return a channel's name in NI-DAQmx, such as ``Dev1/ai0`` or ``Dev1/port0/line1``."""
        found = _PLACE.fullmatch(channel)
        return f"{self._name}/{channel}" if found and not found[1] else channel

    def _open_watchdog(self) -> str:
        """Set up the device's own timer, which takes the outputs to their safe volts.

        Returns a description of the timer, or of why there is none.
        """
        if not self._command_channels:
            return "none: there are no outputs to guard"
        after = _LATER * self._calibration.watchdog
        states = [
            AOExpirationState(
                self._physical_channel(channel.channel),
                channel.volts(self.safe_values[name]),
                WatchdogAOExpirState.VOLTAGE,
            )
            for name, channel in self._command_channels.items()
        ]
        try:
            self._watchdog_task = WatchdogTask(self._name, timeout=after)
            self._watchdog_task.cfg_watchdog_ao_expir_states(states)
            # a device without such a watchdog refuses it here
            self._watchdog_task.control(TaskMode.TASK_VERIFY)
        except DaqError as error:
            self._close_watchdog()
            return (
                f"none: {self._name} refuses one ({_one_line(error)}); its outputs stay as they are"
                " if this computer stops"
            )
        return (
            f"{self._name} takes its outputs to their safe volts after {after:g} s without a"
            " command"
        )

    def _open_outputs(self) -> None:
        """Set up the analog outputs without changing them."""
        if not self._command_channels:
            return
        task = self._new_task()
        for channel in self._command_channels.values():
            low, high = channel.range
            name = self._physical_channel(channel.channel)
            task.ao_channels.add_ao_voltage_chan(name, min_val=low, max_val=high)
        self._writer = AnalogMultiChannelWriter(task.out_stream, auto_start=True)

    def _open_inputs(self, timing: str) -> str:
        """Set up and start the analog inputs; return their timing, ``hardware`` or ``software``."""
        if not self._analog:
            return "software"
        task = self._new_task()
        for channel in self._analog:
            task.ai_channels.add_ai_voltage_chan(
                self._physical_channel(channel.channel),
                terminal_config=_TERMINALS[channel.terminal],
                min_val=channel.range[0],
                max_val=channel.range[1],
            )
        self._reader = AnalogMultiChannelReader(task.in_stream)
        chosen = timing
        if timing == "auto":
            has_clock = AcquisitionType.CONTINUOUS in self._device.ai_samp_modes
            chosen = "hardware" if has_clock else "software"
        if chosen == "hardware":
            rate = self._calibration.rate
            task.timing.cfg_samp_clk_timing(
                rate,
                sample_mode=AcquisitionType.CONTINUOUS,
                samps_per_chan=max(round(_BUFFER * rate), _LEAST_BUFFER),
            )
            task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
            # the newest sample is the one before the position of the next
            task.in_stream.relative_to = ReadRelativeTo.MOST_RECENT_SAMPLE
            task.in_stream.offset = -1
        task.start()
        return chosen

    def _open_lines(self) -> None:
        """Set up the digital lines that are read, and that of the heartbeat without changing it."""
        if self._lines:
            task = self._new_task()
            for channel in self._lines:
                task.di_channels.add_di_chan(
                    self._physical_channel(channel.channel),
                    line_grouping=LineGrouping.CHAN_PER_LINE,
                )
            self._line_reader = DigitalMultiChannelReader(task.in_stream)
            task.start()
        if self._calibration.heartbeat:
            task = self._new_task()
            task.do_channels.add_do_chan(self._physical_channel(self._calibration.heartbeat))
            self._beat_writer = DigitalSingleChannelWriter(task.out_stream, auto_start=True)

    def _new_task(self) -> nidaqmx.Task:
        task = nidaqmx.Task()
        self._tasks.append(task)
        return task

    def read(self) -> Mapping[str, float]:
        """Return the newest sample of every measured channel, SI; NaN for volts beyond the range.

        The volts of a digital line are 0 and 1.

        Returns
        -------
        Mapping of str to float

        Raises
        ------
        UserError
            If the driver reports an error, or no sample within the timeout.
        """
        values = dict.fromkeys(self.outputs, math.nan)  # it is closed, or nothing is measured
        with _errors_in_one_line(f"{self._name} cannot be read"):
            if self._reader is not None:
                self._reader.read_one_sample(self._samples, self._timeout)
                values |= _measured(self._analog, self._samples)
            if self._line_reader is not None:
                self._line_reader.read_one_sample_one_line(self._levels, self._timeout)
                values |= _measured(self._lines, self._levels)
        return values

    def write(self, values: Mapping[str, float]) -> None:
        """Put out every command, and reset the device's watchdog timer.

        Raises
        ------
        UserError
            If a command is missing, unknown, not finite or beyond its channel's range, which
            changes nothing, or the driver reports an error.
        """
        volts = list(self._volts(values).values())
        if self._writer is None:
            if self._command_channels:
                raise UserError(
                    f"{self._name} cannot be written: it is closed, or was reset to reach a safe"
                    " state"
                )
            return
        with _errors_in_one_line(f"{self._name} cannot be written"):
            if self._watchdog_task is not None:
                if self._armed:
                    self._watchdog_task.reset_timer()
                else:
                    self._watchdog_task.start()
                    self._armed = True
            self._writer.write_one_sample(np.array(volts), self._timeout)

    def heartbeat(self, level: bool) -> None:
        """Set the line of the heartbeat, if the calibration names one and the device is open.

        Raises
        ------
        UserError
            If the driver reports an error.
        """
        if self._beat_writer is not None:
            with _errors_in_one_line(f"{self._name} cannot set its heartbeat"):
                self._beat_writer.write_one_sample_one_line(level, self._timeout)

    def safe(self) -> None:
        """Put out the safe value of every command, or reset a device that does not take it.

        Raises
        ------
        UserError
            If neither works, or the device had to be reset: it has to be opened again.
        """
        if self._writer is None:
            return
        volts = np.array(list(self._volts(self.safe_values).values()))
        try:
            with suppress(Error):
                self._disarm_watchdog()  # for an expired one refuses values
            self._writer.write_one_sample(volts, self._timeout)
        except Error as error:
            self.close()
            with _errors_in_one_line(f"{self._name} cannot be brought to its safe state"):
                self._device.reset_device()
            raise UserError(
                f"{self._name} was reset, because it did not take safe values: {_one_line(error)}"
            ) from error

    def _disarm_watchdog(self) -> None:
        """Stop the device's own timer."""
        if self._watchdog_task is None or not self._armed:
            return
        self._armed = False
        if self._watchdog_task.expired:
            self._watchdog_task.clear_expiration()
        self._watchdog_task.stop()

    def close(self) -> None:
        """Release the device; its outputs stay as they are."""
        self._reader = None
        self._writer = None
        self._line_reader = None
        self._beat_writer = None
        tasks = self._tasks
        self._tasks = []
        for task in tasks:
            with suppress(Error):
                task.close()
        self._close_watchdog()

    def _close_watchdog(self) -> None:
        watchdog = self._watchdog_task
        self._watchdog_task = None
        if watchdog is None:
            return
        if self._armed:  # a task that is cleared while it runs may expire
            with suppress(Error):
                watchdog.stop()
        self._armed = False
        with suppress(Error):
            watchdog.close()


def _is_line(channel: str) -> bool:
    """Return whether a channel is a digital line."""
    found = _PLACE.fullmatch(channel)
    return found is not None and found[2] is not None


def _measured(channels: list[MeasuredChannel], samples: Array) -> dict[str, float]:
    """Return the values, SI, of samples of channels in V, or 0 and 1."""
    pairs = zip(channels, samples.tolist(), strict=True)
    return {channel.name: channel.measured(volts) for channel, volts in pairs}


@contextmanager
def _errors_in_one_line(failure: str) -> Iterator[None]:
    """Turn errors of the driver into UserErrors of one line."""
    try:
        yield
    except Error as error:
        raise UserError(f"{failure}: {_one_line(error)}") from error


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= 300 else text[:297] + "..."
