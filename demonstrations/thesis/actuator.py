"""Chapters 1 and 3, the actuator: strain, equations, creep, programs of appendix A2."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, pi
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.galvanostat import Galvanostat
from fmus.kit import Integrator
from fmus.kit.arrays import Array
from fmus.kit.symbolic import trace
from fmus.ppy_actuator import PpyActuator
from orchestration.experiment import waveforms
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MODEL = {p.name: float(p.start) for p in PpyActuator.layout.parameters}
CURRENT_LIMIT = float(Galvanostat().current_limit)
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


_PPY = "polypyrrole"


class Material(NamedTuple):
    """A row of table 1-1: printed ranges of the strain in % and of the strain rate in %/s."""

    strain: tuple[float, float]
    rate: tuple[float, float]


MATERIALS = {
    _PPY: Material((2.0, 2.0), (1.0, 1.0)),
    "piezoelectric ceramics": Material((0.0, 0.1), (10.0, inf)),
    "dielectric elastomers": Material((20.0, 380.0), (100.0, inf)),
    "shape memory alloy": Material((5.0, 5.0), (3.0, 3.0)),
}
MUSCLE_RATE = 50.0  # %/s, section 1.1
_SHORTEST = 93.2e-3  # m, the shortest actuator of table 5-1


def entries() -> Iterator[Entry]:
    """Yield claims and errata of chapters 1 and 3."""
    for part in (_speed, _equations, _scripts, _creep):
        yield from part()


def run(
    time: Array, inputs: Mapping[str, Array], model: PpyActuator | None = None
) -> dict[str, Array]:
    """Simulate the actuator of chapter 3 with inputs that are constant between the times.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs : Mapping[str, ndarray]
        Values (n,) by name, SI.
    model : PpyActuator, optional
        Model with effects; by default that of chapter 3.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Outputs and states.
    """
    model = model or PpyActuator()
    integrator = Integrator(model)
    names = [v.name for v in model.layout.outputs]
    states = [v.name for v in model.layout.states]
    rows = []
    for k, now in enumerate(time):
        for name, values in inputs.items():
            setattr(model, name, float(values[k]))
        rows.append([*map(float, model.outputs()), *(float(getattr(model, s)) for s in states)])
        if k + 1 < len(time):
            integrator.advance(float(now), float(time[k + 1] - now))
    return dict(zip(names + states, np.array(rows).T, strict=True))


# --- chapter 1 and the strain
# -----------------------------------------------------------------------------------------


def strain_rate() -> float:
    """Return the largest strain rate in %/s of the shortest actuator: 1.3 A without charge."""
    share = MODEL["R2"] / (MODEL["R1"] + MODEL["R2"])
    return 100.0 * MODEL["alpha"] * CURRENT_LIMIT * share / _SHORTEST


def strain() -> float:
    """Return the largest strain in % of that actuator: in the steady state at 1.3 A."""
    return 100.0 * MODEL["alpha"] * CURRENT_LIMIT * MODEL["R2"] * MODEL["C"] / _SHORTEST


def _speed() -> Iterator[Entry]:
    yield Claim(
        "section 1.2",
        "stress of PPy over that of muscle",
        ">10",
        5.0 / 0.1,
        "",
        "5 MPa over 0.1 MPa",
    )
    length = _SHORTEST
    rate = strain_rate()
    about = (
        f"fastest with alpha {1e3 * MODEL['alpha']:g} mm/C and {CURRENT_LIMIT:g} A, shortest"
        " actuator of table 5-1"
    )
    others = Claim(
        "table 1-1",
        "strain rate of PPy",
        "1",
        rate,
        "%/s",
        f"of the literature; {about}",
        erratum=30,
    )
    yield others
    yield Claim(
        "table 1-1",
        "strain of PPy",
        f"{MATERIALS[_PPY].strain[0]:g}",
        strain(),
        "%",
        f"of the literature; charge that {CURRENT_LIMIT:g} A leave in the end, {about[13:]}",
        erratum=30,
    )
    speed = Claim(
        "section 1.2", "strain rate of the 12-layer actuator", "0.5", rate, "%/s", about, erratum=30
    )
    yield speed
    alpha = 1e3 * MODEL["alpha"]  # mm/C
    used = 5.0  # mm/C
    ratio = Claim(
        "section 5.4.2",
        "how often 5 mm/C holds the alpha of fig. 3-10",
        "7 to 10",
        used / alpha,
        "",
        f"7 to 10 would need {used / 10:.2g} to {used / 7:.2g} mm/C",
        erratum=30,
    )
    yield ratio
    yield Erratum(
        30,
        "section 5.4.2 against fig. 3-10",
        f"{used:g} mm/C is {ratio.published} times what the latest actuators can do; strain rate"
        f" {speed.published} %/s of the maker's (section 1.2), {others.published} %/s in the"
        " literature (table 1-1)",
        f"it is {ratio.reproduced:.0f} times the {alpha:g} mm/C that chapter 3 measures, with which"
        f" {CURRENT_LIMIT:g} A strain a film of {1e3 * length:.1f} mm, the shortest of table 5-1,"
        f" by {rate:.2f} %/s at most. The statements want a larger α,"
        f" {float(speed.published) / rate:.0f} to {float(others.published) / rate:.0f} times; they"
        " can be about other actuators, and the data are lost",
        "demonstrations/thesis/test_actuator",
    )


# --- equations 3.5 to 3.9
# ---------------------------------------------------------------------------------------------


def _printed_responses(s: np.ndarray) -> tuple[tuple[str, str, str, np.ndarray], ...]:
    """Return equations, outputs, inputs and printed transfer functions at complex frequencies."""
    r1, r2, cap, k1, b1, k2, b2 = (MODEL[n] for n in ("R1", "R2", "C", "k1", "b1", "k2", "b2"))
    slow = (r1 + r2) * cap * s + 1.0
    numerator = b2 / k1 * s**2 + (1.0 + k2 / k1 + b2 / b1) * s + k2 / b1
    return (
        ("eq. 3.6", "electrochemical_displacement", "current", MODEL["alpha"] * r2 * cap / slow),
        ("eq. 3.7", "mechanical_displacement", "force", numerator / (s * (k2 + b2 * s))),
        ("eq. 3.9", "voltage", "current", (r1 * r2 * cap * s + r2) / slow),
    )


def _equations() -> Iterator[Entry]:
    a, b, c, d = trace(PpyActuator).linearise()
    s = 1j * np.logspace(-4, 3, 50)
    response = np.array([c @ np.linalg.solve(x * np.eye(len(a)) - a, b) + d for x in s])
    rows = [v.name for v in PpyActuator.layout.outputs]
    columns = [v.name for v in PpyActuator.layout.inputs]
    for equation, output, given, printed in _printed_responses(s):
        entry = response[:, rows.index(output), columns.index(given)]
        same = bool(np.allclose(entry, printed, rtol=1e-9, atol=0.0))
        yield Claim(
            f"eq. 3.5, {equation}",
            f"{output.replace('_', ' ')} from {given}",
            "equal",
            "equal" if same else "different",
            inferred=True,
        )


# --- programs and creep
# -----------------------------------------------------------------------------------------------


def _scripts() -> Iterator[Entry]:
    # appendix A2, first program
    k2 = 3190.0
    b2 = 0.76
    k1 = 1.0
    b1 = 0.02
    s = 1j * np.logspace(-2, 4, 50)
    program = (b1 * b2 * s**2 + (k2 * b2 + k1 * b2 + k2 * b1) * s + k1 * k2) / (
        b1 * b2 * k2 * s**2 + k1 * k2 * b2 * s
    )

    def is_program(k1: float, b1: float, k2: float, b2: float) -> bool:
        return bool(
            np.allclose(1.0 / k1 + 1.0 / (b1 * s) + 1.0 / (k2 + b2 * s), program, rtol=1e-9)
        )

    kelvin = "2" if is_program(k1, b1, k2, b2) else "1" if is_program(k2, b2, k1, b1) else "none"
    yield Claim(
        "appendix A2 against eq. 3.7",
        "index of the Kelvin element",
        "2",
        kelvin,
        reason="the program has the indices of spring-dashpot pairs exchanged",
        erratum=24,
        inferred=True,
    )
    yield Erratum(
        24,
        "appendix A2 against eq. 3.7",
        "k1, b1 are the Maxwell element, k2, b2 the Kelvin element",
        f"the first program names them the other way, its index {kelvin} is the Kelvin element;"
        " A4's is eq. 3.7 itself",
        "demonstrations/thesis/test_actuator",
    )
    r1 = MODEL["R1"]
    r2 = MODEL["R2"]
    c = MODEL["C"]
    share = (r2 - r1 * r2 / (r1 + r2)) / ((r1 + r2) * c)
    start = Claim(
        "appendix A2",
        "voltage at the start per V(1) - 0.2",
        "1",
        share,
        "V/V",
        "lsim takes a state of tf2ss, which is no voltage",
        erratum=25,
        inferred=True,
    )
    yield start
    yield Erratum(
        25,
        "appendix A2",
        "`lsim(sys,I,t,V(1)-0.2)`: a voltage is taken for the state at the start",
        f"the state of `tf2ss` is no voltage: {share:.3f} of it shows in the output (table 3-1)."
        " The 0.2 V may be a correction by hand",
        "demonstrations/thesis/test_actuator",
    )


def _creep() -> Iterator[Entry]:
    load = 2.75  # N
    plotted = "0.4"  # mm, as fig. 3-9 plots it
    k1 = MODEL["k1"]
    yield Claim(
        "fig. 3-9, section 3.3.1",
        f"elongation of k1 by {load:g} N, in N/mm",
        plotted,
        load / k1,
        "mm",
        "appendix A4 multiplies its output by 1000",
        f"{1e3 * load / k1:.2f} mm with k1 in N/m",
        erratum=1,
    )
    yield Erratum(
        1,
        "section 3.3.1, fig. 3-9",
        "k1 = 6300 N/mm, b1 = 1.7e6 N·s/mm, k2 = 1.0e4 N/mm, b2 = 2.0e6 N·s/mm",
        f"N/m and N·s/m: {load:g} N on {k1:.0f} N/mm would stretch the actuator by"
        f" {1e3 * load / k1:.2f} µm, where the plots show {plotted} mm; fig. 5-7 has the same b1 in"
        " N·s/m, and A4 multiplies its output by 1000",
    )
    time, force = staircase()
    flow = run(time, {"force": force - force.min()})["maxwell_elongation"][-1]
    yield Claim(
        "section 3.3.1",
        "elongation that stays when all is unloaded",
        "0.2",
        1e3 * flow,
        "mm",
        "model of fig. 3-9, loads of 30 s every 60 s; the thesis prints no period",
    )
    yield Claim("section 3.3.2", "1 Hz as an angular frequency", "6.3", 2.0 * pi, "rad/s")


def staircase() -> tuple[Array, Array]:
    """Return loads of figs. 3-6 to 3-9, 0.5 to 2.75 N in steps of 0.25 N.

    Returns
    -------
    time, force : ndarray, shape (601,)
        In s and N.
    """
    # s, of one load and its removal; not printed. Nine exceed the 500 s of section 5.3.2
    period = 60.0
    time = np.arange(0.0, 10.0 * period + 1.0)
    return time, waveforms.force_staircase(time, period)


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return table 1-1 and figs. 3-4 and 3-9 from the model."""
    return (
        Illustration(
            "Table 1-1: strain and strain rate of active materials",
            "As printed; an arrow where the table has a bound. The dashed line is what muscle does"
            f" (section 1.1), {MUSCLE_RATE:g} %/s, the cross what the model of chapter 3 gives an"
            f" actuator of {1e3 * _SHORTEST:g} mm at {CURRENT_LIMIT:g} A (errata 30).",
            _materials,
        ),
        Illustration(
            "Fig. 3-4: a current square wave",
            "±0.9 A at 0.2 Hz into the circuit with the means of table 3-1. The voltage jumps with"
            " the current, over R1 and R2 side by side, then follows the charge; the displacement"
            " is proportional to the charge.",
            _square,
        ),
        Illustration(
            "Fig. 3-9: loads that grow step by step",
            "Every load stretches the spring k1 at once (dashed), the Kelvin element follows over"
            f" b2/k2 = {MODEL['b2'] / MODEL['k2']:.0f} s, and the dashpot b1 flows for good: what"
            " is left at the end does not come back. The period of the loads is chosen, for the"
            " thesis does not print it.",
            _creeping,
        ),
    )


def _materials() -> Figure:
    figure, (axis,) = pictures.panels(1, "Active materials, table 1-1")
    figure.set_size_inches(9, 4.5)
    for (name, row), colour in zip(MATERIALS.items(), (_BLUE, _GREY, _RED, "#7a5195"), strict=True):
        low, high = row.strain[0] or row.strain[1] / 10.0, row.strain[1]
        rate = row.rate[0]
        axis.plot([low, high], [rate, rate], "o-", color=colour, label=name)
        for bound, (x, y) in (
            (row.strain[0] == 0.0, (low, rate)),
            (row.rate[1] == inf, (high, 3.0 * rate)),
        ):
            if bound:
                axis.annotate(
                    "", (x, y), (high, rate), arrowprops={"arrowstyle": "->", "color": colour}
                )
    axis.plot(strain(), strain_rate(), "x", color=_BLUE, ms=9, label="model of chapter 3")
    axis.axhline(MUSCLE_RATE, color=_GREY, linestyle="--", linewidth=1)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.legend(fontsize=8)
    axis.set_xlabel("strain [%]")
    pictures.label(axis, "strain rate", "%/s")
    return figure


def _square() -> Figure:
    time = np.linspace(0.0, 30.0, 1500, endpoint=False)
    current = waveforms.square_wave(time, 0.9, 0.2)
    signals = run(time, {"current": current})
    figure, axes = pictures.panels(3, "±0.9 A at 0.2 Hz, 12 layers")
    for axis, name, unit, values in zip(
        axes,
        ("current", "voltage", "displacement"),
        ("A", "V", "mm"),
        (current, signals["voltage"], 1e3 * signals["displacement"]),
        strict=True,
    ):
        axis.plot(time, values, color=_BLUE)
        pictures.label(axis, name, unit)
    return figure


def _creeping() -> Figure:
    time, force = staircase()
    signals = run(time, {"force": force})
    figure, (upper, lower) = pictures.panels(2, "Loads from 0.5 N to 2.75 N, 12 layers")
    upper.step(time, force, where="post", color=_BLUE)
    lower.plot(time, 1e3 * signals["displacement"], color=_BLUE, label="all")
    lower.step(
        time,
        1e3 * force / MODEL["k1"],
        where="post",
        color=_GREY,
        linestyle="--",
        label="spring k1",
    )
    lower.plot(time, 1e3 * signals["maxwell_elongation"], color=_RED, label="dashpot b1")
    lower.legend(fontsize=8)
    pictures.label(upper, "force", "N")
    pictures.label(lower, "displacement", "mm")
    return figure
