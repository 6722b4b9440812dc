"""Corrections: effects that add a function of a signal to a law, or multiply the law with it.

The function is a shape or a table. Its argument is an input or a state as in
:mod:`fmus.kit.curves`, the value of another law, the time, or a memory of any of these.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from inspect import signature
from math import inf, isfinite
from typing import Any

from .component import Component
from .curves import ANY, SHAPES, coefficient, in_brackets, per, width_parameter
from .declare import Constant, Parameter, State
from .effects import Effect, Term, make_effect
from .errors import UserError, suggestion
from .functions import absolute, smooth_table
from .layout import law_of
from .titles import capitalised, in_words, law_title

KINDS = ("add", "multiply")
MEMORIES = ("", "lagged", "leading", "heat", "integrated", "throughput")
LAGS = ("lagged", "leading", "heat")
# family of effects by the memory of the signal; the default is "remembering {}"
_FAMILIES = {"": "over {}", "heat": "over temperature", "throughput": "over throughput"}


@dataclass(frozen=True)
class SignalTerm:
    """A signal that a law depends on, or a memory of it.

    Attributes
    ----------
    name : str
        Input, state, law, or ``time``.
    memory : {"", "lagged", "leading", "heat", "integrated", "throughput"}
        In this order: the signal itself; the signal after a lag of first order; the signal less its
        lagged value; its square after a lag, like heat; its integral; the integral of its modulus.
    constant : float
        Time constant of the lag, s.
    unit : str
        SI unit of the signal itself.
    scale : float
        Typical magnitude of the remembered value.
    start : float
        Start value of the remembered value.
    zero : float
        Origin of the argument of shapes, for signals such as an absolute temperature, which are
        never near zero.
    """

    name: str
    memory: str = ""
    constant: float = 0.0
    unit: str = "1"
    scale: float = 1.0
    start: float = 0.0
    zero: float = 0.0

    @property
    def label(self) -> str:
        """Description for people, with the time constant."""
        lag = f" by {self.constant:.3g} s" if self.constant else ""
        words = {
            "lagged": f" lagged{lag}",
            "leading": f" less itself lagged{lag}",
            "heat": f" squared, lagged{lag}",
            "integrated": " integrated",
            "throughput": " integrated in modulus",
        }
        return self.name + words.get(self.memory, "")

    @property
    def words(self) -> str:
        """Description for people without the time constant, which is a parameter of the effect."""
        return replace(self, constant=0.0).label

    @property
    def counted(self) -> str:
        """Description of the argument x of a shape."""
        return self.words + (f" less {self.zero:g}" if self.zero else "")

    @property
    def unit_of_memory(self) -> str:
        """SI unit of the remembered value."""
        if self.memory in ("integrated", "throughput"):
            return "s" if self.unit == "1" else f"({self.unit})*s"
        if self.memory == "heat" and self.unit != "1":
            return f"({self.unit})^2"
        return self.unit


@dataclass(frozen=True)
class SmoothTable:
    """A function given by its values at knots.

    It is smooth in between and straight beyond them (:func:`~fmus.kit.functions.smooth_table`).

    Attributes
    ----------
    knots : sequence of float, shape (k,)
        Strictly increasing, in the unit of the signal.
    values : sequence of float, shape (k,)
        In the unit of the law, or without a unit if the law is multiplied; by default 0.
    fixed : bool
        Whether the values are constants rather than parameters.
    """

    knots: Sequence[float]
    values: Sequence[float] = ()
    fixed: bool = False


@dataclass(frozen=True)
class _CorrectedLaw:
    """A law that a function corrects, with the unit and the size of the function's values.

    Attributes
    ----------
    law : str
    switch : str
        Name of the parameter that switches the effect; other names begin with it.
    unit : str
        Unit of the function's values: that of the law, or 1 if the law is multiplied.
    nominal : float
        Typical magnitude of the function's values.
    """

    law: str
    switch: str
    unit: str
    nominal: float


@dataclass(frozen=True)
class _Function:
    """A function of a signal that corrects a law.

    Attributes
    ----------
    text : str
        Formula, for people.
    value : callable
        Value of the function, from the component instance and x.
    declared : dict of str to object
        Declarations of its parameters, by name.
    """

    text: str
    value: Callable[[Any, Any], Any]
    declared: dict[str, Any]


def effect_family(law: str, signal: str, memory: str = "") -> str:
    """Return the family (:class:`~fmus.kit.effects.Term`) of an effect of a signal on a law.

    The memories ``heat`` and ``throughput`` have families of their own, for any signal.
    """
    return f"{law} {_FAMILIES.get(memory, 'remembering {}').format(signal)}"


def correction(
    component: type[Component],
    law: str,
    signal: SignalTerm,
    shape: str | SmoothTable,
    unit: str = "1",
    nominal: float = 1.0,
    *,
    kind: str = "add",
    number: int = 1,
    beside: bool = False,
) -> type[Effect]:
    """Make an effect by which a law depends on a signal.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method to correct, which returns one number; its arguments are passed on.
    signal : SignalTerm
        The signal (x). For the corrected law itself, x is its value without the correction.
    shape : str or SmoothTable
        One of :data:`~fmus.kit.curves.SHAPES`, or a table.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    kind : {"add", "multiply"}
        Whether ``f(x)`` is added to the law, or the law is multiplied with ``1 + f(x)``.
    number : int
        Distinguishes the parameters of several corrections of the same law, signal and memory.
    beside : bool
        Whether a constant is added to the shape: ``a (f(x) + b)``.

    Returns
    -------
    type[Effect]
        With a parameter that switches it, ``<law>_of_<signal>[_<memory>][_<number>]``: the amount
        ``a``, which for a table is 1 for the whole table. The names of further variables begin with
        it and end in ``_width`` (of a shape that has one), ``_beside`` (the constant), ``_at_<k>``
        (a value of a table), ``_memory`` (the remembered value) and ``_memory_constant`` (its lag).

    Raises
    ------
    UserError
        If the component has no such law or signal, or the signal is computed from the law; if there
        is no such shape, memory or kind; if knots do not increase or differ in number from the
        values; if a magnitude or a time constant is not positive.
    """
    source = _with_python_floats(signal)
    size = float(nominal)
    _check_choices(source, shape, kind, size)
    _check_law_and_signal(component, law, source)
    suffix = "_".join(filter(None, (source.name, source.memory, str(number) if number > 1 else "")))
    switch = f"{law}_of_{suffix}"
    values = (unit, size) if kind == "add" else ("1", 1.0)
    target = _CorrectedLaw(law, switch, *values)
    plain_shape: str | SmoothTable
    if isinstance(shape, str):
        plain_shape = shape
        function = _shape_function(target, source, shape, beside)
    else:
        plain_shape = _complete_table(shape)
        function = _table_function(target, source, plain_shape)
    memory = f"{switch}_memory"

    def signal_value(self: Any) -> Any:
        """Return the signal itself; for the corrected law, its value without the correction."""
        value = getattr(super(effect, self) if source.name == law else self, source.name)
        return value() if callable(value) else value

    def argument(self: Any) -> Any:
        if not source.memory:
            return signal_value(self)
        remembered = getattr(self, memory)
        return signal_value(self) - remembered if source.memory == "leading" else remembered

    def corrected(self: Any, *arguments: Any) -> Any:
        base = getattr(super(effect, self), law)(*arguments)
        value = function.value(self, argument(self))
        return base + value if kind == "add" else base * (1.0 + value)

    body = {
        "__doc__": (
            f"{law} hangs on {source.words}: {function.text}, "
            + ("added." if kind == "add" else "multiplied with one and it.")
        ),
        "__module__": __name__,
        law: corrected,
    }
    memory_members = _memory_members(law, source, memory, signal_value) if source.memory else {}
    family = effect_family(law, source.name, source.memory)
    effect = make_effect(
        f"{switch}_correction".title().replace("_", ""),
        body | function.declared | memory_members,
        id=law,
        title=f"{capitalised(law_title(component, law))} that depends on {in_words(source.words)}",
        term=Term(law, source.words, function.text, family, suffix),
        neutral=switch,
        assumption=(
            f"{law} does not hang on {source.words}"
            + (" like this" if isinstance(plain_shape, str) else "")
        ),
        made_by=correction,
        made_with={
            "law": law,
            "signal": source,
            "shape": plain_shape,
            "unit": unit,
            "nominal": size,
            "kind": kind,
            "number": number,
            "beside": beside,
        },
    )
    return effect


def _with_python_floats(signal: SignalTerm) -> SignalTerm:
    """Return a signal with Python floats, because a Python FMU contains their ``repr``."""
    return replace(
        signal,
        constant=float(signal.constant),
        scale=float(signal.scale),
        start=float(signal.start),
    )


def _complete_table(table: SmoothTable) -> SmoothTable:
    """Return a table with Python floats and a value at every knot."""
    knots = tuple(map(float, table.knots))
    values = tuple(map(float, table.values)) or (0.0,) * len(knots)
    _check_table(knots, values)
    return SmoothTable(knots, values, table.fixed)


def _shape_function(
    target: _CorrectedLaw, signal: SignalTerm, shape: str, beside: bool
) -> _Function:
    """Return the function ``a f(x)``, or ``a (f(x) + b)``, where ``f`` is one of the shapes.

    It declares the coefficient ``a``, the width ``w`` of a shape that has one, and ``b``.
    """
    definition = SHAPES[shape]
    law = target.law
    switch = target.switch
    width = f"{switch}_width"
    constant = f"{switch}_beside"
    text = with_constant(definition.text) if beside else definition.text
    scale = Constant(signal.scale, signal.unit_of_memory)
    typical = signal.scale**definition.power
    declared = {
        switch: coefficient(
            per(target.unit, signal.unit_of_memory, definition.power),
            target.nominal / typical,
            f"{text} in {law}, x being {signal.counted} (a)",
        )
    }
    if definition.width:
        doc = f"{signal.counted} at which {law} bends (w)"
        declared[width] = width_parameter(definition, signal.unit_of_memory, signal.scale, doc)
    if beside:
        declared[constant] = Parameter(
            0.0,
            _power_of_unit(signal.unit_of_memory, definition.power),
            min=-ANY * typical,
            max=ANY * typical,
            nominal=typical,
            doc=f"beside the shape in {law} (b)",
        )

    def value(self: Any, x: Any) -> Any:
        argument = x - signal.zero if signal.zero else x
        w = getattr(self, width) if definition.width else 1.0
        form = definition.form(argument, w, scale)
        return getattr(self, switch) * (form + getattr(self, constant) if beside else form)

    return _Function(text, value, declared)


def with_constant(text: str) -> str:
    """Return the formula of a shape plus a constant: ``a (x^3 + b)`` for ``a x^3``."""
    # words after the formula, such as ", smooth" or " beyond |x| = w", stay outside the brackets
    formula, *words = re.split(
        r"(?=, [^()]*$| with | beyond )", text.removeprefix("a "), maxsplit=1
    )
    inner = formula[1:-1] if formula.startswith("(") and formula.endswith(")") else formula
    return f"a ({inner} + b){''.join(words)}"


def _power_of_unit(unit: str, power: float) -> str:
    """Return a power of a unit."""
    if not power or unit == "1":
        return "1"
    return in_brackets(unit) + (f"^{power:g}" if power != 1 else "")


def _table_function(target: _CorrectedLaw, signal: SignalTerm, table: SmoothTable) -> _Function:
    """Return the function of a table; unless fixed, its values are declared as parameters."""
    law = target.law
    switch = target.switch
    names = [f"{switch}_at_{k}" for k in range(len(table.knots))]
    doc = f"how much of the table of {signal.words} {law} has; 0 is without"
    declared = {switch: Parameter(0.0, "1", min=-ANY, max=ANY, doc=doc)}
    if not table.fixed:
        for name, x, y in zip(names, table.knots, table.values, strict=True):
            declared[name] = Parameter(
                y,
                target.unit,
                min=-ANY * target.nominal,
                max=ANY * target.nominal,
                nominal=target.nominal,
                doc=f"{law} has so much more at {signal.words} = {x:g}",
            )

    def value(self: Any, x: Any) -> Any:
        ys = table.values if table.fixed else [getattr(self, name) for name in names]
        return getattr(self, switch) * smooth_table(x, table.knots, ys)

    return _Function("a table", value, declared)


def _memory_members(
    law: str, signal: SignalTerm, memory: str, signal_value: Callable[[Any], Any]
) -> dict[str, Any]:
    """Declare the state of a memory, with its rate and, for a lag, the time constant, by name.

    The value of the signal is `signal_value`, from the component instance.
    """
    rate = f"{memory}_rate"
    constant = f"{memory}_constant"

    def lag_rate(self: Any) -> Any:
        x = signal_value(self)
        target = x * x if signal.memory == "heat" else x
        return (target - getattr(self, memory)) / getattr(self, constant)

    def integral_rate(self: Any) -> Any:
        x = signal_value(self)
        return absolute(x) if signal.memory == "throughput" else x

    state = State(
        signal.unit_of_memory,
        rate=rate,
        start=signal.start,
        nominal=signal.scale,
        doc=f"{signal.words}, on which {law} hangs",
    )
    if signal.memory not in LAGS:
        return {memory: state, rate: integral_rate}
    lag = Parameter(
        signal.constant,
        "s",
        min=1e-3 * min(signal.constant, 1.0),
        max=1e9,
        nominal=signal.constant,
        doc=f"lag of {signal.name}",
    )
    return {memory: state, rate: lag_rate, constant: lag}


def _check_choices(signal: SignalTerm, shape: str | SmoothTable, kind: str, nominal: float) -> None:
    """Raise an error unless memory, kind and shape exist and magnitudes are positive numbers."""
    for title, given, allowed in (("memory", signal.memory, MEMORIES), ("kind", kind, KINDS)):
        if given not in allowed:
            known = list(filter(None, allowed))
            raise UserError(f"no {title} named {given!r}{suggestion(given, known)}")
    if isinstance(shape, str) and shape not in SHAPES:
        raise UserError(f"no shape named {shape!r}{suggestion(shape, SHAPES)}")
    sizes = {
        f"typical magnitude of {signal.name}": signal.scale,
        "typical magnitude of the law": nominal,
    }
    if signal.memory in LAGS:
        sizes["time constant of a lag"] = signal.constant
    for title, size in sizes.items():
        if not 0.0 < size < inf:
            raise UserError(f"{title} must be positive, which {size:g} is not")
    if not isfinite(signal.start):
        raise UserError(
            f"start value of the memory of {signal.name} must be a number, which"
            f" {signal.start:g} is not"
        )


def _check_table(knots: Sequence[float], values: Sequence[float]) -> None:
    """Raise an error unless knots increase and there is a finite value at each."""
    if not knots or not all(a < b for a, b in zip((-inf, *knots), (*knots, inf), strict=True)):
        raise UserError(f"knots of a table must rise, which {list(knots)} do not")
    if len(values) != len(knots):
        raise UserError(f"a table of {len(knots)} knots has as many values, not {len(values)}")
    if not all(map(isfinite, values)):
        raise UserError(f"values of a table must be numbers, which {list(values)} are not")


def _check_law_and_signal(component: type[Component], law: str, signal: SignalTerm) -> None:
    """Raise an error unless law and signal exist, are single numbers, and form no loop."""
    layout = component.layout
    label = component.name or component.__name__
    laws = _laws_by_name(component)
    if law not in laws:
        raise UserError(f"{label}: no law named {law!r}{suggestion(law, laws)}")
    variables = [v.name for v in (*layout.inputs, *layout.states, *layout.discretes)] + ["time"]
    known = [*variables, *laws]
    if signal.name not in known:
        raise UserError(
            f"{label}: no input, state or law named {signal.name!r}{suggestion(signal.name, known)}"
        )
    for name in {law, signal.name} - set(variables):  # the laws among the two
        arguments = len(signature(laws[name]).parameters) - 1
        if arguments and name == signal.name:
            raise UserError(f"{label}: {name} takes arguments, and is no signal")
        if not arguments and isinstance(_value_at_defaults(component, name), Sequence):
            raise UserError(f"{label}: {name} gives several numbers, not one")
    is_other_law = signal.name not in variables and signal.name != law
    passes_at_once = signal.memory in ("", "leading")
    if is_other_law and passes_at_once and _calls(component, signal.name, law):
        raise UserError(f"{label}: {law} cannot hang on {signal.name}, which is computed from it")


def _laws_by_name(component: type[Component]) -> dict[str, Callable[..., Any]]:
    """Return the methods of a component that its base class does not have, by name."""
    methods = {name: law_of(component, name) for name in dir(component)}
    return {n: law for n, law in methods.items() if law is not None and not hasattr(Component, n)}


def _value_at_defaults(component: type[Component], law: str) -> Any:
    """Return the value of a law at the defaults; None if it cannot be evaluated there."""
    # at its defaults a law may divide by zero, or lack another
    with suppress(ArithmeticError, AttributeError):
        return getattr(component(), law)()
    return None


def _calls(component: type[Component], law: str, other: str) -> bool:
    """Return whether a law calls another one, evaluated at the defaults."""
    is_called = False

    def recorded(self: Any, *arguments: Any) -> Any:
        nonlocal is_called
        is_called = True
        return getattr(super(recording, self), other)(*arguments)

    body: dict[str, Any] = {"__module__": component.__module__, other: recorded}
    recording = type(component.__name__, (component,), body)
    _value_at_defaults(recording, law)
    return is_called
