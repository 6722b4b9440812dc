"""Safe state of an open backend: it is commanded, and confirmed by what the device reports.

Device and guards have one each, of the backend that they opened themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic

from orchestration.rig.backends import Backend
from orchestration.rig.server.calls import BackendSignals, call, read_back
from orchestration.rig.stuck import least_change

# s between two looks at what the device reports, and between two commands where it reports nothing
# or something else: 0.2 s were asked for, and a process may be late
_AGAIN = 0.1
_SETTLING = 0.25  # s that a device may take to follow, of the 0.5 s within which there is an alarm


class SafeState:
    """The safe state of an open backend.

    What the device reports is compared with the safe values. Inputs that it does not report are
    commanded again and again, since nobody can tell whether they kept their values.

    Parameters
    ----------
    backend : Backend
    signals : BackendSignals
        Signals as they were when the server started.
    show : callable
        Called with the name of each call of the backend, before it.

    Attributes
    ----------
    since : float
        Time from which the rig is in its safe state, as far as the device reports it, s; 0 while
        it is not.
    is_denied : bool
        True if the device has reported other values for longer than it may take to follow.
    """

    def __init__(
        self, backend: Backend, signals: BackendSignals, show: Callable[[str], None]
    ) -> None:
        self._backend = backend
        self._signals = signals
        self._show = show
        self._tolerances = [least_change(signals.limits.get(name)) for name in signals.inputs]
        self._commanded = 0.0  # when it was last commanded, s
        self._looked = 0.0  # when the device was last asked, s
        self._differs_since = 0.0  # s; 0 while the device reports the safe values
        self.since = 0.0
        self.is_denied = False

    def leave(self) -> None:
        """Note that the rig is commanded to other values from now on."""
        self.since = 0.0
        self._differs_since = 0.0
        self.is_denied = False

    def command(self) -> str:
        """Command the safe values, and look at once whether the device has them.

        Returns
        -------
        str
            See :meth:`judge`.

        Raises
        ------
        BackendError
        """
        self.since = 0.0
        self._command()
        return self._look()

    def keep(self) -> str:
        """Look at the device again, if it was safe a while ago at the last look; see `judge`."""
        is_due = not self.since or monotonic() - self._looked >= _AGAIN
        return self._look() if is_due else ""

    def _command(self) -> None:
        self._show("safe()")
        call("safe()", self._backend.safe)
        self._commanded = monotonic()

    def _look(self) -> str:
        self._show("read_back()")
        return self.judge(read_back(self._backend, self._signals))

    def judge(self, reported: Sequence[float]) -> str:
        """Compare what the device reports with the safe values; command them again if need be.

        Parameters
        ----------
        reported : sequence of float
            Value of each input; NaN where the device reports none.

        Returns
        -------
        str
            Sentence for the operator if the rig has just been found to have left its safe state, or
            not to have reached it; else empty.

        Raises
        ------
        BackendError
        """
        now = self._looked = monotonic()
        different = self._differences(reported)
        if (different or self._signals.unreported) and now - self._commanded >= _AGAIN:
            self._command()
        if not different:
            self._differs_since = 0.0
            self.is_denied = False
            self.since = self.since or now
            return ""
        has_left = self.since > 0.0
        was_denied = self.is_denied
        self.since = 0.0
        self._differs_since = self._differs_since or now
        self.is_denied = now - self._differs_since > _SETTLING
        if has_left or self.is_denied > was_denied:
            return f"in the safe state the device has {different}; it is commanded again"
        return ""

    def _differences(self, reported: Sequence[float]) -> str:
        """Return the inputs that are not at their safe values, and what they are; else empty."""
        signals = self._signals
        rows = zip(
            signals.inputs.items(), signals.safe_values, reported, self._tolerances, strict=True
        )
        return ", ".join(
            f"{name} = {value:.6g} {unit}"
            for (name, unit), safe, value, tolerance in rows
            if abs(value - safe) > tolerance  # False where the device reports none
        )
