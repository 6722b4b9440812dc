"""Sobol indices: the share of an output's variance that each parameter explains, by SALib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray
from rich.table import Table

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.reporting import pictures, plain_table
from orchestration.sweeps.curves import describe_omission, names_to_draw
from orchestration.sweeps.result import SweepResult
from orchestration.sweeps.sensitivity.numbers import (
    numbers,
    parameters_of,
    require_complete,
    require_design,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SOBOL_INDICES = "sobol-indices"
ORDERS = ("first", "total")
_RESAMPLES = 1000  # of the bootstrap
_LARGEST = 4_000_000  # most values of an array of the bootstrap, which has about six of them


def saltelli_points(count: int, samples: int, seed: int) -> Array:
    """Return points for the estimation of Sobol indices.

    Source: Saltelli et al., Comput. Phys. Commun. 181, 2010.

    Parameters
    ----------
    count : int
        Number of parameters, p.
    samples : int
        Number of base points, N, a power of two.
    seed : int

    Returns
    -------
    ndarray, shape (N (p + 2), p)
        Shares of the ranges, 0 to 1.
    """
    with optional():
        from SALib.sample import sobol

    points = sobol.sample(_problem(count), samples, calc_second_order=False, seed=seed)
    return np.asarray(points, dtype=float)


def _problem(count: int) -> dict[str, object]:
    """Return the description of parameters between 0 and 1 for SALib."""
    return {
        "num_vars": count,
        "names": [f"x{k}" for k in range(count)],
        "bounds": [[0.0, 1.0]] * count,
    }


def sensitivity(found: xarray.Dataset, *, level: float = 0.95, seed: int = 0) -> SweepResult:
    """Return the Sobol indices of the parameters of a sweep of ``sobol-indices``.

    Parameters are independent and uniformly distributed over their ranges, or over the logarithm of
    a range with ``log``. The first-order index of a parameter is the share of an output's variance
    that it explains alone; the total index includes its interactions with other parameters (Sobol;
    Saltelli et al., Comput. Phys. Commun. 181, 2010).

    Parameters
    ----------
    found : xarray.Dataset
        Result of `sweep` with ``kind="sobol-indices"``, also if it was read from a file.
    level : float
        Level of the confidence intervals.
    seed : int
        Seed of the bootstrap for these intervals.

    Returns
    -------
    SweepResult
        Indices of each number of the sweep, such as ``voltage_last_index`` over ``index``
        (``first``, ``total``) and ``parameter``, and their intervals,
        ``voltage_last_index_interval``, also over ``end`` (``lower``, ``upper``). NaN for a number
        that does not vary.

    Raises
    ------
    UserError
        If it is not such a sweep, or one of its cases failed, as all are needed.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> over = {"R1": "0.3..0.7", "C": "5..10"}
    >>> found = ppy.sweep(
    ...     "ppy_actuator", over, {"current": 0.5}, stop=10.0, kind="sobol-indices", samples=64
    ... )
    >>> shares = ppy.sensitivity(found)["voltage_last_index"]
    >>> bool(shares.sel(index="first", parameter="R1") < shares.sel(index="first", parameter="C"))
    True
    """
    require_design(found, SOBOL_INDICES)
    if not 0.0 < level < 1.0:
        raise UserError(f"level {level:g} of a confidence interval (allowed: between 0 and 1)")
    require_complete(found, "Sobol indices")
    parameters = parameters_of(found)
    if found.sizes["case"] % (len(parameters) + 2):
        raise UserError(f"{found.sizes['case']} cases are not all of a sweep for Sobol indices")
    values: dict[str, object] = {}
    for name in numbers(found):
        index, half_width = _indices(found[name].values, len(parameters), level, seed)
        interval = np.stack([index - half_width, index + half_width], axis=-1)
        title = f"Sobol indices of {name}"
        values[f"{name}_index"] = (
            ("index", "parameter"),
            index,
            {"units": "1", "long_name": title},
        )
        title_of_interval = f"{100.0 * level:g} % confidence interval of {name}_index, by bootstrap"
        values[f"{name}_index_interval"] = (
            ("index", "parameter", "end"),
            interval,
            {"units": "1", "long_name": title_of_interval},
        )
    coordinates = {"index": list(ORDERS), "parameter": parameters, "end": ["lower", "upper"]}
    attributes = {"model": found.attrs["model"], "design": SOBOL_INDICES, "level": level}
    return SweepResult(values, coordinates, attributes)


def _indices(values: Array, count: int, level: float, seed: int) -> tuple[Array, Array]:
    """Return first-order and total indices, shape (2, p), and half-widths of their intervals."""
    with optional():
        from SALib.analyze import sobol

    is_constant = np.ptp(values) <= 1e-12 * np.abs(values).max()  # up to rounding
    if is_constant:
        return np.full((2, count), np.nan), np.full((2, count), np.nan)
    resamples = int(np.clip(_LARGEST * (count + 2) // len(values), 100, _RESAMPLES))
    indices = sobol.analyze(
        _problem(count),
        values,
        calc_second_order=False,
        conf_level=level,
        num_resamples=resamples,
        seed=seed + 1,  # SALib ignores a seed of zero
    )
    half_widths = np.array([indices["S1_conf"], indices["ST_conf"]])
    return np.array([indices["S1"], indices["ST"]]), half_widths


def table(indices: xarray.Dataset) -> Table:
    """Return a table of indices, with the parameter of the largest total index first."""
    interval = f"{100.0 * indices.attrs['level']:g} % interval"
    columns = ("first order", interval, "total", interval)
    result = plain_table(None, "variance of", "from", *columns, right=columns[:3])
    for name in _numbers(indices):
        for parameter in _ranked(indices[f"{name}_index"]):
            row = indices.sel(parameter=parameter)
            cells: list[str] = []
            for order in ORDERS:
                value = float(row[f"{name}_index"].sel(index=order))
                lower, upper = row[f"{name}_index_interval"].sel(index=order).values
                if np.isfinite(value):
                    cells += [f"{value:.3f}", f"{lower:.3f} … {upper:.3f}"]
                else:
                    cells += ["none", ""]
            result.add_row(name, parameter, *cells)
    return result


def draw(indices: xarray.Dataset) -> Figure:
    """Draw first-order and total index of each parameter as bars with their intervals."""
    names = names_to_draw(_numbers(indices))
    title = f"{indices.attrs['model']}: shares of the variance"
    figure, panels = pictures.panels(len(names), title)
    parameters = [str(p) for p in indices["parameter"].values]
    x = np.arange(len(parameters))
    colours = (pictures.MODEL, pictures.MEASURED)
    for panel, name in zip(panels, names, strict=True):
        for k, (order, colour) in enumerate(zip(ORDERS, colours, strict=True)):
            value = indices[f"{name}_index"].sel(index=order).values
            upper = indices[f"{name}_index_interval"].sel(index=order, end="upper").values
            panel.bar(
                x + 0.38 * (k - 0.5),
                value,
                0.36,
                yerr=upper - value,
                capsize=2.5,
                color=colour,
                error_kw={"lw": 1.0},
                label="first order" if order == "first" else "total",
            )
        panel.set_axisbelow(True)
        panel.set_ylim(min(0.0, panel.get_ylim()[0]), max(1.0, panel.get_ylim()[1]))
        pictures.label(panel, name, "1")
    pictures.legend_above(panels[0], 2)
    pictures.name_ticks(panels[-1].xaxis, x, parameters)
    panels[-1].set_xlabel("parameter")
    return figure


def omissions(indices: xarray.Dataset) -> list[str]:
    """Return a line on indices that the picture does not show, if there are any."""
    return describe_omission(_numbers(indices))


def _numbers(indices: xarray.Dataset) -> list[str]:
    """Return the names of the numbers that have indices."""
    return [str(name).removesuffix("_index") for name in indices if str(name).endswith("_index")]


def _ranked(index: xarray.DataArray) -> list[str]:
    """Return the parameters in falling order of their total index."""
    totals = index.sel(index="total")
    return [str(p) for p in totals["parameter"].values[np.argsort(-totals.values, kind="stable")]]
