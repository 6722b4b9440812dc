"""Stimuli of an experiment: one table for each kind of signal."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union, get_args

import numpy as np
from pydantic import BeforeValidator, Field, create_model

from fmus.kit import UserError, registry, units
from fmus.kit.arrays import Array
from orchestration.experiment import waveforms
from orchestration.experiment.values import (
    Amount,
    File,
    Hertz,
    QuantityValue,
    Seconds,
    Span,
    ValueTable,
)
from orchestration.fmu.simulation import held
from orchestration.records import read_record

_ZERO = QuantityValue(0.0)
_ROUNDING = 1e-9  # relative, of times and frequencies that are converted to SI
Seed = Annotated[int, Field(ge=0, strict=True)]


@dataclass(frozen=True)
class DrivenInput:
    """The input that a stimulus drives.

    Attributes
    ----------
    name, unit : str
        Name and unit of the input.
    seed : tuple of int
        Seed of random numbers, unless the stimulus has its own.
    start : float
        Value before the first step, in that unit: of a parameter its own.
    notes : list of str
        Receives remarks on a record, such as repairs.
    """

    name: str
    unit: str
    seed: tuple[int, ...]
    start: float = 0.0
    notes: list[str] = field(default_factory=list)


class StimulusTable(ValueTable):
    """Table of a stimulus: a signal over time."""

    def values(self, time: Array, driven: DrivenInput) -> Array:
        """Return the values of the signal at communication points.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds, from 0.
        driven : DrivenInput

        Returns
        -------
        ndarray, shape (n,)
            In the unit of the input.

        Raises
        ------
        UserError
            If a unit does not fit the input, or the values of keys are not allowed.
        """
        return self._signal(time, driven)

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        raise NotImplementedError

    def _amount_in(self, unit: str, key: str) -> Any:
        """Return the amount of a key, or its list of amounts, in a unit."""
        given = getattr(self, key)
        if isinstance(given, QuantityValue):
            return given.to(unit, f"{key} = {given.value:g} {given.unit}")
        return [q.to(unit, f"{key} = {q.value:g} {q.unit}") for q in given]

    def _amounts_in(self, unit: str, *keys: str) -> Iterator[Any]:
        """Yield the amount of each key in a unit."""
        return (self._amount_in(unit, key) for key in keys)

    def _check_frequency(self, key: str, frequency: float, time: Array) -> None:
        """Raise UserError for a frequency that the communication points alias to a lower one."""
        step = time[1] - time[0]
        if frequency * step > 0.5 * (1.0 + _ROUNDING):
            limit = f"at most {0.5 / step:g} Hz, half the sampling rate at a step of {step:g} s"
            raise UserError(
                f"{key} = {frequency:g} Hz: allowed is {limit}; above, it is sampled as a lower one"
            )

    def _require_steps(self, key: str, seconds: float, steps: int, time: Array) -> None:
        """Raise UserError for a time in s below a number of steps: levels could be missed."""
        least = steps * (time[1] - time[0])
        if seconds < least * (1.0 - _ROUNDING):
            count = "one step" if steps == 1 else f"{steps} steps"
            raise UserError(f"{key} = {seconds:g} s: must be at least {least:g} s, {count}")


class ConstantSignal(StimulusTable):
    """A constant; in a file it can be written as a value without a table."""

    kind: Literal["constant"]
    value: Amount

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        return np.full(time.size, self._amount_in(driven.unit, "value"))


class _Wave(StimulusTable):
    """A periodic signal about an offset."""

    amplitude: Amount
    offset: Amount = _ZERO


class Square(_Wave):
    """Square wave whose periods begin at `delay`, each with its high half."""

    kind: Literal["square"]
    frequency: Hertz
    delay: Seconds = 0.0

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        self._check_frequency("frequency", self.frequency, time)
        amplitude, offset = self._amounts_in(driven.unit, "amplitude", "offset")
        return waveforms.square_wave(time - self.delay, amplitude, self.frequency, offset)


class Sine(_Wave):
    """Sine that rises through its offset at `delay`."""

    kind: Literal["sine"]
    frequency: Hertz
    delay: Seconds = 0.0

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        self._check_frequency("frequency", self.frequency, time)
        amplitude, offset = self._amounts_in(driven.unit, "amplitude", "offset")
        return waveforms.sine(time - self.delay, amplitude, self.frequency, offset)


class Chirp(_Wave):
    """Sine whose frequency changes linearly from the start to the end of the experiment."""

    kind: Literal["chirp"]
    start_frequency: Hertz
    stop_frequency: Hertz

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        self._check_frequency("start_frequency", self.start_frequency, time)
        self._check_frequency("stop_frequency", self.stop_frequency, time)
        amplitude, offset = self._amounts_in(driven.unit, "amplitude", "offset")
        return waveforms.chirp(
            time, amplitude, self.start_frequency, self.stop_frequency, float(time[-1]), offset
        )


class Multisine(StimulusTable):
    """Sum of sines of equal amplitude and random phases; `rms` is of the sum without the offset."""

    kind: Literal["multisine"]
    frequencies: list[Hertz]
    rms: Amount
    offset: Amount = _ZERO
    seed: Seed | None = None

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        for k, frequency in enumerate(self.frequencies):
            self._check_frequency(f"frequencies[{k}]", frequency, time)
        rms, offset = self._amounts_in(driven.unit, "rms", "offset")
        return waveforms.multisine(
            time, self.frequencies, rms, driven.seed if self.seed is None else self.seed, offset
        )


class Multilevel(StimulusTable):
    """Random sequence of levels; each lasts a random time between the two of `dwell`."""

    kind: Literal["multilevel"]
    levels: list[Amount]
    dwell: Annotated[list[Span], Field(min_length=2, max_length=2)]
    seed: Seed | None = None

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        self._require_steps("dwell[0]", self.dwell[0], 1, time)
        seed = driven.seed if self.seed is None else self.seed
        return waveforms.multilevel(
            time, self._amount_in(driven.unit, "levels"), (self.dwell[0], self.dwell[1]), seed
        )


class Steps(StimulusTable):
    """Steps to ``levels[k]`` at ``times[k]``, as ramps if they are limited by a slew rate.

    Before the first it has the value `initial`, by default 0, or the parameter's own.
    """

    kind: Literal["steps"]
    times: list[Seconds]
    levels: list[Amount]
    initial: Amount | None = None
    slew: Amount | None = None

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        levels = self._amount_in(driven.unit, "levels")
        initial = driven.start
        if self.initial is not None:
            initial = self._amount_in(driven.unit, "initial")
        values = waveforms.steps(time, self.times, levels, initial)
        if self.slew is None:
            return values
        return waveforms.slewed(time, values, self._amount_in(f"{driven.unit}/s", "slew"))


class Ramps(StimulusTable):
    """Linear interpolation of levels at `times`, constant before the first and after the last."""

    kind: Literal["ramps"]
    times: list[Seconds]
    levels: list[Amount]

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        return waveforms.ramps(time, self.times, self._amount_in(driven.unit, "levels"))


class Staircase(StimulusTable):
    """Half periods of growing levels, one `increment` higher each, and of the bias in between."""

    kind: Literal["staircase"]
    period: Span
    bias: Amount
    increment: Amount
    maximum: Amount

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        self._require_steps("period", self.period, 2, time)
        forces = self._amounts_in(driven.unit, "bias", "increment", "maximum")
        return waveforms.force_staircase(time, self.period, *forces)


class FromFile(StimulusTable):
    """A column of a record, with a zero-order hold between samples.

    The column is that with the name of the input, unless `column` names another.
    """

    kind: Literal["file"]
    file: File
    column: str | None = None
    unit: str | None = None

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        target = driven.name + (f"[{self.unit}]" if self.unit else "")
        mapping = {self.column or driven.name: target}
        record = read_record(
            self.file, {driven.name: driven.unit}, mapping=mapping, inputs=[driven.name]
        )
        driven.notes.extend(
            repair.message for repair in record.repairs if repair.kind != "ignored columns"
        )
        first = record.time[0]
        last = record.time[-1]
        end = last + np.median(np.diff(record.time))  # the last sample lasts a step, too
        if first > time[0] or end < time[-1]:
            raise UserError(
                f"{self.file} goes from {first:g} s to {last:g} s, the experiment from 0 s to"
                f" {time[-1]:g} s"
            )
        return held(record, driven.name, time)


class _Declared(StimulusTable):
    """A signal from a package of components."""

    declared: ClassVar[registry.StimulusDeclaration]
    kind: str

    def _signal(self, time: Array, driven: DrivenInput) -> Array:
        declared = self.declared
        values = registry.load(declared.signals)(time)[getattr(self, declared.key)]
        return np.asarray(units.convert(values, declared.unit, driven.unit, self.kind))


def declared_kinds() -> Iterator[type[StimulusTable]]:
    """Yield tables of the kinds of stimulus that packages of components declare."""
    known = [get_args(kind.model_fields["kind"].annotation)[0] for kind in _OWN_KINDS]
    for kind, declared in registry.stimuli().items():
        if kind in known:
            text = f"the kind of stimulus {kind!r} of a package is left out: there is one already"
            warnings.warn(text, registry.RegistryWarning, stacklevel=2)
            continue
        keys: Any = {"kind": Literal[kind], declared.key: Literal[declared.choices]}
        made = create_model(kind.title(), __base__=_Declared, __doc__=declared.summary, **keys)
        made.declared = declared
        yield made


def _as_table(given: Any) -> Any:
    """Return the table of a value without one: a constant, or a step ``LEVEL@TIME[@SLEW]``."""
    if isinstance(given, dict | StimulusTable):
        return given
    if isinstance(given, str) and "@" in given:
        level, time, *slew = given.split("@", 2)
        table = {"kind": "steps", "levels": [level], "times": [time]}
        return table | ({"slew": slew[0]} if slew else {})
    return {"kind": "constant", "value": given}


_OWN_KINDS = (
    ConstantSignal,
    Square,
    Sine,
    Chirp,
    Multisine,
    Multilevel,
    Steps,
    Ramps,
    Staircase,
    FromFile,
)
KINDS: tuple[type[StimulusTable], ...] = (
    *_OWN_KINDS,
    *declared_kinds(),
)
if TYPE_CHECKING:
    AnyStimulus = StimulusTable
else:
    AnyStimulus = Annotated[
        Annotated[Union[KINDS], Field(discriminator="kind")],  # noqa: UP007
        BeforeValidator(_as_table),
    ]
