"""The form in which an option is declared once, and the keyword arguments that are made from it.

A class of options is a ``TypedDict`` whose keys are annotated with an `Option`::

    class SearchOptions(TypedDict, total=False):
        hold: Annotated[Sequence[str], Option("Parameters that are known.", default=(), form=NAMES)]

`takes` gives its keys to a function as keyword arguments, with defaults, in the signature and in
the docstring; ``**options: Unpack[SearchOptions]`` tells type checkers of them. The same class, or
one that extends it by files to write, becomes a command in `orchestration.cli.options`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from inspect import Parameter, cleandoc, signature
from numbers import Integral, Real
from types import UnionType
from typing import Any, ForwardRef, NamedTuple, TypeVar, Union, cast, get_args, get_origin

from fmus.kit.errors import UserError, suggestion
from fmus.kit.extras import optional
from orchestration.reporting import flag
from orchestration.reporting import option as as_written

Declared = TypeVar("Declared")
Function = TypeVar("Function", bound=Callable[..., Any])
REQUIRED: Any = ...
_COLUMNS = 96  # of a docstring, so that it fits a terminal where `help` indents it
# where the section ``Parameters`` ends, or what it ends with: ``**options``
_END = r"^(?:\*\*\w+|(?:Returns|Yields|Raises|Examples|References)\n-{3,})$"


class Form(NamedTuple):
    """The way in which the value of an option is written on the command line.

    Attributes
    ----------
    read : callable
        Of what was typed and the name of the option, for messages; returns the value.
    write : callable
        Of a value; returns the texts that are typed for it, one for each time that the option is
        named.
    typed : type, optional
        Of what is typed, such as ``str`` or ``list[str]``; the type of the option unless given.
    parse : callable, optional
        Of a text; returns the value, or raises ValueError with what is wrong.
    given : callable
        Of a value given in Python, and the name of the argument, for messages; returns the value as
        it is used, such as a list of names for a single one.
    """

    read: Callable[[Any, str], Any] = lambda typed, flag: typed
    write: Callable[[Any], list[str]] = lambda value: [str(value)]
    typed: Any = None
    parse: Callable[[str], Any] | None = None
    given: Callable[[Any, str], Any] = lambda value, name: value


AS_IT_IS = Form()
# what a value of a type may be in Python, such as a number of NumPy, and how that is called
_NUMBERS: Mapping[Any, tuple[Any, str]] = {
    int: (Integral, "a whole number"),
    int | None: (Integral | None, "a whole number"),
    float: (Real, "a number"),
}


class Option(NamedTuple):
    """An option: what it is called, what it means, which values it has and how they are written.

    Attributes
    ----------
    help : str
        Meaning in a line, for the command line, which does not take the option without one.
    doc : str
        Meaning for Python, with what a line has no room for; `help` unless given.
    default : object
        Value where the option is not given; `REQUIRED` if it must be. A function is called for it
        when a command is made.
    form : Form
    flag : str
        Name on the command line, ``--on/--off`` for both values of a switch; made from the name
        unless given.
    metavar : str, optional
        Stands for the value in the help.
    kind : str
        Type in the words of numpydoc; made from the annotation unless given.
    unit : str
        Of the value in Python; the command line takes others, too, and converts them.
    choices : sequence of str
        Allowed values, where these are all.
    least, most : float, optional
        Range of a number; there is no most without a least.
    complete : str
        What is offered to complete a value: ``component``, ``effect``, ``experiment``, ``system``.
    argument : bool
        Whether the command line takes it by its place, without a flag.
    name : str
        Key in the class; filled in by `options_of`.
    type : object
        Annotation of the key; filled in by `options_of`.
    """

    help: str = ""
    doc: str = ""
    default: Any = None
    form: Form = AS_IT_IS
    flag: str = ""
    metavar: str | None = None
    kind: str = ""
    unit: str = ""
    choices: Sequence[str] = ()
    least: float | None = None
    most: float | None = None
    complete: str = ""
    argument: bool = False
    name: str = ""
    type: Any = None

    @property
    def on_command_line(self) -> bool:
        """True if the command line takes it."""
        return bool(self.help)

    @property
    def flags(self) -> list[str]:
        """Names on the command line; of a switch the one that turns it on, then the other."""
        return (self.flag or flag(self.name)).split("/")

    def read(self, typed: Any) -> Any:
        """Return the value for what was typed, which is None or empty where nothing was."""
        if typed is None or typed == []:
            return self.default
        value = self.form.read(typed, self.flags[0])
        if self.choices and value not in self.choices:
            name = self.metavar if self.argument else self.flags[0]
            raise UserError(f"{name} {value!r}: there are {', '.join(self.choices)}")
        return value

    def given(self, value: Any) -> Any:
        """Return a value that was given in Python as it is used; UserError if it cannot be one."""
        kind, called = _NUMBERS.get(self.type, (object, ""))
        if not isinstance(value, kind):
            raise UserError(f"{self.name}={value!r}: must be {called}")
        if value is None:
            return None
        if self.least is not None and not self.least <= value <= (self.most or math.inf):
            to = f"to {self.most:,}" if self.most else "on"
            raise UserError(f"{as_written(self.name, value)}: from {self.least:,} {to}")
        return self.form.given(value, f"{self.name} =")

    def words(self, value: Any) -> list[str]:
        """Return the words that give this value on the command line, none for the default."""
        if value is None or value == self.default:
            return []
        if isinstance(self.default, tuple) and self.default == tuple(value):
            return []
        if isinstance(value, bool):
            return [self.flags[0] if value or len(self.flags) == 1 else self.flags[1]]
        return [word for text in self.form.write(value) for word in (self.flags[0], text)]

    def documented(self) -> str:
        """Return its entry in the section ``Parameters`` of a numpydoc docstring."""
        import textwrap  # which no command needs

        head = f"{self.name} : {self.kind or _in_words(self)}"
        # code such as ``1..2:7 log`` stays in one line
        text = re.sub(r"``.+?``", lambda code: code[0].replace(" ", "\0"), self.doc or self.help)
        indent = "    "
        lines = textwrap.fill(
            text,
            _COLUMNS,
            initial_indent=indent,
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        return f"{head}\n{lines}".replace("\0", " ").rstrip()


def options_of(*declared: type) -> dict[str, Option]:
    """Return the options that classes declare, by name, in the order of the declaration."""
    return {option.name: option for cls in declared for option in _options_of(cls)}


@cache
def _options_of(declared: type) -> list[Option]:
    # `get_type_hints` would have to import what the annotations name; only the outer one is needed
    return [
        hint.__metadata__[0]._replace(name=name, type=hint.__origin__)
        for name, hint in declared.__annotations__.items()
    ]


def only(declared: type[Declared], values: Mapping[str, object]) -> Declared:
    """Return those of the values whose options a class declares."""
    return cast(Declared, {name: values[name] for name in options_of(declared) if name in values})


def words_of(declared: type, values: Mapping[str, object]) -> list[str]:
    """Return the words that give values on the command line, in the order of the declaration."""
    return [
        word
        for option in options_of(declared).values()
        if option.on_command_line and option.name in values
        for word in option.words(values[option.name])
    ]


def takes(*declared: type) -> Callable[[Function], Function]:
    """Give a function the options of some classes as keyword arguments.

    What the function has as arguments of its own keeps their defaults and gets its documentation
    only. The others arrive in its ``**options``, complete: each with its value or its default.

    Parameters
    ----------
    declared : TypedDict
        Classes of options.

    Returns
    -------
    callable
        Decorator. The function's attribute ``__options__`` has the options by name.
    """
    options = options_of(*declared)

    def decorate(function: Function) -> Function:
        plain = signature(function)
        own = [p for p in plain.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        known = {parameter.name for parameter in own}
        added = [option for option in options.values() if option.name not in known]
        defaults = {option.name: option.default for option in added}

        @wraps(function)
        def call(*arguments: Any, **given: Any) -> Any:
            for name in given:
                if name not in defaults and name not in known:
                    near = suggestion(name, [*known, *defaults])
                    raise TypeError(
                        f"{function.__name__}() got an unexpected keyword argument {name!r}{near}"
                    )
            used = {n: options[n].given(v) if n in options else v for n, v in given.items()}
            with optional():
                return function(*arguments, **defaults | used)

        made = cast(Any, call if added else function)
        if added:
            made.__signature__ = plain.replace(parameters=[*own, *map(_parameter, added)])
        made.__doc__ = with_options(function.__doc__, options.values())
        made.__options__ = options
        return cast(Function, made)

    return decorate


def _parameter(option: Option) -> Parameter:
    kind = option.type.__forward_arg__ if isinstance(option.type, ForwardRef) else option.type
    return Parameter(option.name, Parameter.KEYWORD_ONLY, default=option.default, annotation=kind)


def with_options(docstring: str | None, options: Iterable[Option]) -> str | None:
    """Return a numpydoc docstring with options at the end of its section ``Parameters``."""
    if docstring is None:  # as `python -OO` has it
        return None
    text = cleandoc(docstring)
    end = re.search(_END, text, re.M)
    place = end.start() if end else len(text)
    head = text[:place].rstrip()
    tail = text[place:]
    if "\nParameters\n---" not in head:
        head += "\n\nParameters\n----------"
    entries = "\n".join(option.documented() for option in options)
    gap = "\n" if tail.startswith("**") else "\n\n"
    return f"{head}\n{entries}{gap}{tail}".rstrip() + "\n"


def _in_words(option: Option) -> str:
    """Return the type of an option in the words of numpydoc."""
    if option.choices:
        listed = ", ".join(f'"{choice}"' for choice in option.choices)
        return f"{{{listed}}}"
    parts = get_args(option.type) if _is_union(option.type) else (option.type,)
    words = " or ".join(_type_in_words(part) for part in parts if part is not type(None))
    words += f" in {option.unit}" if option.unit else ""
    return words + (", optional" if type(None) in parts else "")


def _is_union(kind: Any) -> bool:
    return get_origin(kind) in (Union, UnionType)


def _type_in_words(kind: Any) -> str:
    outer = get_origin(kind)
    if outer is Callable:
        return "callable"
    if _is_union(kind):
        return " or ".join(map(_type_in_words, get_args(kind)))
    if outer is not None:
        inner = " to ".join(map(_type_in_words, get_args(kind)))
        return f"{outer.__name__.replace('Sequence', 'sequence')} of {inner}"
    return str(kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind.__name__)
