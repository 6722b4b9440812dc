"""A correction of a law as a file of Python: a class of a few lines to read, to change and to lay over the model."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fmus.kit import Component, files
from fmus.kit.corrections import Of
from fmus.kit.declare import Declaration
from orchestration.discrepancy.extended_model import fitted_defaults
from orchestration.discrepancy.laws.discovery import Correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.asked import Asked, signal_of, table_of

# as the kit computes them: x is the signal, w its width, s its typical size
FORMULAS = {
    "linear": "x",
    "asymmetric": "absolute(x)",
    "quadratic": "x * x",
    "odd_quadratic": "x * absolute(x)",
    "cubic": "x * (x * x)",
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
_FAR = 1e9  # nominal values, beyond which a bound is none
_ROW = 6  # numbers in a line of a table


def write(asked: Asked, path: Path) -> None:
    """Write the file.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    files.write(path, source(asked).encode())


def source(asked: Asked) -> str:
    """Return the text of the file: the best correction, and what is beside it."""
    found = [one.best for one in asked.rounds if one.best is not None]
    base, last = asked.component, asked.last
    values = {
        n: v for one in found for n, v in (one.model.problem.start | one.model.fit.values).items()
    }
    values |= last.problem.start | last.fit.values | fitted_defaults(last)
    for each in asked.rounds:  # what the catalogue knows under another name
        values |= each.own_values(last)
    known = {p.name for p in base.layout.parameters}
    fitted = {n: v for n, v in fitted_defaults(last).items() if n in known}
    signals = [f"{one.entry.law} over {_words(one)}" for one in found]
    titles = ["".join(part.title() for part in _id(one).split("_")) for one in found]
    bodies = [list(_body(base, one, values, k)) for k, one in enumerate(found, start=1)]
    used = [
        name
        for name in _FUNCTIONS
        if any(re.search(rf"\b{name}\(", line) for body in bodies for line in body)
    ]
    remembers = any(one.model.effect.layout.states for one in found)
    kit = sorted(["Effect", "Parameter", *(["State"] if remembers else []), *used], key=str.lower)
    shapes = any("SHAPES[" in line for body in bodies for line in body)
    lines = [
        f'"""{" and ".join(signals).capitalize()}: what {base.name} lacks on a record.',
        "",
        f"    from fmus.kit import stack\n\n    better = stack({', '.join([base.__name__, *titles])}, defaults=FITTED)",
        '"""',
        "",
        f"from fmus.kit import {', '.join(kit)}",
        *(["from fmus.kit.curves import SHAPES"] if shapes else []),
        "",
        f"# fitted to {asked.result.files!a}: the model's own parameters beside the correction, SI",
        "FITTED = {",
        *(f'    "{name}": {_number(value)},' for name, value in fitted.items()),
        "}",
    ]
    for k, (one, title, body) in enumerate(zip(found, titles, bodies, strict=True), start=1):
        effect = one.model.effect
        lines += [
            *_table(one, k),
            "",
            "",
            f"class {title}(Effect):",
            f'    """{_said(one)}"""',
            "",
            f'    id = "{_id(one)}"',
            f'    neutral = "{effect.neutral}"',
            f"    assumption = {_text(str(effect.assumption))}",
            "",
            *body,
        ]
    return "\n".join(lines) + "\n"


def _said(correction: Correction) -> str:
    factor = " as a factor" if correction.entry.kind == "multiply" else ""
    text = f"{correction.entry.law} hangs on {_words(correction)}{factor}"
    return (
        f"{text}: {wording.shape_name(correction.shape)}."
        if correction.shape
        else f"{text}: a table."
    )


def _words(correction: Correction) -> str:
    """The signal without a time constant, which is a parameter."""
    return signal_of(correction.model.effect)[1].words


def _id(correction: Correction) -> str:
    """Law and signal, what is remembered of it, and a number where there are several."""
    return f"{correction.entry.law}_over_{correction.model.effect.term.qualifier}"


def _table(correction: Correction, number: int) -> Iterator[str]:
    """Lines of the constants of a table."""
    if correction.shape:
        return
    for name, numbers in zip(_constants(number), table_of(correction.model.effect), strict=True):
        yield f"{name} = ("
        for k in range(0, len(numbers), _ROW):
            yield f"    {', '.join(map(_number, numbers[k : k + _ROW]))},"
        yield ")"


def _constants(number: int) -> tuple[str, str]:
    """Names of the knots and the values of a correction."""
    more = f"_{number}" if number > 1 else ""
    return f"KNOTS{more}", f"VALUES{more}"


def _body(
    cls: type[Component], correction: Correction, values: dict[str, float], number: int
) -> Iterator[str]:
    """Lines of the class: its parameters, what it remembers, and the law."""
    effect = correction.model.effect
    kind, layout, (law, of) = correction.entry.kind, effect.layout, signal_of(effect)
    for p in layout.parameters:
        if not p.starts:
            yield f"    {p.name} = Parameter({', '.join([_number(values[p.name]), *_about(p)])})"
    for state in layout.states:
        start = _number(values[layout.start_of[state.name]])
        told = [_text(state.unit), f'rate="{state.rate}"', f"start={start}", *_about(state)[1:]]
        yield f"    {state.name} = State({', '.join(told)})"
    arguments = "*arguments" if len(inspect.signature(getattr(cls, law)).parameters) > 1 else ""
    yield ""
    yield f"    def {law}(self{', ' if arguments else ''}{arguments}):"
    yield f"        below = super().{law}({arguments})"
    is_law = callable(getattr(cls, of.name, None))
    now = "below" if of.name == law else f"self.{of.name}{'()' if is_law else ''}"
    memory = next((f"self.{state.name}" for state in layout.states), "")
    less = f" - {_number(of.zero)}" if of.zero and correction.shape else ""
    yield f"        x = {f'{now} - {memory}' if of.memory == 'leading' else memory or now}{less}"
    more = f"self.{effect.neutral} * {_form(correction, of, number)}"
    yield (
        f"        return below + {more}"
        if kind == "add"
        else f"        return below * (1.0 + {more})"
    )
    for state in layout.states:
        # what is remembered of the law itself is of the law as it is without
        begin = f"super().{law}()" if of.name == law else now
        what = f"{begin}**2" if of.memory == "heat" else begin
        rate = {"integrated": begin, "throughput": f"absolute({begin})"}.get(
            of.memory, f"({what} - self.{state.name}) / self.{state.name}_constant"
        )
        yield from ("", f"    def {state.rate}(self):", f"        return {rate}")


def _form(correction: Correction, of: Of, number: int) -> str:
    """The function of x, with the constant beside it."""
    beside = f"{correction.model.effect.neutral}_beside"
    alone = _alone(correction, of, number)
    return f"({alone} + self.{beside})" if beside in correction.model.effect.declared else alone


def _alone(correction: Correction, of: Of, number: int) -> str:
    if not correction.shape:
        return f"smooth_table(x, {', '.join(_constants(number))})"
    width, size = f"self.{correction.model.effect.neutral}_width", _number(of.scale)
    known = FORMULAS.get(correction.shape)
    if known is None:
        has = f"{correction.model.effect.neutral}_width" in correction.model.effect.declared
        return f'SHAPES["{correction.shape}"].form(x, {width if has else 1.0}, {size})'
    text = known.format(w=width, s=size)
    return text if text == "x" or re.fullmatch(r"\w+\([^()]*\)", text) else f"({text})"


def _about(declared: Declaration) -> Sequence[str]:
    """Unit, ends that mean something, typical size and words of a parameter."""
    bounds = ((name, getattr(declared, name)) for name in ("min", "max"))
    near = [f"{name}={_number(end)}" for name, end in bounds if abs(end) < _FAR * declared.nominal]
    return [
        _text(declared.unit),
        *near,
        f"nominal={_number(declared.nominal)}",
        f"doc={_text(declared.doc)}",
    ]


def _number(value: Any) -> str:
    """A number with as many digits as a simulation can tell."""
    return repr(float(f"{float(value):.12g}"))


def _text(text: str) -> str:
    """A text between quotes."""
    return json.dumps(text)
