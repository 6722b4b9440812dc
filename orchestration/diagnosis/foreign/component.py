"""The component that corrects an FMU from outside: what it gives, and what it gets.

What the FMU simulated is an input of the component, and each output is a law that hands one on.
What a small change of a fitted parameter does to an output is an input too, times the change. What
the FMU gets of an input is a law as well; where it is another than was recorded, linear responses
of what it simulates follow it. The classes are made, not written and loaded: names and descriptions
are those of somebody else's FMU.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from math import isfinite
from operator import add, attrgetter
from typing import Any, NamedTuple

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit import units as known_units
from fmus.kit.arrays import Array
from fmus.kit.effects import effect_maker
from fmus.kit.quoting import line
from fmus.kit.titles import titled
from orchestration.diagnosis.foreign.response import FmuResponse
from orchestration.fmu import Model, Signal
from orchestration.identify.black_box.study import class_name, identifiers

_Value = Callable[[Any], Any]  # of an instance of the component


@dataclass(frozen=True)
class Names:
    """Names of a component's variables and laws, by those of the FMU.

    Attributes
    ----------
    variables : dict of str to str
        Of inputs, outputs and fitted parameters.
    simulated : dict of str to str
        Of what the FMU simulates, by output: a law if it depends on parameters or on what the FMU
        gets, else an input.
    run : dict of str to str
        Of what the FMU simulated as it was run, by output: an input, if the other is a law.
    in_fmu : dict of str to str
        Of the laws of what the FMU gets, by input.
    recorded : dict of str to str
        Of what was recorded of the inputs that have such a law.
    at : dict of str to str
        Of the values of fitted parameters with which the FMU was simulated.
    slopes : dict of tuple of str to str
        Of derivatives there, by output and parameter.
    """

    variables: dict[str, str]
    simulated: dict[str, str]
    run: dict[str, str]
    in_fmu: dict[str, str]
    recorded: dict[str, str]
    at: dict[str, str]
    slopes: dict[tuple[str, str], str]

    @classmethod
    def of(cls, model: Model, fit: Sequence[str]) -> Names:
        """Name the variables of a correction of an FMU, all differently."""
        inputs, outputs = numbers(model.inputs), reals(model.outputs)
        slopes = [(output, parameter) for output in outputs for parameter in fit]
        wanted = [
            *(*inputs, *outputs, *fit),
            *(f"{name}_simulated" for name in outputs),
            *(f"{name}_run" for name in outputs),
            *(f"{name}_in_fmu" for name in inputs),
            *(f"{name}_recorded" for name in inputs),
            *(f"{name}_simulated_with" for name in fit),
            *(f"{output}_by_{parameter}" for output, parameter in slopes),
        ]
        made = iter(identifiers(tuple(wanted)))
        variables = {name: next(made) for name in (*inputs, *outputs, *fit)}
        simulated = {name: next(made) for name in outputs}
        run = {name: next(made) for name in outputs}
        in_fmu = {name: next(made) for name in inputs}
        recorded = {name: next(made) for name in inputs}
        at = {name: next(made) for name in fit}
        derivatives = {pair: next(made) for pair in slopes}
        return cls(variables, simulated, run, in_fmu, recorded, at, derivatives)

    def in_words_of_fmu(self, message: str) -> str:
        """Return a message about the component with the names that the FMU has for variables."""
        own = {made: line(name) for name, made in self.variables.items()}
        return re.sub(r"\w+", lambda word: own.get(word[0], word[0]), message)


class Fitted(NamedTuple):
    """A parameter of an FMU that may change: its nominal value, and its magnitude."""

    nominal: float
    size: float


@effect_maker
def output_correction(
    model: Model,
    names: Names,
    inputs: Sequence[str],
    measured: Sequence[str],
    experiment: tuple[float, float],
    *,
    fit: Mapping[str, Fitted] | None = None,
    responses: Mapping[tuple[str, str], FmuResponse] | None = None,
) -> type[Component]:
    """Make the component that corrects the outputs of an FMU.

    Parameters
    ----------
    model : Model
    names : Names
    inputs : sequence of str
        Those of the FMU that are inputs of the component, too.
    measured : sequence of str
        Outputs that are judged; the other ones are signals only.
    experiment : tuple of float
        Stop time and step, s.
    fit : Mapping of str to Fitted, optional
        Parameters of the FMU that may change.
    responses : Mapping of tuple of str to FmuResponse, optional
        Of outputs to inputs: these inputs may be others in the FMU than they were recorded.
    """
    fit, responses = fit or {}, responses or {}
    outputs = reals(model.outputs)
    body = _inputs(model, names, inputs)
    laws: dict[str, Any] = {}
    for name in dict.fromkeys(name for _, name in responses):
        doc = f"{name} as it was recorded"
        body[names.recorded[name]] = Input(_unit(model.inputs[name]), doc=doc)
        laws[names.in_fmu[name]] = _law_in_fmu(name, names.variables[name])
    for name, fitted in fit.items():
        signal = model.constants[name]
        body[names.variables[name]] = _parameter(signal, fitted)
        body[names.at[name]] = Input(_unit(signal), doc=f"{name} with which the FMU was simulated")
    for output, signal in outputs.items():
        terms: list[_Value] = []
        for name in fit if output in measured else ():
            slope = names.slopes[output, name]
            doc = f"what {name} does to {output}"
            body[slope] = Input(_unit(signal), doc=doc)
            terms.append(_change(names.variables[name], names.at[name], slope))
        for (responding, name), response in responses.items():
            if responding == output:
                terms += _response(names, output, name, response, body, laws)
        column = names.run[output] if terms else names.simulated[output]
        body[column] = _simulated(output, signal)
        if terms:
            summed = _sum([attrgetter(column), *terms], f"{output} of the FMU.")
            laws[names.simulated[output]] = titled(body[column].title)(summed)
        if output in measured:
            law = _sum([_named(names.simulated[output])], f"{_doc(signal)}.")
            laws[names.variables[output]] = Output(_unit(signal), title=line(output))(law)
    doc = f"What stands behind {model.path.name}."
    body["fed"] = frozenset(names.in_fmu.values())  # see `term_names.sentence`
    return _component(model, doc, "corrected", body, laws, experiment)


@effect_maker
def input_correction(
    model: Model,
    names: Names,
    moved: Sequence[str],
    fed_back: Sequence[str],
    experiment: tuple[float, float],
) -> type[Component]:
    """Make the component that corrects inputs before an FMU gets them.

    Parameters
    ----------
    model : Model
    names : Names
    moved : sequence of str
        Inputs that are corrected; the other ones are signals only.
    fed_back : sequence of str
        Outputs of which what the FMU simulates is an input.
    experiment : tuple of float
        Stop time and step, s.
    """
    laws = {}
    for name in moved:
        law = _law_in_fmu(name, names.variables[name])
        laws[names.in_fmu[name]] = Output(_unit(model.inputs[name]))(law)
    doc = f"What stands ahead of {model.path.name}."
    body = _inputs(model, names, [*reals(model.inputs)])
    body |= {names.simulated[name]: _simulated(name, model.outputs[name]) for name in fed_back}
    return _component(model, doc, "fed", body, laws, experiment)


def reals(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return those signals that are real."""
    return {name: signal for name, signal in signals.items() if signal.type == "real"}


def numbers(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return those signals that are no text."""
    return {name: signal for name, signal in signals.items() if signal.type != "string"}


def _inputs(model: Model, names: Names, inputs: Sequence[str]) -> dict[str, Any]:
    """Declare inputs as the FMU has them; one that nobody sets stays at its start value."""
    declared = {}
    for name in inputs:
        signal = model.inputs[name]
        declared[names.variables[name]] = Input(
            _unit(signal), start=float(signal.start), doc=_doc(signal), title=line(name)
        )
    return declared


def _simulated(name: str, signal: Signal) -> Any:
    """Declare what an FMU simulates of an output."""
    title = f"simulated {line(name)}"
    return Input(_unit(signal), doc=f"{name} of the FMU", title=title)


def _parameter(signal: Signal, fitted: Fitted) -> Any:
    ends = {"min": signal.min, "max": signal.max}
    finite = {name: end for name, end in ends.items() if isfinite(end)}  # a description may say NaN
    about = {"nominal": fitted.size, "doc": _doc(signal)}
    return Parameter(fitted.nominal, _unit(signal), **finite, **about)


def _change(parameter: str, at: str, slope: str) -> _Value:
    return lambda self: (getattr(self, parameter) - getattr(self, at)) * getattr(self, slope)


def _response(
    names: Names,
    output: str,
    name: str,
    response: FmuResponse,
    body: dict[str, Any],
    laws: dict[str, Any],
) -> list[_Value]:
    """Return the terms of an output by which it follows an input, linearly.

    They respond to the difference of what the FMU gets (a law of the component) from what was
    recorded (an input). The states of the response are added to `body`, and their rates to `laws`.
    """
    law, recorded = names.in_fmu[name], names.recorded[name]

    def difference(self: Any) -> Any:
        return getattr(self, law)() - getattr(self, recorded)

    stem = f"{names.variables[output]}_after_{names.variables[name]}"
    states = [f"{stem}_{k + 1}" for k in range(len(response.c))]
    for k, state in enumerate(states):
        doc = f"response of {output} to {name}"
        body[state] = State("1", rate=f"rate_of_{state}", doc=doc)
        rate = [*_products(response.a[k], states), _product(float(response.b[k]), difference)]
        named = titled(f"response of {line(output)} to {line(name)}")
        laws[f"rate_of_{state}"] = named(_sum(rate, "Rate of the state."))
    terms = _products(response.c, states)
    return [*terms, _product(response.d, difference)] if response.d else terms


def _products(amounts: Array, states: Sequence[str]) -> list[_Value]:
    return [
        _product(float(k), attrgetter(state)) for k, state in zip(amounts, states, strict=True) if k
    ]


def _named(name: str) -> _Value:
    """Return the value of a variable, or of a law."""

    def value(self: Any) -> Any:
        found = getattr(self, name)
        return found() if callable(found) else found

    return value


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
    return titled(line(name))(_sum([attrgetter(identifier)], f"What of {name} the FMU gets."))


def _component(
    model: Model,
    doc: str,
    ending: str,
    declared: Mapping[str, Any],
    laws: Mapping[str, Any],
    experiment: tuple[float, float],
) -> type[Component]:
    """Make the class of a component from its declarations and laws."""
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
    """Return the description of a signal, or its name."""
    return line(signal.doc).strip(". ") or signal.name
