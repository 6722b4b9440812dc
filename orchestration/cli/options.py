"""Options that several commands share: what they are called, how they are read, how they complete."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from fmus import MODELS
from fmus.kit.errors import UserError


def option(*names: str, help: str, metavar: str | None = None, **more: Any) -> Any:
    """Make an option whose default is told in its help, if at all."""
    return typer.Option(*names, help=help, metavar=metavar, show_default=False, **more)


def comma_list(text: str | None, option: str) -> list[str]:
    """Names that a user separates by commas, none of them empty or there twice; none at all where there is no text."""
    if text is None or not text.strip():
        return []
    names = [name.strip() for name in text.split(",")]
    if "" in names:
        raise UserError(f"{option} {text!r}: there is nothing before or after a comma")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{option} {text!r}: {twice} is named twice")
    return names


def seconds(text: str) -> float:
    """Read a time: a number of seconds, or one with a unit."""
    from orchestration.fmu.signal import read_amount

    try:
        return float(
            text
        )  # a number that makes no sense, such as nan, is refused where its sense is known
    except ValueError:
        pass
    try:
        return read_amount(text, "s", f"{text!r}")
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def complete_components(incomplete: str) -> list[str]:
    """Names of components."""
    return [name for name in MODELS if name.startswith(incomplete)]


def complete_systems(incomplete: str) -> list[str]:
    """Names of systems that ship."""
    from orchestration.system.library import NAMES

    return [name for name in NAMES if name.startswith(incomplete)]


def complete_experiments(incomplete: str) -> list[str]:
    """Names of experiments that ship."""
    from orchestration.experiment.library import shipped

    return [name for name in shipped() if name.startswith(incomplete)]


def complete_effects(context: typer.Context, incomplete: str) -> list[str]:
    """Effects of the component that was named before, after those that are there already; no file is run for it."""
    from fmus import component
    from orchestration.fmu.effects import known_effects

    # while an option lacks its value, what was named before is among the arguments that are not sorted out yet
    words = [*context.args, *(context.params.get("names") or ()), context.params.get("model")]
    name = next((word for word in words if word in MODELS), None)
    if name is None and context.command.name in ("diagnose", "laws") and "--model" not in words:
        name = DEFAULT_MODEL
    if name is None:
        return []
    before, comma, last = incomplete.rpartition(",")
    return [
        f"{before}{comma}{effect}"
        for effect in known_effects(component(name))
        if effect.startswith(last)
    ]


DEFAULT_MODEL = "ppy_actuator"
_MODEL = "A component (see ppy list), path/to/file.py:Class, or an .fmu file."
_TIME = "such as 30s, 10ms or 2min, plain numbers in s; default the record's, else the FMU's own."
Model = Annotated[
    str, typer.Argument(metavar="MODEL", help=_MODEL, autocompletion=complete_components)
]
ModelOption = Annotated[
    str, typer.Option("--model", metavar="MODEL", help=_MODEL, autocompletion=complete_components)
]
With = Annotated[
    str | None,
    option(
        "--with",
        metavar="EFFECTS",
        help="Effects to lay over it (see ppy info), e.g. strain_saturation,sensor_lag(voltage).",
        autocompletion=complete_effects,
    ),
]
Set = Annotated[
    list[str] | None,
    option(
        "--set",
        metavar="NAME=VALUE[UNIT]",
        help="Set a parameter, e.g. R1=0.61 or k1=6.3N/mm. Repeatable.",
    ),
]
Preset = Annotated[str | None, option("--preset", help="Start from a preset (see ppy info).")]
Map = Annotated[
    list[str] | None,
    option(
        "--map",
        metavar="COLUMN=SIGNAL[UNIT]",
        help="Which column is which signal, e.g. U_cell=voltage or stress=force[N]. Repeatable.",
    ),
]
Runtime = Annotated[
    str,
    typer.Option(
        "--runtime",
        help="Which build of a component to run: native or python.",
        autocompletion=lambda incomplete: [
            r for r in ("native", "python") if r.startswith(incomplete)
        ],
    ),
]
Platforms = Annotated[
    str | None,
    option(
        "--platforms",
        metavar="PLATFORMS",
        help="linux64,win64,darwin64,aarch64-linux, or all that a compiler here can serve; default this machine's.",
    ),
]
Stop = Annotated[
    float | None, option("--stop", metavar="TIME", help=f"Stop time, {_TIME}", parser=seconds)
]
Step = Annotated[
    float | None,
    option("--step", metavar="TIME", help=f"Communication step, {_TIME}", parser=seconds),
]
Record = Annotated[
    Path, typer.Argument(help="Measured record: CSV, Parquet, TDMS, MAT or LabVIEW text.")
]
Picture = Annotated[
    Path | None, option("--plot", metavar="FILE", help="Picture to draw (.png, .svg or .pdf).")
]
RigEndpoint = Annotated[
    str, typer.Option("--endpoint", metavar="tcp://HOST:PORT", help="The rig's server.")
]
Credentials = Annotated[
    Path | None,
    option("--credentials", metavar="FILE", help="Key file of a client (ppy rig keys)."),
]
Json = Annotated[
    Path | None,
    option(
        "--json",
        metavar="FILE",
        help="The result as JSON; - is standard output, which then holds nothing else.",
    ),
]


def platform_list(text: str | None) -> list[str] | None:
    """FMI platforms to build for; None is every one that a compiler here can serve."""
    from fmus.kit.build.toolchain import host_platform

    if text == "all":
        return None
    return comma_list(text, "--platforms") or [host_platform()]
