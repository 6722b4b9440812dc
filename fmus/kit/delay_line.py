"""Delay line of a signal: a shift register of its changes, as an effect declares it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from .declare import ONCE, Discrete, Parameter
from .functions import clip, maximum, minimum, where
from .sampling import DELAY_SAMPLES

Law = Callable[[Any, Any], Any]  # of the component instance and the present value


@dataclass(frozen=True)
class DelayLine:
    """A pure delay of up to 64 sample periods.

    The signal is sampled every period into a shift register, and interpolated linearly at the
    present time less the delay; the newest point is the present value. This is exact for a ramp.
    For a smooth signal the error is at most an eighth of the squared period times the second
    derivative, and a jump becomes a ramp over one period. Before the start the signal is as there.

    Parameters
    ----------
    name : str
        Of the signal, after which the variables are named.
    period : float
        Sample period, s.
    about : Mapping
        Unit, nominal value and display unit of differences of the signal.
    is_held : bool
        Whether the signal jumps at samples, as one does that a host sets, and is held after them.
        A jump becomes a ramp about the time at which it arrives, and not one before it.
    """

    name: str
    period: float
    about: Mapping[str, Any]
    is_held: bool = False

    @property
    def delay(self) -> str:
        """Name of the parameter: the delay, s."""
        return f"{self.name}_delay"

    @property
    def _changes(self) -> list[str]:
        return [self._own(f"change_{k}") for k in range(1, DELAY_SAMPLES + 1)]

    def _own(self, part: str) -> str:
        """Return the name of a variable of the line."""
        return f"{self.delay}_{part}"

    def delayed(self, component: Any, value: Any) -> Any:
        """Return the delayed value: the present one less all changes within the time of the delay.

        Parameters
        ----------
        component : Component
            Instance that has the variables.
        value : float, array or symbol
            Present value.
        """
        delay = getattr(component, self.delay)
        if self.is_held:
            delay = delay + 0.5 * minimum(delay, self.period)
        # change since the latest sample: linear in time, over a time that is not zero
        age = maximum(component.time - getattr(component, self._own("instant")), 1e-9 * self.period)
        undone = minimum(delay / age, 1.0) * self._change_since_sample(component, value)
        # changes in the periods before it: linear from sample to sample
        periods = (delay - age) / self.period
        for k, change in enumerate(self._changes):
            undone = undone + clip(periods - k, 0.0, 1.0) * getattr(component, change)
        return value - undone

    def elapsed(self, component: Any) -> Any:
        """Return the time since the start, s; 0 before the first sample."""
        since = maximum(component.time - getattr(component, self._own("begin")), 0.0)
        return where(getattr(component, self._own("started")), since, 0.0)

    def variables(self, doc: str) -> dict[str, Any]:
        """Return the variables by name; the first one is the delay.

        Parameters
        ----------
        doc : str
            Of the delay.
        """
        delay = Parameter(
            0.0,
            "s",
            min=0,
            max=self.period * DELAY_SAMPLES,
            nominal=5.0 * self.period,
            tunable=False,  # a new delay would act on the past
            doc=doc,
        )
        at_sample = partial(Discrete, period=self.period, is_memory=True)
        declared = {
            self._own("sample"): partial(
                at_sample, doc=f"{self.name} at the latest sample", **self.about
            ),
            self._own("instant"): partial(
                at_sample, unit="s", doc=f"time of the latest sample of {self.name}"
            ),
            self._own("started"): partial(
                at_sample, unit="1", type="boolean", doc=f"whether {self._own('sample')} is known"
            ),
            self._own("begin"): partial(
                Discrete, "s", period=ONCE, is_memory=True, doc="time of the start"
            ),
        }
        for change in self._changes:
            doc = f"change of {self.name} between two samples"
            declared[change] = partial(at_sample, doc=doc, **self.about)
        made = {name: declare(update=f"{name}_update") for name, declare in declared.items()}
        return {self.delay: delay, **made}

    def updates(self) -> dict[str, Law]:
        """Return the update laws of the variables by name, from the instance and the value."""
        laws: dict[str, Law] = {
            self._own("sample"): lambda component, value: value,
            self._own("instant"): lambda component, value: component.time,
            self._own("started"): lambda component, value: 1.0,
            self._own("begin"): lambda component, value: component.time,
        }
        # at a sample the register shifts by one place
        shifted = [self._change_since_sample, *map(_held, self._changes[:-1])]
        laws |= dict(zip(self._changes, shifted, strict=True))
        return {f"{name}_update": law for name, law in laws.items()}

    def _change_since_sample(self, component: Any, value: Any) -> Any:
        # none before there is a sample
        started = getattr(component, self._own("started"))
        return value - where(started, getattr(component, self._own("sample")), value)


def _held(name: str) -> Law:
    return lambda component, value: getattr(component, name)
