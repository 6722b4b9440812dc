"""Names for people of effects, laws and variables; tools and options use their identifiers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from .component import Component
from .effects import Effect

_L = TypeVar("_L", bound=Callable[..., Any])
# titles of generic effects and of shapes, by id
_GENERIC = {
    "asymmetric_dead_zone": "A dead zone with unequal ends",
    "asymmetric": "A part that is the same in both directions",
    "asymmetric_friction": "Friction that differs in the two directions",
    "backlash": "Play",
    "coulomb_friction": "Dry friction",
    "dead_zone": "A dead zone",
    "input_lag": "A late arrival",
    "input_offset": "An offset",
    "input_saturation": "A saturation",
    "lagging": "A part that lags",
    "levelling": "A flat middle",
    "linear": "A straight part",
    "saturating": "A part that levels off",
    "sign": "A step at zero",
    "sign_beyond": "A step beyond a dead zone",
    "stops": "Stops at both ends",
    "stribeck_friction": "Friction that falls with speed, after Stribeck",
    "warming": "A part that rises as it warms",
}
_ADJECTIVES = ("ic", "ial", "root")


def in_words(identifier: str) -> str:
    """Write an identifier as words: ``film voltage`` for ``film_voltage``."""
    return identifier.replace("_", " ").strip()


def capitalised(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def within_sentence(title: str) -> str:
    """Return a title with a small first letter, unless it starts with an abbreviation (RC)."""
    return title if title[1:2].isupper() else title[:1].lower() + title[1:]


def titled(title: str) -> Callable[[_L], _L]:
    """Set the name for people of the decorated law.

    Parameters
    ----------
    title : str
        A noun phrase, such as ``"voltage across the actuator"``.

    Returns
    -------
    callable
        Decorator that returns the law itself.
    """

    def declare(law: _L) -> _L:
        law.__dict__["title"] = title
        return law

    return declare


def effect_title(effect: type[Effect]) -> str:
    """Return the title of an effect, or by default its id in words."""
    of_output = f" of {in_words(effect.output)}" if effect.output else ""
    return effect.title or f"{in_words(effect.id)}{of_output}"


def generic_title(identifier: str, subject: str) -> str:
    """Return the title of a generic effect from its id and the title of its law or input."""
    known = _GENERIC.get(identifier)
    if known is not None:
        return f"{known} in {subject}"
    article = "An" if identifier[0] in "aeiou" else "A"
    kind = in_words(identifier)
    noun = "" if " " in kind or not identifier.endswith(_ADJECTIVES) else " part"
    return f"{article} {kind}{noun} in {subject}"


def variable_title(variable: Any) -> str:
    """Return the title of a declaration or of a variable of an FMU, or its name in words."""
    return getattr(variable, "title", "") or in_words(variable.name)


def law_title(component: type[Component], law: str) -> str:
    """Return the title of a law, an input, an output or a state of a component.

    Parameters
    ----------
    component : type[Component]
    law : str

    Returns
    -------
    str
        Title from the nearest class that declares one, or by default the identifier in words.
    """
    for part in component.__mro__:
        member = vars(part).get("declared", {}).get(law) or vars(part).get(law)
        title = getattr(member, "title", "")
        if title and isinstance(title, str):
            return title
    return in_words(law)
