"""The check of a loaded component: its laws accept symbols, and their units are consistent.

Rates, updates and outputs are evaluated once on numbers that have a unit and no value. An error is
a mistake of the author; the message gives the line and a remedy.
"""

from __future__ import annotations

import linecache
import re
import traceback
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple
from weakref import WeakSet

import fmus.kit as kit
from fmus.kit import units
from fmus.kit.component import Component
from fmus.kit.errors import UserError, suggestion
from fmus.kit.layout import law_of
from fmus.kit.symbolic.laws import RequiredUnit, required_units
from fmus.kit.symbolic.symbols import ANY, LawError, ScaleError, Symbol, ValueNeeded, check_number

_KIT = Path(kit.__file__).parent
_checked: WeakSet[type[Component]] = WeakSet()
# pattern of code that needs the value of a number -> remedy; a message has all that apply to a line
_INSTEAD = {
    r"\bmax\(": "maximum(a, b) for max(a, b)",
    r"\bmin\(": "minimum(a, b) for min(a, b)",
    r"\band\b": "logical_and(a, b) for a and b",
    r"\bor\b": "logical_or(a, b) for a or b",
    r"\bnot\b": "logical_not(a) for not a",
    r"[<>]=?(?:(?!\b(?:and|or)\b)[^<>=])+[<>]": "logical_and(a < x, x < b) for a < x < b",
    r"\b(if|elif|while)\b": "where(condition, yes, no) for if",
}
# function of the module `math` -> function of the kit, where the names differ
_OF_MATH = {"fabs": "absolute", "acos": "arccos", "atan2": "arctan2", "pow": "**"}


class _Place(NamedTuple):
    """The place of an error in an author's file.

    Attributes
    ----------
    file : str
    line : int
    law : str
        Name of the function.
    text : str
        The expression; empty if it is not known.
    """

    file: str
    line: int
    law: str
    text: str


def check_component(cls: type[Component]) -> None:
    """Raise an error unless the laws of a component accept symbols and have consistent units.

    Each class is checked once; one with an engine of its own has no laws.

    Parameters
    ----------
    cls : type[Component]

    Raises
    ------
    UserError
        With file, line, mistake and remedy.
    """
    if cls.engine is not None or cls in _checked:
        return
    _check_declared(cls)
    instance = _symbolic_instance(cls)
    attributes = set(vars(instance))
    for required in required_units(cls):
        _check_law(instance, required)
    new = sorted(vars(instance).keys() - attributes)
    if new:
        raise UserError(
            f"{_line_in_class(cls, rf'self[.]{new[0]} *=')}: a law keeps {new[0]!r} in self, where"
            " nothing is kept from one evaluation to the next; declare it as a State or Discrete"
        )
    _checked.add(cls)


def _check_declared(cls: type[Component]) -> None:
    """Check that declared units exist, and that periods and shifts are in seconds."""
    clocks = cls.layout.clock_parameters
    for v in cls.layout.variables:
        try:
            units.check(v.unit)
        except UserError as error:
            place = _line_in_class(cls, rf"^ *{v.name} *=")
            raise UserError(f"{place}: {v.name}: {error}") from error
        if v.name in clocks and units.base_unit(v.unit) != units.base_unit("s"):
            place = _line_in_class(cls, rf"^ *{v.name} *=")
            raise UserError(
                f"{place}: {v.name} is in {v.unit}, but a sample period is in s;"
                f" declare it in s, with display={v.unit!r}"
            )


def _symbolic_instance(cls: type[Component]) -> Component:
    """Return an instance whose variables are symbols in their units."""
    instance = _instance_of_symbols(cls, lambda unit: Symbol(units.powers_of_names(unit)))
    free = _instance_of_symbols(cls, lambda unit: ANY)
    for name in cls.unchecked:
        if law_of(cls, name) is None:
            place = _line_in_class(cls, r"^ *unchecked *=")
            raise UserError(
                f"{place}: no law named {name!r}{suggestion(name, _variables_and_laws(instance))}"
            )
        vars(instance)[name] = _without_unit_check(getattr(free, name))
    return instance


def _instance_of_symbols(cls: type[Component], make: Any) -> Component:
    """Return an instance whose variables are the symbols that ``make(unit)`` returns."""
    instance = cls()
    # not setattr: an effect of an input is a descriptor with the name of the input
    vars(instance).update(
        {v.name: make(v.unit) for v in cls.layout.variables if hasattr(v, "start")}
    )
    # a function of time may have bare numbers
    instance.time = Symbol({"s": 1.0}, ANY.numbers, is_variable=True)
    return instance


def _without_unit_check(law: Any) -> Any:
    """Return a law that takes and returns symbols of any unit in place of those with a unit."""

    def free(value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(map(free, value))
        return ANY if isinstance(value, Symbol) else value

    return lambda *arguments: free(law(*free(arguments)))


def _check_law(instance: Component, required: RequiredUnit) -> None:
    """Evaluate a law, and check the unit of its value."""
    try:
        value = getattr(instance, required.law)()
    except Exception as error:
        raise UserError(_evaluation_message(instance, required, error)) from error
    try:
        if isinstance(value, Symbol):
            value.match(Symbol(required.powers))
        else:
            check_number(value)
    except LawError as error:
        raise UserError(_unit_message(instance, required, value, error)) from error


def _unit_message(instance: Component, required: RequiredUnit, value: Any, error: LawError) -> str:
    """Return the message for the value of a law that is no number or has another unit."""
    place = _place_of_law(type(instance), required.law)
    if not isinstance(value, Symbol):
        return f"{place}: the value of {required.law} is no number: {error}; {error.remedy}"
    reason = f"{place}: {required.law} gives {value.unit}, but {required.words}"
    if isinstance(error, ScaleError):
        return f"{reason}: {error}; {_scale_remedy(instance)}"
    return f"{reason}; {_unit_hints(instance, _source_of(type(instance), required.law))}"


def _evaluation_message(instance: Component, required: RequiredUnit, error: Exception) -> str:
    """Return the message for an error in the evaluation of a law: place, mistake and remedy."""
    place = _place_of(error)
    quoted = f" in {place.text!r}" if place and place.text else ""
    where = (
        f"{shown(place.file)}, line {place.line}: in {place.law}{quoted}"
        if place
        else f"{_place_of_law(type(instance), required.law)}: in {required.law}"
    )
    if isinstance(error, ScaleError):
        return f"{where}: {error}; {error.remedy or _scale_remedy(instance)}"
    if isinstance(error, ValueNeeded):
        return f"{where}: {error}; {_value_remedy(place) or error.remedy}"
    if isinstance(error, LawError):
        remedy = error.remedy or _unit_hints(instance, place.text if place else "")
        return f"{where}: {error}; {remedy}"
    return f"{where}: {_python_message(instance, place, error)}"


def _python_message(instance: Component, place: _Place | None, error: Exception) -> str:
    """Return the message for an exception of Python in a law."""
    name = getattr(error, "name", None) or ""
    known = _variables_and_laws(instance)
    match error:
        case UserError():
            return str(error)
        case NameError() if name in kit.__all__:
            return f"{name} is not there; write: from fmus.kit import {name}"
        case NameError() if name in known:
            return f"{name} is not there; write self.{name}"
        case NameError():
            return f"{name} is not there{suggestion(name, [*known, *kit.__all__], few=0)}"
        case AttributeError() if isinstance(error.obj, Component | super):
            return f"there is no variable or law {name!r}{suggestion(name, known)}"
        case TypeError() if without_self := _without_self(instance):
            return f"{error}; write self between the brackets of {without_self}"
        case TypeError() if _calls_a_variable(instance, place):
            return "a variable is called like a law; leave out the brackets behind its name"
        case RecursionError():
            return "the law calls itself without end; call super().law() or another law"
    return f"{type(error).__name__}: {error}"


def _without_self(instance: Component) -> str:
    """Return the first law that lacks the argument ``self``; empty if there is none."""
    laws = ((name, _code_of(type(instance), name)) for name in _variables_and_laws(instance))
    return next((name for name, code in laws if code and not code.co_argcount), "")


def _calls_a_variable(instance: Component, place: _Place | None) -> bool:
    """Return whether an expression calls a variable as if it were a law."""
    call = re.match(r"self\.(\w+)\(", place.text) if place else None
    return call is not None and any(call[1] == v.name for v in type(instance).layout.variables)


def _value_remedy(place: _Place | None) -> str:
    """Return the remedy for code in a line that needs the value of a number; empty if unknown."""
    if place is None:
        return ""
    line = linecache.getline(place.file, place.line).partition("#")[0]
    match = re.search(r"\bmath\.(\w+)", place.text or line)
    if match:
        name = _OF_MATH.get(match[1], match[1])
        if name == "**":
            return "write x**y"
        if name in kit.__all__:
            return f"write {name}(...) and: from fmus.kit import {name}"
        return ""
    remedies = [text for pattern, text in _INSTEAD.items() if re.search(pattern, line)]
    return f"write {', and '.join(remedies)}, of fmus.kit" if remedies else ""


def _scale_remedy(instance: Component) -> str:
    """Return the remedy for units of different scale."""
    others = [
        f"{v.name} ({v.unit})"
        for v in type(instance).layout.variables
        if units.base_unit(v.unit).factor != 1.0 and not getattr(v, "starts", None)
    ]
    declare = f", or declare {', '.join(others)} in SI, with display= for people" if others else ""
    return f"write this factor into the law{declare}"


def _unit_hints(instance: Component, text: str) -> str:
    """Return a hint for an expression: the units of its variables and laws."""
    layout = type(instance).layout
    declared = {v.name: v.unit for v in layout.variables if hasattr(v, "start")}
    hints = []
    for name in dict.fromkeys(re.findall(r"\bself\.(\w+)", text)):
        if name in declared:
            hints.append(f"{name} is declared in {declared[name]}")
        elif law_of(type(instance), name):
            hints.append(_unit_of_law(instance, name))
    return ", ".join(filter(None, hints)) or "check the units in this expression"


def _unit_of_law(instance: Component, law: str) -> str:
    """Return the unit of a law without arguments, as a hint; empty if it has none."""
    try:
        value = getattr(instance, law)()
    except Exception:
        return ""
    return f"{law}() gives {value.unit}" if isinstance(value, Symbol) else ""


def _variables_and_laws(instance: Component) -> list[str]:
    """Return the variables and laws of a component."""
    cls = type(instance)
    laws = [n for n in dir(cls) if not n.startswith("_") and not hasattr(Component, n)]
    return [*(v.name for v in cls.layout.variables), *laws]


# --- places in files ----------------------------------------------------------------------------


def shown(file: str) -> str:
    """Return a file's path relative to the working directory, if it is below it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file


def _place_of(error: BaseException) -> _Place | None:
    """Return the innermost place of an error in an author's file; None if there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    authors = [each for each in frames if not Path(each.filename).is_relative_to(_KIT)]
    if not authors:
        return None
    frame = authors[-1]
    line = frame.lineno or 0
    text = b""
    if line == frame.end_lineno:
        text = linecache.getline(frame.filename, line).encode()[frame.colno : frame.end_colno]
    return _Place(frame.filename, line, frame.name, text.decode())


def _code_of(cls: type[Component], law: str) -> CodeType | None:
    """Return the code of an author's law; None for a law of the kit."""
    function = law_of(cls, law)
    author = getattr(function, "__wrapped__", function)  # of a shared law
    code: CodeType | None = getattr(author, "__code__", None)
    return None if code is None or Path(code.co_filename).is_relative_to(_KIT) else code


def _place_of_law(cls: type[Component], law: str) -> str:
    """Return file and line of a law; for a law of the kit, the name of the component."""
    code = _code_of(cls, law)
    if code is None:
        return cls.name or cls.__name__
    return f"{shown(code.co_filename)}, line {code.co_firstlineno}"


def _source_of(cls: type[Component], law: str) -> str:
    """Return the source of an author's law; empty for a law of the kit."""
    code = _code_of(cls, law)
    if code is None:
        return ""
    lines = {line for _, _, line in code.co_lines() if line}
    return "".join(linecache.getline(code.co_filename, line) for line in sorted(lines))


def _line_in_class(cls: type[Component], pattern: str) -> str:
    """Return file and line of the first match in the source of a class or an author's base of it.

    If there is no match, it is the name of the component.
    """
    import inspect

    for part in cls.__mro__[:-2]:  # without `Component` and `object`
        try:
            lines, first = inspect.getsourcelines(part)
        except (OSError, TypeError):  # no file has its source
            continue
        file = inspect.getsourcefile(part) or ""
        if Path(file).is_relative_to(_KIT):
            continue
        for number, line in enumerate(lines, first):
            if re.search(pattern, line):
                return f"{shown(file)}, line {number}"
    return cls.name or cls.__name__
