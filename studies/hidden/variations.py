"""Variations that may be hidden in each plant, and the effects that name them rightly.

A right answer is the label of an effect or a family of them, as `Term.family` has it: a law over a
signal, in whatever shape. What cannot be told apart by principle, such as a constant torque and an
offset of the torque that is commanded, has both names; what one record cannot tell apart is
computed (`studies.judging.floor`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import exp, sin

from studies.hidden import curves
from studies.hidden.book import by_the_book
from studies.hidden.shapes import (
    OUTSIDE,
    STRENGTHS,
    Dice,
    Variation,
    backlash,
    delayed,
    drag,
    drift,
    dry,
    lag,
    levelling,
    named,
    outside,
    shifted,
    uneven,
    zone,
)
from studies.plants import DRAWN, PLANTS, Change, ladder, remembered, squared, static

__all__ = ["OUTSIDE", "STRENGTHS", "VARIATIONS", "Variation"]


def _motor() -> Iterator[Variation]:
    friction = "friction over omega; friction remembering omega"
    fed = "winding_current over voltage"
    yield from named("Motor", "dry friction", friction, dry("friction", 0.02, 0.06, 1.5, 0.004))
    yield from named("Motor", "drag", "friction over omega", drag("friction", 0.02, 0.06, 150.0))
    yield from named(
        "Motor", "uneven damping", "friction over omega", uneven("friction", 0.02, 0.05, 150.0)
    )
    yield from named(
        "Motor",
        "dead zone",
        f"dead_zone(voltage); asymmetric_dead_zone(voltage); {fed}",
        zone("voltage", 0.8, 2.5),
    )
    yield from named(
        "Motor", "saturation", f"input_saturation(voltage); {fed}", levelling("voltage", 9.0, 14.0)
    )
    yield from named("Motor", "backlash", "backlash(voltage)", backlash("voltage", 0.8, 2.5, 0.005))
    yield from named("Motor", "input lag", "input_lag(voltage)", lag("voltage", 0.1, 0.4))
    yield from named(
        "Motor", "offset", "force_offset; input_offset(load)", shifted("friction", 0.02)
    )
    yield from named("Motor", "sensor lag", "sensor_lag(speed)", lag("speed", 0.1, 0.4))
    yield from named("Motor", "sensor delay", "transport_delay(speed)", delayed("speed", 0.1, 0.3))
    yield from named("Motor", "sensor offset", "sensor_offset(current)", shifted("current", 0.3))
    yield from named("Motor", "sensor drift", "sensor_drift(speed)", drift("speed", 10.0))
    yield from named("Motor", OUTSIDE, "", outside("friction", 0.03, 0.6, 3e-4))


def _pendulum() -> Iterator[Variation]:
    friction = "friction over velocity; friction remembering velocity"
    spring = "gravity over angle"

    def stop(hertz: bool, d: Dice) -> Change:
        kind = curves.stop_hertz if hertz else curves.stop_rounded
        return static("gravity", kind(d.size(5.0, 15.0), d.plain(0.05, 0.15), 0.02, d.sign()))

    def tilted(d: Dice) -> Change:
        tilt = d.sign() * d.size(0.05, 0.12)
        return static("gravity", lambda x: 5.0 * (sin(x + tilt) - sin(x)))

    def arms(times: tuple[float, ...], d: Dice) -> Change:
        time = d.plain(0.5, 1.5)
        return remembered("gravity", d.size(1.0, 3.0), [time * t for t in times], ahead=True)

    yield from named("Pendulum", "dry friction", friction, dry("friction", 0.05, 0.15, 0.01, 0.01))
    yield from named("Pendulum", "drag", "friction over velocity", drag("friction", 0.1, 0.3, 0.6))
    yield from named(
        "Pendulum", "uneven damping", "friction over velocity", uneven("friction", 0.1, 0.3, 0.6)
    )
    yield from named(
        "Pendulum",
        "hard spring",
        spring,
        {
            "sinh": lambda d: static("gravity", curves.hard_sinh(d.size(0.3, 1.0), 0.3)),
            "rational": lambda d: static("gravity", curves.hard_rational(d.size(0.3, 1.0), 0.3)),
        },
    )
    yield from named(
        "Pendulum",
        "stop",
        spring,
        {
            "rounded": lambda d: stop(False, d),
            "Hertz": lambda d: stop(True, d),
        },
    )
    yield from named(
        "Pendulum",
        "offset",
        "force_offset; input_offset(torque); sensor_offset(position)",
        {"tilt": tilted},
    )
    yield from named(
        "Pendulum",
        "relaxing spring",
        "gravity remembering angle",
        {
            "two arms": lambda d: arms((0.4, 1.6), d),
            "spectrum": lambda d: arms((0.2, 0.7, 2.5), d),
        },
    )
    yield from named(
        "Pendulum",
        "dead zone",
        "dead_zone(torque); asymmetric_dead_zone(torque)",
        zone("torque", 0.12, 0.35),
    )
    yield from named(
        "Pendulum", "saturation", "input_saturation(torque)", levelling("torque", 1.0, 1.6)
    )
    yield from named(
        "Pendulum", "backlash", "backlash(torque)", backlash("torque", 0.12, 0.35, 0.01)
    )
    yield from named("Pendulum", "input lag", "input_lag(torque)", lag("torque", 0.1, 0.4))
    yield from named("Pendulum", "sensor lag", "sensor_lag(position)", lag("position", 0.1, 0.3))
    yield from named(
        "Pendulum", "sensor delay", "transport_delay(position)", delayed("position", 0.15, 0.4)
    )
    yield from named("Pendulum", "sensor drift", "sensor_drift(position)", drift("position", 0.05))
    yield from named("Pendulum", OUTSIDE, "", outside("friction", 0.15, 1.5, 0.4))


def _thermal_nodes() -> Iterator[Variation]:
    def stored(place: str, times: tuple[float, ...], low: float, high: float, d: Dice) -> Change:
        time = d.plain(low, high)
        return remembered(place, d.size(0.4, 1.2), [time * t for t in times], 293.0, ahead=True)

    def neighbour(d: Dice) -> Change:
        warmer = d.sign() * d.plain(5.0, 12.0)
        resistance = 5.0 / d.strength
        return static("loss", lambda x: (x - warmer) / resistance)

    two = (0.4, 1.6)
    three = (0.2, 0.7, 2.5)
    yield from named(
        "ThermalNodes",
        "heat loss",
        "loss over outer",
        {
            "convection": lambda d: static(
                "loss", curves.power(d.size(2.0, 5.0), 8.0, d.plain(1.3, 1.5))
            ),
            "boiling": lambda d: static(
                "loss", curves.power(d.size(1.0, 3.0), 8.0, d.plain(2.5, 3.0))
            ),
        },
    )
    yield from named(
        "ThermalNodes",
        "conduction",
        "conduction over inner; conduction over outer",
        {
            "growing": lambda d: static(
                "conduction", curves.power(d.size(2.0, 5.0), 12.0, d.plain(1.6, 2.3))
            ),
            "levelling": lambda d: static(
                "conduction", curves.hard_rational(d.size(1.0, 3.0), 12.0)
            ),
        },
    )
    yield from named(
        "ThermalNodes",
        "storage outside",
        "loss remembering outer; conduction remembering outer",
        {
            "two nodes": lambda d: stored("outer", two, 100.0, 400.0, d),
            "wall": lambda d: stored("outer", three, 100.0, 400.0, d),
        },
    )
    yield from named(
        "ThermalNodes",
        "storage inside",
        "conduction remembering inner",
        {
            "two nodes": lambda d: stored("inner", two, 60.0, 250.0, d),
            "wall": lambda d: stored("inner", three, 60.0, 250.0, d),
        },
    )
    yield from named(
        "ThermalNodes", "offset", "force_offset; input_offset(ambient)", {"neighbour": neighbour}
    )
    yield from named("ThermalNodes", "input lag", "input_lag(power)", lag("power", 15.0, 60.0))
    yield from named(
        "ThermalNodes", "saturation", "input_saturation(power)", levelling("power", 11.0, 16.0)
    )
    for output, low, high in (("inner_temperature", 8.0, 25.0), ("outer_temperature", 20.0, 80.0)):
        for family, effect, shapes in (
            ("sensor lag", "sensor_lag", lag(output, low, high)),
            ("sensor offset", "sensor_offset", shifted(output, 2.0)),
        ):
            by_shape = {f"{shape} of {output}": make for shape, make in shapes.items()}
            yield from named("ThermalNodes", family, f"{effect}({output})", by_shape)
    yield from named(
        "ThermalNodes",
        "sensor drift",
        "sensor_drift(inner_temperature)",
        drift("inner_temperature", 2.0),
    )
    yield from named("ThermalNodes", OUTSIDE, "", outside("loss", 1.5, 60.0, 0.4))


def _cell() -> Iterator[Variation]:
    def spread(low: float, high: float, d: Dice) -> Change:
        time = d.plain(low, high)
        times = [time * 10.0**k for k in (-0.6, -0.2, 0.2, 0.6)]
        return remembered("drop", d.size(0.012, 0.03), times)

    pair = "drop remembering current; drop remembering relaxed"
    yield from named(
        "Cell",
        "slow pair",
        pair,
        {
            "diffusion": lambda d: ladder("drop", d.size(0.012, 0.03), d.plain(200.0, 500.0)),
            "stretched": lambda d: spread(100.0, 250.0, d),
        },
    )
    yield from named(
        "Cell",
        "fast pair",
        pair,
        {
            "diffusion": lambda d: ladder("drop", d.size(0.012, 0.03), d.plain(3.0, 8.0)),
            "stretched": lambda d: spread(1.5, 4.0, d),
        },
    )
    yield from named(
        "Cell",
        "resistance",
        "drop over current",
        {
            "Butler and Volmer": lambda d: static(
                "drop", curves.butler_volmer(d.size(0.02, 0.05), 2.0, d.plain(0.15, 0.5))
            ),
            "exponent": lambda d: static(
                "drop", curves.power(d.size(0.02, 0.05), 2.0, d.plain(0.4, 0.6))
            ),
        },
    )
    yield from named(
        "Cell", "uneven resistance", "drop over current", uneven("drop", 0.015, 0.04, 2.0)
    )
    yield from named("Cell", "sensor lag", "sensor_lag(voltage)", lag("voltage", 1.5, 5.0))
    yield from named(
        "Cell", "sensor delay", "transport_delay(voltage)", delayed("voltage", 1.0, 1.2)
    )
    yield from named("Cell", "sensor drift", "sensor_drift(voltage)", drift("voltage", 0.015))
    yield from named("Cell", OUTSIDE, "", outside("drop", 0.015, 15.0, 0.015))


def _galvanostat() -> Iterator[Variation]:
    command = "current_command"
    wanted = "wanted_current over current_command"
    late = f"input_lag({command}); wanted_current remembering {command}"

    def gain(d: Dice) -> Change:
        share = d.size(0.1, 0.2)
        return static("current", lambda y: share * y)

    yield from named(
        "Galvanostat",
        "saturation",
        f"input_saturation({command}); {wanted}",
        levelling(command, 1.0, 1.7),
    )
    yield from named(
        "Galvanostat", "backlash", f"backlash({command})", backlash(command, 0.1, 0.35, 0.01)
    )
    yield from named("Galvanostat", "input lag", late, lag(command, 0.1, 0.4))
    yield from named(
        "Galvanostat", "offset", f"input_offset({command}); current_offset", shifted(command, 0.15)
    )
    yield from named("Galvanostat", "sensor gain", "sensor_gain(current)", {"constant": gain})
    yield from named(
        "Galvanostat", "sensor offset", "sensor_offset(current)", shifted("current", 0.1)
    )
    yield from named("Galvanostat", "sensor drift", "sensor_drift(current)", drift("current", 0.1))
    yield from named(
        "Galvanostat", "sensor delay", "transport_delay(current)", delayed("current", 0.15, 0.4)
    )
    yield from named("Galvanostat", OUTSIDE, "", outside(command, 0.2, 1.5, 0.15))


def _voice_coil() -> Iterator[Variation]:
    friction = (
        "coulomb_friction; asymmetric_friction; slide_friction over velocity; slide_friction"
        " remembering velocity"
    )
    constant = "position_dependent_force_constant"
    fed = "force_reference"

    def falling(d: Dice) -> Change:
        share = d.size(0.15, 0.35)
        width = d.plain(0.008, 0.015)
        centre = d.plain(0.0, 0.003)
        return static(
            "force_constant", lambda x: -share * (1.0 - exp(-(((x - centre) / width) ** 2)))
        )

    def tilting(d: Dice) -> Change:
        share = d.size(0.1, 0.3)
        return static("force_constant", lambda x: -share * x / 0.01 / (1.0 + abs(x) / 0.02))

    def stop(hertz: bool, d: Dice) -> Change:
        kind = curves.stop_hertz if hertz else curves.stop_rounded
        return static("stop", kind(d.size(300.0, 1000.0), d.plain(0.009, 0.013), 5e-4))

    def warming(share: float, d: Dice) -> Change:
        amount = d.size(0.2, 0.6)
        time = d.plain(0.8, 2.5)
        return squared("resistance", amount, (time * share, time / share))

    yield from named(
        "VoiceCoil",
        "stop",
        "slide_friction over position",
        {
            "rounded": lambda d: stop(False, d),
            "Hertz": lambda d: stop(True, d),
        },
    )
    yield from named(
        "VoiceCoil",
        "heating",
        "coil_resistance remembering coil_current",
        {
            "two masses": lambda d: warming(0.5, d),
            "coil and frame": lambda d: warming(0.2, d),
        },
    )
    yield from named("VoiceCoil", "dry friction", friction, dry("friction", 0.2, 0.6, 2e-3, 2e-4))
    yield from named("VoiceCoil", "drag", friction, drag("friction", 0.2, 0.6, 0.1))
    yield from named("VoiceCoil", "force constant", constant, {"bell": falling, "tilted": tilting})
    yield from named(
        "VoiceCoil",
        "saturation",
        f"amplifier_saturation; input_saturation({fed})",
        levelling(fed, 3.5, 6.0),
    )
    yield from named(
        "VoiceCoil",
        "offset",
        f"input_offset({fed}); dead_zone({fed}); asymmetric_dead_zone({fed})",
        shifted(fed, 0.3),
    )
    yield from named(
        "VoiceCoil",
        "sensor delay",
        "transport_delay(position_measured)",
        delayed("position_measured", 0.008, 0.03),
    )
    yield from named(
        "VoiceCoil",
        "sensor drift",
        "sensor_drift(position_measured)",
        drift("position_measured", 2.5e-3),
    )
    yield from named("VoiceCoil", OUTSIDE, "", outside("friction", 0.3, 0.1, 6.0))


def _foot() -> Iterator[Variation]:
    rest = PLANTS["Foot"].inputs["po_tension"].centre
    ankle = "ankle_friction over ankle_rate; ankle_friction remembering ankle_rate"
    toe = "mtp_friction over mtp_rate; mtp_friction remembering mtp_rate"

    def stretching(times: tuple[float, ...], d: Dice) -> Change:
        time = d.plain(0.05, 0.2)
        return remembered("stretch", d.size(1e-4, 3e-4), [time * t for t in times], rest)

    def crossing(bent: float, d: Dice) -> Change:
        radius = d.size(0.006, 0.015)
        bend = bent * d.plain(0.8, 1.2)
        return static("arch_radius", lambda angle: radius * (1.0 + bend * angle))

    def wrapped(curve: Callable[[float, float], curves.Curve], d: Dice) -> Change:
        return static("guide", curve(d.size(0.02, 0.06), 1e-3), 1e-3)

    yield from named(
        "Foot", "dry friction of the ankle", ankle, dry("ankle_friction", 2e-3, 6e-3, 0.02, 2e-3)
    )
    yield from named(
        "Foot", "dry friction of the toe", toe, dry("mtp_friction", 2e-4, 6e-4, 0.1, 2e-3)
    )
    yield from named("Foot", "uneven damping", ankle, uneven("ankle_friction", 2e-3, 6e-3, 1.0))
    yield from named(
        "Foot",
        "hard arch",
        "arch_torque over tm_angle",
        {
            "sinh": lambda d: static("arch", curves.hard_sinh(d.size(0.02, 0.06), 0.05)),
            "rational": lambda d: static("arch", curves.hard_rational(d.size(0.02, 0.06), 0.05)),
        },
    )
    yield from named(
        "Foot",
        "tendon across the arch",
        "plantar_tendon_across_arch",
        {
            "opening": lambda d: crossing(2.0, d),
            "closing": lambda d: crossing(-2.0, d),
        },
    )
    yield from named(
        "Foot",
        "stretching tendon",
        "tendon_stretch",
        {
            "two Voigt bodies": lambda d: stretching((0.4, 1.6), d),
            "spectrum": lambda d: stretching((0.2, 0.7, 2.5), d),
        },
    )
    yield from named(
        "Foot",
        "rubbing tendons",
        "tendon_friction",
        {
            "arc tangent": lambda d: wrapped(curves.dry_arctan, d),
            "root": lambda d: wrapped(curves.dry_root, d),
        },
    )
    yield from named(
        "Foot", "sensor drift", "sensor_drift(po_length_change)", drift("po_length_change", 1e-3)
    )
    yield from named("Foot", OUTSIDE, "", outside("ankle_friction", 4e-3, 0.3, 4e-3))


VARIATIONS: dict[str, Variation] = {
    f"{v.plant}, {v.family}, {v.shape}": v
    for v in (
        *_motor(),
        *_pendulum(),
        *_thermal_nodes(),
        *_cell(),
        *_galvanostat(),
        *_voice_coil(),
        *_foot(),
        *by_the_book(),
    )
}

NAMES = tuple(dict.fromkeys(v.plant for v in VARIATIONS.values()))
"""Plants in which something may be hidden."""
USUAL = tuple(name for name in NAMES if name in DRAWN)
