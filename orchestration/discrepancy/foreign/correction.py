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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from math import isfinite
from operator import add, attrgetter
from typing import Any

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit import units as known_units
from fmus.kit.arrays import Array
from orchestration.discrepancy.foreign.response import FmuResponse
from orchestration.fmu import Model, Signal
from orchestration.identify.black_box.study import class_name, identifiers

SIMULATED = "simulated_{}"
IN_FMU = "{}_in_fmu"
RECORDED = "{}_as_recorded"
_Value = Callable[[Any], Any]  # of an instance of the component


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
    """Make the component that corrects the outputs of an FMU.

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
    following = {output: _response(names, output, responses or {}) for output in measured}
    body = _inputs(names, inputs) | _recorded(names, moved) | _simulated(correction, outputs)
    body |= _parameters(model, correction, measured, fit)
    for response in following.values():
        body |= response.states
    laws = {IN_FMU.format(names[name]): _law_in_fmu(name, names[name]) for name in moved}
    for output, response in following.items():
        terms = [*_linearised(correction, output, fit), *response.terms]
        laws[names[output]] = _output_law(outputs[output], terms)
    for response in following.values():
        laws |= response.rates
    doc = f"What stands behind {model.path.name}."
    return replace(correction, cls=_component(model, doc, "corrected", body, laws, (stop, step)))


def input_correction(
    model: Model, moved: Sequence[str], stop: float, step: float
) -> type[Component]:
    """Make the component that corrects inputs before an FMU gets them.

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
    laws = {
        IN_FMU.format(names[name]): Output(_unit(inputs[name]))(_law_in_fmu(name, names[name]))
        for name in moved
    }
    doc = f"What stands ahead of {model.path.name}."
    return _component(model, doc, "fed", _inputs(names, inputs), laws, (stop, step))


def real_signals(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return those signals that are real."""
    return {name: signal for name, signal in signals.items() if signal.type == "real"}


def _inputs(names: Mapping[str, str], inputs: Mapping[str, Signal]) -> dict[str, Any]:
    """Declare inputs as the FMU has them; one that nobody sets stays at its start value."""
    return {
        names[name]: Input(_unit(signal), start=float(signal.start), doc=_doc(signal))
        for name, signal in inputs.items()
    }


def _recorded(names: Mapping[str, str], moved: Mapping[str, Signal]) -> dict[str, Any]:
    """Declare the recorded values of the inputs that may be others in the FMU."""
    return {
        RECORDED.format(names[name]): Input(_unit(signal), doc=f"{name} as it was recorded")
        for name, signal in moved.items()
    }


def _simulated(correction: OutputCorrection, outputs: Mapping[str, Signal]) -> dict[str, Any]:
    """Declare the outputs that the FMU simulates, which are inputs of the correction."""
    return {
        correction.simulated(name): Input(_unit(signal), doc=f"{name} of the FMU")
        for name, signal in outputs.items()
    }


def _parameters(
    model: Model, correction: OutputCorrection, measured: Sequence[str], fit: Mapping[str, float]
) -> dict[str, Any]:
    """Declare the parameters of an FMU that may change, and derivatives of outputs by them.

    The derivatives are inputs.
    """
    declared: dict[str, Any] = {}
    for parameter, own_name in correction.fitted.items():
        declared[own_name] = _parameter(model.parameters[parameter], fit[parameter])
        for output in measured:
            unit = _unit(model.outputs[output])
            doc = f"what {parameter} does to {output}"
            declared[correction.slope(output, parameter)] = Input(unit, doc=doc)
    return declared


def _parameter(signal: Signal, value: float) -> Any:
    ends = {"min": signal.min, "max": signal.max}
    finite = {name: end for name, end in ends.items() if isfinite(end)}  # a description may say NaN
    size = abs(value) or 1.0
    return Parameter(value, _unit(signal), **finite, nominal=size, doc=_doc(signal))


def _linearised(
    correction: OutputCorrection, output: str, fit: Mapping[str, float]
) -> list[_Value]:
    """Return the terms of an output: what the FMU simulates, and what its parameters change."""
    terms: list[_Value] = [attrgetter(correction.simulated(output))]
    for parameter, name in correction.fitted.items():
        terms.append(_change(name, fit[parameter], correction.slope(output, parameter)))
    return terms


def _change(parameter: str, at: float, slope: str) -> _Value:
    return lambda self: (getattr(self, parameter) - at) * getattr(self, slope)


@dataclass(frozen=True)
class _Response:
    """States, laws of their rates, and terms of an output, by which it follows its inputs."""

    states: dict[str, Any] = field(default_factory=dict)
    rates: dict[str, _Value] = field(default_factory=dict)
    terms: list[_Value] = field(default_factory=list)


def _response(
    names: Mapping[str, str], output: str, responses: Mapping[tuple[str, str], FmuResponse]
) -> _Response:
    """Make the linear response of an output to the difference of inputs from those recorded.

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
    made = _Response()
    for (responding, name), response in responses.items():
        if responding != output:
            continue
        difference = _difference(IN_FMU.format(names[name]), RECORDED.format(names[name]))
        states = [f"{names[output]}_after_{names[name]}_{k + 1}" for k in range(len(response.c))]
        made.terms.extend(_products(response.c, states))
        if response.d:
            made.terms.append(_product(response.d, difference))
        for k, state in enumerate(states):
            rate = f"rate_of_{state}"
            made.states[state] = State("1", rate=rate, doc=f"response of {output} to {name}")
            terms = _products(response.a[k], states)
            terms.append(_product(float(response.b[k]), difference))
            made.rates[rate] = _sum(terms, "Rate of the state.")
    return made


def _difference(law: str, name: str) -> _Value:
    return lambda self: getattr(self, law)() - getattr(self, name)


def _products(amounts: Array, states: Sequence[str]) -> list[_Value]:
    return [
        _product(float(k), attrgetter(state)) for k, state in zip(amounts, states, strict=True) if k
    ]


def _product(amount: float, value: _Value) -> _Value:
    return lambda self: amount * value(self)


def _sum(terms: Sequence[_Value], doc: str) -> _Value:
    """Make the law that adds terms in their order."""

    def law(self: Any) -> Any:
        return reduce(add, (term(self) for term in terms))

    law.__doc__ = doc
    return law


def _law_in_fmu(name: str, identifier: str) -> _Value:
    """Make the law of what an input is in the FMU."""
    return _sum([attrgetter(identifier)], f"What of {name} the FMU gets.")


def _output_law(signal: Signal, terms: Sequence[_Value]) -> Any:
    return Output(_unit(signal))(_sum(terms, f"{_doc(signal)}."))


def _component(
    model: Model,
    doc: str,
    ending: str,
    declared: Mapping[str, Any],
    laws: Mapping[str, Any],
    experiment: tuple[float, float],
) -> type[Component]:
    """Make the class of a component from its declarations and laws.

    It is made, not written and loaded: names and descriptions are those of somebody else's FMU.
    """
    (identifier,) = identifiers((model.path.stem,))
    body = {
        "__doc__": doc,
        "__module__": __name__,
        "name": f"{identifier}_{ending}",
        "experiment": experiment,
        "unchecked": tuple(laws),  # slopes and gains are bare numbers
    }
    return type(class_name(identifier), (Component,), {**body, **declared, **laws})


def _unit(signal: Signal) -> str:
    """Return the unit of a signal if the kit knows it, else that of no dimension."""
    try:
        known_units.parse(signal.unit)
    except UserError:
        return "1"
    return signal.unit


def _doc(signal: Signal) -> str:
    """Return the description of a signal without control characters, or its name."""
    printable = "".join(filter(str.isprintable, signal.doc))
    return printable.strip(". ") or signal.name
