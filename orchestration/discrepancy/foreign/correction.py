"""Components that correct an FMU from outside: its outputs, or the inputs that it gets.

The correction of outputs hands them on, and every one is a law to which corrections may be added.
What the FMU simulates reaches it as an input, so that effects of measurement, and curves over any
signal of the FMU, are laid over it as over any component of ours. What a small change of a
parameter of the FMU does to an output is an input too, by the size of which that parameter may
change (a linearisation): no correction takes over what a parameter can do. What an input is in the
FMU is a law as well; where it is another than was recorded, linear responses of the outputs follow
it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256

import numpy as np

from fmus.kit import Component, UserError
from fmus.kit import units as known_units
from fmus.kit.arrays import Array
from fmus.kit.storage import cache
from orchestration.discrepancy.foreign.response import FmuResponse
from orchestration.fmu import Model, Signal
from orchestration.fmu.model import load_class
from orchestration.identify.black_box.study import class_name, identifiers

SIMULATED = "simulated_{}"
IN_FMU = "{}_in_fmu"
RECORDED = "{}_as_recorded"
_HEAD = '''"""{doc}"""

from fmus.kit import Component, Input, Output, Parameter, State


class {cls}(Component):
    """{doc}"""

    name = "{identifier}"
    experiment = {experiment!r}
    unchecked = {laws!r}

'''


@dataclass(frozen=True)
class OutputCorrection:
    """The component that corrects the outputs of an FMU.

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
        """Return the name of the input that has an output as the FMU simulates it."""
        return SIMULATED.format(self.names[output])

    def slope(self, output: str, parameter: str) -> str:
        """Return the name of the input that has the derivative of an output by a parameter."""
        return f"{self.names[output]}_by_{self.fitted[parameter]}"


def output_correction(
    model: Model,
    measured: Sequence[str],
    fit: Mapping[str, float],
    stop: float,
    step: float,
    responses: Mapping[tuple[str, str], FmuResponse] | None = None,
) -> OutputCorrection:
    """Write and load the component that corrects the outputs of an FMU.

    Parameters
    ----------
    model : Model
    measured : sequence of str
        Outputs that are judged; the other ones are signals only.
    fit : Mapping of str to float
        Parameters of the FMU that may change, from values at which it was linearised.
    stop, step : float
        Of its experiment, s.
    responses : Mapping of tuple of str to FmuResponse, optional
        Of outputs to inputs: these inputs may be others in the FMU than they were recorded.
    """
    inputs = real_signals(model.inputs)
    outputs = real_signals(model.outputs)
    every = (*inputs, *outputs, *fit)
    identifier = dict(zip(every, identifiers(every), strict=True))
    names = {name: identifier[name] for name in (*inputs, *outputs)}
    correction = OutputCorrection(Component, names, {name: identifier[name] for name in fit})
    of_inputs = {name for _, name in responses or {}}
    moved = {name: signal for name, signal in inputs.items() if name in of_inputs}
    following = {output: _write_response(names, output, responses or {}) for output in measured}
    declarations = [
        *_input_lines(names, inputs),
        *_recorded_lines(names, moved),
        *_simulated_lines(correction, outputs),
        *_parameter_lines(model, correction, measured, fit),
        *(line for response in following.values() for line in response.states),
    ]
    laws = [
        *(_law_in_fmu(name, names[name]) for name in moved),
        *(
            _output_law(correction, outputs[output], fit, response.terms)
            for output, response in following.items()
        ),
        *(law for response in following.values() for law in response.laws),
    ]
    doc = f"What stands behind {model.path.name}."
    cls = _load(model, doc, "corrected", declarations, laws, (stop, step))
    return replace(correction, cls=cls)


def input_correction(
    model: Model, moved: Sequence[str], stop: float, step: float
) -> type[Component]:
    """Write and load the component that corrects inputs before an FMU gets them.

    Parameters
    ----------
    model : Model
    moved : sequence of str
        Inputs that are corrected; the other ones are signals only.
    stop, step : float
        Of its experiment, s.
    """
    inputs = real_signals(model.inputs)
    names = dict(zip(inputs, identifiers(tuple(inputs)), strict=True))
    declarations = _input_lines(names, inputs)
    laws = [
        replace(_law_in_fmu(name, names[name]), output_unit=_unit(inputs[name])) for name in moved
    ]
    doc = f"What stands ahead of {model.path.name}."
    return _load(model, doc, "fed", declarations, laws, (stop, step))


def real_signals(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return those signals that are real."""
    return {name: signal for name, signal in signals.items() if signal.type == "real"}


def _parameter_lines(
    model: Model, correction: OutputCorrection, measured: Sequence[str], fit: Mapping[str, float]
) -> list[str]:
    """Return lines of a component's source that declare the parameters of an FMU that may change.

    Inputs are declared beside them for the derivatives of outputs by these parameters.
    """
    lines = []
    for parameter, own_name in correction.fitted.items():
        lines.append(_parameter_line(own_name, model.parameters[parameter], fit[parameter]))
        for output in measured:
            unit = _unit(model.outputs[output])
            declaration = f'Input("{unit}", doc="what {parameter} does to {output}")'
            lines.append(f"    {correction.slope(output, parameter)} = {declaration}")
    return lines


def _parameter_line(name: str, signal: Signal, value: float) -> str:
    ends = "".join(
        f", {end}={x!r}" for end, x in (("min", signal.min), ("max", signal.max)) if np.isfinite(x)
    )
    size = abs(value) or 1.0
    return (
        f'    {name} = Parameter({value!r}, "{_unit(signal)}"{ends}, nominal={size!r},'
        f' doc="{_doc(signal)}")'
    )


def _linearised(correction: OutputCorrection, output: str, fit: Mapping[str, float]) -> list[str]:
    """Write the terms of an output: what the FMU simulates, and what its parameters change."""
    terms = [f"self.{correction.simulated(output)}"]
    for parameter, name in correction.fitted.items():
        change = f"(self.{name} - {fit[parameter]!r})"
        terms.append(f"{change} * self.{correction.slope(output, parameter)}")
    return terms


def _input_lines(names: Mapping[str, str], inputs: Mapping[str, Signal]) -> list[str]:
    """Declare inputs as the FMU has them; one that nobody sets stays at its start value."""
    return [
        f'    {names[n]} = Input("{_unit(s)}", start={float(s.start)!r}, doc="{_doc(s)}")'
        for n, s in inputs.items()
    ]


def _recorded_lines(names: Mapping[str, str], moved: Mapping[str, Signal]) -> list[str]:
    """Declare what was recorded of the inputs that may be others in the FMU."""
    return [
        f'    {RECORDED.format(names[n])} = Input("{_unit(s)}", doc="{n} as it was recorded")'
        for n, s in moved.items()
    ]


def _simulated_lines(correction: OutputCorrection, outputs: Mapping[str, Signal]) -> list[str]:
    """Declare the outputs that the FMU simulates, which are inputs of the correction."""
    return [
        f'    {correction.simulated(n)} = Input("{_unit(s)}", doc="{n} of the FMU")'
        for n, s in outputs.items()
    ]


@dataclass(frozen=True)
class _Law:
    """A law of a component's source; it is an output where it has a unit of one."""

    name: str
    returned: str
    doc: str
    output_unit: str | None = None

    @property
    def lines(self) -> list[str]:
        """Lines of its definition."""
        unit = self.output_unit
        return [
            "",
            *([] if unit is None else [f'    @Output("{unit}")']),
            f"    def {self.name}(self):",
            f'        """{self.doc}"""',
            f"        return {self.returned}",
        ]


@dataclass(frozen=True)
class _WrittenResponse:
    """Lines of states, laws, and terms of an output, by which it follows its inputs."""

    states: list[str] = field(default_factory=list)
    laws: list[_Law] = field(default_factory=list)
    terms: list[str] = field(default_factory=list)


def _write_response(
    names: Mapping[str, str], output: str, responses: Mapping[tuple[str, str], FmuResponse]
) -> _WrittenResponse:
    """Write the linear response of an output to the difference of inputs from those recorded.

    The difference is between what the FMU gets (a law of the component) and the record (an input).
    The response has states (a, b, c, d of a state-space model), laws of their rates, and terms that
    are added to the output.

    Parameters
    ----------
    names : Mapping of str to str
        Of inputs and outputs, by those of the FMU.
    output : str
    responses : Mapping of tuple of str to FmuResponse
        By output and input.
    """
    written = _WrittenResponse()
    for (responding, name), response in responses.items():
        if responding != output:
            continue
        difference = f"(self.{IN_FMU.format(names[name])}() - self.{RECORDED.format(names[name])})"
        states = [f"{names[output]}_after_{names[name]}_{k + 1}" for k in range(len(response.c))]
        written.terms.extend(_products(response.c, states))
        if response.d:
            written.terms.append(f"{response.d!r} * {difference}")
        for k, state in enumerate(states):
            rate = f"rate_of_{state}"
            written.states.append(
                f'    {state} = State("1", rate="{rate}", doc="response of {output} to {name}")'
            )
            terms = [*_products(response.a[k], states), f"{float(response.b[k])!r} * {difference}"]
            written.laws.append(_Law(rate, " + ".join(terms), "Rate of the state."))
    return written


def _products(amounts: Array, states: Sequence[str]) -> list[str]:
    return [f"{float(k)!r} * self.{state}" for k, state in zip(amounts, states, strict=True) if k]


def _law_in_fmu(name: str, identifier: str) -> _Law:
    """Write the law of what an input is in the FMU."""
    return _Law(IN_FMU.format(identifier), f"self.{identifier}", f"What of {name} the FMU gets.")


def _output_law(
    correction: OutputCorrection, signal: Signal, fit: Mapping[str, float], response: Sequence[str]
) -> _Law:
    """Write the law of an output, to which the terms of its response are added."""
    terms = [*_linearised(correction, signal.name, fit), *response]
    own_name = correction.names[signal.name]
    return _Law(own_name, " + ".join(terms), f"{_doc(signal)}.", _unit(signal))


def _load(
    model: Model,
    doc: str,
    ending: str,
    declarations: Sequence[str],
    laws: Sequence[_Law],
    experiment: tuple[float, float],
) -> type[Component]:
    """Write a class to a file in the cache, where it is found again, and load it."""
    (identifier,) = identifiers((model.path.stem,))
    name = class_name(identifier)
    head = _HEAD.format(
        doc=doc,
        cls=name,
        identifier=f"{identifier}_{ending}",
        experiment=experiment,
        laws=tuple(law.name for law in laws),  # slopes and gains are written as bare numbers
    )
    definitions = [line for law in laws for line in law.lines]
    text = head + "\n".join([*declarations, *definitions, ""])
    file = cache.cached_file(
        f"behind-{sha256(text.encode()).hexdigest()[:16]}/{identifier}.py", text.encode
    )
    return load_class(f"{file}:{name}")


def _unit(signal: Signal) -> str:
    """Return the unit of a signal if the kit knows it, else that of no dimension."""
    try:
        known_units.parse(signal.unit)
    except UserError:
        return "1"
    return signal.unit


def _doc(signal: Signal) -> str:
    """Return the description of a signal as it may stand in a string, or its name."""
    printable = "".join(c for c in signal.doc if c.isprintable() and c not in '"\\')
    return printable.strip(". ") or signal.name
