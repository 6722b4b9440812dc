"""Results of experiments: signals with units over time, with all settings that repeat them.

A result is an :class:`xarray.Dataset` in memory, and NetCDF (``.nc``), Parquet or CSV as a file.
CSV is a record like a measured one and has the numbers only.
"""

from __future__ import annotations

import io
import json
import platform
from collections.abc import Collection, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from pydantic import BaseModel, Json

from fmus.kit import UserError, files, units
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import error_context
from fmus.kit.extras import optional
from fmus.kit.storage import scratch
from orchestration.experiment.model import Experiment, parse
from orchestration.experiment.values import checked
from orchestration.fmu import Signal
from orchestration.master import Pacing
from orchestration.records import Record, header, write_record
from orchestration.reporting import ResultDataset

FORMATS = (".nc", ".csv", ".parquet")
_ABOUT = b"ppy_rig"  # key of the metadata in a Parquet file


class ExperimentResult(ResultDataset):
    """Signals of an experiment over time, with all settings that repeat it.

    A dataset of xarray; a notebook shows its picture and its variables. ``plot()`` draws the
    picture, and ``plot("file.png")`` also writes it.
    """

    __slots__ = ()


def dataset(
    time: Array,
    values: Signals,
    signals: Mapping[str, Signal],
    inputs: Collection[str],
    about: Mapping[str, Any],
) -> ExperimentResult:
    """Return signals over time as a result.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    values : Mapping of str to ndarray, shape (n,)
        By signal, in the FMU's units.
    signals : Mapping of str to Signal
        By the same names.
    inputs : collection of str
        Names of the inputs, which are constant from point to point.
    about : Mapping
        Attributes of the dataset: numbers and texts.

    Raises
    ------
    UserError
        If a signal has the name of the coordinate.
    """
    variables = {
        name: (
            "time",
            array,
            {
                "units": signals[name].unit,
                "long_name": signals[name].doc or name,
                "display_units": signals[name].display,
                "role": "input" if name in inputs else "output",
                "type": signals[name].type,
            },
        )
        for name, array in values.items()
    }
    if "time" in values:
        raise UserError("a signal is named time, as the coordinate of a result is; write .csv")
    clock = {"time": ("time", time, {"units": "s", "long_name": "time"})}
    return ExperimentResult(variables, clock, dict(about))


def side_by_side(
    runs: Mapping[str, ExperimentResult], experiment: Experiment, where: str
) -> ExperimentResult:
    """Return results of variants as one; they have the same times and inputs.

    Parameters
    ----------
    runs : Mapping of str to ExperimentResult
        By the name of the variant.
    experiment : Experiment
        The experiment with these variants.
    where : str
        File or name of the experiment.
    """
    first = next(iter(runs.values()))
    variant_keys = experiment.model_dump(mode="json", include={"parameters", "variants"})
    settings = [json.loads(run.attrs["parameters"]) for run in runs.values()]
    shared = {
        name: value
        for name, value in settings[0].items()
        if all(other.get(name) == value for other in settings)
    }
    about = first.attrs | {
        "title": experiment.title or where,
        "experiment": json.dumps(json.loads(first.attrs["experiment"]) | variant_keys),
        "parameters": json.dumps(shared),
        "wall_time": sum(run.attrs["wall_time"] for run in runs.values()),
    }
    variables = {name: array for name, array in first.items() if array.role == "input"}
    for variant, run in runs.items():
        variables |= {
            f"{variant}.{name}": array.assign_attrs(variant=variant, signal=name)
            for name, array in run.items()
            if array.role == "output"
        }
    return ExperimentResult(variables, first.coords, about)


def displayed(array: xarray.DataArray) -> tuple[Array, str]:
    """Return the values of a signal in its display unit, and that unit."""
    unit = array.attrs.get("display_units", array.units)
    return units.convert(array.values, array.units, unit), unit


def about_experiment(experiment: Experiment, where: str) -> dict[str, Any]:
    """Return attributes about an experiment, its file or name `where`, and the software."""
    return {
        "title": experiment.title or where,
        "source": experiment.source,
        "duration": experiment.duration,
        "step": experiment.step,
        "seed": experiment.seed,
        "runtime": experiment.runtime,
        "over": experiment.over,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": (
            f"ppy-rig {version('ppy-rig')}, numpy {np.__version__}, Python"
            f" {platform.python_version()}"
        ),
        "experiment": experiment.model_dump_json(exclude_none=True),
    }


def about_pace(pacing: Pacing | None) -> dict[str, Any]:
    """Return attributes about the pace of a run; none if it was not in real time."""
    if pacing is None:
        return {}
    return {
        "deadlines": pacing.deadlines,
        "missed_deadlines": pacing.missed,
        "worst_lag": pacing.worst_lag,
        "worst_lag_at": pacing.worst_at,
        "lateness": json.dumps({"upper_bounds": pacing.edges, "counts": pacing.counts}),
    }


def check_format(path: Path) -> None:
    """Raise UserError if the ending of a file is that of no format."""
    if path.suffix.lower() not in FORMATS:
        raise UserError(
            f"--out {path}: its name must end in {', '.join(FORMATS)}, not"
            f" {path.suffix or 'nothing'!r}"
        )


def check(sketch: xarray.Dataset, path: Path) -> None:
    """Check that a format can store a result, by writing one of a single point to a scratch folder.

    Raises
    ------
    UserError
        If the format does not allow a name.
    """
    with scratch.folder("check") as folder:
        _write(sketch, folder / f"sketch{path.suffix}", str(path))


def write(data: xarray.Dataset, path: Path) -> None:
    """Write a result, whole or not at all, in the format of the file's ending.

    Raises
    ------
    UserError
        If the file cannot be written, the ending is no format, or the format does not allow a name.
    """
    check_format(path)
    _write(data, path, str(path))


def _write(data: xarray.Dataset, path: Path, called: str) -> None:
    """Write a result in the format of the file's ending; `called` is its name in messages."""
    kind = path.suffix.lower()
    if kind == ".nc":
        try:
            content = bytes(data.to_netcdf(engine="scipy"))
        except UnicodeEncodeError as error:
            raise UserError(
                f"{called}: {error.object!r} cannot be a name in NetCDF 3; write .parquet"
            ) from error
        except ValueError as error:
            raise UserError(f"{called}: {error}; write .parquet") from error
        files.write(path, content)
    elif kind == ".parquet":
        files.write(path, _parquet(data, called))
    else:
        columns = {str(name): array.values for name, array in data.items()}
        units = {str(name): array.units for name, array in data.items()}
        with error_context(called):
            header(units)
        write_record(path, data.time.values, columns, units)


def _parquet(data: xarray.Dataset, called: str) -> bytes:
    with optional():
        import pyarrow
        from pyarrow import parquet
    whole = {"time": data.time, **data}
    table = pyarrow.table(
        {f"{name} [{array.units}]": array.values for name, array in whole.items()}
    )
    about = {
        "attributes": data.attrs,
        "variables": {str(name): array.attrs for name, array in whole.items()},
    }
    buffer = io.BytesIO()
    parquet.write_table(table.replace_schema_metadata({_ABOUT: json.dumps(about).encode()}), buffer)
    return buffer.getvalue()


def read(path: Path) -> xarray.Dataset:
    """Read a result with its experiment, from NetCDF or Parquet.

    Raises
    ------
    UserError
        If the file cannot be read or is not such a result.
    """
    try:
        content = path.read_bytes()
        if content.startswith(b"PAR1"):
            data = _from_parquet(content)
        else:
            data = xarray.load_dataset(io.BytesIO(content), engine="scipy", decode_times=False)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UserError:
        raise
    except Exception as error:  # a damaged file can raise any error in these libraries
        raise UserError(
            f"{path}: not a result of ppy run, or damaged (.nc and .parquet hold an experiment)"
        ) from error
    if "experiment" not in data.attrs:
        raise UserError(f"{path}: holds no experiment; only results of ppy run do")
    about = checked(_About, data.attrs, f"{path}: not a result of ppy run, or damaged")
    parse(about.experiment, f"{path}: experiment", str(path.parent))
    time = data.coords.get("time")
    if (
        time is None
        or time.ndim != 1
        or not time.size
        or time.dtype.kind != "f"
        or not np.isfinite(time).all()
    ):
        raise UserError(f"{path}: not a result of ppy run, or damaged: it has no times")
    return data


class _About(BaseModel):
    """Attributes of a result that commands read."""

    experiment: Json[dict[str, Any]]
    guids: Json[dict[str, str]]
    complete: int
    versions: str


def _from_parquet(content: bytes) -> xarray.Dataset:
    with optional():
        from pyarrow import parquet

    table = parquet.read_table(io.BytesIO(content))
    about = json.loads(table.schema.metadata[_ABOUT])
    columns = {
        name: table[f"{name} [{a['units']}]"].to_numpy() for name, a in about["variables"].items()
    }
    variables = {name: ("time", columns[name], a) for name, a in about["variables"].items()}
    return xarray.Dataset(variables, attrs=about["attributes"]).set_coords("time")


def as_record(data: xarray.Dataset, name: str) -> Record:
    """Return the signals of a result as a record from a file of that name."""
    signals = {str(one): np.asarray(array.values, dtype=float) for one, array in data.items()}
    signal_units = {str(one): array.units for one, array in data.items()}
    return Record(np.asarray(data.time.values, dtype=float), signals, signal_units, Path(name))
