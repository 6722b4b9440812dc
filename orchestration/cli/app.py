"""The command ``ppy``: its commands, each loaded when it is called, and what a failure becomes."""

from __future__ import annotations

import io
import os
import signal
import sys
from importlib import import_module
from inspect import cleandoc
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from fmus.kit import UserError
from orchestration.cli.real_time import IncompleteRecord
from orchestration.reporting import in_shell

_HELP = (
    "Components of a polypyrrole artificial-muscle rig as FMUs: build, run, compare with measured"
    " data.\n\nStart with [bold]ppy demo[/] (everything once, with pictures) or [bold]ppy list[/]"
    " (what there is)."
)
_LONGEST = 300  # characters of a name that are shown
_INTERRUPTED = 130  # 128 + SIGINT, as shells have it
# A line for ``ppy --help``, and the function or group of commands in a module of `commands`.
_COMMANDS = {
    "list": ("List the components.", "list:list_components"),
    "info": (
        "Show a model's variables, units, defaults, ranges, effects, and where they come from.",
        "info:info",
    ),
    "build": ("Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.", "build:build"),
    "check": (
        (
            "Check FMUs against the static part of the contract: structure, units, documentation,"
            " binaries."
        ),
        "check:check",
    ),
    "simulate": ("Simulate a component or any FMU.", "simulate:simulate"),
    "run": (
        (
            "Run an experiment: one of the thesis's by name, a TOML file, or a result again, bit by"
            " bit."
        ),
        "run:run",
    ),
    "sweep": (
        (
            "Run a component or any FMU over many values of its parameters, or a sweep that a TOML"
            " file describes."
        ),
        "sweep:sweep",
    ),
    "compare": (
        (
            "Hold a model against a measured record: fit in percent, RMS error, whiteness;"
            " recalibrate with --fit."
        ),
        "compare:compare",
    ),
    "identify": (
        (
            "Identify parameters of a component or any FMU from a record: values, intervals, and a"
            " file to bind them."
        ),
        "identify:identify",
    ),
    "black-box": (
        (
            "Identify ARX, ARMAX, OE, state-space and Box-Jenkins models of one column of a record,"
            " and choose one."
        ),
        "black_box:black_box",
    ),
    "diagnose": (
        (
            "Name what a model gets wrong on a record, extend it, and measure the gain on data it"
            " has not seen."
        ),
        "diagnose:diagnose",
    ),
    "laws": (
        (
            "Ask every law of a model what it lacks on a record: which signal it hangs on besides,"
            " and by which curve."
        ),
        "diagnose:laws",
    ),
    "demo": (
        (
            "Do everything once: build, run the thesis's experiments, compare with an emulated rig,"
            " recalibrate, report."
        ),
        "thesis:demo",
    ),
    "thesis": (
        (
            "Recompute the thesis: every table and simulated figure, what holds, what does not and"
            " why."
        ),
        "thesis:thesis",
    ),
    "system": ("Systems of components: show, draw, check, and export as SSP.", "system:systems"),
    "rig": (
        "The other end of the cable: serve a rig to proxies, watch it, record from it, stop it.",
        "rig:rig",
    ),
}


class _Commands(TyperGroup):
    """The group of all commands, which loads a command when it is called.

    Putting together all of them takes longer than ``ppy list`` does.
    """

    _listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        return names()

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in _COMMANDS:
            return None
        summary, _ = _COMMANDS[cmd_name]
        if self._listing:
            return TyperCommand(cmd_name, help=summary)
        loaded = load(cmd_name)
        if isinstance(loaded, typer.Typer):
            return typer.main.get_command(loaded)
        alone = typer.Typer(rich_markup_mode="rich", add_completion=False)
        _, _, details = (loaded.__doc__ or "").partition("\n\n")
        alone.command(cmd_name, help=f"{summary}\n\n{cleandoc(details)}")(loaded)
        return typer.main.get_command(alone)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self._listing = True
        super().format_help(ctx, formatter)
        self._listing = False


def names() -> list[str]:
    """Return the names of the commands."""
    return list(_COMMANDS)


def load(name: str) -> Any:
    """Return the function of a command, or the group of commands of a name."""
    module, _, attribute = _COMMANDS[name][1].partition(":")
    return getattr(import_module(f"orchestration.cli.commands.{module}"), attribute)


app = typer.Typer(
    name="ppy", cls=_Commands, rich_markup_mode="rich", pretty_exceptions_enable=False
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"ppy {version('ppy-rig')}")
        raise typer.Exit


@app.callback(invoke_without_command=True, help=_HELP)
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
    """Do what options before the command ask for; print the help where there is no command."""
    if quiet and verbose:
        raise UserError("--quiet and --verbose contradict each other")
    if quiet or verbose:
        from orchestration.reporting import verbosity

        context.with_resource(verbosity(quiet, verbose))
    if context.invoked_subcommand is None:
        print(context.get_help())


def main() -> None:
    """Run the command line; every failure is one line on standard error and exit code 2."""
    code: object = 0
    for stream in (sys.stdout, sys.stderr):
        # a terminal or a file name that knows no Unicode is no reason to fail
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with in_shell():
            code = app(standalone_mode=False, prog_name="ppy")
        if code == _INTERRUPTED:  # typer has taken the interrupt for itself
            raise KeyboardInterrupt
    except (KeyboardInterrupt, typer.Abort):
        # pressed twice, it would end Python on its way out
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print("interrupted", file=sys.stderr)
        sys.exit(_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if os.environ.get("PPY_DEBUG") and not _is_expected(error):
            raise
        _fail(_message(error), 1 if isinstance(error, IncompleteRecord) else 2)
    sys.exit(code if isinstance(code, int) else 0)


def _is_expected(error: Exception) -> bool:
    """Return True for an error about what the user gave."""
    # a usage error is told by what it can do: its class moved between versions of typer
    return isinstance(error, UserError) or hasattr(error, "format_message")


def _message(error: Exception) -> str:
    """Return what the user is told of an error."""
    if isinstance(error, UserError):
        return str(error)
    if hasattr(error, "format_message"):
        context = getattr(error, "ctx", None)
        hint = f"  (see {context.command_path} --help)" if context else ""
        return f"{error.format_message()}{hint}"
    if isinstance(error, OSError) and isinstance(error.filename, str):
        name = error.filename  # and what the system says of this file
        shown = name if len(name) < _LONGEST else f"{name[:_LONGEST]}..."
        return f"{shown}: {error.strerror}"
    return (
        f"internal error, please report: {type(error).__name__}: {error}  (PPY_DEBUG=1 shows where)"
    )


def _fail(message: str, status: int = 2) -> NoReturn:
    print("error: " + " ".join(message.split()), file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
