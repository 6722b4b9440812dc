"""Backends that write down with monotonic times what they are told, and fail when a test asks for
it.

They stand for hardware that cannot exist here, of the dangerous kind: it holds its last command,
whichever process ends. A fault happens in every call from when the file `trigger` exists.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import random
import struct
import sys
import threading
import time
from collections.abc import Mapping
from math import nan
from pathlib import Path

from fmus.kit.errors import UserError
from orchestration.rig.backends.backend import Backend, Limit, Steppable

GAIN = {"voltage": 2.0, "displacement": 0.5}  # of the commands, see `Logged.read`


_HELD = struct.Struct("<2d")  # both commands


class Logged(Backend):
    """Two commands that the hardware holds, two measured values that follow them, and a log.

    The hardware is a file beside the log, mapped into memory: it outlives every process.

    Parameters
    ----------
    log : str
        File; one line a call.
    rate : str
        Limit of the current's rate.
    """

    inputs = {"current": "A", "force": "N"}
    outputs = {"voltage": "V", "displacement": "m"}

    def __init__(self, log: str = os.devnull, rate: str = "inf") -> None:
        self.limits = {
            "current": Limit(-1.3, 1.3, float(rate)),
            "force": Limit(0.0, 3.0),
            "voltage": Limit(-2.0, 2.0),
        }
        self._log = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        self._hardware = _mapped(log)
        self._note("open")

    @property
    def _commands(self) -> dict[str, float]:
        """Values that the hardware holds."""
        return dict(zip(self.inputs, _HELD.unpack_from(self._hardware), strict=True))

    def _hold(self, values: Mapping[str, float]) -> None:
        _HELD.pack_into(self._hardware, 0, *(values[name] for name in self.inputs))

    def _note(self, what: str) -> None:
        os.write(self._log, f"{time.monotonic()!r} {os.getpid()} {what}\n".encode())

    def measured(self, commands: Mapping[str, float]) -> dict[str, float]:
        """Values that are measured while something is commanded."""
        return {
            "voltage": GAIN["voltage"] * commands["current"],
            "displacement": GAIN["displacement"] * commands["force"],
        }

    def read(self) -> Mapping[str, float]:
        return self.measured(self._commands)

    def write(self, values: Mapping[str, float]) -> None:
        self._note(" ".join(["write", *(repr(values[name]) for name in self.inputs)]))
        self._hold(values)

    def read_back(self) -> Mapping[str, float]:
        return self._commands

    def safe(self) -> None:
        self._hold(dict.fromkeys(self.inputs, 0.0))
        self._note("safe")  # after it: a process may be stopped in between

    def close(self) -> None:
        self._note("close")
        os.close(self._log)


def _mapped(log: str) -> mmap.mmap:
    """Return the hardware that belongs to a log; without a file it belongs to this process."""
    if log == os.devnull:
        return mmap.mmap(-1, _HELD.size)
    file = os.open(f"{log}.held", os.O_RDWR | os.O_CREAT, 0o600)
    try:
        os.ftruncate(file, _HELD.size)
        return mmap.mmap(file, _HELD.size)
    finally:
        os.close(file)


class Stepped(Logged, Steppable):
    """The same in lockstep: an integrator of the current, which is not real."""

    charge = 0.0

    @classmethod
    def devices(cls, **options: str) -> list[str]:
        return []

    def advance(self, step: float) -> None:
        self._note(f"advance {step!r}")
        self.charge += self._commands["current"] * step

    def read(self) -> Mapping[str, float]:
        return {"voltage": self.charge, "displacement": self._commands["force"]}


class RealStepped(Stepped):
    """A real device whose time can be a client's."""

    def __init__(self, log: str, trigger: str) -> None:
        super().__init__(log)

    @classmethod
    def devices(cls, **options: str) -> list[str]:
        return ["integrator"]


class Beating(Logged):
    """Has a heartbeat, and a door that is open while the file `trigger` exists."""

    outputs = {**Logged.outputs, "door": "1"}

    def __init__(self, log: str, trigger: str, rate: str = "inf") -> None:
        super().__init__(log, rate)
        self.limits["door"] = Limit(0.5, 1.5)
        self._trigger = Path(trigger)

    def heartbeat(self, level: bool) -> None:
        self._note(f"beat {level}")

    def read(self) -> Mapping[str, float]:
        return {**super().read(), "door": float(not self._trigger.exists())}


class Faulty(Logged):
    """Fails in one of its calls.

    Parameters
    ----------
    log, trigger : str
        Files.
    where : {"open", "read", "write", "safe", "close"}
    how : str
        Its fault: `raise`, `refuse`, `exit`, `hang`, `die`, `slow`, `nan`, `alternate`, `beyond`,
        `nothing`.
    times : str
        Largest number of faults, over all processes: the log is counted.
    """

    _reads = 0

    def __init__(
        self, log: str, trigger: str, where: str, how: str, times: str = "1000000"
    ) -> None:
        self._trigger, self._where, self._how, self._times, self._path = (
            trigger,
            where,
            how,
            int(times),
            Path(log),
        )
        super().__init__(log)
        self._fail("open")

    def _fail(self, where: str) -> bool:
        if where != self._where or not os.path.exists(self._trigger):
            return False
        if self._times < 1000000 and self._path.read_text().count("fault") >= self._times:
            return False
        self._note(f"fault {where} {self._how}")
        if self._how == "raise":
            raise OSError(5, f"the cable of {where} is out")
        if self._how == "refuse":
            raise UserError("the device is in use by another program")
        if self._how == "exit":
            raise SystemExit(3)
        if self._how == "hang":
            time.sleep(3600.0)
        if self._how == "die":
            os._exit(7)
        if self._how == "slow":
            time.sleep(0.06)
        return True

    def read(self) -> Mapping[str, float]:
        failed, values = self._fail("read"), dict(super().read())
        self._reads += 1
        if failed and (self._how == "nan" or (self._how == "alternate" and self._reads % 2)):
            return dict.fromkeys(values, nan)
        if failed and self._how == "beyond":
            return {**values, "voltage": 2.5}
        if failed and self._how == "nothing":
            return {}
        return values

    def write(self, values: Mapping[str, float]) -> None:
        self._fail("write")
        super().write(values)

    def safe(self) -> None:
        self._fail("safe")
        super().safe()

    def close(self) -> None:
        self._fail("close")
        super().close()


class Reporting(Logged):
    """Reports 1 A, whatever the hardware holds, as long as the trigger exists.

    Parameters
    ----------
    log, trigger : str
        Files.
    opening : str
        Time that opening takes, s.
    """

    def __init__(self, log: str, trigger: str, opening: str = "0") -> None:
        time.sleep(float(opening))
        self._trigger = trigger
        super().__init__(log)

    def read_back(self) -> Mapping[str, float]:
        lie = {"current": 1.0} if os.path.exists(self._trigger) else {}
        return {**self._commands, **lie}


class Mute(Logged):
    """Does not report what it holds."""

    def read_back(self) -> Mapping[str, float]:
        return {}


class Sluggish(Logged):
    """Takes longer than an attempt may for its safe state, as long as the trigger exists."""

    def __init__(self, log: str, trigger: str) -> None:
        self._trigger = trigger
        super().__init__(log)

    def safe(self) -> None:
        if os.path.exists(self._trigger):
            time.sleep(6.0)
        super().safe()


class Printing(Reporting):
    """Prints at every reading, also as a library in C does, and when it is brought to rest."""

    def read(self) -> Mapping[str, float]:
        print("measured " + "x" * 2000, flush=True)
        print("a warning " + "y" * 2000, file=sys.stderr)
        ctypes.CDLL(None).write(1, b"of C " + b"z" * 2000 + b"\n", 2006)
        return super().read()

    def safe(self) -> None:
        super().safe()
        print("at rest", flush=True)


class Unlimited(Reporting):
    """Lacks the limits of a command."""

    def __init__(self, log: str, trigger: str) -> None:
        super().__init__(log, trigger)
        self.limits = {"current": Limit(-1.3, 1.3)}


class Calibrated(Logged):
    """Measures volts that stand in a file beside its log, give or take a noise, by a calibration.

    Parameters
    ----------
    calibration : str
        File with the commands of the hardware.
    """

    NOISE = 0.002  # V, upwards or downwards

    def __init__(self, log: str, calibration: str) -> None:
        super().__init__(log)
        from orchestration.plugins.calibration import read_calibration  # which takes a second

        self._channels = read_calibration(calibration)
        self.inputs, self.outputs = self._channels.units
        self.limits = self._channels.limits
        self.attributes = self._channels.attributes
        self._volts = Path(log).with_name("volts")
        self._random = random.Random(1)

    def read(self) -> Mapping[str, float]:
        noise = self._random.choice((-self.NOISE, self.NOISE))
        volts = float(self._volts.read_text()) + noise
        return {name: one.measured(volts) for name, one in self._channels.outputs.items()}


class Limitless(Logged):
    """Says None where infinity stands for no limit."""

    def __init__(self, log: str) -> None:
        super().__init__(log)
        self.limits = {"current": Limit(-1.3, 1.3, None)}  # type: ignore[arg-type]


class Threaded(Logged):
    """Has a thread that never ends, as the reader of a serial port."""

    def __init__(self, log: str) -> None:
        super().__init__(log)
        threading.Thread(target=time.sleep, args=(3600.0,)).start()


class Actuator(Faulty):
    """Actuator of the system hil_bench: a spring, whose length is commanded."""

    STIFFNESS, RESISTANCE = 200.0, 0.5  # N/m, ohm; soft: a loop over a bad cable stays stable

    inputs = {"current": "A", "length_change": "m"}
    outputs = {
        "voltage": "V",
        "electrochemical_displacement": "m",
        "mechanical_displacement": "m",
        "charge": "C",
        "tension": "N",
    }

    def __init__(
        self, log: str, trigger: str, where: str = "", how: str = "", times: str = "1000000"
    ) -> None:
        super().__init__(log, trigger, where, how, times)
        self.limits = {"current": Limit(-1.3, 1.3), "length_change": Limit(-0.02, 0.02)}

    def measured(self, commands: Mapping[str, float]) -> dict[str, float]:
        tension = max(0.0, self.STIFFNESS * commands["length_change"])
        voltage = self.RESISTANCE * commands["current"]
        return dict.fromkeys(self.outputs, 0.0) | {"voltage": voltage, "tension": tension}
