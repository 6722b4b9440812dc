"""Chapter 4, degradation: five-hour record, biased batch least squares, derating."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from demonstrations.graphical import least_squares_windows, magnitude, tustin, zero_order_hold
from demonstrations.thesis import ageing
from demonstrations.thesis.circuit import CIRCUIT, PERIOD, periodic_voltage, response
from demonstrations.thesis.claim import Claim, Entry, Erratum, Illustration
from fmus.degradation_estimator.systems import CAPACITANCE, FIRST_VOLTAGE
from fmus.kit.arrays import Array
from orchestration.experiment import read, run
from orchestration.experiment.waveforms import square_wave
from orchestration.identify.ageing import LifeForecast, forecast_life
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WINDOW = 1000  # samples
_SEEN = 4.0 * 3600.0  # s of the life before the forecast
_RISE = 0.10  # of the impedance, which the simulated life reaches in five hours
_CONTROL_RATE = 30.0  # Hz, of eq. 2.2
_PROPORTIONAL = 0.5 * (0.66 + 0.06)  # V/N, eq. 2.2 (errata 18)
_BLUE = pictures.MODEL
_RED = pictures.FITTED
_GREY = pictures.MEASURED


def entries() -> Iterator[Entry]:
    """Yield claims and errata of chapter 4."""
    for part in (_excitation, _record, _windows, _noise, _judging, _switched_off, _forecast):
        yield from part()


# --- the five-hour experiment
# -----------------------------------------------------------------------------------------


def _excitation() -> Iterator[Entry]:
    omega = 2.0 * pi * 0.1
    yield Claim("section 4.3", "angular frequency of 0.1 Hz", "0.628", omega, "rad/s")
    r1, r2, c = CIRCUIT
    z = abs((r1 * r2 * c * 1j * omega + r2) / ((r1 + r2) * c * 1j * omega + 1.0))  # eq. 4.1
    same = abs(float(magnitude(CIRCUIT, omega)) / z - 1.0) < 1e-12
    yield Claim(
        "eq. 4.10", "magnitude of eq. 4.1", "equal", "equal" if same else "different", inferred=True
    )
    yield Claim(
        "section 4.3",
        "largest voltage at 1.3 A and 0.1 Hz",
        f"{FIRST_VOLTAGE:g}",
        periodic_voltage(*CIRCUIT),
        "V",
        "that of actuator 135, whose circuit is not printed; held against the means of table 3-1,"
        f" of another actuator: with their resistances it takes {CAPACITANCE:.1f} F in place of"
        f" {CIRCUIT[2]:.1f} F",
    )


def _record() -> Iterator[Entry]:
    yield Claim("section 4.3", "length of a window", "100", _WINDOW * PERIOD, "s")
    first, last = 16100, 184850  # appendix A3
    yield Claim(
        "abstract",
        "continuous operation that was recorded",
        ">5",
        last * PERIOD / 3600.0,
        "h",
        f"up to the last sample that appendix A3 reads, at {PERIOD:g} s; it leaves out the first "
        f"{first * PERIOD / 60:.0f} minutes",
    )


def _windows() -> Iterator[Entry]:
    count = 10
    rise = 0.5
    time = PERIOD * np.arange(count * _WINDOW + 1)
    current = square_wave(time, 1.3, 0.1)
    r1 = CIRCUIT[0] * (1.0 + rise * time / time[-1])
    voltage = response(current, r1)
    omega = 2.0 * pi * 0.1
    start = float(magnitude(CIRCUIT, omega))
    true = 100.0 * (float(magnitude((r1[-_WINDOW // 2], *CIRCUIT[1:]), omega)) / start - 1.0)
    rise_of = {}
    for kept in (True, False):
        windows = least_squares_windows(
            current,
            voltage,
            PERIOD,
            _WINDOW,
            cumulative=kept,
            angular_frequency=omega,
            conversion=zero_order_hold,
        )
        rise_of[kept] = 100.0 * (float(windows.impedance[-1]) / start - 1.0)
    yield Claim(
        "appendix A3",
        f"samples behind estimate {count}",
        str(_WINDOW),
        float(count * _WINDOW),
        reason=(
            f"the normal matrices are never cleared; a rise of the impedance by {true:.1f} % shows"
            f" as {rise_of[True]:.1f} %"
        ),
        erratum=7,
    )
    yield Erratum(
        7,
        "appendix A3, batch least squares",
        f"estimates for every {_WINDOW} points",
        "the normal matrices are never cleared, so that window n holds all data up to n: of an"
        f" impedance that has risen by {true:.1f} % in the last of {count} windows it shows"
        f" {rise_of[True]:.1f} %, a window of its own {rise_of[False]:.1f} %",
        "demonstrations/graphical/test_impedance",
    )


def expected_estimate(noise: float) -> Array:
    """Return the limit of least squares (eq. 4.6) for a long record with white voltage noise.

    Noise on v(t-1) adds its variance to one element of the normal matrix and nothing to the
    right-hand side.

    Parameters
    ----------
    noise : float
        Standard deviation in V.

    Returns
    -------
    ndarray, shape (3,)
        R1, R2 (ohm) and C (F) by eqs. 3.11 to 3.13; the current is a square wave of 0.9 A at 0.2
        Hz, 10 Hz.
    """
    time = PERIOD * np.arange(1001)
    current = square_wave(time, 0.9, 0.2)
    voltage = response(current)
    period = slice(-50, None)  # the last period, in the periodic state
    phi = np.column_stack([current[1:], current[:-1], -voltage[:-1]])[period]
    normal = phi.T @ phi / len(phi)
    normal[2, 2] += noise**2
    return tustin(np.linalg.solve(normal, phi.T @ voltage[1:][period] / len(phi)), PERIOD)


def _noise() -> Iterator[Entry]:
    large, small = (float(expected_estimate(noise)[1]) for noise in (20e-3, 5e-3))
    yield Claim(
        "section 4.1",
        "R2 by least squares with 20 mV of noise",
        "2.35",
        large,
        "ohm",
        "limit for a long record, 0.9 A at 0.2 Hz; noise on the regressor",
        erratum=9,
        inferred=True,
    )
    yield Erratum(
        9,
        "section 4.1",
        "least squares on the measured regressor",
        "biased by voltage noise: with 20 mV rms on a 0.9 A, 0.2 Hz square wave a long record"
        f" gives R2 = {large:.2f} Ω for a true {CIRCUIT[1]:.2f} Ω (5 mV: {small:.2f} Ω); the fit"
        " here minimises the simulation error, which is not",
    )


def printed_fit(voltage: Array, predicted: Array) -> float:
    """Return the fit in percent of appendix A3, which compares predictions with preceding samples.

    Parameters
    ----------
    voltage : ndarray, shape (n + 1,)
        Measured.
    predicted : ndarray, shape (n,)
        Predictions of all samples but the first.
    """
    spread = np.linalg.norm(predicted - predicted.mean())
    return float(100.0 * (1.0 - np.linalg.norm(voltage[:-1] - predicted) / spread))


def _judging() -> Iterator[Entry]:
    time = PERIOD * np.arange(2 * _WINDOW + 1)
    voltage = response(square_wave(time, 1.3, 0.1))[_WINDOW:]
    fit = Claim(
        "appendix A3",
        "fit of a prediction without error",
        "100",
        printed_fit(voltage, voltage[1:]),
        "%",
        "the program holds every prediction against the sample before it",
        erratum=27,
        inferred=True,
    )
    yield fit
    yield Erratum(
        27,
        "appendix A3",
        "`DataFit`: the fit of the predicted voltage to the measured one",
        "predictions of samples n + 1 are held against samples n: a prediction without error is"
        f" given {fit.reproduced:.0f} % (±1.3 A at 0.1 Hz, circuit of table 3-1)",
        "demonstrations/thesis/test_degradation",
    )


# --- protection and forecast
# --------------------------------------------------------------------------------------------------


@cache
def recoveries() -> dict[str, Array]:
    """Return the result of the experiment ``fig_4_4``: the controller pauses in recoveries.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        ``time`` in s, and signals by ``member.variable`` in SI.
    """
    found = run(read("fig_4_4"))
    return {str(name): np.asarray(found[name].values) for name in ("time", *found.data_vars)}


def windup(signals: dict[str, Array]) -> float:
    """Return the largest change of the controller's integral part in a recovery, in V.

    It is the change of the voltage minus the proportional part (half the difference of the
    coefficients of eq. 2.2 times the change of the force) between samples of the controller.
    """
    off = signals["galvanostat.recovering"] > 0.5
    time = signals["time"]
    instants = np.arange(0.0, time[-1], 1.0 / _CONTROL_RATE)
    force = np.interp(instants, time, signals["bench.force_measured"])
    after = np.minimum(np.searchsorted(time, instants) + 1, time.size - 1)
    # samples at the same instant are omitted, as their order is not known
    resting = off[after] & off[np.maximum(after - 3, 0)]
    integral = signals["bench.coil_voltage"][after] + _PROPORTIONAL * force
    return float(np.abs(np.diff(integral))[resting[1:]].max())


def _switched_off() -> Iterator[Entry]:
    yield Claim(
        "section 4.2",
        "windup of the force controller in a recovery",
        "0",
        1e3 * windup(recoveries()),
        "mV",
        "experiment fig_4_4: its integral part is on hold while the current is zero",
        inferred=True,
    )


@cache
def forecast() -> LifeForecast:
    """Return the forecast from four hours of the life for a rise of the impedance by 10 %."""
    time, impedance = _impedance()
    seen = time < _SEEN
    return forecast_life(time[seen], impedance[seen], rise=_RISE)


def _impedance() -> tuple[Array, Array]:
    """Return the impedance of the life every 100 s, from the first valid estimate on."""
    signals = life()
    valid = signals["estimate_valid"] > 0.5
    return signals["time"][valid][::_WINDOW], signals["impedance"][valid][::_WINDOW]


def _forecast() -> Iterator[Entry]:
    time, impedance = _impedance()
    reached = time[np.argmax(impedance > (1.0 + _RISE) * impedance[0])] / 3600.0
    found = forecast()
    low, high = (end / 3600.0 for end in found.interval)
    yield Claim(
        "section 4.3, fig. 4-7",
        f"life to {100 * _RISE:.0f} % more impedance, forecast after {_SEEN / 3600:g} h",
        f"{reached:.2f}",
        found.life / 3600.0,
        "h",
        f"interval {low:.2f} to {high:.2f} h, of a fall and a growth whose shape is estimated;"
        " the thesis has a line from the minimum on, and the growth of this life, which is chosen,"
        " still bends",
        inferred=True,
    )


# --- figures
# --------------------------------------------------------------------------------------------------


def illustrations() -> tuple[Illustration, ...]:
    """Return figs. 4-3 and 4-4 in simulation, and a life like that of figs. 4-5 to 4-7."""
    return (
        Illustration(
            "Figs. 4-3, 4-6 and 4-7: a life of five hours",
            "Galvanostat, ageing actuator and degradation estimator, coupled. Warming lowers the"
            " series resistance at first, use raises it later: the impedance passes a minimum. Each"
            " step of impedance change takes a step off the voltage limit. How fast this actuator"
            " ages is chosen; the measured life is lost.",
            _life,
        ),
        Illustration(
            "Fig. 4-4: the voltage limit, enforced",
            "The last minute of the same life. Where the voltage passes the lowered limit (dashed),"
            " the current is zero for the recovery time and the voltage falls back; then the"
            " current returns.",
            _protection,
        ),
        Illustration(
            "Fig. 4-4: the controller, switched off",
            "Experiment fig_4_4: while the current is zero (grey) the integral part of the force"
            " controller stands still, and its voltage follows the force by the proportional part"
            " alone.",
            _resting,
        ),
        Illustration(
            "Fig. 4-7: the life, forecast",
            "The impedance of the same life, and the course that is expected from the first"
            f" {_SEEN / 3600:g} h. Where it crosses {100 * _RISE:.0f} % above the first value is"
            " the forecast, with its interval of 95 %.",
            _foreseen,
        ),
    )


@cache
def life() -> dict[str, Array]:
    """Return five hours of an ageing actuator with derating; see :func:`.ageing.run`."""
    return ageing.run()


def _life() -> Figure:
    signals = life()
    valid = signals["estimate_valid"] > 0.5
    time = np.where(valid, signals["time"], np.nan)[::50]
    figure, (upper, middle, lower) = pictures.panels(3, "±1.3 A at 0.1 Hz for five hours")
    upper.plot(
        signals["time"][::50],
        signals["series_resistance"][::50],
        color=_GREY,
        label="of the actuator",
    )
    upper.plot(time, signals["R1"][::50], color=_BLUE, label="estimated")
    upper.legend(fontsize=8)
    middle.plot(time, signals["impedance"][::50], color=_BLUE)
    lower.step(signals["time"][::50], signals["voltage_limit"][::50], where="post", color=_RED)
    pictures.label(upper, "R1", "ohm")
    pictures.label(middle, "impedance at 0.1 Hz", "ohm")
    pictures.label(lower, "voltage limit", "V")
    return figure


def _resting() -> Figure:
    signals = recoveries()
    time = signals["time"]
    off = signals["galvanostat.recovering"] > 0.5
    figure, axes = pictures.panels(4, "±1.3 A, a limit of 1 V, 1.5 N")
    for axis, name, label, unit in zip(
        axes,
        (
            "galvanostat.current",
            "actuator.voltage",
            "bench.force_measured",
            "bench.coil_voltage",
        ),
        ("current", "voltage", "force", "controller"),
        ("A", "V", "N", "V"),
        strict=True,
    ):
        late = time > 1.0  # s, after the step of the force
        axis.plot(time[late], signals[name][late], color=_BLUE)
        axis.fill_between(
            time,
            0.0,
            1.0,
            where=off,
            transform=axis.get_xaxis_transform(),
            color=_GREY,
            alpha=0.3,
            lw=0,
        )
        pictures.label(axis, label, unit)
    return figure


def _foreseen() -> Figure:
    time, impedance = _impedance()
    found = forecast()
    figure, (axis,) = pictures.panels(1, "Impedance at 0.1 Hz")
    figure.set_size_inches(9, 4.5)
    axis.plot(time, impedance, color=_BLUE, label="impedance")
    axis.plot(time, found.course(time), color=_RED, label="expected course")
    axis.plot(found.interval, [found.limit] * 2, "|-", color=_RED, ms=12)
    axis.axvline(_SEEN, color=_GREY, linestyle=":", linewidth=1)
    axis.legend(fontsize=8)
    pictures.label(axis, "impedance", "ohm")
    return figure


def _protection() -> Figure:
    signals = life()
    last = slice(-600, None)
    time = signals["time"][last]
    figure, (upper, lower) = pictures.panels(2, "The last minute")
    upper.step(time, signals["current"][last], where="post", color=_BLUE)
    lower.plot(time, signals["voltage"][last], color=_BLUE)
    for sign in (1.0, -1.0):
        lower.step(
            time,
            sign * signals["voltage_limit"][last],
            where="post",
            color=_RED,
            linestyle="--",
            linewidth=1,
        )
    pictures.label(upper, "current", "A")
    pictures.label(lower, "voltage", "V")
    return figure
