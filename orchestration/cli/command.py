"""Commands of typer, made from classes of options."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from inspect import Parameter, Signature, signature
from typing import Annotated, Any

import typer

from fmus.kit import UserError, registry
from orchestration.api.declaration import REQUIRED, Option, options_of
from orchestration.cli.outputs import standard_output_for
from orchestration.cli.panels import panel_of

Body = Callable[..., None]


def command(declared: type) -> Callable[[Body], Body]:
    """Give a function of options the signature from which typer makes a command.

    Parameters
    ----------
    declared : TypedDict
        Class of the options.

    Returns
    -------
    callable
        Decorator of a function that takes the values of all options, and typer's context if it has
        a second argument. While it runs, standard output is reserved for JSON if ``--json -`` is
        given. The attribute ``__options__`` of the result has the options by name.
    """
    options = {
        name: _with_default(option)
        for name, option in options_of(declared).items()
        if option.on_command_line
    }

    def decorate(body: Body) -> Body:
        wants_context = len(signature(body).parameters) > 1

        def run(context: typer.Context, **typed: Any) -> None:
            values = {name: option.read(typed[name]) for name, option in options.items()}
            with standard_output_for(values.get("json")):
                if wants_context:
                    body(values, context)
                else:
                    body(values)

        made: Any = run
        made.__name__ = body.__name__
        made.__doc__ = body.__doc__
        made.__module__ = body.__module__
        made.__annotations__ = {}  # typer reads those of the signature
        made.__options__ = options
        made.__signature__ = Signature([_CONTEXT, *map(_parameter, options.values())])
        return run

    return decorate


def refuse(
    declared: type,
    options: Mapping[str, object],
    reason: str,
    names: Iterable[str] | None = None,
) -> None:
    """Refuse options that are for other uses of a command.

    Parameters
    ----------
    declared : type
        Class that declares options of the command.
    options : Mapping of str to object
        Their values.
    reason : str
        End of the message, after the flag.
    names : iterable of str, optional
        Of those that are refused; by default all that the class declares.

    Raises
    ------
    UserError
        If one of them is given.
    """
    known = options_of(declared)
    for name in known if names is None else names:
        option = _with_default(known[name])
        if not option.is_default(options[name]):
            raise UserError(f"{option.flags[0]} {reason}")


def _with_default(option: Option) -> Option:
    """Return an option with a value as its default, which may be declared as a function of it."""
    return option._replace(default=option.default()) if callable(option.default) else option


_WORDS = list[str] | None  # of an option that may be given several times
_CONTEXT = Parameter("context", Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)


def _parameter(option: Option) -> Parameter:
    """Return the parameter from which typer reads an option."""
    kind = option.type if option.form.typed is None else option.form.typed
    more: dict[str, Any] = {
        "help": option.help,
        "metavar": option.metavar or ("NAMES" if kind == _WORDS else None),
        "parser": _parser(option),
        "min": option.least,
        "max": option.most,
        "autocompletion": _completion(option),
        "rich_help_panel": None if option.argument else panel_of(option.name),
    }
    names = () if option.argument else ("/".join(option.flags), *filter(None, [option.alias]))
    about = typer.Argument(**more) if option.argument else typer.Option(*names, **more)
    default = Parameter.empty if option.default is REQUIRED else _typed_default(option)
    return Parameter(
        option.name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, about]
    )


def _typed_default(option: Option) -> Any:
    """Return the default as a user types it, for the help."""
    if option.form.typed is None:
        return option.default
    if option.form.typed is bool:
        return False
    if option.default in (None, ()):
        return None
    words = option.form.write(option.default)
    return words if option.form.typed == _WORDS else words[0]


def _parser(option: Option) -> Callable[[str], Any] | None:
    """Return the parser of one text with typer's error for a wrong one; None without a parser."""
    parse = option.form.parse
    if parse is None:
        return None

    def parser(text: str) -> Any:
        try:
            return parse(text)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    return parser


# --- completion ----------------------------------------------------------------------------------


def _completion(option: Option) -> Callable[..., list[str]] | None:
    """Return the function that completes a value in a shell; None if there is none."""
    if option.complete:
        return _COMPLETIONS[option.complete]
    return _complete(lambda: option.choices) if option.choices else None


def _complete(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return a function that completes a text to names, which are listed when it is called."""
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


def _systems() -> Iterable[str]:
    from orchestration.system import NAMES

    return NAMES


def _experiments() -> Iterable[str]:
    from orchestration.experiment import shipped

    return shipped()


def _complete_effects(context: typer.Context, incomplete: str) -> list[str]:
    """Return completions by effects of the component in the words before; no user's file is run.

    Each begins with the effects that are typed already.
    """
    from orchestration.fmu.model import known_effects

    # while an option lacks its value, earlier names are among the arguments that are not
    # sorted out yet
    words = [*context.args, *(context.params.get("names") or ()), context.params.get("model")]
    name = next((word for word in words if word in registry.models()), None)
    if name is None and context.command.name in ("diagnose", "laws") and "--model" not in words:
        name = registry.default_model()
    if name is None:
        return []
    before, comma, last = incomplete.rpartition(",")
    effects = known_effects(registry.component(name))
    return [f"{before}{comma}{effect}" for effect in effects if effect.startswith(last)]


_COMPLETIONS: Mapping[str, Callable[..., list[str]]] = {
    "component": _complete(registry.models),
    "effect": _complete_effects,
    "experiment": _complete(_experiments),
    "system": _complete(_systems),
}
