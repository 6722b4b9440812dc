"""Source code of an identified model as a component, from which both builds of an FMU are made."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fmus.kit import Component, quoting
from fmus.kit.arrays import Array
from orchestration.identify.black_box.models import IdentifiedModel

_LENGTH = 118  # characters of a line of source code
_TAKEN = ("name", "experiment", "time")  # attributes of the class with a meaning of their own


def source(model: IdentifiedModel, name: str, units: Mapping[str, str], doc: str) -> str:
    """Write the source of a component class that simulates the model sample by sample.

    Its states are those of a state-space form in arbitrary coordinates. The operating point is a
    parameter.

    Parameters
    ----------
    model : IdentifiedModel
    name : str
        Name of the component; see `component_name`.
    units : Mapping of str to str
        Units of inputs and output, by name.
    doc : str
        Docstring of the class, one sentence.

    Returns
    -------
    str
        Contents of a file for ``ppy build file.py:Class``.
    """
    a, b, c, d = model.matrices()
    state_amounts = np.hstack([a, b])
    states = [f"state_of_model_{i + 1}" for i in range(len(state_amounts))]
    signals = (*model.input_names, model.output_name)
    *inputs, output = identifiers(signals)
    unit = {new: units[old] for new, old in zip((*inputs, output), signals, strict=True)}
    shown = model.output_name
    about = "Output of the identified model" + (f", column {shown}." if shown != output else ".")
    factors = [f"self.{x}" for x in states] + [f"(self.{u} - self.{u}_mean)" for u in inputs]
    lines = [
        ascii(doc),
        "",
        "from fmus.kit import Component, Discrete, Input, Output, Parameter",
        "",
        "",
        f"class {class_name(name)}(Component):",
        f"    {doc!a}",
        "",
        f'    name = "{component_name(name)}"',
        f"    experiment = ({100.0 * model.step!r}, {model.step!r})",
        f"    unchecked = {(output, *(f'next_{x}' for x in states))!r}",
        "",
        *_declarations(model, inputs, output, states, unit),
        "",
        f"    @Output({unit[output]!a})",
        f"    def {output}(self):",
        f"        {about!a}",
        *_return_statement([f"self.{output}_mean"], factors, np.hstack([c, d])[0]),
    ]
    for x, amounts in zip(states, state_amounts, strict=True):
        lines += [
            "",
            f"    def next_{x}(self):",
            '        """State of the model a sample later."""',
            *_return_statement([], factors, amounts),
        ]
    return "\n".join(lines) + "\n"


def _declarations(
    model: IdentifiedModel,
    inputs: list[str],
    output: str,
    states: list[str],
    unit: Mapping[str, str],
) -> list[str]:
    """Return the lines that declare inputs, the operating point and states."""
    lines = []
    levels = model.input_offsets.tolist()
    for u, column, level in zip(inputs, model.input_names, levels, strict=True):
        doc = "input" if u == column else f"input, column {column}"
        lines.append(f"    {u} = Input({unit[u]!a}, start={level!r}, doc={doc!a})")
        lines.append(f'    {u}_mean = Parameter({level!r}, {unit[u]!a}, doc="operating point")')
    lines.append(
        f"    {output}_mean = Parameter({model.output_offset!r}, {unit[output]!a},"
        ' doc="operating point")'
    )
    for x in states:
        lines.append(
            f'    {x} = Discrete("1", update="next_{x}", period={model.step!r}, doc="state of the'
            ' model")'
        )
    return lines


def identifiers(names: tuple[str, ...]) -> list[str]:
    """Turn names of columns into names that Python allows, all different.

    Those of the operating points, with ``_mean`` behind them, differ, too.
    """
    made: list[str] = []
    for name in names:
        plain = quoting.identifier(name, "signal")
        while (
            {plain, f"{plain}_mean"} & {*made, *(f"{one}_mean" for one in made)}
            or hasattr(Component, plain)
            or plain in _TAKEN
        ):
            plain += "_"
        made.append(plain)
    return made


def component_name(name: str) -> str:
    """Turn a name into one for Python and FMI: ``2-layer`` into ``model_2_layer``.

    Its class has a name that Python allows, too.
    """
    return quoting.identifier(name, "model")


def class_name(name: str) -> str:
    """Turn a name into that of a class: ``two_layer_wall`` into ``TwoLayerWall``."""
    return "".join(part.capitalize() for part in component_name(name).split("_"))


def _return_statement(terms: list[str], factors: list[str], amounts: Array) -> list[str]:
    """Return the source lines of a sum of terms, and of factors times amounts that are not zero."""
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
    return [*lines, line + ")"]
