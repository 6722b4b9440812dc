"""Options that several commands have and Python has not: the model, files to write, isolation.

No ``from __future__ import annotations``: see `orchestration.api.options`.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypedDict

from fmus.kit import registry
from orchestration.api.declaration import Form, Option
from orchestration.api.forms import File, Names, Number, Seconds, names_among, seconds

# --- how values are written ----------------------------------------------------------------------

_SIZES = {
    "": 1.0,
    "B": 1.0,
    "KB": 1e3,
    "MB": 1e6,
    "GB": 1e9,
    "KIB": 2.0**10,
    "MIB": 2.0**20,
    "GIB": 2.0**30,
}
_LEAST = 256e6  # an interpreter with NumPy takes a third of it


def _parse_size(text: str) -> float:
    """Return the bytes of an amount of memory such as ``2GB``; ValueError for anything else."""
    parts = re.fullmatch(r"\s*([0-9.]+(?:e[0-9]+)?)\s*([A-Za-z]*)\s*", text)
    unit = parts.group(2).upper() if parts else None
    try:
        # -1 is out of range: it gets the message for all that is no amount
        size = float(parts.group(1)) * _SIZES[unit] if parts and unit in _SIZES else -1.0
    except ValueError:
        size = -1.0
    if not _LEAST <= size < 1e15:
        raise ValueError(
            f"{text!r}: an amount of memory such as 2GB or 800MB, at least {_LEAST / 1e6:g}MB"
        )
    return size


def _parse_timeout(text: str) -> float:
    value = seconds(text)
    if not 0.0 < value < 1e9:
        raise ValueError(f"{text!r}: a time above 0, such as 10s or 2min")
    return value


_ALL = "all"


def platform_list(names: Sequence[str]) -> list[str] | None:
    """Return the FMI platforms to build for; None is every one that a compiler here can serve."""
    from fmus.kit.build import host_platform

    return None if _ALL in names else [*names] or [host_platform()]


# --- options of several commands ------------------------------------------------------------------

_MODEL = "A component (see ppy list), path/to/file.py:Class, or an .fmu file."
_RUNNABLE = (
    "A component (see ppy list), path/to/file.py:Class, an .fmu file, or a system: its name or .ssp"
    " file."
)


class ModelArgument(TypedDict):
    """The model, a positional argument."""

    model: Annotated[str, Option(_MODEL, metavar="MODEL", complete="component", argument=True)]


class ModelOption(TypedDict):
    """Option ``--model``, for commands without a positional argument for the model."""

    model: Annotated[
        str, Option(_MODEL, default=registry.default_model, metavar="MODEL", complete="component")
    ]


class RunnableArgument(TypedDict):
    """The model or the system, a positional argument."""

    model: Annotated[
        str, Option(_RUNNABLE, metavar="MODEL|SYSTEM", complete="component", argument=True)
    ]


class RunnableOption(TypedDict):
    """The model or the system, as an option."""

    model: Annotated[
        str,
        Option(
            _RUNNABLE, default=registry.default_model, metavar="MODEL|SYSTEM", complete="component"
        ),
    ]


class LaidOverOption(TypedDict):
    """Effects that are part of the model from the start."""

    laid_over: Annotated[
        Names,
        Option(
            "Effects to lay over it (see ppy info), e.g. strain_saturation,sensor_lag(voltage).",
            flag="--with",
            metavar="EFFECTS",
            complete="effect",
        ),
    ]


class PresetOption(TypedDict):
    """The preset that a model starts from."""

    preset: Annotated[str | None, "Start from a preset (see ppy info)."]


class RuntimeOption(TypedDict):
    """The build of a component that is run."""

    runtime: Annotated[
        str | None,
        Option(
            "Which build of components to run: native (default) or python.",
            choices=("native", "python"),
        ),
    ]


class PlatformsOption(TypedDict):
    """The platforms that an FMU is built for, as `platform_list` takes them."""

    platforms: Annotated[
        Sequence[str],
        names_among(("linux64", "win64", "darwin64", "aarch64-linux", _ALL)),
        Option(
            "linux64,win64,darwin64,aarch64-linux, or all that a compiler here can serve; default"
            " this machine's.",
            metavar="PLATFORMS",
            # those of the toolchain, which would take its time to load with every command
        ),
    ]


def _read_tolerances(texts: Sequence[str], flag: str) -> object:
    from orchestration.experiment.regression import read_tolerances

    return read_tolerances(texts, flag)


# by how much a result may differ from a reference
Tolerances = Annotated[Any, Form(_read_tolerances, typed=list[str] | None, metavar="TOLERANCES")]


class RecordArgument(TypedDict):
    """The record, a positional argument."""

    record: Annotated[
        Path, Option("Measured record: CSV, Parquet, TDMS, MAT or LabVIEW text.", argument=True)
    ]


class RecordsArgument(TypedDict):
    """One or several records, a positional argument."""

    records: Annotated[
        list[Path],
        Option(
            "Measured records: CSV, Parquet, TDMS, MAT or LabVIEW text. Several have one set of"
            " parameters.",
            metavar="RECORD...",
            argument=True,
        ),
    ]


class JsonOption(TypedDict):
    """The result as figures."""

    json: Annotated[
        File, "The result as JSON; - is standard output, which then holds nothing else."
    ]


class JunitOption(TypedDict):
    """The verdicts for continuous integration."""

    junit: Annotated[File, "The verdicts as JUnit (.xml), as CI servers show them."]


class PlotOption(TypedDict):
    """The result as a picture."""

    plot: Annotated[File, "Picture to draw (.png, .svg or .pdf)."]


class IsolateOption(TypedDict):
    """Isolation of an FMU that is not ours in a process."""

    isolate: Annotated[
        bool | None,
        Option(
            "Run the FMU in a process of its own, which may crash or hang; default for FMUs that"
            " are not ours.",
            flag="--isolate/--no-isolate",
        ),
    ]


class IsolationOptions(IsolateOption):
    """Isolation of an FMU in a process, and the limits of this process."""

    step_timeout: Annotated[
        float | None,
        Form(parse=_parse_timeout),
        Option("How long a call of an isolated FMU may take; default 60 s.", metavar="TIME"),
    ]
    memory_limit: Annotated[
        float | None,
        Form(parse=_parse_size),
        Option("Memory of an isolated FMU, such as 2GB; default the machine's.", metavar="SIZE"),
    ]


class RealTimeOptions(TypedDict):
    """Pace of a run in real time."""

    real_time: Annotated[bool, "Keep pace with the clock, as a rig does, and tell how well."]
    missed: Annotated[
        str | None,
        Option(
            "Action on a missed deadline: warn (default) or stop.",
            metavar="WHAT",
            choices=("warn", "stop"),
        ),
    ]
    lag: Annotated[
        Seconds, "Lag beyond which the run stops; default 1 s, with a rig half its watchdog."
    ]
    processor: Annotated[Number, Option("The only processor to run on.", flag="--cpu")]
    priority: Annotated[bool, "Ask for a higher priority."]


TUNING_PORT = 5580


class TuningOptions(TypedDict):
    """Parameters that are moved by hand in a run in real time."""

    tunable: Annotated[
        Names,
        Option(
            "Tunable parameters that ppy rig tune and ppy rig watch may move, e.g."
            " pid.proportional_gain; with --real-time.",
            metavar="NAMES",
        ),
    ]
    tuning_port: Annotated[
        int,
        Option(
            "Where they find the run, on this machine; 0 takes a free one.",
            default=TUNING_PORT,
            least=0,
            most=65535,
        ),
    ]
