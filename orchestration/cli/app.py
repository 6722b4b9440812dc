"""The command ``ppy``. Every command is thin; heavy imports happen inside the command that needs them."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from fmus.kit.errors import UserError

_INTERRUPTED = 130  # 128 + SIGINT, as shells have it
app = typer.Typer(name="ppy", add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
systems = typer.Typer(help="Systems of components: show, draw, check, and export as SSP.")
app.add_typer(systems, name="system")


def _option(*names: str, help: str, metavar: str | None = None) -> Any:
    return typer.Option(*names, help=help, metavar=metavar, show_default=False)


_SECONDS = "in s; default the record's, else the FMU's own."
Model = Annotated[str, typer.Argument(metavar="NAME_OR_FMU", help="A component (see ppy list) or an .fmu file.")]
Set = Annotated[
    list[str] | None,
    _option("--set", metavar="NAME=VALUE[UNIT]", help="Set a parameter, e.g. R1=0.61 or k1=6.3N/mm. Repeatable."),
]
Preset = Annotated[str | None, _option("--preset", help="Start from a preset (see ppy info).")]
Map = Annotated[
    list[str] | None,
    _option(
        "--map",
        metavar="COLUMN=SIGNAL[UNIT]",
        help="Which column is which signal, e.g. U_cell=voltage or stress=force[N]. Repeatable.",
    ),
]
Runtime = Annotated[str, typer.Option("--runtime", help="Which build of a component to run: native or python.")]
System = Annotated[str, typer.Argument(metavar="NAME_OR_SSP", help="A system (see ppy system list) or its file.")]
Picture = Annotated[Path | None, _option("--plot", help="Picture to draw (.png, .svg or .pdf).")]


@app.callback(invoke_without_command=True)
def start(context: typer.Context) -> None:
    """Components of a polypyrrole artificial-muscle rig as FMUs: build, run, compare with measured data.

    Start with [bold]ppy demo[/] (everything once, with pictures) or [bold]ppy list[/] (what there is).
    """
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command("list")
def list_components() -> None:
    """List the components."""
    from fmus import COMPONENTS, component

    width = max(map(len, COMPONENTS))
    for name in COMPONENTS:
        summary = (component(name).__doc__ or "").strip().split("\n")[0].rstrip(".")
        print(f"{name:{width}}  {summary}")


@app.command()
def info(name: Annotated[str, typer.Argument(help="A component (see ppy list).")]) -> None:
    """Show a component's variables, units, defaults, ranges and where the equations come from."""
    from orchestration.reporting import console as screen

    screen.info(name)


@app.command()
def build(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", help="Components; default all.")] = None,
    runtime: Annotated[str, typer.Option(help="python, native or both.")] = "both",
    platforms: Annotated[
        str, typer.Option(help="linux64,win64,darwin64; all: what a compiler here can serve.")
    ] = "all",
    out: Annotated[Path, typer.Option(help="Folder that gets python/NAME.fmu and native/NAME.fmu.")] = Path("fmu"),
) -> None:
    """Build FMUs: OUT/python/NAME.fmu and OUT/native/NAME.fmu."""
    from fmus import COMPONENTS, component
    from fmus.kit import build as kit
    from fmus.kit import files
    from orchestration.reporting import console as screen

    classes = [component(name) for name in names or COMPONENTS]
    runtimes = kit.RUNTIMES if runtime == "both" else (runtime,)
    targets = None if platforms == "all" else [p.strip() for p in platforms.split(",")]
    with screen.progress() as tell:
        for cls in classes:
            for kind in runtimes:
                path = out / kind / f"{cls.name}.fmu"
                files.write(path, kit.build(cls, kind, targets, progress=tell))
                print(path)


@app.command()
def check(files: Annotated[list[Path], typer.Argument(metavar="FMU...", help="FMU files, ours or anybody's.")]) -> None:
    """Check FMUs against the static part of the contract: structure, units, documentation, binaries."""
    from orchestration.reporting import console as screen

    if not screen.check(files):
        raise typer.Exit(1)


@app.command()
def simulate(
    model: Model,
    input_file: Annotated[Path | None, _option("--input", help="Record with the inputs, held between samples.")] = None,
    settings: Set = None,
    preset: Preset = None,
    mapping: Map = None,
    stop: Annotated[float | None, _option("--stop", help=f"Stop time {_SECONDS}")] = None,
    step: Annotated[float | None, _option("--step", help=f"Communication step {_SECONDS}")] = None,
    out: Annotated[Path | None, _option("--out", help="CSV for inputs and outputs, with units.")] = None,
    plot: Picture = None,
    runtime: Runtime = "native",
) -> None:
    """Simulate a component or any FMU."""
    from orchestration.reporting import console as screen

    screen.simulate(model, runtime, input_file, mapping or [], settings or [], preset, stop, step, out, plot)


@app.command()
def run(
    experiment: Annotated[
        str | None,
        typer.Argument(metavar="NAME|FILE.toml|RESULT", help="One of --list, a file, or a result to make again."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        _option("--set", metavar="KEY=VALUE", help="Over the file: duration=20s, R1=610mohm, inputs.current.value=1."),
    ] = None,
    out: Annotated[Path | None, _option("--out", help="Result: .nc, .parquet (both can be run again) or .csv.")] = None,
    plot: Annotated[Path | None, _option("--plot", help="Picture (.png, .svg, .pdf) or page (.html).")] = None,
    runtime: Annotated[
        str | None, _option("--runtime", help="Which build of components to run: native, python.")
    ] = None,
    show_list: Annotated[bool, typer.Option("--list", help="List the experiments that ship.")] = False,
) -> None:
    """Run an experiment: one of the thesis's by name, a TOML file, or a result again, bit by bit."""
    from orchestration.cli import run as screen_run

    if show_list:
        screen_run.catalogue()
        return
    if experiment is None:
        raise UserError("ppy run needs the name or the file of an experiment (ppy run --list shows what there is)")
    complete, reproduced = screen_run.run(experiment, settings or [], runtime, out, plot)
    if not complete:
        raise KeyboardInterrupt
    if not reproduced:
        raise typer.Exit(1)


@app.command()
def compare(
    record: Annotated[Path, typer.Argument(help="Measured record: CSV, Parquet, TDMS, MAT or LabVIEW text.")],
    model: Annotated[str, typer.Option(metavar="NAME_OR_FMU", help="A component or an .fmu file.")] = "ppy_actuator",
    mapping: Map = None,
    settings: Set = None,
    preset: Preset = None,
    fit: Annotated[str | None, _option("--fit", help="Parameters to recalibrate, e.g. R1,R2,C.")] = None,
    out: Annotated[Path | None, _option("--out", help="JSON file for the figures.")] = None,
    plot: Picture = None,
    runtime: Runtime = "native",
) -> None:
    """Hold a model against a measured record: fit in percent, RMS error, whiteness; recalibrate with --fit."""
    from orchestration.reporting import console as screen

    names = [name.strip() for name in (fit or "").split(",") if name.strip()]
    if fit is not None and not names:
        raise UserError(f"--fit {fit!r}: name the parameters to recalibrate, e.g. R1,R2,C")
    screen.compare(record, model, runtime, mapping or [], settings or [], preset, names, out, plot)


@app.command()
def diagnose(
    record: Annotated[Path, typer.Argument(help="Measured record: CSV, Parquet, TDMS, MAT or LabVIEW text.")],
    model: Annotated[
        str | None,
        _option(
            "--model",
            metavar="NAME_OR_CLASS",
            help="A component (see ppy list) or path/to/file.py:Class; default ppy_actuator.",
        ),
    ] = None,
    mapping: Map = None,
    settings: Set = None,
    effects: Annotated[
        str | None, _option("--effects", help="Only these, e.g. diffusion,sensor_lag(voltage); none only recalibrates.")
    ] = None,
    interpolate: Annotated[
        bool, typer.Option("--interpolate", help="Inputs go linearly between samples; default each is held.")
    ] = False,
    hold: Annotated[
        str | None, _option("--hold", help="Parameters that are known and not fitted, e.g. mass,R1; see --set.")
    ] = None,
    holdout: Annotated[
        Path | None, _option("--holdout", help="Another record to judge by; default the last third of the record.")
    ] = None,
    result: Annotated[Path | None, _option("--json", help="JSON file for the verdict and its figures.")] = None,
    report: Annotated[
        Path | None, _option("--report", help="Page (.html) with all of it, to look at and pass on.")
    ] = None,
    fmu: Annotated[
        Path | None, _option("--fmu", help="The extended model as FMU: F.fmu (native) and F.python.fmu beside it.")
    ] = None,
    experiment: Annotated[
        Path | None, _option("--experiment", help="Experiment (.toml) that would tell rivals apart, for ppy run.")
    ] = None,
    system: Annotated[
        Path | None,
        _option("--system", metavar="S.ssp", help="Judge every member of a system alone, cut where it was measured."),
    ] = None,
) -> None:
    """Name what a model gets wrong on a record, extend it, and measure the gain on data it has not seen."""
    if system is not None:
        from orchestration.cli import diagnose_system as screen_members

        others = {
            "--model": model,
            "--effects": effects,
            "--interpolate": interpolate or None,
            "--hold": hold,
            "--holdout": holdout,
            "--report": report,
            "--fmu": fmu,
        }
        screen_members.run(record, system, mapping or [], settings or [], result, others | {"--experiment": experiment})
        return
    wanted, held = ([name.strip() for name in (text or "").split(",") if name.strip()] for text in (effects, hold))
    chosen = None if not wanted else [] if wanted == ["none"] else wanted
    from orchestration.cli import diagnose as screen_diagnose

    files = screen_diagnose.Files(record, holdout, result, report, fmu, experiment)
    model = model or "ppy_actuator"
    screen_diagnose.run(files, model, mapping or [], settings or [], chosen, ["ppy", *sys.argv[1:]], held, interpolate)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, pictures, the record and the report.")] = Path(
        "demo-output"
    ),
) -> None:
    """Do everything once: build, run the thesis's experiments, compare with an emulated rig, recalibrate, report."""
    from orchestration.cli import demo as work

    work.run(out)


@app.command()
def thesis(
    out: Annotated[Path, typer.Option(metavar="FOLDER_OR_HTML", help="Where the page goes.")] = Path("thesis.html"),
) -> None:
    """Recompute the thesis: every table and simulated figure, what holds, what does not and why."""
    from orchestration.thesis import page as work

    work.run(out)


@systems.command("list")
def list_systems() -> None:
    """List the systems that ship."""
    from orchestration.cli import system as screen_system

    screen_system.catalogue()


@systems.command("show")
def show_system(name: System) -> None:
    """Show a system's members, connections, inputs and outputs."""
    from orchestration.cli import system as screen_system

    screen_system.show(name)


@systems.command("draw")
def draw_system(
    name: System,
    out: Annotated[Path | None, _option("--out", help="Picture (.png, .svg or .pdf); default NAME.png.")] = None,
) -> None:
    """Draw a system: members as boxes, connections as arrows."""
    from orchestration.cli import system as screen_system

    screen_system.draw(name, out)


@systems.command("export")
def export_system(
    name: System,
    out: Annotated[Path | None, _option("--out", help="The .ssp, or a .ssd with resources/; default NAME.ssp.")] = None,
    runtime: Runtime = "native",
    connectors: Annotated[
        bool,
        typer.Option("--connectors", help="Inputs and outputs as connectors of the system; not for libcosim, Ecos."),
    ] = False,
) -> None:
    """Write a system with its FMUs as SSP 1.0, for any master that reads it."""
    from orchestration.cli import system as screen_system

    screen_system.export(name, out, runtime, connectors)


@systems.command("check")
def check_system(file: Annotated[Path, typer.Argument(metavar="FILE.ssp", help="System, ours or anybody's.")]) -> None:
    """Check a system: everything connected exists and fits, and every input has one source."""
    from orchestration.cli import system as screen_system

    screen_system.check_file(file)


def main() -> None:
    """Run the command line; every failure is one line on standard error and exit code 2."""
    code: object = 0
    for stream in (sys.stdout, sys.stderr):  # a terminal or a file name that knows no Unicode is no reason to fail
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = app(standalone_mode=False, prog_name="ppy")
        if code == _INTERRUPTED:  # typer has taken the interrupt for itself
            raise KeyboardInterrupt
    except UserError as error:
        _fail(str(error))
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        sys.exit(_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if hasattr(error, "format_message"):  # a usage error; its class moved between versions of typer
            context = getattr(error, "ctx", None)
            _fail(error.format_message() + (f"  (see {context.command_path} --help)" if context else ""))
        if os.environ.get("PPY_DEBUG"):
            raise
        _fail(f"internal error, please report: {type(error).__name__}: {error}  (PPY_DEBUG=1 shows where)")
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str) -> NoReturn:
    print("error: " + " ".join(message.split()), file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
