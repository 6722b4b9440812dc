"""Section 3.3.1, figs. 3-10 and 3-11: slope and area of loops of displacement over charge."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.graphical import Loops, read_loops
from demonstrations.thesis.actuator import MODEL, run
from demonstrations.thesis.circuit import PERIOD
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.kit.arrays import Array
from fmus.ppy_actuator import PpyActuator
from fmus.ppy_actuator.effects import StrainLag, StrainSaturation
from orchestration.experiment.waveforms import square_wave
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# assumed as in fig. 3-4
AMPLITUDE = 0.9  # A
DURATION = 60.0  # s
LOAD = 0.2 * 9.80665  # N, 200 g
FIGURES = {"fig. 3-10": 0.2, "fig. 3-11": 0.1}  # Hz
# chosen, as lag and saturation of the figures are not printed
LAG = 0.3  # s
SATURATION = 2.5  # C
# m, of the displacement (section 2.2.2), used as the standard deviation of white noise
RESOLUTION = 3e-6
_TEST = "demonstrations/thesis/analyses/test_charge_displacement"
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


class _Lagging(StrainLag, StrainSaturation, PpyActuator):
    """Actuator whose elongation lags behind the charge and saturates."""


def entries() -> Iterator[Entry]:
    """Yield claims and errata about eq. 3.4."""
    yield from _slopes()
    yield from _hysteresis()


@cache
def record(
    frequency: float, creeping: bool = True, lagging: bool = False
) -> tuple[Array, Array, Array]:
    """Return time (s), charge (C) and noisy displacement (m) of a square wave from rest.

    The charge follows from the current by eq. 3.5.

    Parameters
    ----------
    frequency : float
        Hz.
    creeping : bool
        Whether the dashpot b1 flows under the load; the Kelvin element is in its steady state.
    lagging : bool
        Whether the displacement lags behind the charge and saturates.
    """
    time = np.asarray(PERIOD * np.arange(round(DURATION / PERIOD) + 1), dtype=np.float64)
    current = square_wave(time, AMPLITUDE, frequency)
    model = PpyActuator()
    if lagging:
        model = _Lagging()
        model.lag_time = LAG
        model.strain_saturation_coefficient = SATURATION**-2
    signals = run(time, {"current": current}, model)
    noise = RESOLUTION * np.random.default_rng(0).standard_normal(time.size)
    flow = LOAD / MODEL["b1"] * time if creeping else 0.0
    return time, signals["charge"], signals["displacement"] + flow + noise


@cache
def read(
    frequency: float, creeping: bool = True, lagging: bool = False, drift: bool = False
) -> Loops:
    """Return the loops of :func:`record`.

    Parameters
    ----------
    frequency : float
        Hz.
    creeping, lagging : bool
        As in :func:`record`.
    drift : bool
        Whether a steady flow is estimated, too.
    """
    return read_loops(
        *record(frequency, creeping, lagging), 1.0 / frequency, units=("C", "m"), drift=drift
    )


def _slopes() -> Iterator[Entry]:
    printed = "0.068"
    flow = LOAD / MODEL["b1"]
    about = f"{DURATION:g} s from rest under 200 g, alpha as printed"
    for drift, how in (False, ""), (True, ", steady flow fitted along"):
        for figure, frequency in FIGURES.items():
            of = read(frequency, drift=drift)
            for crossing, slope in (("free", of.slope), ("forced", of.slope_through_zero)):
                low, high = (1e3 * end for end in slope.interval)
                yield Claim(
                    f"{figure}, eq. 3.4",
                    f"alpha, zero crossing {crossing}{how}",
                    printed,
                    1e3 * slope.value,
                    "mm/C",
                    f"{about}{'' if drift else '; the load flows on while the charge settles'};"
                    f" interval {low:.4f} to {high:.4f}",
                    erratum=None if drift else 40,
                    inferred=True,
                )
    yield Claim(
        "section 3.3.1, footnote 2",
        "speed of the mechanical displacement in its steady state",
        "0",
        1e6 * flow,
        "um/s",
        "eq. 3.7 has a free integrator: under 200 g the dashpot b1 flows for ever",
        erratum=40,
        inferred=True,
    )
    first = read(0.2)
    along = read(0.2, drift=True)
    cycle = 1e6 * flow / 0.2
    stroke = 1e6 * MODEL["alpha"] * _stroke(0.2)
    yield Erratum(
        40,
        "section 3.3.1, footnote 2, against eq. 3.7",
        "the viscoelastic displacement reaches a steady state under the load, so that x_T is x_e",
        f"it has none: 200 g on b1 of fig. 3-9 flow by {1e6 * flow:.2f} µm/s for ever, {cycle:.1f}"
        f" µm in a cycle of 0.2 Hz, whose stroke is {stroke:.0f} µm. Of {DURATION:g} s from rest,"
        f" with α = {printed} mm/C, the line through all points then has a slope of"
        f" {1e3 * first.slope.value:.4f} mm/C and the one through zero"
        f" {1e3 * first.slope_through_zero.value:.4f} mm/C; with a steady flow fitted along they"
        f" have {1e3 * along.slope.value:.4f} and {1e3 * along.slope_through_zero.value:.4f} mm/C",
        _TEST,
    )


def _stroke(frequency: float) -> float:
    """Return the range of the charge in the last cycle, in C."""
    _, charge, _ = record(frequency)
    return float(np.ptp(charge[-round(1.0 / frequency / PERIOD) :]))


def _hysteresis() -> Iterator[Entry]:
    areas = {}
    for lagging in (False, True):
        for figure, frequency in FIGURES.items():
            areas[figure, lagging] = read(frequency, lagging=lagging, drift=True).area
    straight = areas["fig. 3-11", False]
    low, high = (1e3 * end for end in straight.interval)
    yield Claim(
        "fig. 3-11",
        "whether loops of eq. 3.4 enclose an area",
        "yes",
        "no" if low <= 0.0 <= high else "yes",
        "",
        f"x_e is in step with the charge: {1e3 * straight.value:.1g} mm*C a cycle, interval"
        f" {low:.1g} to {high:.1g}; loops need a law of their own",
        erratum=41,
    )
    slow, fast = (1e3 * areas[figure, True].value for figure in ("fig. 3-11", "fig. 3-10"))
    yield Erratum(
        41,
        "section 3.3.1, figs. 3-10 to 3-12",
        "hysteresis loops in figs. 3-11 and 3-12 suggest a time lag; the model is taken to be"
        " linear for simplicity",
        "fig. 3-12 is a record over time: 3-10 must be meant. The line of eq. 3.4 encloses no"
        f" area, {low:.1g} to {high:.1g} mm·C a cycle with noise of {1e6 * RESOLUTION:g} µm; a lag"
        f" of {LAG:g} s (chosen) has {fast:.3f} mm·C at 0.2 Hz and {slow:.3f} mm·C at 0.1 Hz,"
        " counterclockwise. The areas of the figures are not printed",
        _TEST,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figs. 3-10 and 3-11."""
    return tuple(
        Illustration(
            f"{figure.capitalize()}: displacement over charge at {frequency:g} Hz",
            f"±{AMPLITUDE:g} A, 200 g, {DURATION:g} s from rest. Dots: the model, whose dashpot"
            " flows under the load. The lines of least squares through all of it differ with and"
            f" without forced zero crossing. Grey, with a lag of {LAG:g} s and a saturation at"
            f" {SATURATION:g} C (both chosen), its last two cycles: a loop, as was measured.",
            lambda figure=figure, frequency=frequency: _loops(figure, frequency),  # type: ignore[misc]
        )
        for figure, frequency in FIGURES.items()
    )


def _loops(name: str, frequency: float) -> Figure:
    figure, (axis,) = pictures.panels(1, f"{name.capitalize()}, 12 layers")
    figure.set_size_inches(9, 4.5)
    found = read(frequency)
    lagging = read(frequency, lagging=True, drift=True)
    _, charge, displacement = record(frequency, lagging=True)
    last = slice(-round(2.0 / frequency / PERIOD) - 1, None)
    area = f"{1e3 * lagging.area.value:.3f} mm C a cycle"
    axis.plot(
        charge[last],
        1e3 * displacement[last],
        color=_GREY,
        lw=2,
        label=f"with lag and saturation, {area}",
    )
    _, charge, displacement = record(frequency)
    axis.plot(
        charge, 1e3 * displacement, ".", color=_BLUE, ms=3, label="eq. 3.4 and the flow of b1"
    )
    ends = np.array([charge.min(), charge.max()])
    for label, slope, intercept, style in (
        ("free", found.slope.value, found.intercept.value, "-"),
        ("through zero", found.slope_through_zero.value, 0.0, "--"),
    ):
        axis.plot(
            ends,
            1e3 * (slope * ends + intercept),
            style,
            color=_RED,
            label=f"{label}: {1e3 * slope:.4f} mm/C",
        )
    axis.legend(fontsize=8)
    axis.set_xlabel("charge [C]")
    pictures.label(axis, "displacement", "mm")
    return figure
