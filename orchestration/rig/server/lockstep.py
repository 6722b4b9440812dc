"""A rig in lockstep with its client: an emulated one, stepped in the process of the front."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, nan

from fmus.kit import UserError
from fmus.rig_proxy import LOCKSTEP
from orchestration.rig.backends import Backend, Steppable, backend_class, device_names, open_backend
from orchestration.rig.safety import MeasurementMonitor
from orchestration.rig.server.calls import BackendError, BackendSignals, call, measure
from orchestration.rig.server.rig import Notice, RigState, cannot_open
from orchestration.rig.server.settings import ServerSettings


class LockstepRig:
    """A backend whose time the client advances; there is nothing to watch over.

    Parameters
    ----------
    settings : ServerSettings

    Raises
    ------
    UserError
        If the backend cannot be stepped or cannot be opened.
    """

    mode = LOCKSTEP
    watchdog = 0.0
    bound = 0.0

    def __init__(self, settings: ServerSettings) -> None:
        if not issubclass(backend_class(settings.backend), Steppable):
            raise UserError(
                f"--lockstep: the time of {settings.backend} is its own; emulator and replay can"
                " wait"
            )
        devices = device_names(settings.backend, settings.options)
        if devices:
            raise UserError(
                f"--lockstep: {settings.backend} commands {', '.join(devices)}; without a watchdog"
                " only an emulated rig is served, whose class says that it has no devices"
            )
        self._settings = settings
        self._troubles: list[str] = []
        self._clock = 0.0
        self._number = 0
        try:
            self._open()
        except BackendError as error:
            raise cannot_open(settings, str(error)) from error

    def _open(self) -> None:
        """Open the backend, bring it to its safe state, and read it."""
        self._backend: Backend = call(
            "opening", open_backend, self._settings.backend, self._settings.options
        )
        self._failed = False
        self._resting: float | None = None  # since when, s of its clock
        self.signals = BackendSignals.from_backend(self._backend)
        self._measured = dict.fromkeys(self.signals.outputs, nan)
        self._monitor = MeasurementMonitor(
            self.signals.outputs, self.signals.limits, self._settings.watchdog
        )
        self._values: list[float | None] = [None] * len(self.signals.outputs)
        self._taken = [0.0] * len(self.signals.outputs)
        self._safe()
        self._read()

    def clock(self) -> float:
        """Return the time of the rig: the sum of all steps, s."""
        return self._clock

    def apply(self, values: Sequence[float], now: float) -> None:
        """Command every input."""
        self._guarded(lambda: self._write(tuple(values)))

    def _write(self, values: tuple[float, ...]) -> None:
        self._applied = values
        self._resting = None
        commands = dict(zip(self.signals.inputs, values, strict=True))
        call("write()", self._backend.write, commands)

    def advance(self, step: float) -> None:
        """Let time pass under the present commands, then read.

        Parameters
        ----------
        step : float
            In s.
        """
        self._guarded(lambda: self._advance(step))

    def _advance(self, step: float) -> None:
        """Step the backend, read it, and note a value beyond its limits."""
        assert isinstance(self._backend, Steppable)
        if step > 0:
            call("advance()", self._backend.advance, step)
            self._clock += step
        self._read()
        reason = self._monitor.check(self._measured, self._clock)
        if reason:
            self._troubles.append(reason)

    def _read(self) -> None:
        """Read the backend; an output without a finite value keeps its last one, and its time."""
        self._measured = measure(self._backend, self.signals)
        for k, value in enumerate(self._measured.values()):
            if isfinite(value):
                self._values[k] = value
                self._taken[k] = self._clock
        self._number += 1

    def go_safe(self) -> None:
        """Go to the safe state."""
        self._guarded(self._safe)

    def safe_since(self) -> float | None:
        """Return the time at which the rig came to its safe state; None while it is not in it."""
        return self._resting

    def denial(self) -> str:
        """Return an empty text: an emulated rig has nothing to report."""
        return ""

    def kill(self) -> None:
        """Do nothing: the rig is in this process."""

    def beat(self) -> None:
        """Do nothing: the rig is in this process."""

    def alarms(self) -> list[Notice]:
        """Return an empty list: an emulated rig has no sensor that could be stuck."""
        return []

    def _safe(self) -> None:
        call("safe()", self._backend.safe)
        self._applied = self.signals.safe_values
        self._resting = self._clock

    def _guarded(self, work: Callable[[], None]) -> None:
        """Call a function that uses the backend; go safe if that raises."""
        if self._failed:
            return
        try:
            work()
        except BackendError as error:
            self._failed = True
            reason = str(error)
            try:
                self._safe()
            except BackendError as second:
                reason = f"{reason}; THE SAFE STATE WAS NOT REACHED: {second}"
            self._troubles.append(reason)

    def release(self) -> None:
        """Serve again, with a backend that failed opened anew."""
        if self._failed:
            try:
                self._open()
            except BackendError as error:
                self._failed = True
                self._troubles.append(str(error))

    def opening(self) -> str:
        """Return an empty text, for there is nothing to wait for."""
        return ""

    def troubles(self) -> list[str]:
        """Return the failures and limit violations since the last call."""
        troubles = self._troubles
        self._troubles = []
        return troubles

    def state(self) -> RigState:
        """Return the newest sample."""
        nothing = (None,) * len(self._applied)
        values = tuple(self._values)
        return RigState(self._number, self._applied, nothing, values, tuple(self._taken), 0)

    def close(self) -> str:
        """Bring the rig to its safe state and close its backend."""
        if self._failed:
            return ""
        try:
            self._safe()
            call("close()", self._backend.close)
        except BackendError as error:
            return str(error)
        return ""
