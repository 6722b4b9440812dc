"""Which share of an output's variance each parameter explains: Sobol indices, by SALib."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray
from numpy.typing import NDArray
from rich.table import Table

from fmus.kit.errors import UserError
from orchestration.reporting import pictures
from orchestration.reporting.console import plain_table
from orchestration.sweeps.sensitivity.numbers import (
    complete,
    designed,
    drawn,
    numbers,
    parameters_of,
)

Array = NDArray[np.float64]
KIND = "sobol-indices"
ORDERS = ("first", "total")
_RESAMPLES = 1000  # of the bootstrap
_LARGEST = 4_000_000  # values of one array of the bootstrap, which holds half a dozen of them


def sampled(count: int, samples: int, seed: int) -> Array:
    """Choose cases from which indices can be told (Saltelli et al., Comput. Phys. Commun. 181, 2010).

    Parameters
    ----------
    count : int
        Parameters, p.
    samples : int
        Base points N, a power of two.
    seed : int

    Returns
    -------
    ndarray, shape (N (p + 2), p)
        Shares of the ranges, 0 to 1.
    """
    from SALib.sample import sobol

    return np.asarray(
        sobol.sample(_problem(count), samples, calc_second_order=False, seed=seed), dtype=float
    )


def _problem(count: int) -> dict[str, object]:
    return {
        "num_vars": count,
        "names": [f"x{k}" for k in range(count)],
        "bounds": [[0.0, 1.0]] * count,
    }


def sensitivity(found: xarray.Dataset, *, level: float = 0.95, seed: int = 0) -> xarray.Dataset:
    """Tell which share of an output's variance each parameter explains, from a sweep of ``sobol-indices``.

    Parameters vary independently and evenly over their ranges, over the logarithm where a range has ``log`` behind it.
    The first-order index of a parameter is the share of the variance that it explains by itself; the total index has
    what it explains together with others besides (Sobol; Saltelli et al., Comput. Phys. Commun. 181, 2010).

    Parameters
    ----------
    found : xarray.Dataset
        Of `sweep` with ``kind="sobol-indices"``; may have been written to a file and read.
    level : float
        Of the confidence intervals.
    seed : int
        Of the bootstrap that these are from.

    Returns
    -------
    xarray.Dataset
        For each number of the sweep its indices, such as ``voltage_last_index`` over ``index`` (``first``, ``total``)
        and ``parameter``, and ``voltage_last_index_interval`` with ``end`` (``lower``, ``upper``) besides. NaN for a
        number that does not vary.

    Raises
    ------
    UserError
        If it is no such sweep, or a case of it failed: nothing stands in for what is missing.

    Examples
    --------
    >>> import orchestration as ppy
    >>> over = {"R1": "0.3..0.7", "C": "5..10"}
    >>> found = ppy.sweep("ppy_actuator", over, {"current": 0.5}, stop=10.0, kind="sobol-indices", samples=64)
    >>> shares = ppy.sensitivity(found)["voltage_last_index"]
    >>> bool(shares.sel(index="first", parameter="R1") < shares.sel(index="first", parameter="C"))
    True
    """
    designed(found, KIND)
    if not 0.0 < level < 1.0:
        raise UserError(f"level {level:g}: of a confidence interval, between 0 and 1")
    complete(found, "Sobol indices")
    parameters = parameters_of(found)
    if found.sizes["case"] % (len(parameters) + 2):
        raise UserError(f"{found.sizes['case']} cases are not all of a sweep for Sobol indices")
    values: dict[str, object] = {}
    for name in numbers(found):
        index, half = _analysed(found[name].values, len(parameters), level, seed)
        about = {"units": "1", "long_name": f"Sobol indices of {name}"}
        ends = {
            "units": "1",
            "long_name": f"{100.0 * level:g} % confidence interval of {name}_index, by bootstrap",
        }
        values[f"{name}_index"] = (("index", "parameter"), index, about)
        values[f"{name}_index_interval"] = (
            ("index", "parameter", "end"),
            np.stack([index - half, index + half], axis=-1),
            ends,
        )
    coordinates = {"index": list(ORDERS), "parameter": parameters, "end": ["lower", "upper"]}
    return xarray.Dataset(
        values, coordinates, {"model": found.attrs["model"], "design": KIND, "level": level}
    )


def _analysed(values: Array, count: int, level: float, seed: int) -> tuple[Array, Array]:
    """Indices (2, p) of values (n,), and half of their intervals."""
    from SALib.analyze import sobol

    if (
        np.ptp(values) <= 1e-12 * np.abs(values).max()
    ):  # nothing but rounding has a variance to be shared
        return np.full((2, count), np.nan), np.full((2, count), np.nan)
    resamples = int(np.clip(_LARGEST * (count + 2) // len(values), 100, _RESAMPLES))
    found = sobol.analyze(
        _problem(count),
        values,
        calc_second_order=False,
        conf_level=level,
        num_resamples=resamples,
        seed=seed + 1,  # SALib takes zero for none
    )
    return np.array([found["S1"], found["ST"]]), np.array([found["S1_conf"], found["ST_conf"]])


def table(indices: xarray.Dataset) -> Table:
    """Return indices as they are printed, parameters with the largest total first."""
    interval = f"{100.0 * indices.attrs['level']:g} % interval"
    made = plain_table(
        None,
        "variance of",
        "from",
        "first order",
        interval,
        "total",
        interval,
        right=("first order", interval, "total"),
    )
    for name in _of(indices):
        for parameter in _ranked(indices[f"{name}_index"]):
            cells = []
            for order in ORDERS:
                at = {"index": order, "parameter": parameter}
                value, ends = (
                    indices[f"{name}_index"].sel(at),
                    indices[f"{name}_index_interval"].sel(at),
                )
                lower, upper = ends.values
                cells += (
                    [f"{float(value):.3f}", f"{lower:.3f} … {upper:.3f}"]
                    if np.isfinite(value)
                    else ["none", ""]
                )
            made.add_row(name, parameter, *cells)
    return made


def draw(indices: xarray.Dataset, path: Path) -> None:
    """Draw indices as bars with their intervals.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    names = drawn(_of(indices))
    figure, panels = pictures.panels(
        len(names), f"{indices.attrs['model']}: shares of the variance"
    )
    parameters = [str(p) for p in indices["parameter"].values]
    at = np.arange(len(parameters))
    for panel, name in zip(panels, names, strict=True):
        for k, (order, colour) in enumerate(
            zip(ORDERS, (pictures.MODEL, pictures.MEASURED), strict=True)
        ):
            value = indices[f"{name}_index"].sel(index=order).values
            upper = indices[f"{name}_index_interval"].sel(index=order, end="upper").values
            panel.bar(
                at + 0.38 * (k - 0.5),
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
    panels[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.1
    )
    panels[-1].set_xticks(at, parameters)
    panels[-1].set_xlabel("parameter")
    pictures.save(figure, path)


def _of(indices: xarray.Dataset) -> list[str]:
    """Numbers that indices are of."""
    return [str(name).removesuffix("_index") for name in indices if str(name).endswith("_index")]


def _ranked(index: xarray.DataArray) -> list[str]:
    totals = index.sel(index="total")
    return [str(p) for p in totals["parameter"].values[np.argsort(-totals.values, kind="stable")]]
