"""Safety decisions: limits of commands and measured values, and the age of the newest command.

Nothing here reads a clock, a socket or a device; times come in as arguments.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf, isfinite

from orchestration.rig.signals import Limit

# s by which messages of a steady client may come early: it is not refused then
_EARLY = 0.01
_ROUNDING = 1e-9  # of a rate limit: a ramp at the limit must not fail by the last bit of a time


class CommandFilter:
    """Filter that checks commands against their hard limits.

    A set of commands is taken as a whole or not at all: if one value is beyond its limits, none
    changes. The allowed change of a value is a budget that grows with the limit of its rate; a
    small remainder is kept, so that a message that comes a little early is not refused. The budget
    persists over safe states and sessions.

    Parameters
    ----------
    inputs : Mapping of str to str
        Commanded signals and their units.
    limits : Mapping of str to Limit
        Limits by signal; a signal without one has no limits.
    safe_values : sequence of float, optional
        Values at rest, in the order of `inputs`; zero unless given.

    Attributes
    ----------
    applied : tuple of float
        The last values that were taken, in the order of `inputs`; the safe values at rest.
    """

    def __init__(
        self,
        inputs: Mapping[str, str],
        limits: Mapping[str, Limit],
        safe_values: Sequence[float] = (),
    ) -> None:
        self._safe_values = tuple(safe_values) or (0.0,) * len(inputs)
        self._signals = [(name, unit, limits.get(name, Limit())) for name, unit in inputs.items()]
        self._remainders = [_EARLY] * len(self._signals)  # of every budget, s at the limit
        self._taken: float | None = None  # when the last values were
        self.reset()

    def reset(self) -> None:
        """Note that the rig went to its safe state, where nothing is commanded."""
        self.applied = self._safe_values

    def take(self, values: Sequence[float], now: float, longest: float) -> list[str]:
        """Take a set of commands, unless one is refused.

        Parameters
        ----------
        values : sequence of float
            Commands in the order of `inputs`, SI.
        now : float
            Present time in s.
        longest : float
            Longest time in s in which a budget fills: after a pause, a jump is as fast as before.

        Returns
        -------
        list of str
            Sentences about the values that are refused; empty if all were taken.
        """
        elapsed = longest if self._taken is None else min(now - self._taken, longest)
        refused = []
        remainders = []
        for (name, unit, limit), value, before, remainder in zip(
            self._signals, values, self.applied, self._remainders, strict=True
        ):
            fault = "is no finite number"
            if isfinite(value):
                # the change may use the time since the last one, and what remained of its budget
                fault = excess(limit, value, before, elapsed, unit, elapsed + remainder)
                spent = abs(value - before) / limit.rate if limit.rate > 0.0 else 0.0
                remainders.append(min(max(0.0, elapsed + remainder - spent), _EARLY))
            if fault:
                refused.append(f"{name} {value:g} {unit} {fault}; {before:g} {unit} goes on")
        if not refused:
            self.applied = tuple(map(float, values))
            self._remainders = remainders
            self._taken = now
        return refused


class SlewLimiter:
    """Output stage that changes the applied values no faster than the limits of the commands.

    It exists as long as the device, so that a new session does not reset it.

    Parameters
    ----------
    inputs : iterable of str
    limits : Mapping of str to Limit
        Limits by signal.
    now : float
        Time in s at which the rig was at rest.
    safe_values : sequence of float, optional
        Values at rest, in the order of `inputs`; zero unless given.
    """

    def __init__(
        self,
        inputs: Iterable[str],
        limits: Mapping[str, Limit],
        now: float,
        safe_values: Sequence[float] = (),
    ) -> None:
        self._rates = [limits[name].rate if name in limits else inf for name in inputs]
        self._safe_values = tuple(safe_values) or (0.0,) * len(self._rates)
        self.rest(now)

    def rest(self, now: float) -> None:
        """Note that the rig is at rest at a time in s."""
        self._applied = self._safe_values
        self._time = now

    def towards(self, values: Sequence[float], now: float) -> tuple[float, ...]:
        """Return the values to apply.

        Parameters
        ----------
        values : sequence of float
            Commanded, SI.
        now : float
            Present time in s.

        Returns
        -------
        tuple of float
        """
        elapsed = now - self._time
        applied = []
        for value, before, rate in zip(values, self._applied, self._rates, strict=True):
            step = rate * elapsed if rate < inf else inf
            applied.append(min(max(value, before - step), before + step))
        self._applied = tuple(applied)
        self._time = now
        return self._applied


def excess(
    limit: Limit,
    value: float,
    before: float | None,
    elapsed: float,
    unit: str,
    budget: float | None = None,
) -> str:
    """Describe how a value exceeds its limits.

    Parameters
    ----------
    limit : Limit
    value : float
        Finite.
    before : float or None
        The previous value, if there is one.
    elapsed : float
        Time since then in s.
    unit : str
    budget : float, optional
        Time that a change may take at the limit of its rate, s; `elapsed` unless given.

    Returns
    -------
    str
        Such as ``is above 1.3 A``; empty if it is within them.
    """
    if value < limit.min:
        return f"is below {limit.min:g} {unit}"
    if value > limit.max:
        return f"is above {limit.max:g} {unit}"
    longest = elapsed if budget is None else budget
    if (
        before is not None
        and limit.rate < inf
        and abs(value - before) > limit.rate * longest * (1 + _ROUNDING)
    ):
        return (
            f"is a change by {value - before:+.3g} {unit} in {elapsed:.3g} s, faster than"
            f" {limit.rate:g} {unit}/s"
        )
    return ""


def beyond(inputs: Mapping[str, str], limits: Mapping[str, Limit], values: Sequence[float]) -> str:
    """Describe which value of a set of commands must not be written, whatever came before.

    Parameters
    ----------
    inputs : Mapping of str to str
        Commanded signals and their units.
    limits : Mapping of str to Limit
        Limits by signal.
    values : sequence of float
        Commands in the order of `inputs`, SI.

    Returns
    -------
    str
        Such as ``current 4 A is above 1.3 A``; empty if all are within their limits.
    """
    for (name, unit), value in zip(inputs.items(), values, strict=True):
        fault = "is no finite number"
        if isfinite(value):
            fault = excess(limits.get(name, Limit()), value, None, 0.0, unit)
        if fault:
            return f"{name} {value:g} {unit} {fault}"
    return ""


class MeasurementMonitor:
    """Monitor of hard limits of measured values, and of a device that delivers none.

    Parameters
    ----------
    outputs : Mapping of str to str
        Measured signals and their units.
    limits : Mapping of str to Limit
        Limits by signal.
    patience : float
        Longest time in s without a finite value, of an output with limits or of all together.
    """

    def __init__(
        self, outputs: Mapping[str, str], limits: Mapping[str, Limit], patience: float
    ) -> None:
        self._signals = [(name, unit, limits.get(name)) for name, unit in outputs.items()]
        self._patience = patience
        # newest finite value of each output, and its time
        self._last: dict[str, tuple[float, float]] = {}
        self._begun: float | None = None

    def check(self, values: Mapping[str, float], now: float) -> str:
        """Check one reading.

        Parameters
        ----------
        values : Mapping of str to float
            Values by output, SI; NaN for one without a value.
        now : float
            Time of the reading in s; never earlier than the previous one.

        Returns
        -------
        str
            Why the rig has to go to its safe state; empty if it need not.
        """
        if self._begun is None:
            self._begun = now
        # all of them, even after a fault: each signal remembers its newest value
        faults = [
            self._signal_fault(name, unit, limit, values[name], now, self._begun)
            for name, unit, limit in self._signals
        ]
        faults.append(self._silence(now, self._begun))
        return next(filter(None, faults), "")

    def _signal_fault(
        self, name: str, unit: str, limit: Limit | None, value: float, now: float, begun: float
    ) -> str:
        """Store a value, and return its fault in words; empty if it has none."""
        before, since = self._last.get(name, (None, begun))
        if isfinite(value):
            self._last[name] = (value, now)
        if limit is None:
            return ""
        if isfinite(value):
            fault = excess(limit, value, before, now - since, unit)
            return f"measured {name} {value:g} {unit} {fault}" if fault else ""
        if now - since > self._patience:
            return f"no finite {name} for {self._patience:g} s, and it has limits"
        return ""

    def _silence(self, now: float, begun: float) -> str:
        """Describe a device that has delivered nothing finite for too long; empty otherwise."""
        newest = max((time for _, time in self._last.values()), default=begun)
        if self._signals and now - newest > self._patience:
            return f"the device delivers nothing finite for {self._patience:g} s"
        return ""


def expired(accepted: float, now: float, watchdog: float) -> bool:
    """Return True if a command is too old for the rig to go on with it.

    Parameters
    ----------
    accepted, now : float
        Time at which the command was accepted, and the present time, in s of one clock.
    watchdog : float
        Time in s for which a command holds.

    Returns
    -------
    bool
    """
    return not now - accepted < watchdog  # a time that is not a number has expired, too


def stale(seen: float, now: float, watchdog: float) -> str:
    """Describe why a message is too old, by the newest time of the rig that its sender knew.

    Parameters
    ----------
    seen, now : float
        Newest time that the sender knew, and the present time, in s of the rig's clock.
    watchdog : float
        Largest age in s of a fresh message.

    Returns
    -------
    str
        The reason for which its commands are not carried out; empty if they are fresh.
    """
    if seen > now:
        return f"the message has seen {seen - now:.3g} s more of the rig's time than there was"
    if now - seen > watchdog:
        return f"the message was under way for {now - seen:.3g} s; fresh is up to {watchdog:g} s"
    return ""
