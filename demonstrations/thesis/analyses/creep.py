"""Section 3.3.1, creep: actuator 114 of appendix A4, eqs. 3.1 to 3.3, and fits after them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.graphical import CreepReading, read_creep
from demonstrations.thesis.actuator import MODEL, run, staircase
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration, number
from demonstrations.thesis.work_loops import DAMPING, STIFFNESS
from fmus.kit.arrays import Array
from fmus.ppy_actuator import PpyActuator
from orchestration.experiment.waveforms import force_staircase
from orchestration.identify import Fit, fit_grey_box
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("k1", "b1", "k2", "b2")
ACTUATOR_106 = {name: MODEL[name] for name in NAMES}  # fig. 3-9
ACTUATOR_114 = {
    "k1": 9100.0,
    "b1": 3.3e6,
    "k2": 1.0e4,
    "b2": 1.5e6,
}  # N/m, N s/m; appendix A4, in a comment
PRINTED = {"k1": "6300", "b1": "1.7e6", "k2": "1.0e4", "b2": "2.0e6"}
# m, of the displacement (section 2.2.2), used as the standard deviation of white noise
RESOLUTION = 3e-6
STEP = 2.75  # N
REST = 5.0  # s before the load
HELD = 2400.0  # s under the load, until creep is steady
_TEST = "demonstrations/thesis/analyses/test_creep"
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata about the Burgers parameters."""
    yield from _actuator_114()
    yield from _readings()


def _e(value: float) -> str:
    """Return a damping with three significant digits and a power of ten."""
    return number(value, 3, True)


# --- actuator 114
# --------------------------------------------------------------------------------------------------


def burgers(time: Array, force: Array, chain: Mapping[str, float]) -> tuple[Array, Array, Array]:
    """Return the elongation of spring, dashpot and Kelvin element under a force.

    The force is constant between equally spaced samples.

    Parameters
    ----------
    time, force : ndarray, shape (n,)
        In s and N, from rest.
    chain : Mapping of str to float
        k1, b1, k2 and b2 in N/m and N s/m.

    Returns
    -------
    spring, dashpot, kelvin : ndarray, shape (n,)
        In m.
    """
    step = float(time[1] - time[0])
    impulse = step * np.concatenate([[0.0], np.cumsum(force[:-1])])
    left = float(np.exp(-step * chain["k2"] / chain["b2"]))
    kelvin = np.zeros_like(force)
    for n in range(1, force.size):
        kelvin[n] = left * kelvin[n - 1] + (1.0 - left) * force[n - 1] / chain["k2"]
    return force / chain["k1"], impulse / chain["b1"], kelvin


def maxwell_of(chain: Mapping[str, float], period: float) -> tuple[float, float]:
    """Fit a Maxwell model (fig. 5-6) to a Burgers chain for the loads of fig. 3-7.

    Parameters
    ----------
    chain : Mapping of str to float
    period : float
        Period of a load and its removal in s, which is not printed.

    Returns
    -------
    k, b : float
        N/m and N s/m.
    """
    time = np.arange(0.0, 10.0 * period + 0.5)
    force = force_staircase(time, period)
    force -= force.min()
    impulse = np.concatenate([[0.0], np.cumsum(force[:-1])])
    solved = np.linalg.lstsq(
        np.column_stack([force, impulse]), np.sum(burgers(time, force, chain), axis=0)
    )[0]
    return float(1.0 / solved[0]), float(1.0 / solved[1])


def _remaining_elongation() -> tuple[float, float]:
    """Return the elongation of actuator 114 in the end, and right after unloading, in mm."""
    time, loads_ = staircase()
    force = loads_ - loads_.min()
    unloaded = int(np.flatnonzero(force)[-1]) + 1
    _, dashpot, kelvin = burgers(time, force, ACTUATOR_114)
    return 1e3 * dashpot[-1], 1e3 * (dashpot + kelvin)[unloaded]


def _actuator_114() -> Iterator[Entry]:
    flow, at_once = _remaining_elongation()
    yield Claim(
        "section 3.3.1, A4",
        "elongation that stays of actuator 114",
        "0.2",
        float(flow),
        "mm",
        f"of the dashpot, loads of 30 s every 60 s; just after the last load {at_once:.2f} mm are"
        " there, and what the Kelvin element has of them goes back. The period is not printed",
        erratum=38,
    )
    k, b = maxwell_of(ACTUATOR_114, 60.0)
    _, short = maxwell_of(ACTUATOR_114, 40.0)
    other_k, other_b = maxwell_of(ACTUATOR_106, 60.0)
    about = "least squares on the response of the chain in A4's comment, loads of 30 s every 60 s"
    stiffness = 1e3 * STIFFNESS
    damping = "1.7e6"
    yield Claim(
        "fig. 5-7 against A4",
        "k of a Maxwell model of actuator 114",
        f"{stiffness:.0f}",
        k,
        "N/m",
        f"{about}; k1 of that chain itself is {ACTUATOR_114['k1']:.0f} N/m",
        erratum=38,
        inferred=True,
    )
    yield Claim(
        "fig. 5-7 against A4",
        "b of a Maxwell model of actuator 114",
        damping,
        b,
        "N*s/m",
        f"{about}; every 40 s {_e(short)} N*s/m. The period is not printed",
        erratum=38,
        inferred=True,
    )
    yield Erratum(
        38,
        "appendix A4 against figs. 3-7 and 5-7",
        "k1 = 9100, b1 = 3.3e6, k2 = 1e4, b2 = 1.5e6, without units, in a comment of the program"
        " that reads actuator 114; fig. 5-7 of a 12-layer actuator without number has k ="
        f" {stiffness:.0f} N/m, b = {damping} N·s/m",
        "N/m and N·s/m, for the program multiplies by 1000 to plot mm, and the actuator of fig."
        f" 5-7: a Maxwell model of that chain has k = {k:.0f} N/m and b = {_e(b)} N·s/m over loads"
        f" of 30 s every 60 s ({_e(short)} N·s/m every 40 s), one of the chain of fig. 3-9"
        f" {other_k:.0f} N/m and {_e(other_b)} N·s/m. The b of fig. 5-7 is then not the b1 of fig."
        f" 3-9, though the number is the same. Of the 0.2 mm that stay, {flow:.2f} mm are its"
        f" dashpot's; just after the last load it has {at_once:.2f} mm",
        _TEST,
    )


# --- eqs. 3.1 to 3.3
# --------------------------------------------------------------------------------------------------


@cache
def held_load() -> tuple[Array, Array, Array]:
    """Return time (s), force (N) and displacement (m) of one load until creep is steady."""
    time = np.arange(0.0, REST + HELD + 0.5)
    return _record(time, np.where(time >= REST, STEP, 0.0))


@cache
def loads() -> tuple[Array, Array, Array]:
    """Return the loads of fig. 3-6 above their bias: time (s), force (N) and displacement (m)."""
    time, force = staircase()
    return _record(time, force - force.min())


def _record(time: Array, force: Array) -> tuple[Array, Array, Array]:
    noise = RESOLUTION * np.random.default_rng(0).standard_normal(time.size)
    return time, force, run(time, {"force": force})["displacement"] + noise


@cache
def readings() -> dict[str, CreepReading]:
    """Return the readings by eqs. 3.1 to 3.3 of one load, and of the largest load of fig. 3-6."""
    time, force, displacement = loads()
    largest = np.flatnonzero(force == force.max())
    seen = slice(
        2 * largest[0] - largest[-1] - 1, largest[-1] + 1
    )  # the load and a rest of the same length before it
    return {
        "held": read_creep(*held_load()),
        "loads": read_creep(time[seen], force[seen], displacement[seen]),
    }


@cache
def fits() -> dict[str, Fit]:
    """Return fits of the simulation error to these records, with the readings as start values."""
    records = {"held": held_load(), "loads": loads()}
    return {
        name: fit_grey_box(
            PpyActuator, time, {"force": force}, {"displacement": x}, NAMES, readings()[name].values
        )
        for name, (time, force, x) in records.items()
    }


def contained(found: Fit) -> int:
    """Count the printed parameters that are in the 95 % intervals of a fit."""
    return sum(low <= ACTUATOR_106[name] <= high for name, (low, high) in found.intervals.items())


def _readings() -> Iterator[Entry]:
    found = readings()
    tau = MODEL["b2"] / MODEL["k2"]
    about = f"a record of the model of fig. 3-9, noise of {1e6 * RESOLUTION:g} um"
    for name, unit in zip(NAMES, ("N/m", "N*s/m", "N/m", "N*s/m"), strict=True):
        low, high = fits()["held"].intervals[name]
        yield Claim(
            "eqs. 3.1 to 3.3",
            f"{name} of {STEP:g} N held for {HELD / 60:.0f} min",
            PRINTED[name],
            found["held"].values[name],
            unit,
            f"{about}; the fit that begins there has the interval {low:.5g} to {high:.5g}",
            inferred=True,
        )
    read = found["loads"]
    yield Claim(
        "eq. 3.3, fig. 3-6",
        f"b1 of the {read.load:g} N above the bias, 30 s",
        PRINTED["b1"],
        read.b1,
        "N*s/m",
        f"{about}; b2/k2 = {tau:.0f} s, so that the Kelvin element still creeps and counts as flow",
        erratum=39,
        inferred=True,
    )
    for name, what in (
        ("held", f"{STEP:g} N held for {HELD / 60:.0f} min"),
        ("loads", "the loads of fig. 3-6"),
    ):
        yield Claim(
            "fig. 3-9",
            f"printed parameters in the intervals of the fit to {what}",
            "4",
            float(contained(fits()[name])),
            "",
            f"simulation error, begun at the readings; {about}",
            inferred=True,
        )
    chain = fits()["loads"].values
    yield Erratum(
        39,
        "section 3.3.1; eqs. 3.1 to 3.3",
        "the parameters were obtained by fitting eqs. 3.1 to 3.3 to fig. 3-6, then tuned by hand",
        "three equations for four parameters, and eq. 3.3 wants a load that is held for several"
        f" b2/k2 = {tau:.0f} s. Of the largest load of fig. 3-6, taken to last 30 s, it gives b1 ="
        f" {_e(read.b1)} N·s/m for {PRINTED['b1']}, and k2 = {_e(read.k2)} N/m for {PRINTED['k2']}:"
        " creep cannot be told from flow there. A fit of the simulation error to all nine loads"
        f" that begins with these values ends at k1 = {chain['k1']:.0f} and k2 = {_e(chain['k2'])}"
        f" N/m, b1 = {_e(chain['b1'])} and b2 = {_e(chain['b2'])} N·s/m",
        _TEST,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figures of eqs. 3.1 to 3.3 on a record, and of actuator 114 of fig. 3-7."""
    return (
        Illustration(
            "Eqs. 3.1 to 3.3: creep under a load that is held",
            f"{STEP:g} N on the model of fig. 3-9, noise of {1e6 * RESOLUTION:g} µm. k1 is read off"
            " the elongation at once, b1 off the slope in the end; that line, drawn back to the"
            " step (dashed), passes F0/k2 above it, and b2/k2 is how fast the creep comes up to"
            " it. Below, what the fit that begins there leaves, and how far off the reading is.",
            _held,
        ),
        Illustration(
            "Fig. 3-7: actuator 114 of appendix A4",
            "The loads of figs. 3-6 to 3-8 on the two chains that are printed: that of fig. 3-9,"
            " and that of A4's comment, which is stiffer and flows half as much. Dashed the Maxwell"
            " model of fig. 5-7: near the second chain up to some 500 s, then apart, as section"
            " 5.3.2 says of the measurement. 30 s every 60 s are chosen, for the thesis prints no"
            " period.",
            _two_actuators,
        ),
    )


def _held() -> Figure:
    time, force, displacement = held_load()
    read = readings()["held"]
    fitted = fits()["held"]
    figure, (upper, lower) = pictures.panels(2, f"{STEP:g} N from {REST:g} s on, 12 layers")
    upper.plot(time, 1e3 * displacement, color=_GREY, lw=2.5, label="record")
    since = time - REST
    line = read.load * (1.0 / read.k1 + 1.0 / read.k2 + since / read.b1)
    upper.plot(time, 1e3 * line, color=_RED, ls="--", label="steady creep, drawn back")
    simulated, read_off = (
        np.sum(burgers(time, force, chain), axis=0) for chain in (fitted.values, read.values)
    )
    lower.plot(time, 1e6 * (displacement - simulated), color=_GREY, lw=0.8, label="record over fit")
    lower.plot(time, 1e6 * (read_off - simulated), color=_RED, label="reading over fit")
    for axis, name, unit in ((upper, "displacement", "mm"), (lower, "difference", "um")):
        axis.legend(fontsize=8, loc="lower right" if unit == "mm" else "upper right", ncols=2)
        pictures.label(axis, name, unit)
    return figure


def _two_actuators() -> Figure:
    time, force, _ = loads()
    figure, (upper, lower) = pictures.panels(2, "Loads above the bias of 0.5 N")
    upper.step(time, force, where="post", color=_BLUE)
    for name, chain, colour in (
        ("106, fig. 3-9", ACTUATOR_106, _GREY),
        ("114, A4", ACTUATOR_114, _BLUE),
    ):
        lower.plot(
            time, 1e3 * np.sum(burgers(time, force, chain), axis=0), color=colour, label=name
        )
    impulse = np.concatenate([[0.0], np.cumsum(force[:-1])])
    lower.plot(
        time,
        force / STIFFNESS + impulse / DAMPING,
        color=_RED,
        ls="--",
        lw=1,
        label="Maxwell, fig. 5-7",
    )
    lower.legend(fontsize=8)
    pictures.label(upper, "force", "N")
    pictures.label(lower, "displacement", "mm")
    return figure
