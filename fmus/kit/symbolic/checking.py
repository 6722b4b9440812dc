"""The check of a component when it is loaded: its laws work on signals, and their units fit.

Every law that the rates, updates and outputs call is evaluated once on numbers of which only the
unit is known. What goes wrong is a mistake of the author, who is told the line and what to write.
"""

from __future__ import annotations

import linecache
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import CodeType, TracebackType
from typing import Any, NamedTuple
from weakref import WeakSet

import fmus.kit as kit
from fmus.kit import units
from fmus.kit.component import Component
from fmus.kit.errors import UserError, suggestion
from fmus.kit.layout import law_of
from fmus.kit.symbolic.symbols import ANY, LawError, ScaleError, Symbol, ValueNeeded, check_number

_KIT = Path(kit.__file__).parent
_checked: WeakSet[type[Component]] = WeakSet()
# What is written in a law that needs a value -> what to write instead. All that are there are told.
_INSTEAD = {
    r"\bmax\(": "maximum(a, b) for max(a, b)",
    r"\bmin\(": "minimum(a, b) for min(a, b)",
    r"\band\b": "logical_and(a, b) for a and b",
    r"\bor\b": "logical_or(a, b) for a or b",
    r"\bnot\b": "logical_not(a) for not a",
    r"[<>]=?(?:(?!\b(?:and|or)\b)[^<>=])+[<>]": "logical_and(a < x, x < b) for a < x < b",
    r"\b(if|elif|while)\b": "where(condition, yes, no) for if",
}
_OF_MATH = {"fabs": "absolute", "acos": "arccos", "atan2": "arctan2", "pow": "**"}


class _Place(NamedTuple):
    """Where in an author's file something went wrong.

    Attributes
    ----------
    file : str
    line : int
    law : str
        The function that stands there.
    text : str
        The expression; empty if it is not to be had.
    """

    file: str
    line: int
    law: str
    text: str


class _Wanted(NamedTuple):
    """A law whose unit follows from what a class declares.

    Attributes
    ----------
    law : str
    unit : str
        Of the variable that it belongs to, as it is declared.
    powers : Mapping of str to float
        Of the units that the law must be in.
    words : str
        Why it must.
    """

    law: str
    unit: str
    powers: Mapping[str, float]
    words: str


def check_component(cls: type[Component]) -> None:
    """Check once that the laws of a component work on symbols, and that their units fit.

    Parameters
    ----------
    cls : type[Component]
        One with an engine of its own has no laws.

    Raises
    ------
    UserError
        With file, line, what is wrong there, and what to write instead.
    """
    if cls.engine is not None or cls in _checked:
        return
    _check_declared(cls)
    one = _on_symbols(cls)
    held = set(vars(one))
    for wanted in _wanted(cls):
        _check_law(one, wanted)
    new = sorted(vars(one).keys() - held)
    if new:
        raise UserError(
            f"{_of_class(cls, rf'self[.]{new[0]} *=')}: a law keeps {new[0]!r} in self, where"
            " nothing is kept from one evaluation to the next; declare it as a State or Discrete"
        )
    _checked.add(cls)


def _check_declared(cls: type[Component]) -> None:
    """Check that units are some, and that what is sampled has its period in seconds."""
    clocks = cls.layout.clock_parameters
    for v in cls.layout.variables:
        try:
            units.check(v.unit)
        except UserError as error:
            place = _of_class(cls, rf"^ *{v.name} *=")
            raise UserError(f"{place}: {v.name}: {error}") from error
        if v.name in clocks and units.base_unit(v.unit) != units.base_unit("s"):
            place = _of_class(cls, rf"^ *{v.name} *=")
            raise UserError(
                f"{place}: {v.name} is in {v.unit}, but a sample period is in s;"
                f" declare it in s, with display={v.unit!r}"
            )


def _wanted(cls: type[Component]) -> Iterator[_Wanted]:
    """Yield the laws that declarations name, with the units that these give them."""
    for state in cls.layout.states:
        powers = Counter[str](units.powers_of_names(state.unit))
        powers.subtract(["s"])
        words = f"it is the rate of {state.name}, which is in {state.unit}"
        yield _Wanted(state.rate, state.unit, powers, words)
    for discrete in cls.layout.discretes:
        words = f"it is the next value of {discrete.name}, which is in {discrete.unit}"
        powers_of = units.powers_of_names(discrete.unit)
        yield _Wanted(discrete.update, discrete.unit, powers_of, words)
    for output in cls.layout.outputs:
        words = f"it is an output in {output.unit}"
        yield _Wanted(output.name, output.unit, units.powers_of_names(output.unit), words)


def _on_symbols(cls: type[Component]) -> Component:
    """Return an instance whose variables are symbols in their units."""
    one = _filled(cls, lambda unit: Symbol(units.powers_of_names(unit)))
    free = _filled(cls, lambda unit: ANY)
    for name in cls.unchecked:
        if law_of(cls, name) is None:
            place = _of_class(cls, r"^ *unchecked *=")
            raise UserError(f"{place}: no law named {name!r}{suggestion(name, _names(one))}")
        vars(one)[name] = _of_any_unit(getattr(free, name))
    return one


def _filled(cls: type[Component], make: Any) -> Component:
    one = cls()
    # not setattr: an effect of an input stands in the class under the name of the input
    vars(one).update({v.name: make(v.unit) for v in cls.layout.variables if hasattr(v, "start")})
    one.time = Symbol({"s": 1.0}, ANY.numbers)  # a course over time is written in numbers
    return one


def _of_any_unit(law: Any) -> Any:
    """Return a law that takes and gives numbers whose units nobody knows."""

    def free(value: Any) -> Any:
        if isinstance(value, tuple | list):
            return type(value)(map(free, value))
        return ANY if isinstance(value, Symbol) else value

    return lambda *arguments: free(law(*free(arguments)))


def _check_law(one: Component, wanted: _Wanted) -> None:
    """Evaluate a law, and check the unit of what it gives."""
    try:
        value = getattr(one, wanted.law)()
    except Exception as error:
        raise UserError(_told(one, wanted, error)) from error
    try:
        check_number(value) if not isinstance(value, Symbol) else value.meet(Symbol(wanted.powers))
    except LawError as error:
        raise UserError(_of_result(one, wanted, value, error)) from error


def _of_result(one: Component, wanted: _Wanted, value: Any, error: LawError) -> str:
    """Return what is wrong with what a law gives."""
    place = _of_law(type(one), wanted.law)
    if not isinstance(value, Symbol):
        return f"{place}: what {wanted.law} gives is no number: {error}; {error.remedy}"
    reason = f"{place}: {wanted.law} gives {value.unit}, but {wanted.words}"
    if isinstance(error, ScaleError):
        return f"{reason}: {error}; {_for_scale(one)}"
    return f"{reason}; {_for_units(one, _source_of(type(one), wanted.law))}"


def _told(one: Component, wanted: _Wanted, error: Exception) -> str:
    """Return what went wrong while a law was evaluated: where, what, and what to write."""
    place = _place_of(error)
    if place is None:
        where = f"{_of_law(type(one), wanted.law)}: in {wanted.law}"
    else:
        quoted = f" in {place.text!r}" if place.text else ""
        where = f"{shown(place.file)}, line {place.line}: in {place.law}{quoted}"
    if isinstance(error, ScaleError):
        return f"{where}: {error}; {error.remedy or _for_scale(one)}"
    if isinstance(error, ValueNeeded):
        return f"{where}: {error}; {_instead(place) or error.remedy}"
    if isinstance(error, LawError):
        remedy = error.remedy or _for_units(one, place.text if place else "")
        return f"{where}: {error}; {remedy}"
    return f"{where}: {_of_python(one, place, error)}"


def _of_python(one: Component, place: _Place | None, error: Exception) -> str:
    """Return what Python's own error means in a law."""
    name = getattr(error, "name", None) or ""
    known = _names(one)
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
        case TypeError() if without_self := _without_self(one):
            return f"{error}; write self between the brackets of {without_self}"
        case TypeError() if _calls_a_variable(one, place):
            return "a variable is called like a law; leave out the brackets behind its name"
        case RecursionError():
            return "the law calls itself without end; call super().law() or another law"
    return f"{type(error).__name__}: {error}"


def _without_self(one: Component) -> str:
    """Return the law that takes no argument, not even the component; empty if there is none."""
    laws = ((name, _code_of(type(one), name)) for name in _names(one))
    return next((name for name, code in laws if code and not code.co_argcount), "")


def _calls_a_variable(one: Component, place: _Place | None) -> bool:
    called = re.match(r"self\.(\w+)\(", place.text) if place else None
    return called is not None and any(called[1] == v.name for v in type(one).layout.variables)


def _instead(place: _Place | None) -> str:
    """Return what to write for what needs a value in a line."""
    if place is None:
        return ""
    line = linecache.getline(place.file, place.line).partition("#")[0]
    found = re.search(r"\bmath\.(\w+)", place.text or line)
    if found:
        name = _OF_MATH.get(found[1], found[1])
        if name == "**":
            return "write x**y"
        if name in kit.__all__:
            return f"write {name}(...) and: from fmus.kit import {name}"
        return ""
    wanted = [text for pattern, text in _INSTEAD.items() if re.search(pattern, line)]
    return f"write {', and '.join(wanted)}, of fmus.kit" if wanted else ""


def _for_scale(one: Component) -> str:
    """Return how units come to have the same scale."""
    others = [
        f"{v.name} ({v.unit})"
        for v in type(one).layout.variables
        if units.base_unit(v.unit).factor != 1.0 and not getattr(v, "starts", None)
    ]
    declare = f", or declare {', '.join(others)} in SI, with display= for people" if others else ""
    return f"write this factor into the law{declare}"


def _for_units(one: Component, text: str) -> str:
    """Return the units of what stands in an expression."""
    layout = type(one).layout
    declared = {v.name: v.unit for v in layout.variables if hasattr(v, "start")}
    told = []
    for name in dict.fromkeys(re.findall(r"\bself\.(\w+)", text)):
        if name in declared:
            told.append(f"{name} is declared in {declared[name]}")
        elif law_of(type(one), name):
            told.append(_of_called(one, name))
    return ", ".join(filter(None, told)) or "check the units of what stands there"


def _of_called(one: Component, law: str) -> str:
    """Return the unit of what another law gives, if it does so without arguments."""
    try:
        value = getattr(one, law)()
    except Exception:
        return ""
    return f"{law}() gives {value.unit}" if isinstance(value, Symbol) else ""


def _names(one: Component) -> list[str]:
    """Return the variables and laws of a component."""
    cls = type(one)
    laws = [n for n in dir(cls) if not n.startswith("_") and not hasattr(Component, n)]
    return [*(v.name for v in cls.layout.variables), *laws]


# --- places in files ----------------------------------------------------------------------------


def shown(file: str) -> str:
    """Return a file's name as people know it: from the folder that they are in."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file


def _place_of(error: BaseException) -> _Place | None:
    """Return where an error came up in what an author wrote; None if nowhere."""
    linecache.checkcache()  # a file may be another one by now
    place = None
    for at in _tracebacks(error):
        code = at.tb_frame.f_code
        if not Path(code.co_filename).is_relative_to(_KIT):
            text = _text(code, at.tb_lasti)
            place = _Place(code.co_filename, at.tb_lineno, code.co_name, text)
    return place


def _tracebacks(error: BaseException) -> Iterator[TracebackType]:
    at = error.__traceback__
    while at:
        yield at
        at = at.tb_next


def _text(code: CodeType, instruction: int) -> str:
    """Return the expression that an instruction is of, if it stands in one line."""
    start, end, left, right = list(code.co_positions())[instruction // 2]
    if start is None or start != end:
        return ""
    line = linecache.getline(code.co_filename, start).encode()
    return line[left:right].decode()


def _code_of(cls: type[Component], law: str) -> CodeType | None:
    """Return the code of a law that an author wrote; None if the kit made it."""
    written = law_of(cls, law)
    written = getattr(written, "__wrapped__", written)  # of a shared law
    code: CodeType | None = getattr(written, "__code__", None)
    return None if code is None or Path(code.co_filename).is_relative_to(_KIT) else code


def _of_law(cls: type[Component], law: str) -> str:
    """Return where a law is defined; of one that the kit made its component."""
    code = _code_of(cls, law)
    if code is None:
        return cls.name or cls.__name__
    return f"{shown(code.co_filename)}, line {code.co_firstlineno}"


def _source_of(cls: type[Component], law: str) -> str:
    """Return the lines of a law that an author wrote."""
    code = _code_of(cls, law)
    if code is None:
        return ""
    lines = {line for _, _, line in code.co_lines() if line}
    return "".join(linecache.getline(code.co_filename, line) for line in sorted(lines))


def _of_class(cls: type[Component], pattern: str) -> str:
    """Return the file and line of a class, or of one below it, on which something stands."""
    import inspect

    for part in cls.__mro__[:-2]:
        try:
            lines, first = inspect.getsourcelines(part)
        except (OSError, TypeError):
            continue
        if Path(inspect.getsourcefile(part) or "").is_relative_to(_KIT):
            continue
        for number, line in enumerate(lines, first):
            if re.search(pattern, line):
                return f"{shown(inspect.getsourcefile(part) or '')}, line {number}"
    return cls.name or cls.__name__
