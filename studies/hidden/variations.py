"""Variations that may be hidden in each plant, and the effects that name them rightly.

A right answer is the label of an effect or a family of them, as `Term.family` has it: a law over a
signal, in whatever shape. What cannot be told apart by principle, such as a constant torque and an
offset of the torque that is commanded, has both names.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, sin

from studies.hidden import curves
from studies.hidden.book import BOOK
from studies.hidden.shapes import (
    OUTSIDE,
    STRENGTHS,
    THREE,
    TWO,
    Dice,
    Family,
    Maker,
    Shapes,
    Variation,
    backlash,
    charge_transfer,
    drag,
    dry,
    hardening,
    lag,
    levelling,
    outside,
    powers,
    sensor,
    shifted,
    slow_pair,
    stop,
    stores,
    uneven,
    variations,
    zone,
)
from studies.plants import DRAWN, PLANTS, Change, remembered, squared, static

__all__ = ["OUTSIDE", "STRENGTHS", "VARIATIONS", "Variation"]


def _tilted(d: Dice) -> Change:
    tilt = d.sign() * d.size(0.05, 0.12)
    return static("gravity", lambda x: 5.0 * (sin(x + tilt) - sin(x)))


def _neighbour(d: Dice) -> Change:
    warmer = d.sign() * d.plain(5.0, 12.0)
    resistance = 5.0 / d.strength
    return static("loss", lambda x: (x - warmer) / resistance)


def _levelling_conduction(d: Dice) -> Change:
    return static("conduction", curves.hard_rational(d.size(1.0, 3.0), 12.0))


def _larger(d: Dice) -> Change:
    share = d.size(0.1, 0.2)
    return static("current", lambda y: share * y)


def _falling(d: Dice) -> Change:
    share = d.size(0.15, 0.35)
    width = d.plain(0.008, 0.015)
    centre = d.plain(0.0, 0.003)
    return static("force_constant", lambda x: -share * (1.0 - exp(-(((x - centre) / width) ** 2))))


def _tilting(d: Dice) -> Change:
    share = d.size(0.1, 0.3)
    return static("force_constant", lambda x: -share * x / 0.01 / (1.0 + abs(x) / 0.02))


def _warming(share: float) -> Maker:
    def make(d: Dice) -> Change:
        amount = d.size(0.2, 0.6)
        time = d.plain(0.8, 2.5)
        return squared("resistance", amount, (time * share, time / share))

    return make


def _stretching(times: tuple[float, ...]) -> Maker:
    rest = PLANTS["Foot"].inputs["po_tension"].centre

    def make(d: Dice) -> Change:
        time = d.plain(0.05, 0.2)
        return remembered("stretch", d.size(1e-4, 3e-4), [time * t for t in times], rest)

    return make


def _crossing(bent: float) -> Maker:
    def make(d: Dice) -> Change:
        radius = d.size(0.006, 0.015)
        bend = bent * d.plain(0.8, 1.2)
        return static("arch_radius", lambda angle: radius * (1.0 + bend * angle))

    return make


def _wrapped(curve: Callable[[float, float], curves.Curve]) -> Maker:
    return lambda d: static("guide", curve(d.size(0.02, 0.06), 1e-3), 1e-3)


def _of_output(output: str, shapes: Shapes) -> Shapes:
    """Name shapes by their output, where a plant has the same in several."""
    return {f"{shape} of {output}": make for shape, make in shapes.items()}


def _dead(name: str) -> str:
    return f"dead_zone({name}); asymmetric_dead_zone({name})"


_INNER, _OUTER = "inner_temperature", "outer_temperature"
_NODES = ("two nodes", "wall")
_MOTOR = "friction over omega; friction remembering omega"
_PENDULUM = "friction over velocity; friction remembering velocity"
_PAIR = "drop remembering current; drop remembering relaxed"
_COMMAND = "current_command"
_COIL = (
    "coulomb_friction; asymmetric_friction; slide_friction over velocity; slide_friction"
    " remembering velocity"
)
_FED = "force_reference"
_ANKLE = "ankle_friction over ankle_rate; ankle_friction remembering ankle_rate"
_TOE = "mtp_friction over mtp_rate; mtp_friction remembering mtp_rate"

_FAMILIES: dict[str, list[Family]] = {
    "Motor": [
        ("dry friction", _MOTOR, dry("friction", 0.02, 0.06, 1.5, 0.004)),
        ("drag", "friction over omega", drag("friction", 0.02, 0.06, 150.0)),
        ("uneven damping", "friction over omega", uneven("friction", 0.02, 0.05, 150.0)),
        (
            "dead zone",
            f"{_dead('voltage')}; winding_current over voltage",
            zone("voltage", 0.8, 2.5),
        ),
        (
            "saturation",
            "input_saturation(voltage); winding_current over voltage",
            levelling("voltage", 9.0, 14.0),
        ),
        ("backlash", "backlash(voltage)", backlash("voltage", 0.8, 2.5, 0.005)),
        ("input lag", "input_lag(voltage)", lag("voltage", 0.1, 0.4)),
        ("offset", "friction(); input_offset(load)", shifted("friction", 0.02)),
        sensor("lag", "speed", 0.1, 0.4),
        sensor("delay", "speed", 0.1, 0.3),
        sensor("offset", "current", 0.3),
        sensor("drift", "speed", 10.0),
        (OUTSIDE, "", outside("friction", 0.03, 0.6, 3e-4)),
    ],
    "Pendulum": [
        ("dry friction", _PENDULUM, dry("friction", 0.05, 0.15, 0.01, 0.01)),
        ("drag", "friction over velocity", drag("friction", 0.1, 0.3, 0.6)),
        ("uneven damping", "friction over velocity", uneven("friction", 0.1, 0.3, 0.6)),
        ("hard spring", "gravity over angle", hardening("gravity", 0.3, 1.0, 0.3)),
        ("stop", "gravity over angle", stop("gravity", 5.0, 15.0, (0.05, 0.15), 0.02)),
        (
            "offset",
            "gravity(); input_offset(torque); sensor_offset(position)",
            {"tilt": _tilted},
        ),
        (
            "relaxing spring",
            "gravity remembering angle",
            stores("gravity", (1.0, 3.0), (0.5, 1.5), names=("two arms", "spectrum")),
        ),
        ("dead zone", _dead("torque"), zone("torque", 0.12, 0.35)),
        ("saturation", "input_saturation(torque)", levelling("torque", 1.0, 1.6)),
        ("backlash", "backlash(torque)", backlash("torque", 0.12, 0.35, 0.01)),
        ("input lag", "input_lag(torque)", lag("torque", 0.1, 0.4)),
        sensor("lag", "position", 0.1, 0.3),
        sensor("delay", "position", 0.15, 0.4),
        sensor("drift", "position", 0.05),
        (OUTSIDE, "", outside("friction", 0.15, 1.5, 0.4)),
    ],
    "ThermalNodes": [
        (
            "heat loss",
            "loss over outer",
            powers("loss", 8.0, convection=(2.0, 5.0, 1.3, 1.5), boiling=(1.0, 3.0, 2.5, 3.0)),
        ),
        (
            "conduction",
            "conduction over inner; conduction over outer",
            {
                **powers("conduction", 12.0, growing=(2.0, 5.0, 1.6, 2.3)),
                "levelling": _levelling_conduction,
            },
        ),
        (
            "storage outside",
            "loss remembering outer; conduction remembering outer",
            stores("outer", (0.4, 1.2), (100.0, 400.0), 293.0, _NODES),
        ),
        (
            "storage inside",
            "conduction remembering inner",
            stores("inner", (0.4, 1.2), (60.0, 250.0), 293.0, _NODES),
        ),
        ("offset", "loss(); input_offset(ambient)", {"neighbour": _neighbour}),
        ("input lag", "input_lag(power)", lag("power", 15.0, 60.0)),
        ("saturation", "input_saturation(power)", levelling("power", 11.0, 16.0)),
        ("sensor lag", f"sensor_lag({_INNER})", _of_output(_INNER, lag(_INNER, 8.0, 25.0))),
        ("sensor offset", f"sensor_offset({_INNER})", _of_output(_INNER, shifted(_INNER, 2.0))),
        ("sensor lag", f"sensor_lag({_OUTER})", _of_output(_OUTER, lag(_OUTER, 20.0, 80.0))),
        ("sensor offset", f"sensor_offset({_OUTER})", _of_output(_OUTER, shifted(_OUTER, 2.0))),
        sensor("drift", _INNER, 2.0),
        (OUTSIDE, "", outside("loss", 1.5, 60.0, 0.4)),
    ],
    "Cell": [
        ("slow pair", _PAIR, slow_pair("drop", (0.012, 0.03), (200.0, 500.0), (100.0, 250.0))),
        ("fast pair", _PAIR, slow_pair("drop", (0.012, 0.03), (3.0, 8.0), (1.5, 4.0))),
        ("resistance", "drop over current", charge_transfer("drop", 0.02, 0.05)),
        ("uneven resistance", "drop over current", uneven("drop", 0.015, 0.04, 2.0)),
        sensor("lag", "voltage", 1.5, 5.0),
        sensor("delay", "voltage", 1.0, 1.2),
        sensor("drift", "voltage", 0.015),
        (OUTSIDE, "", outside("drop", 0.015, 15.0, 0.015)),
    ],
    "Galvanostat": [
        (
            "saturation",
            f"input_saturation({_COMMAND}); wanted_current over {_COMMAND}",
            levelling(_COMMAND, 1.0, 1.7),
        ),
        ("backlash", f"backlash({_COMMAND})", backlash(_COMMAND, 0.1, 0.35, 0.01)),
        (
            "input lag",
            f"input_lag({_COMMAND}); wanted_current remembering {_COMMAND}",
            lag(_COMMAND, 0.1, 0.4),
        ),
        ("offset", f"input_offset({_COMMAND}); current_offset", shifted(_COMMAND, 0.15)),
        ("sensor gain", "sensor_gain(current)", {"constant": _larger}),
        sensor("offset", "current", 0.1),
        sensor("drift", "current", 0.1),
        sensor("delay", "current", 0.15, 0.4),
        (OUTSIDE, "", outside(_COMMAND, 0.2, 1.5, 0.15)),
    ],
    "VoiceCoil": [
        (
            "stop",
            "slide_friction over position",
            stop("stop", 300.0, 1000.0, (0.009, 0.013), 5e-4, either_side=False),
        ),
        (
            "heating",
            "coil_resistance remembering coil_current",
            {"two masses": _warming(0.5), "coil and frame": _warming(0.2)},
        ),
        ("dry friction", _COIL, dry("friction", 0.2, 0.6, 2e-3, 2e-4)),
        ("drag", _COIL, drag("friction", 0.2, 0.6, 0.1)),
        (
            "force constant",
            "position_dependent_force_constant",
            {"bell": _falling, "tilted": _tilting},
        ),
        (
            "saturation",
            f"amplifier_saturation; input_saturation({_FED})",
            levelling(_FED, 3.5, 6.0),
        ),
        ("offset", f"input_offset({_FED}); {_dead(_FED)}", shifted(_FED, 0.3)),
        sensor("delay", "position_measured", 0.008, 0.03),
        sensor("drift", "position_measured", 2.5e-3),
        (OUTSIDE, "", outside("friction", 0.3, 0.1, 6.0)),
    ],
    "Foot": [
        ("dry friction of the ankle", _ANKLE, dry("ankle_friction", 2e-3, 6e-3, 0.02, 2e-3)),
        ("dry friction of the toe", _TOE, dry("mtp_friction", 2e-4, 6e-4, 0.1, 2e-3)),
        ("uneven damping", _ANKLE, uneven("ankle_friction", 2e-3, 6e-3, 1.0)),
        ("hard arch", "arch_torque over tm_angle", hardening("arch", 0.02, 0.06, 0.05)),
        (
            "tendon across the arch",
            "plantar_tendon_across_arch",
            {"opening": _crossing(2.0), "closing": _crossing(-2.0)},
        ),
        (
            "stretching tendon",
            "tendon_stretch",
            {"two Voigt bodies": _stretching(TWO), "spectrum": _stretching(THREE)},
        ),
        (
            "rubbing tendons",
            "tendon_friction",
            {"arc tangent": _wrapped(curves.dry_arctan), "root": _wrapped(curves.dry_root)},
        ),
        sensor("drift", "po_length_change", 1e-3),
        (OUTSIDE, "", outside("ankle_friction", 4e-3, 0.3, 4e-3)),
    ],
    **BOOK,
}

VARIATIONS: dict[str, Variation] = {
    f"{v.plant}, {v.family}, {v.shape}": v
    for plant, families in _FAMILIES.items()
    for v in variations(plant, families)
}

NAMES = tuple(_FAMILIES)
"""Plants in which something may be hidden."""
USUAL = tuple(name for name in NAMES if name in DRAWN)
