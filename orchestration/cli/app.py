"""The command ``ppy``, put together. Every command is in a file of its own and imports what is heavy when it runs."""

from __future__ import annotations

import io
import os
import signal
import sys
from importlib import import_module
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from fmus.kit.errors import UserError

_LONGEST = 300  # characters of a name that are shown
_INTERRUPTED = 130  # 128 + SIGINT, as shells have it
# What there is: a line for ``ppy --help``, and the function or group of commands in a module beside this one.
_COMMANDS = {
    "list": ("List the components.", "components:list_components"),
    "info": (
        "Show a model's variables, units, defaults, ranges, effects, and where they come from.",
        "info:info",
    ),
    "build": ("Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu.", "build:build"),
    "check": (
        "Check FMUs against the static part of the contract: structure, units, documentation, binaries.",
        "components:check",
    ),
    "simulate": ("Simulate a component or any FMU.", "simulate:simulate"),
    "run": (
        "Run an experiment: one of the thesis's by name, a TOML file, or a result again, bit by bit.",
        "run:run",
    ),
    "sweep": (
        "Run a component or any FMU over many values of its parameters, or a sweep that a TOML file describes.",
        "sweep:sweep",
    ),
    "compare": (
        "Hold a model against a measured record: fit in percent, RMS error, whiteness; recalibrate with --fit.",
        "compare:compare",
    ),
    "identify": (
        "Identify parameters of a component or any FMU from a record: values, intervals, and a file to bind them.",
        "identify:identify",
    ),
    "black-box": (
        "Identify ARX, ARMAX, OE, state-space and Box-Jenkins models of one column of a record, and choose one.",
        "black_box:black_box",
    ),
    "diagnose": (
        "Name what a model gets wrong on a record, extend it, and measure the gain on data it has not seen.",
        "diagnose:diagnose",
    ),
    "laws": (
        "Ask every law of a model what it lacks on a record: which signal it hangs on besides, and by which curve.",
        "laws:laws",
    ),
    "demo": (
        "Do everything once: build, run the thesis's experiments, compare with an emulated rig, recalibrate, report.",
        "demo:demo",
    ),
    "thesis": (
        "Recompute the thesis: every table and simulated figure, what holds, what does not and why.",
        "thesis:thesis",
    ),
    "system": ("Systems of components: show, draw, check, and export as SSP.", "system:systems"),
    "rig": (
        "The other end of the cable: serve a rig to proxies, watch it, record from it, stop it.",
        "rig:rig",
    ),
}


class _Commands(TyperGroup):
    """Loads a command when it is called: putting together all of them takes longer than ``ppy list`` does."""

    _listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in _COMMANDS:
            return None
        summary, place = _COMMANDS[cmd_name]
        if self._listing:
            return TyperCommand(cmd_name, help=summary)
        module, _, name = place.partition(":")
        found = getattr(import_module(f"orchestration.cli.commands.{module}"), name)
        if not isinstance(found, typer.Typer):
            function, found = found, typer.Typer(rich_markup_mode="rich", add_completion=False)
            found.command(cmd_name)(function)
        return get_command(found)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self._listing = True
        super().format_help(ctx, formatter)
        self._listing = False


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
    """Components of a polypyrrole artificial-muscle rig as FMUs: build, run, compare with measured data.

    Start with [bold]ppy demo[/] (everything once, with pictures) or [bold]ppy list[/] (what there is).
    """
    if quiet and verbose:
        raise UserError("--quiet and --verbose contradict each other")
    if quiet or verbose:
        from orchestration.reporting.console import verbosity

        context.with_resource(verbosity(quiet, verbose))
    if context.invoked_subcommand is None:
        print(context.get_help())


def main() -> None:
    """Run the command line; every failure is one line on standard error and exit code 2."""
    code: object = 0
    for stream in (
        sys.stdout,
        sys.stderr,
    ):  # a terminal or a file name that knows no Unicode is no reason to fail
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = app(standalone_mode=False, prog_name="ppy")
        if code == _INTERRUPTED:  # typer has taken the interrupt for itself
            raise KeyboardInterrupt
    except UserError as error:
        _fail(str(error))
    except (KeyboardInterrupt, typer.Abort):
        signal.signal(
            signal.SIGINT, signal.SIG_IGN
        )  # pressed twice, it would end Python on its way out
        print("interrupted", file=sys.stderr)
        sys.exit(_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if hasattr(
            error, "format_message"
        ):  # a usage error; its class moved between versions of typer
            context = getattr(error, "ctx", None)
            _fail(
                error.format_message()
                + (f"  (see {context.command_path} --help)" if context else "")
            )
        if os.environ.get("PPY_DEBUG"):
            raise
        if isinstance(error, OSError) and isinstance(
            error.filename, str
        ):  # what the system says of a file
            shown = (
                error.filename
                if len(error.filename) < _LONGEST
                else f"{error.filename[:_LONGEST]}..."
            )
            _fail(f"{shown}: {error.strerror}")
        _fail(
            f"internal error, please report: {type(error).__name__}: {error}  (PPY_DEBUG=1 shows where)"
        )
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str) -> NoReturn:
    print("error: " + " ".join(message.split()), file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
