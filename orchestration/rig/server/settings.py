"""Settings of a rig's server, as its command line has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from math import isfinite
from pathlib import Path

from fmus.kit import UserError
from fmus.rig_proxy import PORT
from orchestration.rig.endpoint import HIGHEST_PORT
from orchestration.rig.server.scheduling import WATCHDOG

RATES = (0.1, 1000.0)  # Hz
WATCHDOGS = (0.02, 60.0)  # s
SMALLEST_ARCHIVE = 1e6  # bytes
# behind a reason that a machine gives that is busy with other work
BUSY = "a busy machine needs a longer --watchdog"
# of the watchdog time, that a driver call may take, or a process be silent: the remainder is for
# noticing and for the rescue
_SHARE = 0.75


@dataclass(frozen=True)
class ServerSettings:
    """Settings of a server: its backend, its pace and its address.

    Attributes
    ----------
    backend : str
        Name of the backend, or ``file.py:Class``.
    options : Mapping of str to str
        Options of the backend.
    rate : float
        Samples per second.
    watchdog : float
        Time in s after which the rig stops without a fresh command.
    lockstep : bool
        Whether the client advances the time of an emulated rig.
    host : str
        Address to bind to.
    port : int
        Port of the requests; telemetry has the next, and operators the one after it. Zero is any
        that is free.
    keys : Path or None
        Key file of the server; without one it leaves a key for its user's clients.
    no_keys : bool
        Whether everybody on this machine may drive the rig, without a key.
    log : Path or None
        File that gets a copy of every line.
    state : Path or None
        Folder that keeps the latch of each device; default is the user's.
    priority : int or None
        Real-time priority of the process that has the device.
    cpu : int or None
        Core that this process stays on.
    alarm_hook : str or None
        Program or address that is told of each alarm.
    archive : Path or None
        Folder of the archive; None for none.
    archive_size : float
        Its largest size in bytes.
    files : Mapping of str to bytes
        Contents of the backend's files as the server found them: its code and its calibration.
    stuck_after : int
        Samples in which a measured value stays the same while commands change, or the device does
        not have what was written, before that is an alarm; 0 is never.

    Raises
    ------
    UserError
        If a value is out of range, or would let strangers command the rig.
    """

    backend: str
    options: Mapping[str, str] = field(default_factory=dict)
    rate: float = 30.0
    watchdog: float = WATCHDOG
    lockstep: bool = False
    host: str = "127.0.0.1"
    port: int = PORT
    keys: Path | None = None
    no_keys: bool = False
    log: Path | None = None
    state: Path | None = None
    priority: int | None = None
    cpu: int | None = None
    stuck_after: int = 100
    alarm_hook: str | None = None
    archive: Path | None = None
    archive_size: float = 1e9
    files: Mapping[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _check_range("--rate", self.rate, *RATES, "Hz")
        _check_range("--watchdog", self.watchdog, *WATCHDOGS, "s")
        if not 0 <= self.port <= HIGHEST_PORT:
            raise UserError(
                f"--port {self.port}: allowed are 1 to {HIGHEST_PORT}, and 0 for any that is free"
            )
        if self.priority is not None and not 1 <= self.priority <= 99:
            raise UserError(f"--device-priority {self.priority}: allowed are 1 to 99")
        if self.stuck_after < 0:
            raise UserError(f"--stuck-after {self.stuck_after}: allowed are 0, never, and more")
        if self.cpu is not None and self.cpu < 0:
            raise UserError(f"--device-cpu {self.cpu}: cores count from 0")
        if self.keys is not None and self.no_keys:
            raise UserError(f"--keys {self.keys} and --no-keys exclude each other")
        if self.archive is not None and self.lockstep:
            raise UserError("--archive: is of a rig in real time, without --lockstep")
        if not self.archive_size >= SMALLEST_ARCHIVE:
            raise UserError(f"--archive-size: at least {SMALLEST_ARCHIVE / 1e6:g}MB are needed")
        if self.keys is None and not is_loopback(self.host):
            raise UserError(
                f"--bind {self.host}: beyond this machine the rig is served with keys only; "
                "make them with ppy rig keys and give --keys FILE"
            )

    @property
    def period(self) -> float:
        """Time between two samples in s."""
        return 1 / self.rate

    @property
    def silence(self) -> float:
        """Longest time without a sign of life after which a process counts as hung, in s."""
        return _SHARE * self.watchdog


def _check_range(name: str, value: float, least: float, most: float, unit: str) -> None:
    if not (isfinite(value) and least <= value <= most):
        raise UserError(f"{name} {value:g}: allowed are {least:g} to {most:g} {unit}")


def is_loopback(host: str) -> bool:
    """Return True if nobody on another machine can reach an address.

    Parameters
    ----------
    host : str
        Name or address, an IPv6 one in brackets.

    Returns
    -------
    bool
    """
    if host == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def read_options(texts: list[str]) -> dict[str, str]:
    """Read the options of the backend.

    Parameters
    ----------
    texts : list of str
        Each ``key=value``.

    Returns
    -------
    dict of str to str

    Raises
    ------
    UserError
        If one has no key, no ``=``, or is there twice.
    """
    options: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.isidentifier():
            raise UserError(f"--option {text!r}: write KEY=VALUE")
        if key in options:
            raise UserError(f"--option {key} is given twice: {options[key]!r} and {value!r}")
        options[key] = value
    return options
