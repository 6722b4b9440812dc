"""The command ``ppy``: its commands, each loaded when it is called, and the handling of errors."""

from __future__ import annotations

import io
import os
import re
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from inspect import cleandoc
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from fmus.kit import UserError, quoting
from fmus.kit.extras import optional
from fmus.kit.interrupt import raise_interrupt
from fmus.kit.registry import RegistryWarning
from orchestration.cli.ending import INTERRUPTED, end_interrupted, end_unloadable, is_of_import
from orchestration.cli.examples import epilog
from orchestration.cli.real_time import IncompleteRecord
from orchestration.reporting import in_shell

_LONGEST = 300  # characters of a name that are shown
_MODULES = "orchestration.cli.commands"
_ENTRY_POINTS = "ppy_rig.commands"  # group of the commands of installed packages, as in `_GROUPS`
_Groups = Mapping[str, Mapping[str, tuple[str, str]]]
# By task: a line for ``ppy --help``, which has room for one at 80 columns, and the
# function or group of commands in a module, which is named from `commands` on.
_GROUPS: _Groups = {
    "Find out what is wrong": {
        "diagnose": (
            "Name what a model gets wrong on a record, and extend it by that.",
            ".diagnose:diagnose",
        ),
        "laws": (
            "Search the laws for missing dependences: of which signal.",
            ".diagnose:laws",
        ),
        "compare": (
            "Compare a model with a record: fit in percent; --fit refits.",
            ".compare:compare",
        ),
        "identify": (
            "Identify parameters of a component or any FMU from a record.",
            ".identify:identify",
        ),
        "age": (
            "Follow an actuator's ageing, forecast its life, derate it.",
            ".age:age",
        ),
        "frequency": (
            "Estimate impedance and dynamic stiffness, with intervals.",
            ".frequency:frequency",
        ),
        "black-box": (
            "Identify ARX to Box-Jenkins models of a column, and choose one.",
            ".black_box:black_box",
        ),
    },
    "Models, systems, experiments, rigs": {
        "list": ("List the components.", ".list:list_components"),
        "info": ("Show a model's variables, units, ranges, effects, sources.", ".info:info"),
        "new": ("Write a model, an effect or a rig's backend to start from.", ".new:new"),
        "build": ("Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.", ".build:build"),
        "export": ("Write components as a package of Modelica.", ".export:exports"),
        "check": ("Check FMUs: structure, units, documentation, binaries.", ".check:check"),
        "linearise": (
            "State space, Bode, margins, poles of a component, FMU, system.",
            ".linearise:linearise",
        ),
        "design": (
            "Tune a loop: a controller with its margins, as FMU and system.",
            ".design:design",
        ),
        "simulate": ("Simulate a component, any FMU, or a system (.ssp).", ".simulate:simulate"),
        "run": ("Run an experiment, a system, or a result again, bit for bit.", ".run:run"),
        "system": ("Show, draw and check systems of FMUs; export them as SSP.", ".system:systems"),
        "sweep": ("Run a model over many values of its parameters.", ".sweep:sweep"),
        "optimise": (
            "Search parameters for the best, or for a Pareto front.",
            ".optimise:optimise",
        ),
        "rig": ("Serve a rig, watch it, record from it, stop it.", ".rig:rig"),
    },
}
_OWN = {name: about for group in _GROUPS.values() for name, about in group.items()}
_OPTIONS = "-q|-v|--version"
_HINT = "examples: --help; find: --help WORDS"
_TASK = "task"  # key of the words after --help


class _Commands(TyperGroup):
    """The group of all commands, which loads a command when it is called.

    Putting together all of them takes longer than ``ppy list`` does.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        return names()

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        # entry points are read only where the command is none of our own
        if cmd_name not in _OWN and cmd_name not in names():
            return None
        loaded = load(cmd_name)
        if not isinstance(loaded, typer.Typer):
            return _single_command(cmd_name)
        group: Any = typer.main.get_command(loaded)
        group.help, _ = _summary_and_place(cmd_name)
        for name, member in group.commands.items():
            member.epilog = epilog(f"{cmd_name} {name}")
        # commands that installed packages add to the group
        for words in filter(re.compile(f"{cmd_name} ").match, _commands()):
            added = _single_command(words)
            group.add_command(added, added.name)
        return group

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args[:1] == ["--help"]:
            ctx.meta[_TASK] = " ".join(args[1:])
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the commands by their group within 24 lines, or those for a task."""
        if ctx.meta.get(_TASK):
            _write_tasks(ctx.meta[_TASK], formatter)
            return
        formatter.write(f"Usage: ppy [{_OPTIONS}] COMMAND ... ({_HINT})\n")
        width = max(map(len, names()))
        for title, group in _groups().items():
            formatter.write(typer.style(title, bold=True) + "\n")
            for name in filter(group.get, names()):
                formatter.write(f"  {name:{width}}  {group[name][0]}\n")


def _write_tasks(words: str, formatter: Any) -> None:
    """Write the tasks that words are about, each with its command."""
    from orchestration.cli.tasks import tasks

    found = tasks(words, names())
    if not found:
        formatter.write(f"no task is found by {words!r}; ppy --help lists the commands\n")
    for task, command in found:
        formatter.write(f"{task}\n  {typer.style(command, bold=True)}\n")


def _single_command(words: str) -> Any:
    """Return the command of typer that a function becomes; `words` are typed after ``ppy``."""
    function = load(words)
    summary, _ = _summary_and_place(words)
    _, _, details = (function.__doc__ or "").partition("\n\n")
    text = f"{summary}\n\n{cleandoc(details)}"
    alone = typer.Typer(rich_markup_mode="rich", add_completion=False)
    alone.command(words.split()[-1], help=text, epilog=epilog(words))(function)
    return typer.main.get_command(alone)


@cache
def _groups() -> _Groups:
    """Return our own commands, then those of installed packages, grouped by task.

    A package that cannot be loaded does not affect the others, and none replaces a command of ours.
    """
    from importlib.metadata import entry_points

    groups = {title: dict(group) for title, group in _GROUPS.items()}
    for entry in entry_points(group=_ENTRY_POINTS):
        try:
            for title, group in entry.load().items():
                for name, (summary, function) in group.items():
                    if name not in _OWN:
                        groups.setdefault(title, {})[name] = (summary, function)
        except Exception as error:
            raise_interrupt(error)
            from orchestration.reporting.console import warn

            warn(f"commands of {entry.value} are left out: {type(error).__name__}: {error}")
    return groups


def _commands() -> dict[str, tuple[str, str]]:
    """Return the summary and the function of all commands, by the words that call them."""
    return {words: about for group in _groups().values() for words, about in group.items()}


def _summary_and_place(words: str) -> tuple[str, str]:
    """Return the line for the help of a command, and the place ``.module:function`` of it."""
    return _OWN.get(words) or _commands()[words]


def names() -> list[str]:
    """Return the names of the commands, without those that a package adds to a group."""
    return [words for words in _commands() if " " not in words]


def load(name: str) -> Any:
    """Return the function of a command, or the group of commands of a name."""
    module, _, attribute = _summary_and_place(name)[1].partition(":")
    return getattr(import_module(module, _MODULES), attribute)


app = typer.Typer(
    name="ppy", cls=_Commands, rich_markup_mode="rich", pretty_exceptions_enable=False
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"ppy {version('ppy-rig')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only results and errors.")] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose", "-v", help="Also what is used and built, and how long each step took."
        ),
    ] = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Say which version this is.", callback=_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Apply the options before the command; print the help where there is no command."""
    if quiet and verbose:
        raise UserError("--quiet and --verbose contradict each other")
    if quiet or verbose:
        from orchestration.reporting.console import verbosity

        context.with_resource(verbosity(quiet, verbose))
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the command line; every failure is one line on standard error and exit code 2."""
    code: object = 0
    for stream in (sys.stdout, sys.stderr):
        # a terminal or a file name that knows no Unicode is no reason to fail
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with in_shell(), optional(), _registry_warnings_as_remarks():
            code = _run()
        if code == INTERRUPTED:  # typer has taken the interrupt for itself
            raise KeyboardInterrupt
    except (KeyboardInterrupt, typer.Abort) as ended:
        _end_aborted(ended.__cause__)
    except BrokenPipeError:  # the reader of our output left, as `head` does
        _drop_output()
    except Exception as error:
        if isinstance(error, OSError) and error.filename is None and _output_fails():
            _drop_output()
            _fail(f"standard output: {error.strerror}")
        if os.environ.get("PPY_DEBUG") and not _is_expected(error):
            raise
        _fail(_message(error), 1 if isinstance(error, IncompleteRecord) else 2)
    sys.exit(code if isinstance(code, int) else 0)


def _run() -> object:
    """Run the command that is asked for, and return the exit code that it asks for.

    Raises
    ------
    KeyboardInterrupt
        After a Ctrl-C, also if another error was raised from it.
    """
    try:
        return app(standalone_mode=False, prog_name="ppy")
    except Exception as error:
        raise_interrupt(error)
        raise


def _output_fails() -> bool:
    """Return whether standard output takes no line, as of a full device."""
    try:
        os.write(sys.stdout.fileno(), b"\n")
    except OSError:
        return True
    return False


def _drop_output() -> None:
    """Send what is still to be printed nowhere, or Python would fail on it at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _registry_warnings_as_remarks() -> Iterator[None]:
    """Print warnings about packages that are left out like other remarks, in one line."""
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, RegistryWarning):
            from orchestration.reporting.console import warn

            warn(str(message))
        else:
            usual(message, category, *where, **more)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


def _end_aborted(cause: BaseException | None) -> NoReturn:
    """Exit after an interrupt, or after an end of file, which typer reports as an interrupt."""
    if not isinstance(cause, EOFError):
        end_interrupted()
    if is_of_import(cause):
        end_unloadable(cause)
    _fail(_message(cause))


def _is_expected(error: Exception) -> bool:
    """Return True for an error in the user's input."""
    # a usage error is recognised by its methods: its class moved between versions of typer
    return isinstance(error, UserError) or hasattr(error, "format_message")


def _message(error: Exception) -> str:
    """Return the message of an error for the user."""
    if isinstance(error, UserError):
        return str(error)
    if hasattr(error, "format_message"):
        context = getattr(error, "ctx", None)
        hint = f"  (see {context.command_path} --help)" if context else ""
        return f"{error.format_message()}{hint}"
    if isinstance(error, OSError) and isinstance(error.filename, str):
        name = error.filename  # and the system's message about this file
        shown = name if len(name) < _LONGEST else f"{name[:_LONGEST]}..."
        return f"{shown}: {error.strerror}"
    from orchestration.fmu.model import faulty_place

    place = faulty_place(error)
    if place:
        return f"{place}: {type(error).__name__}: {error}"
    return (
        f"internal error, please report: {type(error).__name__}: {error}  (PPY_DEBUG=1 shows where)"
    )


def _fail(message: str, status: int = 2) -> NoReturn:
    text = quoting.line(message)
    print(f"error: {text}", file=sys.stderr)
    if "GITHUB_ACTIONS" in os.environ:
        from orchestration.cli.verdicts import annotate

        annotate(text)
    sys.exit(status)
