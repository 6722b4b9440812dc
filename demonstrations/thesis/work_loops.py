"""Chapter 5, gait and work loops: eqs. 5.13 to 5.17, figs. 5-7 and 5-9."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, pi
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.thesis.actuator import CURRENT_LIMIT, staircase
from demonstrations.thesis.actuator import run as run_actuator
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from demonstrations.thesis.motor import Maxwell
from fmus.foot import Foot, gait
from fmus.kit.arrays import Array
from orchestration.experiment import read, run
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# of section 5.4.2
STIFFNESS = 9.1  # N/mm
DAMPING = 1700.0  # N s/mm
ALPHA = 5.0  # mm/C
CURRENT = 1.5  # A
PRINTED_RATE = 13.0  # rad/s
PROGRAM_RATE = 4.1 * pi  # rad/s, in appendix A4
_TEST = "demonstrations/thesis/test_foot"
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata about the gait."""
    for part in (_gait, _force, _loops):
        yield from part()


def _gait() -> Iterator[Entry]:
    foot = Foot()
    change = gait.length_changes(0.25)
    angles = {
        a: degrees(gait.joint_angle(foot, a, gait.lengths(0.25, foot)[a])) for a in gait.ACTUATORS
    }
    yield Claim(
        "eq. 5.16",
        "change of the plantar actuator at 0.25 s",
        f"{1e3 * change['do']:.0f}",
        1e3 * change["pl"],
        "mm",
        "eq. 5.15 is printed twice; this is appendix A4's",
        erratum=14,
        inferred=True,
    )
    yield Erratum(
        14,
        "eq. 5.16",
        "repeats eq. 5.15",
        f"the program's plantar length, ℓ_pl,0 + sin(2πt) + 1 mm: {1e3 * change['pl']:.0f} mm"
        f" longer at 0.25 s, where eq. 5.15 has {1e3 * change['do']:.0f} mm".replace("-", "−"),
        "components/foot/test_gait",
    )
    for equations, one, other in (
        ("eqs. 5.13 and 5.14", "an", "po"),
        ("eqs. 5.15 and A4", "do", "pl"),
    ):
        yield Claim(
            equations,
            f"joint angle at 0.25 s, {one} against {other}",
            f"{angles[one]:.1f}",
            angles[other],
            "deg",
            "antagonists of unequal moment arms cannot move alike",
            erratum=29,
            inferred=True,
        )
    yield Erratum(
        29,
        "eqs. 5.13 to 5.16",
        "for simplicity, antagonists whose lengths change alike; eq. 5.4 gives the velocities of"
        " the joints",
        "it gives each joint two, for no rigid foot moves so: at 0.25 s an asks for"
        f" {angles['an']:.1f}° of the ankle, po for {angles['po']:.1f}°; do for {angles['do']:.1f}°"
        f" of the toe, pl for {angles['pl']:.1f}°",
        _TEST,
    )


def _force() -> Iterator[Entry]:
    muscle = Maxwell()
    k = muscle.instantaneous_stiffness
    b = muscle.damping
    yield Claim("appendix A4 against fig. 5-7", "k", f"{STIFFNESS:g}", k * 1e-3, "N/mm")
    yield Claim("appendix A4 against fig. 5-7", "b", f"{DAMPING:g}", b * 1e-3, "N*s/mm")
    frequency = np.logspace(-5, 1, 30)  # Hz
    chain = 1.0 / (
        1.0 / k + 1.0 / (2j * pi * frequency * b)
    )  # spring and dashpot have the same force
    same = bool(np.allclose(muscle.stiffness(frequency), chain, rtol=1e-12, atol=0.0))
    yield Claim(
        "eq. 5.17",
        "force over length of fig. 5-6",
        "equal",
        "equal" if same else "different",
        inferred=True,
    )


def work_loop(rate: float, current: float = CURRENT) -> tuple[Array, Array]:
    """Return length change and force of the anterior actuator over one gait, from rest.

    These are the signals of fig. 5-9, by eq. 5.17.

    Parameters
    ----------
    rate : float
        Angular frequency of the current in rad/s.
    current : float
        Amplitude in A.

    Returns
    -------
    length, force : ndarray, shape (20001,)
        In mm and N, equally spaced over the second of the gait.
    """
    # eq. 5.17 in time: dF/dt = k (dl/dt - alpha i) - (k/b) F, solved for each sine
    t = np.linspace(0.0, 1.0, 20001)
    slow = STIFFNESS / DAMPING
    gait_rate = 2.0 * pi

    def answer(amplitude: float, omega: float, cosine: bool) -> Array:
        """Solution of dF/dt = amplitude cos or sin(omega t) - slow F from rest."""
        scale = amplitude / (slow**2 + omega**2)
        fade = np.exp(-slow * t)
        c = np.cos(omega * t)
        s = np.sin(omega * t)
        return scale * (
            slow * c + omega * s - slow * fade if cosine else slow * s - omega * c + omega * fade
        )

    force = answer(-STIFFNESS * gait_rate, gait_rate, True) - answer(
        STIFFNESS * ALPHA * current, rate, False
    )
    return -np.sin(gait_rate * t), force


def energy(length: Array, force: Array) -> float:
    """Return the energy in N mm that the actuator absorbs along a path, negative if it delivers."""
    return float(np.trapezoid(force, length))


def pushing(force: Array) -> float:
    """Return the share of the time, in percent, in which a force is compressive."""
    return 100.0 * float(np.mean(force < 0.0))


def _loops() -> Iterator[Entry]:
    passive = work_loop(PROGRAM_RATE, 0.0)
    active = work_loop(PROGRAM_RATE)
    as_printed = work_loop(PRINTED_RATE)
    taken = energy(*passive)
    given = energy(*active)
    low, high = float(active[1].min()), float(active[1].max())
    yield Claim(
        "section 5.4.2",
        "angular frequency of the current, against A4",
        f"{PRINTED_RATE:g}",
        PROGRAM_RATE,
        "rad/s",
        "rounded in print",
        erratum=15,
    )
    yield Erratum(
        15,
        "section 5.4.2",
        f"i(t) = {CURRENT:g} sin({PRINTED_RATE:g} t)",
        f"the program has {CURRENT:g} sin(4.1πt) = {CURRENT:g} sin({PROGRAM_RATE:.2f} t). Passive"
        f" path {taken:.4f} N·mm (±{np.abs(passive[1]).max():.1f} N), active {given:.3f} N·mm"
        f" ({low:.2f} to {high:.2f} N) as ∮F dℓ over 1 s from rest".replace("-", "−"),
        _TEST,
    )
    yield Claim(
        "fig. 5-9",
        "direction of the passive loop",
        "clockwise",
        "clockwise" if taken > 0 else "counterclockwise",
    )
    yield Claim(
        "section 5.4.2",
        "net effect of the current",
        "power produced",
        "power produced" if given < 0 else "absorbed",
        reason="over the path of appendix A4",
    )
    limit = Claim(
        "section 5.4.2 against table 2-2",
        "current",
        f"≤{CURRENT_LIMIT:g}",
        CURRENT,
        "A",
        "more than the galvanostat gives; an illustration, says the thesis of its alpha",
        erratum=31,
    )
    yield limit
    yield Erratum(
        31,
        "section 5.4.2 against section 2.3",
        f"a current of {CURRENT:g} A",
        f"the galvanostat gives {CURRENT_LIMIT:g} A, and the model of the circuit is said to be"
        " valid below that; fig. 5-9, an illustration, needs"
        f" {100 * (CURRENT / CURRENT_LIMIT - 1):.0f} % more",
        _TEST,
    )
    for what, force in (("passive", passive[1]), ("active", active[1])):
        yield Claim(
            "fig. 5-9 against table 2-1",
            f"range of the force, {what}",
            "≤3",
            float(np.ptp(force)),
            "N",
            "films buckle below 0 N (section 3.1) and deform permanently beyond 3 N: no bias helps",
            erratum=32,
        )
    yield Erratum(
        32,
        "fig. 5-9",
        "forces of an actuator that is used in tension only and takes about 3 N",
        f"passive ±{np.abs(passive[1]).max():.1f} N, active {low:.1f} to {high:.1f} N:"
        f" {pushing(passive[1]):.0f} % of the one path and {pushing(active[1]):.0f} % of the other"
        f" are compression; no bias brings ranges of {np.ptp(passive[1]):.1f} and"
        f" {np.ptp(active[1]):.1f} N between 0 and 3 N".replace("-", "−"),
        _TEST,
    )
    gap = float(as_printed[1][-1])
    yield Claim(
        "fig. 5-9 against section 5.1",
        "force after one gait, less that at its start",
        "0.0",
        gap,
        "N",
        f"{PRINTED_RATE:g} rad/s is {PRINTED_RATE / (2 * pi):.2f} periods in 1 s; a loop needs"
        " whole ones",
        erratum=33,
        inferred=True,
    )
    yield Erratum(
        33,
        "fig. 5-9 against section 5.1",
        "a work loop; those of a repeated motion must be closed",
        f"{PRINTED_RATE:g} rad/s is {PRINTED_RATE / (2 * pi):.2f} periods of the gait (A4:"
        f" {PROGRAM_RATE / (2 * pi):.2f}): the path ends {abs(gap):.2f} N ({abs(active[1][-1]):.2f}"
        " N) below its start, and its area is no energy per cycle",
        _TEST,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figs. 5-7 and 5-9, and a figure on the open question of section 6.2."""
    return (
        Illustration(
            "Fig. 5-7: the actuator as a spring and a dashpot",
            "The two elements of chapter 5 (blue) against the four of chapter 3 (grey) under the"
            " same loads: without a delayed element nothing creeps back. They were fitted to"
            " different actuators, 114 in appendix A4 and 106 in section 3.3.1. The measured curve"
            " is lost.",
            _maxwell,
        ),
        Illustration(
            "Fig. 5-9: force against length over one gait",
            "Clockwise paths take up energy. Without current (blue) the actuator is nearly a"
            " spring. With the current of the thesis (red) charge pushes the force down and shapes"
            " the path; it does not close, it starts at the dot and ends at the cross. Only the"
            " white band is tension that the actuators bear.",
            _work_loops,
        ),
        Illustration(
            "Section 6.2: work loops that are tracked",
            "The thesis leaves open how feedback and feedforward would follow a wanted loop."
            " Here an actuator whose strain lags and saturates, of which no controller knows,"
            " follows one within the limits of its current and voltage: without current, with"
            " feedback, with the feedforward of the nominal model, with both, and with a"
            " feedforward that learns from cycle to cycle. `ppy run work_loop` gives the"
            " figures.",
            _tracked_loops,
        ),
    )


def _maxwell() -> Figure:
    time, force = staircase()
    muscle = Maxwell()
    flow = np.concatenate([[0.0], np.cumsum(force[:-1] * np.diff(time))]) / muscle.damping
    figure, (upper, lower) = pictures.panels(2, "Loads from 0.5 N to 2.75 N")
    upper.step(time, force, where="post", color=_BLUE)
    lower.plot(
        time,
        1e3 * run_actuator(time, {"force": force})["displacement"],
        color=_GREY,
        label="four elements, fig. 3-9",
    )
    lower.plot(
        time,
        1e3 * (force / muscle.instantaneous_stiffness + flow),
        color=_BLUE,
        label="two elements, fig. 5-7",
    )
    lower.legend(fontsize=8)
    pictures.label(upper, "force", "N")
    pictures.label(lower, "displacement", "mm")
    return figure


def _tracked_loops() -> Figure:
    return run(read("work_loop")).plot()


def _work_loops() -> Figure:
    figure, (axis,) = pictures.panels(1, "Work loops of the anterior actuator")
    figure.set_size_inches(9, 4.5)
    for name, (length, force), color in (
        ("without current", work_loop(PRINTED_RATE, 0.0), _BLUE),
        (f"{CURRENT:g} A, {PRINTED_RATE:g} rad/s", work_loop(PRINTED_RATE), _RED),
    ):
        axis.plot(length, force, color=color, label=name)
        axis.plot(length[0], force[0], "o", color=color)
        axis.plot(length[-1], force[-1], "x", color=color, markersize=9)
    low, high = axis.get_ylim()
    for edge in ((low, 0.0), (3.0, high)):
        axis.axhspan(*edge, color="#f3f4f6", zorder=0)
    axis.set_ylim(low, high)
    axis.set_xlabel("length change [mm]")
    axis.legend(fontsize=8)
    pictures.label(axis, "force", "N")
    return figure
