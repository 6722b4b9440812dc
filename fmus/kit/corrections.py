"""What a law lacks, whichever law, of whichever signal: a shape or a table, added to it or multiplied with it.

The effects of :mod:`fmus.kit.curves` are of inputs and states; here the signal may be what another law gives, the time,
or what is remembered of any of these.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from inspect import signature
from math import inf, isfinite
from typing import Any

from .component import Component, Effect, Term
from .curves import ANY, SHAPES, coefficient, in_brackets, per
from .declare import Parameter, State
from .errors import UserError, suggestion
from .functions import absolute, smooth_table
from .memory import LAGS, MEMORIES, Of, family

KINDS = ("add", "multiply")
__all__ = ["KINDS", "MEMORIES", "Of", "correction", "family", "with_constant"]


@dataclass(frozen=True)
class _Function:
    """A function of a signal: its formula, its value for a component and x, and its own declarations by name."""

    text: str
    value: Callable[[Any, Any], Any]
    declared: dict[str, Any]


def correction(
    component: type[Component],
    law: str,
    of: Of | tuple[Any, ...],
    shape: str | Sequence[float],
    unit: str = "1",
    nominal: float = 1.0,
    kind: str = "add",
    values: Sequence[float] = (),
    fixed: bool = False,
    number: int = 1,
    beside: bool = False,
) -> type[Effect]:
    """Let a law hang on a signal.

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that is corrected, which gives one number; its arguments are passed on.
    of : Of or tuple
        The signal (x), or its attributes in order. Of a law that corrects itself it is what that law is without.
    shape : str or sequence of float
        One of :data:`~fmus.kit.curves.SHAPES`, or the knots of a table in the unit of the signal, smooth in
        between and straight on beyond them (:func:`~fmus.kit.functions.smooth_table`).
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    kind : {"add", "multiply"}
        Whether ``f(x)`` is added to the law, or the law is multiplied with ``1 + f(x)``.
    values : sequence of float, optional
        Of a table at its knots, in the unit of the law or, if multiplied, of unit 1; 0 unless given.
    fixed : bool
        Whether a table's values are constants rather than parameters.
    number : int
        Beside others of the same law, signal and memory, of which each has its own parameters.
    beside : bool
        Whether a constant stands beside the shape: ``a (f(x) + b)``.

    Returns
    -------
    type[Effect]
        With a parameter that switches it, ``<law>_of_<signal>[_<memory>][_<number>]``: the amount ``a``, of a table 1
        for all of it. Beside it, under that name, ``_width`` of a shape that has one, ``_beside`` of a constant,
        ``_at_<k>`` of a table's values, ``_memory`` of what is remembered, ``_memory_constant`` of its lag.

    Raises
    ------
    UserError
        If the component has no such law or signal, or the signal is computed from the law; if there is no such shape,
        memory or kind; if knots do not rise, or values are not as many; if a magnitude or a time constant is not
        positive.
    """
    of = _plain(of if isinstance(of, Of) else Of(*of))
    nominal = float(nominal)
    _check_choices(of, shape, kind, nominal)
    _check_laws(component, law, of)
    what = "_".join(filter(None, (of.name, of.memory, str(number) if number > 1 else "")))
    own = f"{law}_of_{what}"
    memory = f"{own}_memory"
    size, wanted = (unit, nominal) if kind == "add" else ("1", 1.0)
    if isinstance(shape, str):
        function = _shaped(law, of, shape, own, size, wanted, beside)
    else:
        shape, values = tuple(map(float, shape)), tuple(map(float, values)) or (0.0,) * len(shape)
        _check_table(shape, values)
        function = _tabulated(law, of, (shape, values), own, size, wanted, fixed)

    def now(self: Any) -> Any:
        """The signal itself; of the law that is corrected what it is without."""
        value = getattr(super(effect, self) if of.name == law else self, of.name)
        return value() if callable(value) else value

    def corrected(self: Any, *arguments: Any) -> Any:
        below = getattr(super(effect, self), law)(*arguments)
        x = getattr(self, memory) if of.memory else now(self)
        x = now(self) - x if of.memory == "leading" else x
        more = function.value(self, x)
        return below + more if kind == "add" else below * (1.0 + more)

    about = {
        "id": law,
        "term": Term(law, of.words, function.text, family(law, of.name, of.memory), what),
        "neutral": own,
        "made_by": correction,
        # plain numbers, because a Python FMU writes them down
        "made_with": (law, astuple(of), shape, unit, nominal, kind, values, fixed, number, beside),
        "assumption": f"{law} does not hang on {of.words}"
        + (" like this" if isinstance(shape, str) else ""),
        "__doc__": f"{law} hangs on {of.words}: {function.text}, "
        + ("added." if kind == "add" else "multiplied with one and it."),
        "__module__": __name__,
        law: corrected,
    }
    remembers = _remembering(law, of, memory, now) if of.memory else {}
    title = f"{own}_correction".title().replace("_", "")
    effect: type[Effect] = type(title, (Effect,), about | function.declared | remembers)
    return effect


def _plain(of: Of) -> Of:
    """The same with Python's own numbers."""
    return replace(of, constant=float(of.constant), scale=float(of.scale), start=float(of.start))


def _shaped(
    law: str, of: Of, shape: str, own: str, size: str, wanted: float, beside: bool
) -> _Function:
    """One of the shapes; ``size`` and ``wanted`` are unit and typical magnitude of its values."""
    chosen, width, constant = SHAPES[shape], f"{own}_width", f"{own}_beside"
    text = with_constant(chosen.text) if beside else chosen.text
    declared = {
        own: coefficient(
            per(size, of.unit_of_memory, chosen.power),
            wanted / of.scale**chosen.power,
            f"{text} in {law}, x being {of.counted} (a)",
        )
    }
    if chosen.width:
        begin = chosen.width * of.scale
        # a stop may be anywhere; a width is none at zero
        least = -ANY * of.scale if chosen.power else 1e-9 * of.scale
        declared[width] = Parameter(
            begin,
            of.unit_of_memory,
            min=least,
            max=1e3 * of.scale,
            nominal=begin,
            doc=f"{of.counted} at which {law} bends (w)",
        )
    if beside:
        unit, typical = _power(of.unit_of_memory, chosen.power), of.scale**chosen.power
        declared[constant] = Parameter(
            0.0,
            unit,
            min=-ANY * typical,
            max=ANY * typical,
            nominal=typical,
            doc=f"beside the shape in {law} (b)",
        )

    def value(self: Any, x: Any) -> Any:
        x = x - of.zero if of.zero else x
        form = chosen.form(x, getattr(self, width) if chosen.width else 1.0, of.scale)
        return getattr(self, own) * (form + getattr(self, constant) if beside else form)

    return _Function(text, value, declared)


def with_constant(text: str) -> str:
    """Formula of a shape with a constant beside it: ``a (x^3 + b)`` for ``a x^3``."""
    whole, *more = re.split(r"(?=, [^()]*$| with | beyond )", text.removeprefix("a "), maxsplit=1)
    inner = whole[1:-1] if whole.startswith("(") and whole.endswith(")") else whole
    return f"a ({inner} + b){''.join(more)}"


def _power(unit: str, power: float) -> str:
    """Unit of a power of what has a unit."""
    if not power or unit == "1":
        return "1"
    return in_brackets(unit) + (f"^{power:g}" if power != 1 else "")


def _tabulated(
    law: str,
    of: Of,
    points: tuple[Sequence[float], Sequence[float]],
    own: str,
    size: str,
    wanted: float,
    fixed: bool,
) -> _Function:
    """A table of knots and values, of unit ``size`` and of typical magnitude ``wanted``."""
    knots, given = points
    names = [] if fixed else [f"{own}_at_{k}" for k in range(len(knots))]
    how_much = f"how much of the table of {of.words} {law} has; 0 is without"
    declared = {own: Parameter(0.0, "1", min=-ANY, max=ANY, doc=how_much)}
    for name, x, y in zip(names, knots, given, strict=False):  # no names of what is fixed
        text = f"{law} has so much more at {of.words} = {x:g}"
        declared[name] = Parameter(
            y, size, min=-ANY * wanted, max=ANY * wanted, nominal=wanted, doc=text
        )

    def value(self: Any, x: Any) -> Any:
        values = given if fixed else [getattr(self, name) for name in names]
        return getattr(self, own) * smooth_table(x, knots, values)

    return _Function("a table", value, declared)


def _remembering(law: str, of: Of, memory: str, now: Callable[[Any], Any]) -> dict[str, Any]:
    """State that remembers, its rate, and the time constant of a lag, by name."""
    rate, constant = f"{memory}_rate", f"{memory}_constant"

    def lagging(self: Any) -> Any:
        x = now(self)
        return ((x * x if of.memory == "heat" else x) - getattr(self, memory)) / getattr(
            self, constant
        )

    def integral(self: Any) -> Any:
        x = now(self)
        return absolute(x) if of.memory == "throughput" else x

    state = State(
        of.unit_of_memory,
        rate=rate,
        start=of.start,
        nominal=of.scale,
        doc=f"{of.words}, on which {law} hangs",
    )
    if of.memory not in LAGS:
        return {memory: state, rate: integral}
    least = 1e-3 * min(of.constant, 1.0)
    lag = Parameter(
        of.constant, "s", min=least, max=1e9, nominal=of.constant, doc=f"lag of {of.name}"
    )
    return {memory: state, rate: lagging, constant: lag}


def _check_choices(of: Of, shape: str | Sequence[float], kind: str, nominal: float) -> None:
    for what, given, allowed in (("memory", of.memory, MEMORIES), ("kind", kind, KINDS)):
        if given not in allowed:
            raise UserError(
                f"no {what} named {given!r}{suggestion(given, list(filter(None, allowed)))}"
            )
    if isinstance(shape, str) and shape not in SHAPES:
        raise UserError(f"no shape named {shape!r}{suggestion(shape, SHAPES)}")
    sizes = {f"typical magnitude of {of.name}": of.scale, "typical magnitude of the law": nominal}
    if of.memory in LAGS:
        sizes["time constant of a lag"] = of.constant
    for what, size in sizes.items():
        if not 0.0 < size < inf:
            raise UserError(f"{what} must be positive, which {size:g} is not")
    if not isfinite(of.start):
        raise UserError(
            f"what is remembered of {of.name} at first must be a number, which {of.start:g} is not"
        )


def _check_table(knots: Sequence[float], values: Sequence[float]) -> None:
    if not knots or not all(a < b for a, b in zip((-inf, *knots), (*knots, inf), strict=True)):
        raise UserError(f"knots of a table must rise, which {list(knots)} do not")
    if len(values) != len(knots):
        raise UserError(f"a table of {len(knots)} knots has as many values, not {len(values)}")
    if not all(map(isfinite, values)):
        raise UserError(f"values of a table must be numbers, which {list(values)} are not")


def _check_laws(component: type[Component], law: str, of: Of) -> None:
    layout, label = component.layout, component.name or component.__name__
    laws = list(_laws(component))
    if law not in laws:
        raise UserError(f"{label}: no law named {law!r}{suggestion(law, laws)}")
    known = [v.name for v in (*layout.inputs, *layout.states, *layout.discretes)] + ["time"]
    if of.name not in (*known, *laws):
        raise UserError(
            f"{label}: no input, state or law named {of.name!r}{suggestion(of.name, [*known, *laws])}"
        )
    for name in {law, of.name} - set(known):
        arguments = len(signature(getattr(component, name)).parameters) - 1
        if arguments and name == of.name:
            raise UserError(f"{label}: {name} takes arguments, and is no signal")
        if not arguments and isinstance(_asked(component, name)[0], Sequence):
            raise UserError(f"{label}: {name} gives several numbers, not one")
    if (
        of.name not in known
        and of.name != law
        and of.memory in ("", "leading")
        and _asked(component, of.name, law)[1]
    ):
        raise UserError(f"{label}: {law} cannot hang on {of.name}, which is computed from it")


def _laws(component: type[Component]) -> Iterator[str]:
    """Names of methods that the component has beyond what every component has."""
    every = set(dir(Component))
    return (
        name for name in dir(component) if name not in every and callable(getattr(component, name))
    )


def _asked(component: type[Component], law: str, other: str = "") -> tuple[Any, bool]:
    """Value of a law at the defaults, None where there is none, and whether it calls another law for it."""
    called = False

    def spy(self: Any, *arguments: Any) -> Any:
        nonlocal called
        called = True
        return getattr(super(seen, self), other)(*arguments)

    about: dict[str, Any] = {"__module__": component.__module__}
    seen = type(component.__name__, (component,), about | ({other: spy} if other else {}))
    value = None
    with suppress(
        ArithmeticError, AttributeError
    ):  # at its defaults it may divide by zero, or lack a law
        value = getattr(seen(), law)()
    return value, called
