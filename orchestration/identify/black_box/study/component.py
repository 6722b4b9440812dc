"""Source code of an identified model as a component, from which both builds of an FMU are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit import Component, quoting
from fmus.kit.arrays import Array
from orchestration.identify.black_box.models import IdentifiedModel

_ENDINGS = ("mean", "first", "known", "before", "samples", "past", "at_rest", "change", "delayed")
_SETTLES = 1000  # samples after which states are about as large as they become
_LENGTH = 118  # characters of a line of source code
_TAKEN = ("name", "experiment", "time")  # attributes of the class with a meaning of their own


_CLASS = """\
{quoted}

from fmus.kit import Array, Component, Discrete, Input, Output, Parameter, where


class {cls}(Component):
    {quoted}

    name = "{name}"
    experiment = ({stop!r}, {step!r})
    begins_anywhere = True
    unchecked = {unchecked!r}

{inputs}
    {output}_mean = Parameter({level!r}, {unit!a}, doc="operating point")
{states}

    @Output({unit!a})
    def {output}(self):
        {about!a}
        return self.modelled_{output}()

    def modelled_{output}(self):
        \"""Output of the model, which effects may change.\"""
{value}
{laws}
"""
_INPUT = """\
    {name} = Input({unit!a}, start={level!r}, doc={doc!a})
    {name}_mean = Parameter({level!r}, {unit!a}, fitted={fitted}, doc="operating point")
"""
# the period of what is sampled once, at the start
_FIRST = """\
    {name}_first = Discrete(
        {unit!a}, update="{name}_at_rest", period=1e9, is_memory=True, doc="{name} at the start"
    )
    {name}_known = Discrete(
        "1", update="know_{name}", period=1e9, type="boolean", is_memory=True, doc="from then on"
    )
"""
_DELAY = """\
    {name}_before = Discrete(
        {unit!a}, update="same_{name}_before", period={step!r}, nominal={spread!r},
        doc="{name} before the start, more than at the start",
    )
    {name}_samples = Discrete(
        "1", update="next_{name}_samples", period={step!r}, is_memory=True, doc="samples so far"
    )
    {name}_past = Array(
        Discrete(
            {unit!a}, update="next_{name}_past", period={step!r}, is_memory=True,
            doc="{name} at the samples before, less that at the start",
        ),
        {lag},
    )
"""
_AT_FIRST = """
    def {name}_at_rest(self):
        return where(self.{name}_known, self.{name}_first, self.{name})

    def know_{name}(self):
        return 1.0
"""
_AT_OFFSET = """
    def {name}_at_rest(self):
        return self.{name}_mean
"""
_CHANGE = """
    def {name}_change(self):
        return self.{name} - self.{name}_at_rest()
"""
_DELAYED = """
    def {name}_delayed(self):
        return where(self.{name}_samples < {lag} - 0.5, self.{name}_before, self.{name}_past[{lag}])

    def same_{name}_before(self):
        return self.{name}_before

    def next_{name}_samples(self):
        return self.{name}_samples + 1.0

    def next_{name}_past(self, k):
        return self.{name}_change() if k == 1 else self.{name}_past[k - 1]
"""
_STATE = """\
    {name} = Discrete("1", update="next_{name}", period={step!r}, doc="state of the model")
"""
_NEXT = """
    def next_{name}(self):
        \"""State of the model a sample later.\"""
{value}
"""


def source(
    model: IdentifiedModel, name: str, units: Mapping[str, str], doc: str, spreads: Array
) -> str:
    """Write the source of a component class that simulates the model sample by sample.

    It begins at rest at its first inputs; a model that integrates, at its operating point. Its
    states are deviations from there in arbitrary coordinates. Of what a delayed input was before
    the start there is one state.

    Parameters
    ----------
    model : IdentifiedModel
    name : str
        Name of the component; see `component_name`.
    units : Mapping of str to str
        Units of inputs and output, by name.
    doc : str
        Docstring of the class, one sentence.
    spreads : ndarray, shape (m,)
        By how much the inputs vary, for typical sizes of the states.

    Returns
    -------
    str
        Contents of a file for ``ppy build file.py:Class``.
    """
    *names, output = identifiers((*model.input_names, model.output_name))
    a, b, c, d = _scaled(model.without_delays()[0], spreads)
    gains = [model.static_output(one) for one in np.eye(len(names))]
    rests = bool(np.isfinite(gains).all())
    inputs = _inputs(model, names, units, spreads, rests)
    labels = [f"state_of_model_{i + 1}" for i in range(len(a))]
    factors = [*(f"self.{x}" for x in labels), *(u.arriving for u in inputs)]
    rest = [f"(self.{u}_at_rest() - self.{u}_mean)" for u in names] if rests else []
    amounts = [*gains[: len(rest)], *c[0], *d[0]]
    updates = "".join(
        _NEXT.format(name=x, value=_sum([], factors, row))
        for x, row in zip(labels, np.hstack([a, b]), strict=True)
    )
    return _CLASS.format(
        quoted=ascii(doc),
        cls=class_name(name),
        name=component_name(name),
        stop=100.0 * model.step,
        step=model.step,
        unchecked=(output, f"modelled_{output}", *(f"next_{x}" for x in labels)),
        inputs="".join(u.declarations for u in inputs).rstrip("\n"),
        output=output,
        about=_told("Output of the identified model", output, model.output_name) + ".",
        unit=units[model.output_name],
        level=model.output_offset,
        states="".join(_STATE.format(name=x, step=model.step) for x in labels).rstrip("\n"),
        value=_sum([f"self.{output}_mean"], [*rest, *factors], amounts),
        laws=("".join(u.laws for u in inputs) + updates).rstrip("\n"),
    )


def _inputs(
    model: IdentifiedModel,
    names: Sequence[str],
    units: Mapping[str, str],
    spreads: Array,
    rests: bool,
) -> list[_Input]:
    """Return the inputs of a model under other names."""
    lags = model.without_delays()[1]
    return [
        _Input(name, signal, units[signal], float(level), model.step, lag, float(spread), rests)
        for name, signal, level, lag, spread in zip(
            names, model.input_names, model.input_offsets, lags, spreads, strict=True
        )
    ]


def _scaled(model: IdentifiedModel, spreads: Array) -> tuple[Array, Array, Array, Array]:
    """Return the matrices of a model in coordinates that are as large as one for such inputs."""
    a, b, c, d = model.matrices()
    size = np.zeros(len(a))
    for column in (b * spreads).T:
        x = np.zeros(len(a))
        for _ in range(_SETTLES):
            x = a @ x + column
            size = np.maximum(size, np.abs(x))
    size[size == 0.0] = 1.0
    return a * size / size[:, np.newaxis], b / size[:, np.newaxis], c * size, d


def _told(about: str, name: str, column: str) -> str:
    """Return a description with the column of a record that has another name."""
    return about if name == column else f"{about}, column {column}"


@dataclass(frozen=True)
class _Input:
    """An input in the source of a class.

    Attributes
    ----------
    name, column, unit : str
    level : float
        The operating point.
    step : float
        Sample period in seconds.
    lag : int
        Samples by which it is delayed.
    spread : float
        By how much it varies.
    rests : bool
        Whether the model is at rest at its first value, or at the operating point.
    """

    name: str
    column: str
    unit: str
    level: float
    step: float
    lag: int
    spread: float
    rests: bool

    @property
    def arriving(self) -> str:
        """The expression of its deviation when it arrives."""
        return f"self.{self.name}_delayed()" if self.lag else f"self.{self.name}_change()"

    @property
    def declarations(self) -> str:
        """The source of its declaration, and of those of its past."""
        text = _INPUT + _FIRST * self.rests + _DELAY * (self.lag > 0)
        doc = _told("input", self.name, self.column)
        return text.format(**vars(self), doc=doc, fitted=not self.rests)

    @property
    def laws(self) -> str:
        """The source of its deviation from the rest, and of its delay."""
        text = (_AT_FIRST if self.rests else _AT_OFFSET) + _CHANGE + _DELAYED * (self.lag > 0)
        return text.format(**vars(self))


def identifiers(names: tuple[str, ...]) -> list[str]:
    """Turn names of columns into names that Python allows, all different.

    Names with something behind them, such as ``_mean`` of the operating point, differ, too.
    """
    made: list[str] = []
    for name in names:
        plain = quoting.identifier(name, "signal")
        while (
            _with_endings(plain) & {x for one in made for x in _with_endings(one)}
            or hasattr(Component, plain)
            or plain in _TAKEN
        ):
            plain += "_"
        made.append(plain)
    return made


def _with_endings(name: str) -> set[str]:
    """Return a name, and those that a class makes of it."""
    return {name, *(f"{name}_{ending}" for ending in _ENDINGS)}


def component_name(name: str) -> str:
    """Turn a name into one for Python and FMI: ``2-layer`` into ``model_2_layer``.

    Its class has a name that Python allows, too.
    """
    return quoting.identifier(name, "model")


def class_name(name: str) -> str:
    """Turn a name into that of a class: ``two_layer_wall`` into ``TwoLayerWall``."""
    return "".join(part.capitalize() for part in component_name(name).split("_"))


def _sum(terms: Sequence[str], factors: Sequence[str], amounts: Sequence[float]) -> str:
    """Return the source of a return of terms, and of factors times amounts that are not zero."""
    summands = [*terms]
    for factor, amount in zip(factors, amounts, strict=True):
        if amount != 0.0:
            summands.append(f"{float(amount)!r} * {factor}")
    lines = []
    line = "        return ("
    for i, summand in enumerate(summands or ["0.0"]):
        piece = f" + {summand}" if i else summand
        if len(line) + len(piece) > _LENGTH:
            lines.append(line)
            line = "           "
        line += piece
    return "\n".join([*lines, line + ")"])
