"""The component that stands behind an FMU: it hands its outputs on, and every one of them is a law to be asked.

What the FMU simulates reaches it as an input, so that effects of measurement, and curves over any signal of the FMU,
are laid over it as over any component of ours. What a small change of a parameter of the FMU does to an output is an
input too, by the size of which that parameter may change (a linearisation): no correction takes over what a parameter
can do. What an input is in the FMU is a law as well; where it is another than was recorded, linear responses of the
outputs tell what follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component
from fmus.kit import units as known_units
from fmus.kit.errors import UserError
from fmus.kit.storage import cache
from orchestration.discrepancy.foreign.response import Response
from orchestration.fmu.loading import load_class
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal
from orchestration.identify.black_box.study.component import class_name, identifiers

SIMULATED = "simulated_{}"
IN_FMU, RECORDED = "{}_in_fmu", "{}_as_recorded"
_HEAD = '''"""{doc}"""

from fmus.kit import Component, Input, Output, Parameter, State


class {cls}(Component):
    """{doc}"""

    name = "{identifier}"
    experiment = ({stop!r}, {step!r})

'''


@dataclass(frozen=True)
class Behind:
    """The component behind an FMU.

    Attributes
    ----------
    cls : type[Component]
    names : dict of str to str
        Of its inputs and outputs by those of the FMU.
    fitted : dict of str to str
        Of its parameters by those of the FMU that may change.
    """

    cls: type[Component]
    names: dict[str, str]
    fitted: dict[str, str]

    def simulated(self, output: str) -> str:
        """Name of the input that has what the FMU simulates."""
        return SIMULATED.format(self.names[output])

    def slope(self, output: str, parameter: str) -> str:
        """Name of the input that has what a parameter, changed by its size, does to an output."""
        return f"{self.names[output]}_by_{self.fitted[parameter]}"


def behind(
    model: Model,
    measured: Sequence[str],
    fit: Mapping[str, float],
    stop: float,
    step: float,
    answers: Mapping[tuple[str, str], Response] | None = None,
) -> Behind:
    """Write and load the component behind an FMU.

    Parameters
    ----------
    model : Model
    measured : sequence of str
        Outputs that are judged; the other ones are signals only.
    fit : Mapping of str to float
        Parameters of the FMU that may change, from values at which it was linearised.
    stop, step : float
        Of its experiment, s.
    answers : Mapping of tuple of str to Response, optional
        Of outputs to inputs: these inputs may be others in the FMU than they were recorded.
    """
    inputs, outputs = real(model.inputs), real(model.outputs)
    every = (*inputs, *outputs, *fit)
    made = dict(zip(every, identifiers(every), strict=True))
    names, fitted = {n: made[n] for n in (*inputs, *outputs)}, {p: made[p] for p in fit}
    found, answers = Behind(Component, names, fitted), answers or {}
    moved = [i for i in inputs if any(name == i for _, name in answers)]
    lines = _inputs(names, inputs)
    lines += [
        f'    {RECORDED.format(names[i])} = Input("{_unit(inputs[i])}", doc="{i} as it was recorded")'
        for i in moved
    ]
    lines += [
        f'    {found.simulated(n)} = Input("{_unit(s)}", doc="{n} of the FMU")'
        for n, s in outputs.items()
    ]
    for p, name in fitted.items():
        lines.append(_parameter(name, model.parameters[p], fit[p]))
        lines += [
            f'    {found.slope(n, p)} = Input("{_unit(outputs[n])}", doc="what {p} does to {n}")'
            for n in measured
        ]
    more = {
        n: _answering(names, n, {i: r for (o, i), r in answers.items() if o == n}) for n in measured
    }
    lines += [line for n in measured for line in more[n].states]
    for i in moved:
        lines += _law(IN_FMU.format(names[i]), f"self.{names[i]}", f"What of {i} the FMU gets.")
    for n in measured:
        terms = [f"self.{found.simulated(n)}"] + [
            f"(self.{c} - {fit[p]!r}) * self.{found.slope(n, p)}" for p, c in fitted.items()
        ]
        lines += ["", f'    @Output("{_unit(outputs[n])}")']
        lines += _law(names[n], " + ".join([*terms, *more[n].terms]), f"{_doc(outputs[n])}.")[1:]
    lines += [line for n in measured for line in more[n].laws]
    return replace(
        found,
        cls=_loaded(
            model, f"What stands behind {model.path.name}.", "corrected", lines, stop, step
        ),
    )


def ahead(model: Model, moved: Sequence[str], stop: float, step: float) -> type[Component]:
    """Write and load the component ahead of an FMU, whose outputs are what the FMU gets of some inputs."""
    inputs = real(model.inputs)
    names = dict(zip(inputs, identifiers(tuple(inputs)), strict=True))
    lines = _inputs(names, inputs)
    for i in moved:
        lines += ["", f'    @Output("{_unit(inputs[i])}")']
        lines += _law(IN_FMU.format(names[i]), f"self.{names[i]}", f"What of {i} the FMU gets.")[1:]
    return _loaded(model, f"What stands ahead of {model.path.name}.", "fed", lines, stop, step)


def real(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Those that are real."""
    return {name: signal for name, signal in signals.items() if signal.type == "real"}


def _parameter(name: str, signal: Signal, value: float) -> str:
    ends = "".join(
        f", {end}={x!r}" for end, x in (("min", signal.min), ("max", signal.max)) if np.isfinite(x)
    )
    size = abs(value) or 1.0
    return f'    {name} = Parameter({value!r}, "{_unit(signal)}"{ends}, nominal={size!r}, doc="{_doc(signal)}")'


def _inputs(names: Mapping[str, str], inputs: Mapping[str, Signal]) -> list[str]:
    """Inputs as the FMU has them, which stay at its start values where nobody sets them."""
    return [
        f'    {names[n]} = Input("{_unit(s)}", start={float(s.start)!r}, doc="{_doc(s)}")'
        for n, s in inputs.items()
    ]


class _Answering(NamedTuple):
    """Lines of states and laws, and terms of an output."""

    states: list[str]
    laws: list[str]
    terms: list[str]


def _answering(
    names: Mapping[str, str], output: str, answers: Mapping[str, Response]
) -> _Answering:
    """What an output does if inputs are others in the FMU than they were recorded."""
    made = _Answering([], [], [])
    for name, answer in answers.items():
        difference = f"(self.{IN_FMU.format(names[name])}() - self.{RECORDED.format(names[name])})"
        states = [f"{names[output]}_after_{names[name]}_{k + 1}" for k in range(len(answer.c))]
        made.terms.extend(_sum(answer.c, states))
        made.terms.extend([f"{answer.d!r} * {difference}"] if answer.d else [])
        for k, state in enumerate(states):
            made.states.append(
                f'    {state} = State("1", rate="rate_of_{state}", doc="response of {output} to {name}")'
            )
            terms = [*_sum(answer.a[k], states), f"{float(answer.b[k])!r} * {difference}"]
            made.laws.extend(_law(f"rate_of_{state}", " + ".join(terms), "Rate of the state."))
    return made


def _sum(amounts: NDArray[np.float64], states: Sequence[str]) -> list[str]:
    return [f"{float(k)!r} * self.{state}" for k, state in zip(amounts, states, strict=True) if k]


def _law(name: str, returned: str, doc: str) -> list[str]:
    return ["", f"    def {name}(self):", f'        """{doc}"""', f"        return {returned}"]


def _loaded(
    model: Model, doc: str, ending: str, lines: Sequence[str], stop: float, step: float
) -> type[Component]:
    """Write a class to where it is found again, and load it."""
    (identifier,) = identifiers((model.path.stem,))
    name = class_name(identifier)
    head = _HEAD.format(
        doc=doc, cls=name, identifier=f"{identifier}_{ending}", stop=stop, step=step
    )
    text = head + "\n".join([*lines, ""])
    file = cache.entry(
        f"behind-{sha256(text.encode()).hexdigest()[:16]}/{identifier}.py", text.encode
    )
    return load_class(f"{file}:{name}")


def _unit(signal: Signal) -> str:
    """A unit that the kit knows, or none."""
    try:
        known_units.parse(signal.unit)
    except UserError:
        return "1"
    return signal.unit


def _doc(signal: Signal) -> str:
    return (
        "".join(c for c in signal.doc if c.isprintable() and c not in '"\\').strip(". ")
        or signal.name
    )
