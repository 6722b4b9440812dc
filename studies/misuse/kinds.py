"""Kinds of misuse: each spoils the columns of a record in one way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from fmus.kit.arrays import Array

TIME = "time"
_DEGREES = 57.29578  # in a radian
_RPM = 9.549297  # in rad/s
_ZERO_CELSIUS = 273.15


@dataclass(frozen=True)
class Columns:
    """The columns of a record, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, outputs : dict of str to ndarray, shape (n,)
    """

    time: Array
    inputs: dict[str, Array]
    outputs: dict[str, Array]

    @property
    def everything(self) -> dict[str, Array]:
        """All columns by name, time first."""
        return {TIME: self.time, **self.inputs, **self.outputs}

    def changed(self, columns: Mapping[str, Array]) -> Columns:
        """Return the same with other values in some columns."""
        return Columns(
            columns.get(TIME, self.time),
            {name: columns.get(name, values) for name, values in self.inputs.items()},
            {name: columns.get(name, values) for name, values in self.outputs.items()},
        )

    def rows(self, chosen: Array) -> Columns:
        """Return rows by index, at the times of as many first ones."""
        kept = {name: values[chosen] for name, values in self.everything.items()}
        return self.changed(kept | {TIME: self.time[: len(chosen)]})


@dataclass(frozen=True)
class Kind:
    """A kind of misuse.

    Attributes
    ----------
    spoil : callable
        Makes spoilt columns of right ones and of others: the same signals of another specimen, in a
        run with another stimulus.
    plants : tuple of str
        Of which records are drawn.
    """

    spoil: Callable[[Columns, Columns], Columns]
    plants: tuple[str, ...] = ("Motor", "Pendulum", "ThermalNodes", "Cell", "Actuator")


def _first(columns: Mapping[str, Array]) -> str:
    return next(iter(columns))


def _last(columns: Mapping[str, Array]) -> str:
    return list(columns)[-1]


def _scaled(name: Callable[[Columns], str], factor: float, offset: float = 0.0) -> Kind:
    """Return a column in another unit than it says."""

    def spoil(right: Columns, _: Columns) -> Columns:
        chosen = name(right)
        return right.changed({chosen: factor * right.everything[chosen] + offset})

    return Kind(spoil)


def _exchanged(one: Callable[[Columns], str], other: Callable[[Columns], str]) -> Kind:
    """Return two columns in each other's place."""

    def spoil(right: Columns, _: Columns) -> Columns:
        a, b = one(right), other(right)
        return right.changed({a: right.everything[b], b: right.everything[a]})

    return Kind(spoil)


def _of_outputs(function: Callable[[Array, float], Array]) -> Kind:
    """Return all outputs changed by a function of their values and the step, s."""

    def spoil(right: Columns, _: Columns) -> Columns:
        step = float(np.median(np.diff(right.time)))
        return right.changed({n: function(y, step) for n, y in right.outputs.items()})

    return Kind(spoil)


def _only(kind: Kind, *plants: str) -> Kind:
    return Kind(kind.spoil, plants)


def _first_input(columns: Columns) -> str:
    return _first(columns.inputs)


def _last_input(columns: Columns) -> str:
    return _last(columns.inputs)


def _first_output(columns: Columns) -> str:
    return _first(columns.outputs)


def _last_output(columns: Columns) -> str:
    return _last(columns.outputs)


def _time(_: Columns) -> str:
    return TIME


def _clipped(values: Array) -> Array:
    low, high = np.quantile(values, [0.02, 0.98])
    return np.minimum(values, low + 0.6 * (high - low))


def _late(right: Columns, _: Columns) -> Columns:
    """Lay outputs beside inputs that were logged a tenth of the record earlier."""
    shift = len(right.time) // 10
    kept = right.rows(np.arange(len(right.time) - shift))
    return kept.changed({n: y[shift:] for n, y in right.outputs.items()})


def _other_clock(right: Columns, _: Columns) -> Columns:
    """Take outputs by a logger that counts a thirtieth too fast."""
    read = right.time[0] + (right.time - right.time[0]) / 1.03
    return right.changed({n: np.interp(read, right.time, y) for n, y in right.outputs.items()})


def _cut(right: Columns, _: Columns) -> Columns:
    """Cut a quarter out of the middle, and close up the time."""
    rows = np.arange(len(right.time))
    inside = (rows > 0.3 * len(rows)) & (rows < 0.55 * len(rows))
    return right.rows(rows[~inside])


def _shuffled(right: Columns, _: Columns) -> Columns:
    """Pieces of ten were joined in the wrong order."""
    pieces = np.array_split(np.arange(len(right.time)), 10)
    order = np.random.default_rng(len(right.time)).permutation(10)
    return right.rows(np.concatenate([pieces[k] for k in order]))


def _too_short(right: Columns, _: Columns) -> Columns:
    return right.rows(np.arange(max(len(right.time) // 60, 40)))


def _upsampled(right: Columns, _: Columns) -> Columns:
    fine = np.linspace(right.time[0], right.time[-1], 10 * (len(right.time) - 1) + 1)
    return right.changed(
        {n: np.interp(fine, right.time, values) for n, values in right.everything.items()}
    )


def _too_coarse(right: Columns, _: Columns) -> Columns:
    return right.changed({n: values[::50] for n, values in right.everything.items()})


def _zero_phase(values: Array, step: float) -> Array:
    return np.asarray(sosfiltfilt(butter(4, 0.02, output="sos"), values))


def _joined(right: Columns, other: Columns) -> Columns:
    """Join the first half to the second of another specimen."""
    half = len(right.time) // 2
    return right.changed(
        {
            n: np.concatenate([values[:half], other.everything[n][half:]])
            for n, values in right.everything.items()
            if n != TIME
        }
    )


def _of_other(names: Callable[[Columns], Mapping[str, Array]]) -> Kind:
    """Return columns of another run beside those of this one."""

    def spoil(right: Columns, other: Columns) -> Columns:
        return right.changed(dict(names(other)))

    return Kind(spoil)


def _copied(right: Columns, _: Columns) -> Columns:
    return right.changed({_first_output(right): right.everything[_first_input(right)]})


def _unrelated(right: Columns, _: Columns) -> Columns:
    """Put something else in the place of the outputs: a random walk each."""
    rng = np.random.default_rng(len(right.time))
    walks = {}
    for name, values in right.outputs.items():
        walk = np.cumsum(rng.standard_normal(len(values)))
        walks[name] = np.mean(values) + np.std(values) * (walk - np.mean(walk)) / np.std(walk)
    return right.changed(walks)


KINDS: dict[str, Kind] = {
    # units
    "output in thousandths": _scaled(_first_output, 1e3),
    "output in thousands": _scaled(_last_output, 1e-3),
    "input in thousandths": _scaled(_first_input, 1e3),
    "input in thousands": _scaled(_first_input, 1e-3),
    "speed in rpm": _only(_scaled(_last_output, _RPM), "Motor"),
    "angle in degrees": _only(_scaled(_last_output, _DEGREES), "Pendulum"),
    "temperature in degC": _only(_scaled(_first_output, 1.0, -_ZERO_CELSIUS), "ThermalNodes"),
    "ambient in degC": _only(_scaled(_last_input, 1.0, -_ZERO_CELSIUS), "ThermalNodes"),
    # columns
    "input and output exchanged": _exchanged(_first_input, _last_output),
    "outputs exchanged": _only(
        _exchanged(_first_output, _last_output), "Motor", "ThermalNodes", "Actuator"
    ),
    "inputs exchanged": _only(_exchanged(_first_input, _last_input), "Motor", "ThermalNodes"),
    "output is a copy of the input": Kind(_copied),
    "inputs of another run": _of_other(lambda other: other.inputs),
    "outputs of something else": Kind(_unrelated),
    # signs
    "input of the other sign": _scaled(_first_input, -1.0),
    "output of the other sign": _scaled(_first_output, -1.0),
    "last output of the other sign": _scaled(_last_output, -1.0),
    "output without sign": _of_outputs(lambda y, step: np.abs(y - np.mean(y))),
    # clocks
    "clock in ms": _scaled(_time, 1e3),
    "clock in minutes": _scaled(_time, 1.0 / 60.0),
    "outputs logged late": Kind(_late),
    "outputs by another clock": Kind(_other_clock),
    "pieces in the wrong order": Kind(_shuffled),
    # processing
    "too short": Kind(_too_short),
    "cut and closed up": Kind(_cut),
    "resampled ten times finer": Kind(_upsampled),
    "sampled too coarsely": Kind(_too_coarse),
    "filtered both ways": _of_outputs(_zero_phase),
    "differentiated": _of_outputs(lambda y, step: np.gradient(y, step)),
    "integrated": _of_outputs(lambda y, step: step * np.cumsum(y - y[0])),
    "saturated": _of_outputs(lambda y, step: _clipped(y)),
    "of six levels": _of_outputs(lambda y, step: np.round(y / (np.ptp(y) / 5)) * np.ptp(y) / 5),
    "two specimens in one": Kind(_joined),
}
