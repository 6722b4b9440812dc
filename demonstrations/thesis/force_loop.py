"""Chapter 2, the force loop: eqs. 2.1 and 2.2, the program of appendix A1, figs. 2-5 and 2-6."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from demonstrations.thesis import loop_analysis as analysis
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration, number
from fmus.kit.arrays import Array
from fmus.kit.units import convert
from fmus.voice_coil_dma import VoiceCoilDma
from orchestration.experiment import read, run
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TEST = "demonstrations/thesis/test_loop_analysis"
_DMA = {p.name: float(p.start) for p in VoiceCoilDma.layout.parameters}
_A1 = {"gain": 15.0, "zero_time": 0.002}  # controller of appendix A1
_A1_CUTOFF = _DMA["force_cutoff"]
_NYQUIST = 0.5 / analysis.SAMPLE_PERIOD
_SIMPLE: dict[str, Any] = {"period": None, "cutoff": None}  # the loop without hold and filter
_PRINTED_PHASE = "107"  # deg
_PRINTED_CROSSOVER = "6.2"  # Hz
_OLD = pictures.FITTED
_NEW = pictures.MODEL
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata about the force loop."""
    for part in (_plant, _controller, _margins, _closed_loop):
        yield from part()


def program_plant(s: complex) -> complex:
    """Return coil force over coil voltage in N/V as in the first line of appendix A1.

    A parenthesis of that line is misplaced.
    """
    a = analysis.A1_ACTUATOR
    relaxing = a["b2"] * s + a["k2"]
    mechanical = (a["k1"] + _DMA["b_vc"] * s + _DMA["m"] * s**2) * relaxing + a["b2"] * a["k2"] * s
    return _DMA["K"] / (_DMA["R"] + s * _DMA["L"] + _DMA["K"] ** 2 * s * relaxing) / mechanical


def static_stiffness() -> float:
    """Return the stiffness of eq. 2.1 under a lasting load in N/m, which is k1."""
    a = analysis.A1_ACTUATOR
    s = 1e-9  # rad/s, nearly zero
    return a["k1"] + a["k2"] * a["b2"] * s / (a["b2"] * s + a["k2"])


def _plant() -> Iterator[Entry]:
    frequency = 10.0  # Hz
    program = abs(program_plant(2j * pi * frequency))
    equation = abs(analysis.plant()(2j * pi * frequency))
    yield Claim(
        "appendix A1 against eq. 2.1",
        f"gain of the plant at {frequency:g} Hz",
        f"{equation:.3g}",
        program,
        "N/V",
        "a parenthesis is misplaced; the next line overwrites it",
        erratum=2,
        inferred=True,
    )
    yield Erratum(
        2,
        "appendix A1",
        "the plant's denominator with a parenthesis misplaced, overwritten in the next line by "
        "(K/R)/((L/R)s + 1); comments shifted by one line",
        f"eq. 2.1: {equation:.2f} N/V at {frequency:g} Hz, where the program's line gives"
        f" {number(program)} N/V; R = {_DMA['R']:g} Ω, L = {convert(_DMA['L'], 'H', 'mH'):g} mH, K"
        f" = {_DMA['K']:g} N/A, m = {_DMA['m']:g} kg, b_vc = {_DMA['b_vc']:g} N·s/m. The design was"
        " done without back-EMF",
    )
    stiff = static_stiffness()
    yield Claim(
        "eq. 2.1",
        "static stiffness of chapter 3's actuator",
        "0",
        stiff,
        "N/m",
        "eq. 2.1 has k1 beside k2 and b2 in series, a standard linear solid; chapter 3 has a fluid,"
        " which yields",
        erratum=19,
        inferred=True,
    )
    yield Erratum(
        19,
        "eq. 2.1",
        "the term in parentheses holds the actuator dynamics of chapter 3",
        f"it holds a standard linear solid, whose stiffness under a lasting load is {stiff:.0f}"
        " N/m; the actuator of eq. 3.7 flows, its static stiffness is 0",
    )


def _controller() -> Iterator[Entry]:
    held = analysis.discrete_coefficients(18.0, 0.02)
    a1 = analysis.discrete_coefficients(**_A1)
    printed = ("0.66", "-0.06")
    about = "Tustin's rule at 30 Hz for 18 (0.02 s + 1)/s"
    for text, now, program, name in zip(printed, held, a1, ("E(t)", "E(t-1)"), strict=True):
        yield Claim("eq. 2.2", f"coefficient of {name}", text, now, "V/N", about)
        yield Claim(
            "eq. 2.2",
            f"coefficient of {name}, from A1",
            text,
            program,
            "V/N",
            f"A1 has another controller; {about}",
            erratum=3,
            inferred=True,
        )
    yield Erratum(
        3,
        "eq. 2.2 against A1",
        f"{printed[0]} and {printed[1].replace('-', '−')}",
        f"Tustin at 30 Hz of 18 (0.02 s + 1)/s; A1's {_A1['gain']:g} ({_A1['zero_time']:g} s + 1)/s"
        f" gives {a1[0]:.2f} and {a1[1]:.2f}",
        _TEST,
    )
    gain, zero_time = analysis.continuous_coefficients(float(printed[0]), float(printed[1]))
    proportional = Claim(
        "section 2.2.3",
        "proportional gain of eq. 2.2",
        printed[0],
        gain * zero_time,
        "V/N",
        "half the difference of the coefficients; their sum is the integral gain times the period",
        erratum=18,
    )
    yield proportional
    yield Erratum(
        18,
        "section 2.2.3",
        f"the coefficient of E(t), {proportional.published}, is the proportional gain",
        "by Tustin's rule the proportional gain is half the difference of the coefficients,"
        f" {proportional.reproduced:.2f} V/N; {proportional.published} V/N holds half a period of"
        " the integral too",
    )


def _margins() -> Iterator[Entry]:
    plain = analysis.margins(analysis.loop(**_SIMPLE, back_emf=False))
    whole = analysis.margins(analysis.loop(**_SIMPLE))
    a1 = analysis.margins(analysis.loop(**_A1, back_emf=False))
    # a gain from a comment of A1, with its cutoff in rad/s
    near = analysis.margins(
        analysis.loop(24.55, 0.02, period=None, cutoff=_A1_CUTOFF / (2.0 * pi), back_emf=False)
    )
    about = (
        "eq. 2.2 as a continuous controller on (K/R)/((L/R)s + 1); no printed set of numbers"
        " gives it"
    )
    phase = Claim(
        "section 2.2.3, fig. 2-5",
        "phase margin",
        _PRINTED_PHASE,
        plain.phase,
        "deg",
        about,
        erratum=4,
    )
    crossover = Claim(
        "section 2.2.3, fig. 2-5",
        "crossover frequency",
        _PRINTED_CROSSOVER,
        plain.crossover,
        "Hz",
        about,
        erratum=4,
    )
    yield phase
    yield crossover
    yield Erratum(
        4,
        "section 2.2.3",
        f"phase margin {phase.published}°, crossover {crossover.published} Hz",
        f"not reproduced: eq. 2.2 gives {plain.phase:.1f}° at {plain.crossover:.2f} Hz, with eq."
        f" 2.1's full plant {whole.phase:.1f}° at {whole.crossover:.2f} Hz, A1's gains"
        f" {a1.phase:.1f}° at {a1.crossover:.2f} Hz. Nearest found: {near.phase:.1f}° at"
        f" {near.crossover:.2f} Hz with the gain 24.55, which A1 has in a comment, the zero of eq."
        f" 2.2, a filter of {_A1_CUTOFF:g} rad/s and no hold",
        _TEST,
    )


def sampled_bandwidth() -> float:
    """Return the -3 dB bandwidth in Hz of the force by eq. 2.2 at 30 Hz with the filter of A1."""
    import control

    period = analysis.SAMPLE_PERIOD
    coil = analysis.plant(back_emf=False)
    driven, read = (
        control.sample_system(p, period, "zoh")
        for p in (coil, coil * analysis.force_filter(_A1_CUTOFF))
    )
    law = control.tf([_DMA["error_gain"], _DMA["previous_error_gain"]], [1.0, -1.0], period)
    frequencies = np.linspace(0.01, _NYQUIST, 3001)
    z = np.exp(2j * pi * frequencies * period)
    hold = np.sinc(frequencies * period)  # gain of a zero-order hold
    closed = hold * np.abs(law(z) * driven(z) / (1.0 + law(z) * read(z)))
    return float(frequencies[np.argmax(closed < sqrt(0.5))])


@cache
def sampled_step() -> tuple[Array, Array]:
    """Return time in s and force above the bias in N of ``fig_2_6``, from its step on.

    The experiment has coil, actuator and load cell, with eq. 2.2 at 30 Hz.
    """
    found = run(read("fig_2_6"))
    reference = found["force_reference"].values
    at = int(np.argmax(np.diff(reference))) + 1
    force = found["actuator.tension"].values[at:] - reference[0]
    return found["time"].values[at:] - found["time"].values[at], force


def _closed_loop() -> Iterator[Entry]:
    time = np.linspace(0.0, 1.0, 2001)
    rise = analysis.rise_time(time, analysis.closed_loop_step(time))
    yield Claim(
        "section 2.2.3, fig. 2-6", "closed-loop time constant", "<0.1", rise, "s", "63 % of a step"
    )
    yield Claim(
        "section 2.2.3, fig. 2-6",
        "time constant of the sampled loop",
        "<0.1",
        analysis.rise_time(*sampled_step()),
        "s",
        "experiment fig_2_6: eq. 2.2 at 30 Hz on bench and actuator, 63 % of a step",
    )
    yield Claim(
        "table 2-1",
        "force bandwidth",
        "≥5",
        sampled_bandwidth(),
        "Hz",
        "-3 dB of eq. 2.2 at 30 Hz with A1's filter",
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figs. 2-5 and 2-6."""
    return (
        Illustration(
            "Fig. 2-5: the force loop, open",
            "Gain and phase around the loop without a controller (grey) and with one. The blue"
            " curve is the controller that eq. 2.2 is the sampled form of, the red one that of"
            " appendix A1. Dots mark where the gain is one, the cross where the thesis says it is."
            " Hold and filter of A1 are in all three.",
            _bode,
        ),
        Illustration(
            "Fig. 2-6: the force loop, closed",
            "The force after its reference has stepped by 1 N, by linear analysis with A1's hold"
            " and filter. The dashed line is 63 %; both controllers reach it within the 0.1 s that"
            " the thesis gives (dotted). Grey: the loop as it is sampled, the actuator's tension in"
            " the experiment fig_2_6.",
            _step,
        ),
    )


def _bode() -> Figure:
    frequencies = np.logspace(-1, 2, 400)
    coil = analysis.plant(back_emf=False) * analysis.sample_and_hold() * analysis.force_filter()
    loops = (
        ("coil, hold and filter alone", coil, _GREY),
        ("with eq. 2.2's controller", analysis.loop(back_emf=False), _NEW),
        ("with A1's controller", analysis.loop(**_A1, back_emf=False), _OLD),
    )
    figure, (upper, lower) = pictures.panels(2, "Force loop, open")
    for name, system, color in loops:
        magnitude, phase = analysis.bode(system, frequencies)
        upper.semilogx(frequencies, magnitude, color=color, label=name)
        lower.semilogx(frequencies, phase, color=color)
        margins = analysis.margins(system)
        if np.isfinite(margins.crossover):
            upper.plot(margins.crossover, 0.0, "o", color=color)
            lower.plot(margins.crossover, margins.phase - 180.0, "o", color=color)
    upper.plot(
        float(_PRINTED_CROSSOVER),
        0.0,
        "kx",
        label=f"as printed: {_PRINTED_PHASE}° at {_PRINTED_CROSSOVER} Hz",
    )
    lower.plot(float(_PRINTED_CROSSOVER), float(_PRINTED_PHASE) - 180.0, "kx")
    upper.legend(fontsize=8)
    pictures.label(upper, "gain", "dB")
    pictures.label(lower, "phase", "deg")
    lower.set_xlabel("frequency [Hz]")
    return figure


def _step() -> Figure:
    time = np.linspace(0.0, 0.6, 1201)
    figure, (axis,) = pictures.panels(1, "Force after a step of the reference")
    axis.plot(*sampled_step(), color=_GREY, label="eq. 2.2 at 30 Hz, the actuator's tension")
    axis.plot(time, analysis.closed_loop_step(time), color=_NEW, label="eq. 2.2's controller")
    axis.plot(time, analysis.closed_loop_step(time, **_A1), color=_OLD, label="A1's controller")
    axis.axhline(1.0 - np.exp(-1.0), color=_GREY, linestyle="--", linewidth=1)
    axis.axvline(0.1, color=_GREY, linestyle=":", linewidth=1)
    axis.legend(fontsize=8)
    pictures.label(axis, "force", "N")
    return figure
