"""Measurement errors: effects on the measured value of an output, not on the physics.

Each function here makes an effect for one real output of a component, for use with
:func:`.stack`::

    stack(PpyActuator, sensor_lag(PpyActuator, "voltage"), sensor_gain(PpyActuator, "displacement"))

The ``id`` of the effect is the name of the function, its ``output`` is that output, and its
parameters are named after the output. The effect overrides the output, which no law uses, so that
the physics keeps its bits; at the neutral value the output also does. Several effects of one output
are applied in order, the first to the physics. ``docs/decisions/0007-measurement-effects.md`` has
the reasons.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from .component import Component
from .declare import ONCE, Declaration, Discrete, Parameter, State, of_differences
from .delay_line import DelayLine
from .effects import Effect, Size, effect_maker, make_effect
from .errors import find
from .functions import exp, where
from .sampling import Sampling, sampling_of
from .titles import in_words

Law = Callable[[Any], Any]
Factory = Callable[..., type[Effect]]

_ANY = 1e9  # bound of parameters that may have any value
_ARGUMENTS = """

    Parameters
    ----------
    component : type[Component]
    output : str
        Name of a measured real output.
    sampling : Sampling, optional
        Sampling of the record that the effect is made for.

    Returns
    -------
    type[Effect]

    Raises
    ------
    UserError
        If there is no such output.
    """


@dataclass(frozen=True)
class _Quantity:
    """The output that an effect is made for.

    Attributes
    ----------
    name, unit, nominal, display
        See :class:`.Declaration`.
    before_effect : callable
        Returns the value before the effect, from the component instance.
    sampling : Sampling
        Sampling of the record that the effect is made for.
    """

    name: str
    unit: str
    nominal: float
    display: str | None
    before_effect: Law
    sampling: Sampling

    def about(self, per: str = "", scale: float = 1.0) -> dict[str, Any]:
        """Return unit, nominal value and display unit of a variable of differences of the output.

        Parameters
        ----------
        per : str
            Appended to the units.
        scale : float
            Factor of the nominal value.
        """
        unit = of_differences(self.unit)
        display = of_differences(self.display) + per if self.display else None
        return {"unit": unit + per, "nominal": self.nominal * scale, "display": display}


def _measurement(
    assumption: str, title: str, size: Size
) -> Callable[[Callable[[_Quantity], dict[str, Any]]], Factory]:
    """Return a decorator that makes a factory of effects, one for each output.

    The decorated function returns the class body for one output. Its docstring is that of the
    effects, unless the body has one; the first variable of the body switches them.

    Parameters
    ----------
    assumption : str
        Assumption that the effects relax.
    title : str
        Title of the effects, with a place for the output.
    size : Size
        Size of the effects, without the parameter, which is the variable that switches them.
    """
    return partial(_make_factory, assumption, title, size)


def _make_factory(
    assumption: str,
    title: str,
    size: Size,
    body: Callable[[_Quantity], dict[str, Any]],
) -> Factory:
    """Make a factory of effects; see `_measurement`."""

    @effect_maker
    def make(
        component: type[Component], output: str, sampling: Sampling | None = None
    ) -> type[Effect]:
        # `effect` is assigned below, before the first call
        def before_effect(self: Any) -> Any:
            return getattr(super(effect, self), output)()

        measured = _measured_output(component, output)
        quantity = _Quantity(
            output,
            measured.unit,
            measured.nominal,
            measured.display,
            before_effect,
            sampling or sampling_of(component.experiment),
        )
        members = {"__doc__": body.__doc__, "__module__": __name__, **body(quantity)}
        switch = next(n for n, value in members.items() if isinstance(value, Declaration))
        effect = make_effect(
            f"{body.__name__}_of_{output}".title().replace("_", ""),
            members,
            id=body.__name__,
            title=title.format(in_words(output)),
            output=output,
            neutral=switch,
            assumption=assumption,
            sizes=(replace(size, parameters=(switch,)),),
        )
        return effect

    # without functools.wraps, because the signature is that of the factory
    make.__name__ = make.__qualname__ = body.__name__
    make.__doc__ = f"{body.__doc__}{_ARGUMENTS}"
    return make


def _measured_output(component: type[Component], name: str) -> Declaration:
    """Return a real measured output; UserError if the component has none of that name."""
    declared = {o.name: o for o in component.layout.measured_outputs if o.type == "real"}
    return find(name, declared, f"{component.name or component.__name__}: no measured output")


@_measurement(
    "the sensor follows at once", "A lag of the {} sensor", Size("a time constant of {}", ())
)
def sensor_lag(quantity: _Quantity) -> dict[str, Any]:
    """First-order lag of a sensor, in equilibrium at the start.

    It reads ``u - T dw/dt`` with ``dw/dt = (u - w) / (T + m exp(-T / m))``. This is a first-order
    lag of time ``T`` if ``T`` is several times ``m``, and no lag for ``T = 0``; on a ramp it is
    late by ``T`` in all cases. Without ``m`` a short lag would be infinitely stiff. ``m`` is 10 ms,
    or `Sampling.at_once` of a record. The state is the change of ``w`` since the start, when
    ``w = u``.
    """
    shortest = quantity.sampling.at_once
    lag = f"{quantity.name}_lag_time"
    change = f"{quantity.name}_lag_change"
    reference = f"{quantity.name}_lag_reference"
    started = f"{quantity.name}_lag_started"

    def rate(self: Any) -> Any:
        value = quantity.before_effect(self)
        time = getattr(self, lag)
        # before the first sample, which is taken at the first step, the start is now
        at_start = where(getattr(self, started), getattr(self, reference), value)
        return (value - at_start - getattr(self, change)) / (
            time + shortest * exp(-time / shortest)
        )

    def measured(self: Any) -> Any:
        return quantity.before_effect(self) - getattr(self, lag) * rate(self)

    return {
        lag: Parameter(
            0.0,
            "s",
            min=0,
            max=1e6,
            nominal=quantity.sampling.time_constant,
            tunable=False,  # the state lags by it
            doc=f"time constant of the sensor of {quantity.name}; 0 is without",
        ),
        change: State(
            rate=f"{change}_rate",
            doc=f"change of the lagged {quantity.name} since the start",
            **quantity.about(),
        ),
        reference: Discrete(
            update=f"{reference}_update",
            period=ONCE,
            is_memory=True,
            doc=f"{quantity.name} at the start",
            **quantity.about(),
        ),
        started: Discrete(
            "1",
            update=f"{started}_update",
            period=ONCE,
            type="boolean",
            is_memory=True,
            doc=f"whether {reference} is known",
        ),
        quantity.name: measured,
        f"{change}_rate": rate,
        f"{reference}_update": quantity.before_effect,
        f"{started}_update": lambda self: 1.0,
    }


@_measurement(
    "the measurement arrives at once", "A delay of the measured {}", Size("late by {}", ())
)
def transport_delay(quantity: _Quantity) -> dict[str, Any]:
    """Pure delay of up to 64 sample periods, by a `DelayLine`.

    The period is `Sampling.delay_period` of a record, else 20 ms, or the step of the component's
    experiment where that is above 0.1 s. The output has a corner at each place of the register,
    with an event indicator at which solvers of hosts stop. Before the start the output is a line
    with two states for its deviation and slope; they start at 0, where the output is constant at
    its start value.
    """
    line = DelayLine(quantity.name, quantity.sampling.delay_period, quantity.about())
    history = f"{line.delay}_history"
    slope = f"{history}_slope"

    def measured(self: Any) -> Any:
        # the register has no changes from before the start; there the value is that at the start
        # plus the deviation of a line
        is_before = getattr(self, line.delay) > line.elapsed(self)
        value = line.delayed(self, quantity.before_effect(self))
        return value + where(is_before, getattr(self, history), 0.0)

    def update_law(update: Callable[[Any, Any], Any]) -> Law:
        return lambda self: update(self, quantity.before_effect(self))

    return {
        **line.variables(f"delay of {quantity.name}; 0 is without"),
        history: State(
            rate=f"{history}_rate",
            doc=f"{quantity.name} read of the time before the start, more than at the start",
            **quantity.about(),
        ),
        slope: State(rate=f"{slope}_rate", doc=f"rate of {history}", **quantity.about("/s")),
        quantity.name: measured,
        f"{history}_rate": lambda self: getattr(self, slope),
        f"{slope}_rate": lambda self: 0.0,
        **{name: update_law(update) for name, update in line.updates().items()},
    }


@_measurement(
    "the sensor is calibrated",
    "A scale error of the {} sensor",
    Size("reads {} of it", (), "%", lambda g: 100.0 * g),
)
def sensor_gain(quantity: _Quantity) -> dict[str, Any]:
    """Scale error of a sensor: it reads ``g u``; ``g = 1`` is without."""
    gain = f"{quantity.name}_gain"
    return {
        gain: Parameter(
            1.0,
            "1",
            min=-_ANY,
            max=_ANY,
            doc=f"scale of the measured {quantity.name}; 1 is without error",
        ),
        quantity.name: lambda self: getattr(self, gain) * quantity.before_effect(self),
    }


@_measurement(
    "the sensor has its zero at zero", "An offset of the {} sensor", Size("{} too much", ())
)
def sensor_offset(quantity: _Quantity) -> dict[str, Any]:
    """Bias of a sensor: it reads ``u + b``; ``b = 0`` is the base model."""
    offset = f"{quantity.name}_offset"
    return {
        offset: Parameter(
            0.0,
            min=-_ANY,
            max=_ANY,
            doc=f"bias of the measured {quantity.name}",
            **quantity.about(),
        ),
        quantity.name: lambda self: quantity.before_effect(self) + getattr(self, offset),
    }


@_measurement("the zero of the sensor stays", "A drift of the {} sensor", Size("{}", ()))
def sensor_drift(quantity: _Quantity) -> dict[str, Any]:
    """Bias of a sensor that grows steadily: it reads ``u + d t`` at the time ``t``."""
    drift = f"{quantity.name}_drift"
    since = f"{drift}_time"
    return {
        "__doc__": (
            "Bias of a sensor that grows steadily: it reads ``u + d t``, ``t`` being the time since"
            " the start."
        ),
        drift: Parameter(
            0.0,
            min=-_ANY,
            max=_ANY,
            tunable=False,  # a new rate would act from the start
            doc=f"rate at which the bias of {quantity.name} grows",
            **quantity.about("/s", 1e-3),
        ),
        since: State(
            "s",
            rate=f"{since}_rate",
            nominal=1e3,
            doc=f"time since the start, for the drift of {quantity.name}",
        ),
        quantity.name: lambda self: (
            quantity.before_effect(self) + getattr(self, drift) * getattr(self, since)
        ),
        f"{since}_rate": lambda self: 1.0,
    }


MEASUREMENTS: dict[str, Factory] = {
    make.__name__: make
    for make in (sensor_lag, transport_delay, sensor_gain, sensor_offset, sensor_drift)
}


def measurement_effects(
    component: type[Component], sampling: Sampling | None = None
) -> list[type[Effect]]:
    """Make each of `MEASUREMENTS` for each measured real output of a component.

    Parameters
    ----------
    component : type[Component]
    sampling : Sampling, optional
        Sampling of the record that the effects are made for.

    Returns
    -------
    list of type[Effect]
    """
    outputs = [o.name for o in component.layout.measured_outputs if o.type == "real"]
    return [
        make(component, output, sampling) for output in outputs for make in MEASUREMENTS.values()
    ]
