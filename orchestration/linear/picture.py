"""Pictures of a linear model and of a designed controller.

A model has Bode diagram, step response, poles and zeros; a controller its loop, sensitivities, and
responses to steps of reference and load.

Operating points, and a few values of parameters, are lines; more values make a band.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.units import quotient
from orchestration.linear.feedback import ControllerDesign
from orchestration.linear.model import FAMILY, FAR, LinearModel, margin_words
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 500  # of a curve
_SLOWEST = 5.0  # duration of a step response, in time constants of the slowest pole
_CYCLES = 3.0  # duration of a closed loop's step response, in periods of the crossover frequency


@draw.register(LinearModel)
def draw_linear_model(model: LinearModel) -> Figure:
    """Draw Bode diagram, step response, poles and zeros at all operating points."""
    path = f"{model.inputs[0]} to {model.outputs[0]}"
    content = f"loop transfer function, cut at {model.loop}" if model.loop else path
    figure, axes = pictures.panels(4, f"{model.name}: {content}", height=2.0, shared=False)
    gain, phase, step, plane = axes
    models = (model, *model.beside)
    ends = np.concatenate([one.frequencies(2) for one in models])
    frequencies = np.geomspace(ends.min(), ends.max(), _POINTS)
    if len(model.variations) > FAMILY:
        _draw_bode_band(model, frequencies, gain, phase)
        time = _step_times(model)
        steps = [_step_response(one, time) for one in model.variations]
        _fill(step, time, steps, step="post" if model.period else None)
    for one, color in zip(models, pictures.colors(len(models)), strict=True):
        _draw_bode(one, frequencies, gain, phase, color)
        time = _step_times(one)
        drawstyle = "steps-post" if one.period else "default"
        step.plot(time, _step_response(one, time), color=color, drawstyle=drawstyle)
        _draw_roots(one, plane, color)
    _label(model, gain, phase, step, plane)
    if len(models) > 1 or model.variations:
        gain.legend(fontsize=8)
    return figure


def _draw_roots(model: LinearModel, plane: Axes, color: Any) -> None:
    """Draw poles and zeros, but zeros that are infinite but for rounding."""
    poles = _finite_roots(model, model.poles())
    zeros = _finite_roots(model, model.zeros())
    farthest = np.abs(poles).max() if poles.size else np.inf
    near = zeros[np.abs(zeros) <= FAR * farthest]
    plane.plot(poles.real, poles.imag, "x", color=color)
    plane.plot(near.real, near.imag, "o", markerfacecolor="none", color=color)


def _draw_bode(model: LinearModel, frequencies: Array, gain: Axes, phase: Axes, color: Any) -> None:
    """Draw the Bode diagram of a model, with the crossovers of a loop."""
    margins = model.margins() if model.loop else None
    crossings = (margins.crossover, margins.phase_crossover) if margins else ()
    lines = ((gain, 0.0), (phase, -180.0))
    for (axis, limit), values in zip(lines, _bode(model, frequencies), strict=True):
        axis.semilogx(frequencies, values, label=model.words, color=color)
        if model.loop:
            axis.axhline(limit, color=pictures.MEASURED, linewidth=0.8)
        for crossing in filter(np.isfinite, crossings):
            axis.plot(crossing, np.interp(crossing, frequencies, values), "o", color=color)


def _draw_bode_band(model: LinearModel, frequencies: Array, gain: Axes, phase: Axes) -> None:
    """Shade the band of the Bode diagrams of the variations of a model."""
    curves = [_bode(one, frequencies) for one in model.variations]
    label = f"{len(curves)} values of parameters"
    _fill(gain, frequencies, [decibel for decibel, _ in curves], label=label)
    _fill(phase, frequencies, [degrees for _, degrees in curves])


def _fill(axis: Axes, x: Array, curves: Sequence[Array] | Array, **style: Any) -> None:
    """Shade the band of curves, each of shape (n,), if there are any."""
    if not len(curves):
        return
    low = np.min(curves, axis=0)
    high = np.max(curves, axis=0)
    axis.fill_between(x, low, high, color=pictures.FITTED, alpha=0.2, linewidth=0.0, **style)


def _label(model: LinearModel, gain: Axes, phase: Axes, step: Axes, plane: Axes) -> None:
    """Label all axes."""
    output_unit = model.units.get(model.outputs[0], "1")
    ratio = quotient(output_unit, model.units.get(model.inputs[0], "1"))
    pictures.label(gain, "gain", "dB" if ratio == "1" else f"dB re {ratio}")
    pictures.label(phase, "phase", "deg")
    closed = ", loop closed" if model.loop else ""
    pictures.label(step, f"{model.outputs[0]}\nafter a step{closed}", output_unit)
    pictures.label(plane, "imaginary part", "rad/s")
    for axis in (gain, phase):
        axis.set_xlabel("frequency [Hz]")
    step.set_xlabel("time [s]")
    ends = "poles (crosses) and zeros (circles), real part [rad/s]"
    plane.set_xlabel(f"{ends}, in the w-plane" if model.period else ends)


def _bode(model: LinearModel, frequencies: Array) -> tuple[Array, Array]:
    """Return gain in dB, NaN for a gain of 0, and phase in degrees without jumps, shape (n,)."""
    response = model.response(frequencies)
    size = np.abs(response)
    size[size == 0.0] = np.nan
    angles = np.degrees(np.unwrap(np.angle(response)))
    # whole turns are arbitrary; the first angle is made at most 180 degrees
    return 20.0 * np.log10(size), angles - 360.0 * np.ceil((angles[0] - 180.0) / 360.0)


def _step_times(model: LinearModel) -> Array:
    """Return instants of a step response, s, shape (n,), until it settles."""
    poles = np.atleast_1d(model.poles())
    with np.errstate(divide="ignore"):
        rates = np.log(np.abs(poles)) / model.period if model.period else poles.real
    decays = -rates[(rates < 0.0) & np.isfinite(rates)]
    last = _SLOWEST / decays.min() if decays.size else 1.0
    if model.loop and np.isfinite(model.margins().crossover):
        last = _CYCLES / model.margins().crossover
    if not model.period:
        return np.linspace(0.0, last, _POINTS)
    count = np.clip(np.ceil(last / model.period), 10, 10 * _POINTS)
    return np.asarray(model.period * np.arange(int(count) + 1))


def _step_response(model: LinearModel, time: Array) -> Array:
    """Return the step response at instants, of the closed loop if the model is of a loop."""
    import control

    part = control.feedback(model.part(), 1) if model.loop else model.part()
    return np.asarray(control.step_response(part, time).outputs).ravel()


def _finite_roots(model: LinearModel, roots: Sequence[complex] | Array) -> Array:
    """Return finite roots in the s-plane, or in the w-plane for a sampled model."""
    finite = np.asarray(roots, dtype=complex)[np.isfinite(roots)]
    if not model.period:
        return finite
    z = finite[finite != -1.0]  # which the w-plane has at infinity
    return 2.0 / model.period * (z - 1.0) / (z + 1.0)


# --- controllers ---------------------------------------------------------------------------------


@draw.register(ControllerDesign)
def draw_controller_design(design: ControllerDesign) -> Figure:
    """Draw loop, sensitivities, and steps of reference and load, with the band of each."""
    rows = [["gain", "step"], ["phase", "command"], ["sensitivity", "load"]]
    title = f"{design.plant.name}, linear: {margin_words(design.margins())}"
    figure, axes = pictures.mosaic(rows, title)
    frequencies = design.loop.frequencies(_POINTS)
    _draw_bode_band(design.loop, frequencies, axes["gain"], axes["phase"])
    _draw_bode(design.loop, frequencies, axes["gain"], axes["phase"], pictures.MODEL)
    pictures.label(axes["gain"], "gain of the loop", "dB")
    pictures.label(axes["phase"], "phase of the loop", "deg")
    _draw_sensitivities(design.loop, frequencies, axes["sensitivity"])
    _draw_steps(design, axes)
    return figure


def _draw_sensitivities(loop: LinearModel, frequencies: Array, axis: Axes) -> None:
    """Draw sensitivity and complementary sensitivity with their largest values."""
    curves = np.abs([one.sensitivities(frequencies) for one in (loop, *loop.variations)])
    names = {"sensitivity": "-", "complementary": "--"}
    for k, ((name, style), peak) in enumerate(zip(names.items(), loop.peaks(), strict=True)):
        _fill(axis, frequencies, curves[1:, k])
        label = f"{name}, at most {peak:.3g}"
        axis.loglog(frequencies, curves[0, k], style, color=pictures.MODEL, label=label)
    axis.legend(fontsize=8)
    axis.set_xlabel("frequency [Hz]")
    pictures.label(axis, "sensitivities", "1")


def _draw_steps(design: ControllerDesign, axes: dict[str, Axes]) -> None:
    """Draw the measured value after both steps, and the command after that of the reference."""
    plants = (design.plant, *design.plant.variations)
    stepped = [design.step(design.step_size, plant=one) for one in plants]
    loaded = [design.step(load=design.load_size, plant=one) for one in plants]
    command, measured = design.plant.inputs[0], design.plant.outputs[0]
    units = {name: design.plant.units.get(name, "1") for name in (command, measured)}
    load = f"{design.load_size:.3g} {units[command]}".removesuffix(" 1")
    for name, curves, signal, words in (
        ("step", [one.measured for one in stepped], measured, "after a step of its reference"),
        ("command", [one.command for one in stepped], command, "after that step"),
        ("load", [one.measured for one in loaded], measured, f"after a load of {load}"),
    ):
        _fill(axes[name], design.time, curves[1:], step="post")
        axes[name].step(design.time, curves[0], where="post", color=pictures.MODEL)
        pictures.label(axes[name], f"{signal} {words}", units[signal])
    wanted = stepped[0].measured[0] + design.step_size
    axes["step"].axhline(wanted, color=pictures.MEASURED, linewidth=0.8)
    for limit in filter(np.isfinite, design.limits):
        axes["command"].axhline(limit, color=pictures.FITTED, linewidth=0.8, linestyle="--")
    axes["load"].set_xlabel("time [s]")
