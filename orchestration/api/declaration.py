"""Declaration of options, from which keyword arguments of functions and commands are made.

A class of options is a ``TypedDict`` whose keys are annotated with the meaning of an option for the
command line and, if that differs, for Python, or with an `Option`, which can say more::

    class SearchOptions(TypedDict, total=False):
        hold: Annotated[Names, "Parameters that are known."]
        starts: Annotated[int, Option("Points that a search begins at.", default=1, least=1)]

The type is one of `orchestration.api.forms`, with the form of its values, or a plain one, which a
form may follow.

`takes` adds the keys to a function as keyword arguments, with defaults, in the signature and in
the docstring; ``**options: Unpack[SearchOptions]`` declares them for type checkers. The same class,
or one that extends it by output files, becomes a command in `orchestration.cli.options`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
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
_COLUMNS = 96  # of a docstring, as `help` indents it by four
# the last entry ``**options`` of the section ``Parameters``, or the section after it
_AFTER_PARAMETERS = r"^(?:\*\*\w+|(?:Returns|Yields|Raises|Examples|References)\n-{3,})$"


class Form(NamedTuple):
    """Conversion of the values of an option from and to words of the command line.

    Attributes
    ----------
    read : callable
        Returns the value of a typed word, or of all words of a repeated option; its second argument
        is the name of the option, for messages.
    write : callable
        Returns the words of a value, one for each time that the option is given.
    typed : type, optional
        Type before `read`, such as ``str`` or ``list[str]``; by default the type of the option.
    parse : callable, optional
        Returns the value of one text, or raises ValueError.
    given : callable
        Returns the value that is used for one from Python, such as a list of names for a single
        name; its second argument is the name of the argument, for messages.
    """

    read: Callable[[Any, str], Any] = lambda typed, flag: typed
    write: Callable[[Any], list[str]] = lambda value: [str(value)]
    typed: Any = None
    parse: Callable[[str], Any] | None = None
    given: Callable[[Any, str], Any] = lambda value, name: value
    metavar: str | None = None
    kind: str = ""


AS_IT_IS = Form()
# by type of an option: types that are allowed in Python, with numbers of NumPy, and their name
_NUMBERS: Mapping[Any, tuple[Any, str]] = {
    int: (Integral, "a whole number"),
    int | None: (Integral | None, "a whole number"),
    float: (Real, "a number"),
}


class Option(NamedTuple):
    """Declaration of an option: its name, its meaning, its allowed values and their form.

    Attributes
    ----------
    help : str
        Meaning in one line, for the command line, which has no option without it.
    doc : str
        Longer meaning for Python; `help` by default.
    default : object
        Default value, or a function that returns it when a command is made; `REQUIRED` if there
        is none. Unless given it is False, no names, or None, by the type; an argument that
        cannot be None is required.
    form : Form
        Form of its values, the last in the annotation; set by `options_of`.
    flag : str
        Name on the command line, ``--on/--off`` for both values of a switch; by default made from
        the name.
    alias : str
        Second name on the command line; empty for none.
    metavar : str, optional
        Placeholder of the value in the help.
    kind : str
        Type in the words of numpydoc; by default made from the annotation.
    unit : str
        Unit of the value in Python; the command line takes other units, too.
    choices : sequence of str
        Allowed values; empty if others are allowed.
    least, most : float, optional
        Range of a number; a largest value needs a least one.
    complete : str
        Names for completion in a shell: ``component``, ``effect``, ``experiment``, ``system``.
    argument : bool
        Whether it is a positional argument of the command line.
    name : str
        Key in the class; set by `options_of`.
    type : object
        Annotation of the key; set by `options_of`.
    """

    help: str = ""
    doc: str = ""
    default: Any = None
    form: Form = AS_IT_IS
    flag: str = ""
    alias: str = ""
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
        """True if the command line has the option."""
        return bool(self.help)

    @property
    def flags(self) -> list[str]:
        """Names on the command line: one, or those for True and for False of a switch."""
        return (self.flag or flag(self.name)).split("/")

    def read(self, typed: Any) -> Any:
        """Return the value of a typed word or words; the default if there is none."""
        if typed is None or typed == []:
            return self.default
        value = self.form.read(typed, self.flags[0])
        if self.choices and value not in self.choices:
            name = self.metavar if self.argument else self.flags[0]
            raise UserError(f"{name} {value!r}: there are {', '.join(self.choices)}")
        return value

    def given(self, value: Any) -> Any:
        """Return the value that is used for one from Python; UserError if it is not allowed."""
        kind, called = _NUMBERS.get(self.type, (object, ""))
        if not isinstance(value, kind):
            raise UserError(f"{self.name}={value!r}: must be {called}")
        if value is None:
            return None
        if self.least is not None and not self.least <= value <= (self.most or math.inf):
            to = f"to {self.most:,}" if self.most else "on"
            raise UserError(f"{as_written(self.name, value)}: from {self.least:,} {to}")
        return self.form.given(value, f"{self.name} =")

    def is_default(self, value: Any) -> bool:
        """Return whether a value is the default, or none at all."""
        if isinstance(self.default, tuple) and isinstance(value, Sequence):
            return self.default == tuple(value)
        # a table would be compared cell by cell
        return value is None or (type(value) is type(self.default) and bool(value == self.default))

    def words(self, value: Any) -> list[str]:
        """Return the words of the command line for a value; none for the default."""
        if self.is_default(value):
            return []
        if isinstance(value, bool):
            return [self.flags[0] if value or len(self.flags) == 1 else self.flags[1]]
        return [word for text in self.form.write(value) for word in (self.flags[0], text)]

    def documented(self) -> str:
        """Return the entry of the option in the section ``Parameters`` of a numpydoc docstring."""
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
    """Return the options of one class, each with its name and type."""
    # `get_type_hints` would import the types that the annotations name; the outer one is enough
    return [
        _completed(name, hint.__origin__, *hint.__metadata__)
        for name, hint in declared.__annotations__.items()
    ]


def _completed(name: str, kind: Any, *parts: Any) -> Option:
    """Return an option with its name and type, and what these and its form imply."""
    found = {type(part): part for part in parts}
    form = found.get(Form, AS_IT_IS)
    meanings: list[Any] = [part for part in parts if isinstance(part, str)]
    option: Option = found.get(Option) or Option(*meanings)
    default = option.default
    if default is None and option.argument and not _is_union(kind):
        default = REQUIRED
    elif default is None and (kind is bool or get_origin(kind) is Sequence):
        default = False if kind is bool else ()
    return option._replace(
        default=default,
        form=form,
        metavar=option.metavar or form.metavar,
        name=name,
        type=kind,
    )


def only(declared: type[Declared], values: Mapping[str, object]) -> Declared:
    """Return the values of the options that a class declares."""
    return cast(Declared, {name: values[name] for name in options_of(declared) if name in values})


def stated_of(declared: type, values: Mapping[str, object]) -> list[str]:
    """Return the names of the options of a class whose values are not the default."""
    options = options_of(declared)
    return [name for name, one in options.items() if not one.is_default(values[name])]


def words_of(declared: type, values: Mapping[str, object]) -> list[str]:
    """Return the words of the command line for values, in the order of the declaration."""
    return [
        word
        for option in options_of(declared).values()
        if option.on_command_line and option.name in values
        for word in option.words(values[option.name])
    ]


def takes(*declared: type) -> Callable[[Function], Function]:
    """Return a decorator that adds the options of classes to a function as keyword arguments.

    An option that is a named argument of the function keeps its default there, and only its
    documentation is added. All others are in ``**options``, each with its value or its default.

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
        named = plain.parameters.values()
        own = [parameter for parameter in named if parameter.kind is not Parameter.VAR_KEYWORD]
        known = {parameter.name for parameter in own}
        added = [option for option in options.values() if option.name not in known]
        defaults = {option.name: option.default for option in added}

        @wraps(function)
        def call(*arguments: Any, **given: Any) -> Any:
            _check_names(function.__name__, given, [*known, *defaults])
            used = {
                name: options[name].given(value) if name in options else value
                for name, value in given.items()
                if value is not None or not callable(defaults.get(name))
            }
            with optional(), _shown_progress(options, used, function.__name__) as shown:
                return function(*arguments, **defaults | shown | used)

        made = cast(Any, call if added else function)
        if added:
            made.__signature__ = plain.replace(parameters=[*own, *map(_parameter, added)])
        made.__doc__ = with_options(function.__doc__, options.values())
        made.__options__ = options
        return cast(Function, made)

    return decorate


@contextmanager
def _shown_progress(
    options: Mapping[str, Option], given: Mapping[str, Any], function: str
) -> Iterator[dict[str, Any]]:
    """Yield a bar as the argument `progress` of a function that takes one and was given none."""
    declared = options.get("progress")
    if declared is None or "progress" in given:
        yield {}
        return
    from orchestration.reporting.console import bar

    takes_text = len(get_args(declared.type)[0]) == 1
    with bar("" if takes_text else function) as tell:
        if tell is None:
            yield {}
        else:
            yield {"progress": tell if takes_text else tell.done}


def _check_names(function: str, given: Iterable[str], allowed: Sequence[str]) -> None:
    """Raise TypeError for a keyword argument that a function does not have."""
    for name in given:
        if name not in allowed:
            near = suggestion(name, allowed)
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}{near}")


def _parameter(option: Option) -> Parameter:
    """Return the keyword argument of a function for an option."""
    kind = option.type.__forward_arg__ if isinstance(option.type, ForwardRef) else option.type
    # a function that does nothing stands for none, and a reader is shown that
    default = None if callable(option.default) else option.default
    return Parameter(option.name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def with_options(docstring: str | None, options: Iterable[Option]) -> str | None:
    """Return a numpydoc docstring with options at the end of its section ``Parameters``."""
    if docstring is None:  # with `python -OO`
        return None
    text = cleandoc(docstring)
    after = re.search(_AFTER_PARAMETERS, text, re.M)
    end = after.start() if after else len(text)
    before = text[:end].rstrip()
    if "\nParameters\n---" not in before:
        before += "\n\nParameters\n----------"
    entries = "\n".join(option.documented() for option in options)
    # an entry ``**name`` belongs to the same section, so no blank line separates it
    gap = "\n" if text[end:].startswith("**") else "\n\n"
    return f"{before}\n{entries}{gap}{text[end:]}".rstrip() + "\n"


def _in_words(option: Option) -> str:
    """Return the type of an option in the words of numpydoc."""
    if option.form.kind:
        return option.form.kind + (", optional" if option.default is None else "")
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
    """Return an annotation in the words of numpydoc, such as ``sequence of str``."""
    outer = get_origin(kind)
    if outer is Callable:
        return "callable"
    if _is_union(kind):
        return " or ".join(map(_type_in_words, get_args(kind)))
    if outer is not None:
        inner = " to ".join(map(_type_in_words, get_args(kind)))
        return f"{outer.__name__.replace('Sequence', 'sequence')} of {inner}"
    return str(kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind.__name__)
