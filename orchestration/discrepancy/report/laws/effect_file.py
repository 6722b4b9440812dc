"""Python source of corrections: short classes to read, to change and to lay over a model."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fmus.kit import Component, files
from fmus.kit.declare import Declaration
from fmus.kit.layout import law_of
from orchestration.discrepancy.extended_model import fitted_defaults
from orchestration.discrepancy.laws import Correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.law_report import (
    LawReport,
    knots_and_values,
    law_and_signal,
)

# as the kit computes them: x is the signal, w its width, s its typical size
FORMULAS = {
    "linear": "x",
    "asymmetric": "absolute(x)",
    "quadratic": "x * x",
    "odd_quadratic": "x * absolute(x)",
    "cubic": "x * (x * x)",
    "quartic": "(x * x) * (x * x)",
    "saturating": "tanh(x / {w})",
    "sign": "tanh(x / {w})",
    "sign_beyond": "0.5 * (tanh(10.0 * (x / {w} - 1.0)) + tanh(10.0 * (x / {w} + 1.0)))",
    "levelling": "x - {w} * tanh(x / {w})",
    "exponential": "exp(minimum(x / {w}, 30.0)) - 1.0",
    "square_root": "x / sqrt(absolute(x) / {s} + 1e-6)",
    "stribeck": "tanh(10.0 * x / {w}) * exp(-minimum((x / {w}) * (x / {w}), 30.0))",
    "stops": "x - clip(x, -{w}, {w})",
    "weir": "maximum(x - {w}, 0.0) * sqrt(maximum(x - {w}, 0.0) / {s} + 1e-6)",
    "upper_stop": "maximum(x - {w}, 0.0)",
    "lower_stop": "minimum(x + {w}, 0.0)",
}
_FUNCTIONS = ("absolute", "clip", "exp", "maximum", "minimum", "smooth_table", "sqrt", "tanh")
_UNBOUNDED = 1e9  # nominal values, beyond which a bound is none
_NUMBERS_IN_LINE = 6  # of a table


def write_effect(law_report: LawReport, path: Path) -> None:
    """Write the file.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    files.write(path, source(law_report).encode())


def source(law_report: LawReport) -> str:
    """Return the text of the file: the best correction, and those beside it."""
    corrections = [each.best for each in law_report.rounds if each.best is not None]
    values = _fitted_values(law_report)
    titles = [_class_name(correction) for correction in corrections]
    bodies = [
        list(_ClassBody(law_report.component, correction, values, number).lines())
        for number, correction in enumerate(corrections, start=1)
    ]
    lines = [
        *_module_docstring(law_report, corrections, titles),
        "",
        *_imports(corrections, bodies),
        "",
        *_fitted_defaults(law_report),
    ]
    for number, correction in enumerate(corrections, start=1):
        effect = correction.model.effect
        lines += [
            *_table_lines(correction, number),
            "",
            "",
            f"class {titles[number - 1]}(Effect):",
            f'    """{_class_docstring(correction)}"""',
            "",
            f'    id = "{_effect_id(correction)}"',
            f'    neutral = "{effect.neutral}"',
            f"    assumption = {_quote(str(effect.assumption))}",
            "",
            *bodies[number - 1],
        ]
    return "\n".join(lines) + "\n"


def _fitted_values(law_report: LawReport) -> dict[str, float]:
    """Return the values of all parameters, those of the last fit where it has them."""
    values: dict[str, float] = {}
    for each in law_report.rounds:
        if each.best is not None:
            values |= each.best.model.parameters
    final = law_report.final_model
    values |= final.parameters | fitted_defaults(final)
    for each in law_report.rounds:
        values |= each.correction_values(final)
    return values


def _module_docstring(
    law_report: LawReport, corrections: Sequence[Correction], titles: Sequence[str]
) -> list[str]:
    base = law_report.component
    subjects = " and ".join(f"{each.entry.law} over {_signal_words(each)}" for each in corrections)
    stacked = ", ".join([base.__name__, *titles])
    return [
        f'"""{subjects.capitalize()}: what {base.name} lacks on a record.',
        "",
        f"    from fmus.kit import stack\n\n    better = stack({stacked}, defaults=FITTED)",
        '"""',
    ]


def _imports(corrections: Sequence[Correction], bodies: Sequence[Sequence[str]]) -> list[str]:
    """Return import statements of what the classes need of the kit."""
    code = "\n".join(line for body in bodies for line in body)
    names = ["Effect", "Parameter"]
    if any(correction.model.effect.layout.states for correction in corrections):
        names.append("State")
    names += [name for name in _FUNCTIONS if re.search(rf"\b{name}\(", code)]
    lines = [f"from fmus.kit import {', '.join(sorted(names, key=str.lower))}"]
    if "SHAPES[" in code:
        lines.append("from fmus.kit.curves import SHAPES")
    return lines


def _fitted_defaults(law_report: LawReport) -> list[str]:
    """Return lines of a dictionary of the model's own parameters as they were fitted."""
    names = {parameter.name for parameter in law_report.component.layout.parameters}
    fitted = fitted_defaults(law_report.final_model)
    return [
        f"# fitted to {law_report.result.files!a}: the model's own parameters beside the"
        " correction, SI",
        "FITTED = {",
        *(f'    "{name}": {_number(value)},' for name, value in fitted.items() if name in names),
        "}",
    ]


def _class_docstring(correction: Correction) -> str:
    factor = " as a factor" if correction.entry.kind == "multiply" else ""
    shape = wording.shape_name(correction.shape) if correction.shape else "a table"
    return f"{correction.entry.law} hangs on {_signal_words(correction)}{factor}: {shape}."


def _signal_words(correction: Correction) -> str:
    """Return the signal in words, without a time constant, which is a parameter."""
    return law_and_signal(correction.model.effect)[1].words


def _effect_id(correction: Correction) -> str:
    """Return law and signal, what is remembered of it, and a number where there are several."""
    return f"{correction.entry.law}_over_{correction.model.effect.term.qualifier}"


def _class_name(correction: Correction) -> str:
    return "".join(word.title() for word in _effect_id(correction).split("_"))


def _table_lines(correction: Correction, number: int) -> Iterator[str]:
    """Yield lines of the constants of a table; none where the correction is a shape."""
    if correction.shape:
        return
    columns = knots_and_values(correction.model.effect)
    for name, numbers in zip(_table_names(number), columns, strict=True):
        yield f"{name} = ("
        for k in range(0, len(numbers), _NUMBERS_IN_LINE):
            yield f"    {', '.join(map(_number, numbers[k : k + _NUMBERS_IN_LINE]))},"
        yield ")"


def _table_names(number: int) -> tuple[str, str]:
    """Return the names of the knots and the values of a correction."""
    suffix = f"_{number}" if number > 1 else ""
    return f"KNOTS{suffix}", f"VALUES{suffix}"


class _ClassBody:
    """Lines of the class of a correction: its parameters, what it remembers, and the law.

    Parameters
    ----------
    cls : type[Component]
        That it is laid over.
    correction : Correction
    values : Mapping of str to float
        Of its parameters, SI.
    number : int
        Of the correction, from 1.
    """

    def __init__(
        self,
        cls: type[Component],
        correction: Correction,
        values: Mapping[str, float],
        number: int,
    ):
        self._correction = correction
        self._effect = correction.model.effect
        self._values = values
        self._number = number
        self._law, self._signal = law_and_signal(self._effect)
        law: Any = law_of(cls, self._law)
        has_arguments = len(inspect.signature(law).parameters) > 1
        self._arguments = "*arguments" if has_arguments else ""
        is_law = law_of(cls, self._signal.name) is not None
        self._signal_value = f"self.{self._signal.name}{'()' if is_law else ''}"

    def lines(self) -> Iterator[str]:
        """Yield them from above."""
        layout = self._effect.layout
        for parameter in layout.parameters:
            if not parameter.starts:
                arguments = [_number(self._values[parameter.name]), *_declared(parameter)]
                yield f"    {parameter.name} = Parameter({', '.join(arguments)})"
        for state in layout.states:
            start = _number(self._values[layout.start_of[state.name]])
            unit, *others = _declared(state)
            arguments = [unit, f'rate="{state.rate}"', f"start={start}", *others]
            yield f"    {state.name} = State({', '.join(arguments)})"
        yield ""
        yield from self._law_lines()
        for state in layout.states:
            yield ""
            yield f"    def {state.rate}(self):"
            yield f"        return {self._rate(state.name)}"

    def _law_lines(self) -> Iterator[str]:
        parameters = f"self, {self._arguments}" if self._arguments else "self"
        yield f"    def {self._law}({parameters}):"
        yield f"        below = super().{self._law}({self._arguments})"
        yield f"        x = {self._function_argument()}"
        change = f"self.{self._effect.neutral} * {self._function()}"
        if self._correction.entry.kind == "add":
            yield f"        return below + {change}"
        else:
            yield f"        return below * (1.0 + {change})"

    def _function_argument(self) -> str:
        """Return the signal, or what is remembered of it, counted from its zero."""
        signal = self._signal
        now = "below" if signal.name == self._law else self._signal_value
        memory = next((f"self.{state.name}" for state in self._effect.layout.states), "")
        argument = f"{now} - {memory}" if signal.memory == "leading" else memory or now
        if signal.zero and self._correction.shape:
            return f"{argument} - {_number(signal.zero)}"
        return argument

    def _function(self) -> str:
        """Return the function of x, with the constant beside it where there is one."""
        constant = f"{self._effect.neutral}_beside"
        if constant in self._effect.declared:
            return f"({self._shape_or_table()} + self.{constant})"
        return self._shape_or_table()

    def _shape_or_table(self) -> str:
        shape = self._correction.shape
        if not shape:
            return f"smooth_table(x, {', '.join(_table_names(self._number))})"
        width_name = f"{self._effect.neutral}_width"
        width = f"self.{width_name}"
        scale = _number(self._signal.scale)
        formula = FORMULAS.get(shape)
        if formula is None:
            own_width = width if width_name in self._effect.declared else 1.0
            return f'SHAPES["{shape}"].form(x, {own_width}, {scale})'
        text = formula.format(w=width, s=scale)
        is_single = text == "x" or re.fullmatch(r"\w+\([^()]*\)", text)
        return text if is_single else f"({text})"

    def _rate(self, state: str) -> str:
        """Return the derivative of what is remembered of the signal."""
        signal = self._signal
        # what is remembered of the law itself is of the law as it is without
        now = f"super().{self._law}()" if signal.name == self._law else self._signal_value
        if signal.memory == "integrated":
            return now
        if signal.memory == "throughput":
            return f"absolute({now})"
        target = f"{now}**2" if signal.memory == "heat" else now
        return f"({target} - self.{state}) / self.{state}_constant"


def _declared(declaration: Declaration) -> list[str]:
    """Return unit, ends that mean something, typical size and words of a parameter or a state."""
    arguments = [_quote(declaration.unit)]
    for name in ("min", "max"):
        end = getattr(declaration, name)
        if abs(end) < _UNBOUNDED * declaration.nominal:
            arguments.append(f"{name}={_number(end)}")
    arguments.append(f"nominal={_number(declaration.nominal)}")
    arguments.append(f"doc={_quote(declaration.doc)}")
    return arguments


def _number(value: Any) -> str:
    """Return a number with as many digits as a simulation can tell."""
    return repr(float(f"{float(value):.12g}"))


def _quote(text: str) -> str:
    """Return a text between quotes."""
    return json.dumps(text)
