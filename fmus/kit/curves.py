"""Curves: effects that add a function of one signal, chosen from a table of shapes, to a law.

Examples are friction over velocity, a spring's force over its elongation and a voltage over charge,
where a model assumes a straight line. At the neutral value of the first parameter the law gives the
bits of the base model. :mod:`fmus.kit.generic` has the curves with established names. Stribeck's
curve is that of Armstrong-Hélouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and
compensation methods for the control of machines with friction, Automatica 30(7), 1994; the weir is
Poleni's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .component import Component
from .declare import Constant, Declaration, Parameter
from .effects import Effect, Size, Term, effect_maker, make_effect
from .errors import UserError, find
from .functions import absolute, clip, exp, maximum, minimum, sqrt, tanh, where
from .layout import law_of
from .titles import generic_title, law_title

ANY = 1e12  # bound of parameters that may have any value, in nominal values
_STEEPEST = 30.0  # exponent at which an exponential is cut off, about 1e13
_ROUND = 1e-6  # fraction of the nominal signal below which a square root is nearly linear
_STEEP = 10.0  # steepness of a smooth sign, relative to the width of its shape
_SHARP = 0.01  # width of the smooth sign of a velocity, relative to its typical magnitude
# Least width, relative likewise. A narrower bend is a step in any record, and no integrator follows
# it to the accuracy of an FMU.
_SHARPEST = 1e-4
# z^2 below which tanh(z)/z is computed from its series; the truncation error is below rounding, and
# that of the slope below 1e-12.
_SMALL = 1e-6
# quotients of units with a name of their own
_NAMED_QUOTIENTS = {
    ("V", "A"): "ohm",
    ("A", "V"): "S",
    ("C", "V"): "F",
    ("C", "s"): "A",
    ("J", "s"): "W",
}
# shapes whose size is given as their value at a typical signal, as no rig shows the coefficient
_GROWING = ("quadratic", "odd_quadratic", "cubic", "quartic", "square_root")


def tanhc(square: Any) -> Any:
    """Return ``tanh(z) / z`` for ``z^2``: 1 at zero, with a slope by ``z^2``."""
    small = square < _SMALL
    z = sqrt(where(small, 1.0, square))  # the root is not differentiable at zero
    series = 1.0 - square * (1.0 / 3.0 - square * (2.0 / 15.0))
    return where(small, series, tanh(z) / z)


@dataclass(frozen=True)
class Shape:
    """A function of a signal, ``a f(x / w)``.

    Attributes
    ----------
    form : callable
        Value of ``f``, from the signal, its width ``w`` and its nominal value.
    power : float
        Power of the signal's unit in the unit of ``f``; 0 if ``f`` has no unit.
    width : float
        Start value of ``w`` in a fit, in typical magnitudes of the signal; 0 if there is no width.
    text : str
        The formula, for people; n is the nominal signal, because units have whole powers in FMI.
    least : float
        Lower bound of ``a``, in nominal values.
    bend : str
        Phrase for the behaviour at ``w``, with a place for its value; empty if none is visible.
    """

    form: Callable[[Any, Any, float], Any]
    power: float
    width: float
    text: str
    least: float = -ANY
    bend: str = ""


SHAPES: dict[str, Shape] = {
    "linear": Shape(lambda x, w, s: x, 1, 0.0, "a x"),
    "asymmetric": Shape(lambda x, w, s: absolute(x), 1, 0.0, "a |x|"),
    "quadratic": Shape(lambda x, w, s: x * x, 2, 0.0, "a x^2"),
    "odd_quadratic": Shape(lambda x, w, s: x * absolute(x), 2, 0.0, "a x |x|"),
    "cubic": Shape(lambda x, w, s: x * (x * x), 3, 0.0, "a x^3"),
    "quartic": Shape(lambda x, w, s: (x * x) * (x * x), 4, 0.0, "a x^4"),
    "saturating": Shape(
        lambda x, w, s: tanh(x / w), 0, 1.0, "a tanh(x / w)", bend="levels off beyond about {}"
    ),
    "sign": Shape(lambda x, w, s: tanh(x / w), 0, _SHARP, "a tanh(x / w), w small", 0.0),
    "sign_beyond": Shape(
        lambda x, w, s: 0.5 * (tanh(_STEEP * (x / w - 1.0)) + tanh(_STEEP * (x / w + 1.0))),
        0,
        0.5,
        "a sign(x) beyond |x| = w, smooth",
        bend="sets in beyond {} on either side",
    ),
    "levelling": Shape(
        lambda x, w, s: x - w * tanh(x / w),
        1,
        0.5,
        "a (x - w tanh(x / w))",
        bend="sets in beyond about {} on either side",
    ),
    "exponential": Shape(
        lambda x, w, s: exp(minimum(x / w, _STEEPEST)) - 1.0,
        0,
        1.0,
        "a (exp(x / w) - 1)",
        bend="grows e times with every {}",
    ),
    "square_root": Shape(
        lambda x, w, s: x / sqrt(absolute(x) / s + _ROUND), 1, 0.0, "a x / sqrt(|x| / n)"
    ),
    "stribeck": Shape(
        lambda x, w, s: tanh(_STEEP * x / w) * exp(-minimum((x / w) * (x / w), _STEEPEST)),
        0,
        0.1,
        "a sign(x) exp(-(x / w)^2), smooth",
        0.0,
        bend="falls off beyond about {}",
    ),
    "stops": Shape(
        lambda x, w, s: x - clip(x, -w, w),
        1,
        0.5,
        "a (x - clip(x, -w, w))",
        0.0,
        bend="sets in beyond {} on either side",
    ),
    "weir": Shape(
        lambda x, w, s: maximum(x - w, 0.0) * sqrt(maximum(x - w, 0.0) / s + _ROUND),
        1,
        0.5,
        "a e sqrt(e / n) with e = max(x - w, 0)",
        0.0,
        bend="sets in above {}",
    ),
    "upper_stop": Shape(
        lambda x, w, s: maximum(x - w, 0.0), 1, 0.5, "a max(x - w, 0)", bend="sets in above {}"
    ),
    "lower_stop": Shape(
        lambda x, w, s: minimum(x + w, 0.0), 1, 0.5, "a min(x + w, 0)", bend="sets in below {}"
    ),
}


@dataclass(frozen=True)
class EffectNames:
    """The names of an effect that is made for a law; empty ones are replaced by default names.

    Attributes
    ----------
    id : str
        Id of the effect.
    variables : tuple of str
        Names of its variables, first of the parameter that switches it.
    qualifier : str
        Distinguishes the effect from the same effect on another law.
    """

    id: str = ""
    variables: tuple[str, ...] = ()
    qualifier: str = ""

    def with_defaults(self, id: str, variables: tuple[str, ...]) -> EffectNames:
        """Return the names with defaults for an empty id and for the missing last variables."""
        missing = variables[len(self.variables) :]
        return EffectNames(self.id or id, (*self.variables, *missing), self.qualifier)


@effect_maker
def curve(
    component: type[Component],
    law: str,
    signal: str,
    shape: str,
    unit: str = "1",
    nominal: float = 1.0,
    *,
    scale: float | None = None,
    names: EffectNames | None = None,
) -> type[Effect]:
    """Make an effect that adds a shape of one signal to a law: law + a f(x; w).

    Parameters
    ----------
    component : type[Component]
        Has the law and the signal.
    law : str
        Method that the shape is added to.
    signal : str
        Input or state that is the argument of the shape (x).
    shape : str
        One of `SHAPES`.
    unit : str
        SI unit of the law.
    nominal : float
        Typical magnitude of the law.
    scale : float, optional
        Typical magnitude of the signal; by default its nominal value.
    names : EffectNames, optional
        Names of the effect, of ``a`` and of ``w``. By default the effect has the name of the shape,
        and its parameters are ``<law>_<shape>`` and ``<law>_<shape>_width``.

    Returns
    -------
    type[Effect]
        With a parameter for ``a``, which switches it, and one for the width ``w`` if the shape has
        one.

    Raises
    ------
    UserError
        If the component has no such law or signal, or there is no such shape.
    """
    definition = find(shape, SHAPES, "no shape")
    argument = variable(component, signal)
    size = scale or argument.nominal
    defaults = (f"{law}_{shape}", f"{law}_{shape}_width")
    full = (names or EffectNames()).with_defaults(shape, defaults)
    amount, width = full.variables
    typical = Constant(argument.nominal, argument.unit)

    def value(self: Any) -> Any:
        x = getattr(self, signal)
        w = getattr(self, width) if definition.width else 1.0
        return getattr(self, amount) * definition.form(x, w, typical)

    members: dict[str, Any] = {
        "__doc__": f"Adds to {law}: {definition.text} with x = {signal}; a = 0 is the base model.",
        amount: coefficient(
            per(unit, argument.unit, definition.power),
            nominal / size**definition.power,
            f"part {definition.text} of {law}, x being {signal} (a)",
            least=definition.least,
        ),
    }
    if definition.width:
        doc = f"{signal} at which {law} bends (w)"
        members[width] = width_parameter(definition, argument.unit, size, doc)
    sizes = []
    if shape in _GROWING:

        def unit_value(x: float) -> Any:
            return definition.form(x, 1.0, typical)

        sizes.append(size_at(amount, unit, size, argument.unit, unit_value))
    else:
        sizes.append(Size("{}", (amount,)))
    if definition.bend:
        at_bend = (lambda w: -w) if shape == "lower_stop" else (lambda w: w)
        sizes.append(Size(definition.bend, (width,), argument.unit, at_bend))
    return additive_effect(
        component,
        law,
        value,
        members,
        id=full.id,
        term=Term(law, signal, definition.text, f"{law} over {signal}", full.qualifier),
        title=generic_title(full.id, law_title(component, law)),
        assumption=f"{law} has no part {definition.text} with x = {signal}",
        sizes=tuple(sizes),
    )


def size_at(
    amount: str, unit: str, typical: float, unit_of_x: str, form: Callable[[float], Any]
) -> Size:
    """Return the size of an effect as its value at a typical value of its signal.

    Parameters
    ----------
    amount : str
        Parameter that the value is proportional to.
    unit : str
        Unit of the law.
    typical : float
        Typical value of the signal; it is rounded to two digits.
    unit_of_x : str
        Unit of the signal.
    form : callable
        Value of the effect per amount, from the value of the signal.
    """
    x = float(f"{typical:.2g}")
    place = f"{x:g}" if unit_of_x == "1" else f"{x:g} {unit_of_x}"
    return Size(f"{{}} more at {place}", (amount,), unit, lambda a: a * form(x))


def variable(component: type[Component], name: str) -> Declaration:
    """Return the input or state of a name; raise a UserError if the component has none."""
    layout = component.layout
    known = {v.name: v for v in (*layout.inputs, *layout.states, *layout.discretes)}
    return find(name, known, f"{_label(component)}: no input or state")


def coefficient(unit: str, nominal: float, doc: str, least: float = -ANY) -> Any:
    """Declare the parameter that switches an effect, which is off at 0."""
    return Parameter(
        0.0,
        unit,
        min=least * nominal,
        max=ANY * nominal,
        nominal=nominal,
        doc=f"{doc}; 0 is without",
    )


def width_parameter(shape: Shape, unit: str, size: float, doc: str) -> Any:
    """Declare the width of a shape of a signal that has this unit and this typical magnitude."""
    start = shape.width * size
    # a stop may be anywhere, but the width of a bend must be positive
    least = -ANY * size if shape.power else _SHARPEST * size
    return Parameter(start, unit, min=least, max=1e3 * size, nominal=start, doc=doc)


def in_brackets(unit: str) -> str:
    """Return a unit in brackets, unless it is a single name, for use in a product or a power."""
    return f"({unit})" if set(unit) & set("/*^") else unit


def per(unit: str, below: str, power: float = 1) -> str:
    """Return the unit of a quantity divided by a power of another."""
    if not power or below == "1":
        return unit
    if power == 1 and (unit, below) in _NAMED_QUOTIENTS:
        return _NAMED_QUOTIENTS[unit, below]
    return f"{in_brackets(unit)}/{in_brackets(below)}" + (f"^{power:g}" if power != 1 else "")


def additive_effect(
    component: type[Component],
    law: str,
    value: Callable[[Any], Any],
    members: Mapping[str, Any],
    **about: Any,
) -> type[Effect]:
    """Make an effect that adds a value to a law.

    Parameters
    ----------
    component : type[Component]
        Has the law.
    law : str
    value : callable
        Returns the value to add, from the component instance.
    members : Mapping of str to object
        Further members of the class, with its docstring; the first parameter switches the effect.
    **about
        Description of the effect, with its id; see `make_effect`.

    Raises
    ------
    UserError
        If the component has no such law.
    """
    if law_of(component, law) is None:
        raise UserError(f"{_label(component)}: no law named {law!r}")

    # `effect` is assigned below, before the first call
    def sum_with_value(self: Any) -> Any:
        return getattr(super(effect, self), law)() + value(self)

    switch = next(name for name, member in members.items() if isinstance(member, Declaration))
    effect = make_effect(
        f"{about['id']}_of_{law}".title().replace("_", ""),
        {"__module__": __name__, **members, law: sum_with_value},
        **{"term": Term(law), "neutral": switch, **about},
    )
    return effect


def _label(component: type[Component]) -> str:
    """Return the name of a component for messages."""
    return component.name or component.__name__
