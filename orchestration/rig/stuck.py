"""Monitor of sensors that repeat the same number, and of writes that the device ignores.

Equal numbers alone are no fault: a value that does not depend on the commands stays constant, and a
converter repeats its steps. A sensor is therefore compared with its own earlier behaviour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, nan

from orchestration.rig.signals import Limit

# of the range of a command: smallest change that counts, and largest rounding by a device
_CHANGE = 0.01
SWITCH = "1"  # unit of a signal that is on or off
# of the samples in which no input changed: share with another value, above which a sensor is noisy
_NOISY = 0.5


class StuckMonitor:
    """Monitor of a rig for measured values and device inputs that no longer change.

    A switch, whose unit is 1, may stay as it is.

    Parameters
    ----------
    signals : pair of Mapping of str to str
        Commanded and measured signals, and their units.
    limits : Mapping of str to Limit
        Limits by signal.
    samples : int
        Number of samples in a row after which there is an alarm; 0 is never.
    """

    def __init__(
        self,
        signals: tuple[Mapping[str, str], Mapping[str, str]],
        limits: Mapping[str, Limit],
        samples: int,
    ) -> None:
        self._inputs, self._outputs = signals
        self._least_changes = [least_change(limits.get(name)) for name in self._inputs]
        self._samples = samples
        self._sensors = {name: _Sensor(self._least_changes, samples) for name in self._outputs}
        self._ignored = dict.fromkeys(self._inputs, 0)

    def check(
        self,
        applied: Sequence[float],
        read_back: Sequence[float],
        measured: Mapping[str, float],
    ) -> list[tuple[str, str]]:
        """Check one sample.

        Parameters
        ----------
        applied, read_back : sequence of float
            Commanded value of each input, and the one that the device reports; NaN where it
            reports none.
        measured : Mapping of str to float
            Values by output; NaN for one without a value.

        Returns
        -------
        list of tuple of str and str
            Signal and sentence of each alarm that begins with this sample.
        """
        if not self._samples:
            return []
        alarms = []
        for name, value in measured.items():
            sensor = self._sensors[name]
            sensor.add(value, tuple(applied))
            missed = sensor.missed()
            if missed and self._outputs[name] != SWITCH:
                inputs = " and ".join(list(self._inputs)[k] for k in sorted(missed))
                shown = f"{value:.6g} {self._outputs[name]}"
                sentence = (
                    f"{name} has been {shown} for {sensor.same} samples, while {inputs} changed: is"
                    " its sensor stuck?"
                )
                alarms.append((name, sentence))
        return alarms + self._ignored_writes(applied, read_back)

    def _ignored_writes(
        self, applied: Sequence[float], read_back: Sequence[float]
    ) -> list[tuple[str, str]]:
        """Return an alarm for each input that the device ignored for `samples` samples."""
        alarms = []
        for name, wanted, reported, least in zip(
            self._inputs, applied, read_back, self._least_changes, strict=True
        ):
            is_ignored = abs(reported - wanted) > least  # False where the device reports none
            self._ignored[name] = self._ignored[name] + 1 if is_ignored else 0
            if self._ignored[name] == self._samples:
                unit = self._inputs[name]
                sentence = (
                    f"{name} was written as {wanted:.6g} {unit} in {self._samples} samples, and the"
                    f" device has {reported:.6g} {unit}"
                )
                alarms.append((name, sentence))
        return alarms


class _Sensor:
    """Record of a sensor's values, and of the inputs that it has followed.

    Parameters
    ----------
    least_changes : sequence of float
        Smallest change of each input that counts.
    samples : int
        Length of the window in which changes of the sensor and of inputs belong together.

    Attributes
    ----------
    same : int
        Samples in a row with the present value.
    """

    def __init__(self, least_changes: Sequence[float], samples: int) -> None:
        self._least_changes = least_changes
        self._samples = samples
        self.same = 0
        self._value = nan
        self._has_changed = False
        self._unmoved = 0  # samples since all inputs changed, of a sensor that has never changed
        self._applied: tuple[float, ...] = ()
        self._meanwhile = _Span()  # of the inputs, while the value stayed the same
        self._window = _Span()  # of the inputs, in the samples of a window
        self._changes = 0  # of the value, in the window
        self._still = 0  # samples in which no input changed
        self._noisy = 0  # of these, samples with another value than the one before
        # sets of inputs that changed in a window in which the value changed too
        self._followed: set[frozenset[int]] = set()

    def add(self, value: float, applied: tuple[float, ...]) -> None:
        """Add a sample."""
        is_new = value != self._value
        if applied == self._applied:
            self._still += 1
            self._noisy += is_new
        if is_new:
            self._meanwhile = _Span()
            self.same = 0
        self.same += 1
        self._meanwhile.add(applied)
        self._window.add(applied)
        self._changes += is_new and isfinite(self._value)
        self._has_changed |= is_new and isfinite(self._value)
        if not self._has_changed:
            have_all_moved = len(self._meanwhile.moved(self._least_changes)) == len(applied) > 0
            self._unmoved = (self._unmoved + 1) * have_all_moved
        if self._window.count > self._samples:
            moved = self._window.moved(self._least_changes)
            if moved and self._changes:
                self._followed.add(moved)
            self._window = _Span()
            self._window.add(applied)  # so that a change from this sample to the next counts
            self._changes = 0
        self._value = value
        self._applied = applied

    def missed(self) -> frozenset[int]:
        """Return the inputs that the sensor should have followed while its value stayed the same.

        These are all inputs that changed, if the sensor is noisy and thus never constant for long,
        or if it has followed some of them before; else none. It is asked for once, when the value
        has stayed the same for long enough; and for a sensor that has never had another value, when
        all inputs have changed for as long.
        """
        if self.same != self._samples and self._unmoved != self._samples:
            return frozenset()
        moved = self._meanwhile.moved(self._least_changes)
        if self._unmoved == self._samples:
            return moved
        is_noisy = self._still >= self._samples and self._noisy > _NOISY * self._still
        if is_noisy or any(one <= moved for one in self._followed):
            return moved
        return frozenset()


class _Span:
    """Smallest and largest value of the inputs over some samples."""

    def __init__(self) -> None:
        self.count = 0
        self._least: tuple[float, ...] = ()
        self._most: tuple[float, ...] = ()

    def add(self, applied: tuple[float, ...]) -> None:
        self._least = tuple(map(min, self._least, applied)) if self.count else applied
        self._most = tuple(map(max, self._most, applied)) if self.count else applied
        self.count += 1

    def moved(self, least_changes: Sequence[float]) -> frozenset[int]:
        """Return the indices of the inputs that changed by more than their least change."""
        spans = zip(self._least, self._most, least_changes, strict=True)
        return frozenset(k for k, (low, high, least) in enumerate(spans) if high - low > least)


def least_change(limit: Limit | None) -> float:
    """Return the smallest difference of a signal that counts; 0 if its range is not limited.

    Parameters
    ----------
    limit : Limit or None
    """
    if limit is None or not isfinite(limit.max - limit.min):
        return 0.0
    return _CHANGE * (limit.max - limit.min)
