"""What may be hidden in the plants by the book, and the effects that name it rightly.

Declared before any record was judged. In a linear plant of one input and one output a lag of the
input and one of the sensor are the same, as are offsets of both: either name is right there.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import exp, sin

from studies.hidden import curves
from studies.hidden.shapes import (
    OUTSIDE,
    Dice,
    Maker,
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
from studies.plants import Change, ladder, remembered, static

TWO = 0.4, 1.6  # times of two stores, over their mean
THREE = 0.2, 0.7, 2.5


def by_the_book() -> Iterator[Variation]:
    """Return the variations of all plants by the book."""
    yield from _accelerometer()
    yield from _loudspeaker()
    yield from _vessel()
    yield from _crane()
    yield from _ship()
    yield from _tanks()
    yield from _house()
    yield from _lithium_cell()
    yield from _gear_motor()
    yield from _train()


def _hardening(place: str, low: float, high: float, at: float) -> dict[str, Maker]:
    """Return springs that harden by two formulas."""
    return {
        "sinh": lambda d: static(place, curves.hard_sinh(d.size(low, high), at)),
        "rational": lambda d: static(place, curves.hard_rational(d.size(low, high), at)),
    }


def _stop(place: str, low: float, high: float, where: tuple[float, float]) -> dict[str, Maker]:
    """Return one-sided stops, rounded or after Hertz, of a stiffness and at a place."""

    def at(hertz: bool, d: Dice) -> Change:
        kind = curves.stop_hertz if hertz else curves.stop_rounded
        return static(place, kind(d.size(low, high), d.plain(*where), 0.1 * where[0], d.sign()))

    return {"rounded": lambda d: at(False, d), "Hertz": lambda d: at(True, d)}


def _stores(
    place: str, amount: tuple[float, float], time: tuple[float, float], rest: float = 0.0
) -> dict[str, Maker]:
    """Return two or three stores behind resistances, beside what is there: they take and give."""

    def store(times: tuple[float, ...], d: Dice) -> Change:
        mean = d.plain(*time)
        return remembered(place, d.size(*amount), [mean * t for t in times], rest, ahead=True)

    return {"two stores": lambda d: store(TWO, d), "three stores": lambda d: store(THREE, d)}


def _spread(place: str, amount: tuple[float, float], time: tuple[float, float]) -> dict[str, Maker]:
    """Return what follows by diffusion, or by a spectrum of times."""

    def stretched(d: Dice) -> Change:
        mean = d.plain(*time)
        return remembered(place, d.size(*amount), [mean * 10.0**k for k in (-0.6, -0.2, 0.2, 0.6)])

    return {
        "diffusion": lambda d: ladder(place, d.size(*amount), d.plain(*time)),
        "stretched": stretched,
    }


def _gain(output: str, low: float, high: float) -> dict[str, Maker]:
    """Return a sensor of another scale, which has one shape only."""

    def constant(d: Dice) -> Change:
        share = d.sign() * d.size(low, high)
        return static(output, lambda y: share * y)

    return {"constant": constant}


def _accelerometer() -> Iterator[Variation]:
    plant = "Accelerometer"
    late = "input_lag(shake); sensor_lag(deflection)"
    level = "input_offset(shake); sensor_offset(deflection)"
    yield from named(
        plant, "hard spring", "spring over travel", _hardening("spring", 1e7, 3e7, 0.25)
    )
    yield from named(plant, "stop", "spring over travel", _stop("spring", 2e8, 8e8, (0.1, 0.2)))
    yield from named(plant, "uneven film", "film over slip", uneven("film", 3e6, 8e6, 3e3))
    yield from named(plant, "sensor lag", late, lag("deflection", 2e-5, 8e-5))
    yield from named(
        plant, "sensor delay", "transport_delay(deflection)", delayed("deflection", 7e-5, 1.5e-4)
    )
    yield from named(plant, "tilt", level, shifted("shake", 10.0))
    yield from named(plant, "sensor drift", "sensor_drift(deflection)", drift("deflection", 0.05))
    yield from named(plant, OUTSIDE, "", outside("film", 1e7, 1e-3, 1e4))


def _loudspeaker() -> Iterator[Variation]:
    plant = "Loudspeaker"
    spring = "suspension over cone"
    yield from named(plant, "hard suspension", spring, _hardening("suspension", 1.0, 3.0, 5.0))
    yield from named(plant, "stop", spring, _stop("suspension", 1.0, 5.0, (2.0, 4.0)))
    yield from named(
        plant,
        "creeping suspension",
        "suspension remembering cone",
        _stores("suspension", (0.3, 0.9), (0.02, 0.08)),
    )
    yield from named(
        plant,
        "dry losses",
        "losses over cone_speed; losses remembering cone_speed",
        dry("losses", 0.2, 0.6, 0.01, 5e-4),
    )
    yield from named(plant, "air losses", "losses over cone_speed", drag("losses", 0.3, 1.0, 0.5))
    yield from named(
        plant,
        "clipping",
        "input_saturation(amplifier); coil over amplifier",
        levelling("amplifier", 4.0, 6.0),
    )
    yield from named(plant, "sensor lag", "sensor_lag(excursion)", lag("excursion", 2e-3, 6e-3))
    yield from named(plant, "sensor gain", "sensor_gain(excursion)", _gain("excursion", 0.08, 0.2))
    yield from named(plant, "sensor drift", "sensor_drift(excursion)", drift("excursion", 1.0))
    yield from named(plant, OUTSIDE, "", outside("losses", 0.5, 0.02, 0.8))


def _vessel() -> Iterator[Variation]:
    plant = "Vessel"
    valve = "inflow over opening"
    yield from named(
        plant,
        "orifice",
        "outflow over pressure",
        {
            "turbulent": lambda d: static(
                "outflow", curves.power(d.size(0.6, 1.5), 1.5, d.plain(0.45, 0.6))
            ),
            "compressible": lambda d: static(
                "outflow", curves.power(d.size(0.6, 1.5), 1.5, d.plain(1.5, 2.2))
            ),
        },
    )
    yield from named(
        plant,
        "second volume",
        "outflow remembering pressure",
        _stores("store", (0.5, 1.5), (10.0, 40.0)),
    )
    yield from named(
        plant,
        "valve levels off",
        f"input_saturation(opening); {valve}",
        levelling("opening", 0.6, 0.9),
    )
    yield from named(
        plant,
        "valve lag",
        "input_lag(opening); inflow remembering opening",
        lag("opening", 1.0, 4.0),
    )
    yield from named(plant, "sensor lag", "sensor_lag(gauge)", lag("gauge", 1.0, 4.0))
    yield from named(plant, "sensor offset", "sensor_offset(gauge)", shifted("gauge", 0.2))
    yield from named(plant, "sensor drift", "sensor_drift(gauge)", drift("gauge", 0.2))
    yield from named(plant, OUTSIDE, "", outside("outflow", 0.5, 15.0, 0.4))


def _crane() -> Iterator[Variation]:
    plant = "Crane"
    drops = "air over sway; air remembering sway"

    def wind(d: Dice) -> Change:
        tilt = d.sign() * d.size(0.01, 0.03)
        return static("pull", lambda x: 9.81 / 9.0 * (sin(x - tilt) - sin(x)))

    yield from named(plant, "dry friction", drops, dry("air", 2e-3, 5e-3, 0.01, 0.1))
    yield from named(plant, "drag", "air over sway", drag("air", 5e-3, 1.5e-2, 0.3))
    yield from named(plant, "stiff rope", "pull over swing", _hardening("pull", 0.01, 0.03, 0.3))
    yield from named(plant, "guide", "pull over swing", _stop("pull", 0.1, 0.4, (0.05, 0.15)))
    yield from named(plant, "steady wind", "sensor_offset(inclination)", {"tilt": wind})
    yield from named(plant, OUTSIDE, "", outside("air", 0.01, 6.0, 0.02))


def _ship() -> Iterator[Variation]:
    plant = "Ship"
    rudder = "steering over rudder"
    yield from named(plant, "drag", "hull over yaw", drag("hull", 0.15, 0.4, 0.6))
    yield from named(plant, "uneven hull", "hull over yaw", uneven("hull", 0.1, 0.3, 0.6))
    yield from named(
        plant,
        "slack gear",
        f"dead_zone(rudder); asymmetric_dead_zone(rudder); {rudder}",
        zone("rudder", 1.0, 3.0),
    )
    yield from named(
        plant,
        "rudder levels off",
        f"input_saturation(rudder); {rudder}",
        levelling("rudder", 10.0, 16.0),
    )
    yield from named(plant, "backlash", "backlash(rudder)", backlash("rudder", 1.0, 3.0, 0.5))
    yield from named(
        plant,
        "rudder lag",
        "input_lag(rudder); steering remembering rudder",
        lag("rudder", 8.0, 25.0),
    )
    yield from named(plant, "wind", "input_offset(rudder)", shifted("rudder", 2.0))
    yield from named(plant, "sensor offset", "sensor_offset(turn)", shifted("turn", 0.05))
    yield from named(plant, "sensor drift", "sensor_drift(turn)", drift("turn", 0.08))
    yield from named(plant, OUTSIDE, "", outside("hull", 0.15, 90.0, 0.3))


def _tanks() -> Iterator[Variation]:
    plant = "Tanks"
    out = "draining over lower"

    def pipe(d: Dice) -> Change:
        return static("draining", curves.power(d.size(2e-3, 5e-3), 1.2, d.plain(0.45, 0.6)))

    def weir(d: Dice) -> Change:
        return static("draining", curves.power(d.size(2e-3, 5e-3), 1.2, d.plain(1.4, 1.6)))

    def overflow(d: Dice) -> Change:
        crest = d.plain(1.2, 1.5)
        return static("draining", curves.stop_hertz(d.size(0.01, 0.03), crest, 0.1))

    yield from named(plant, "outlet", out, {"turbulent": pipe, "weir": weir})
    yield from named(plant, "overflow", out, {"after Poleni": overflow})
    yield from named(
        plant, "pump levels off", "input_saturation(pump)", levelling("pump", 0.012, 0.018)
    )
    yield from named(plant, "pump lag", "input_lag(pump)", lag("pump", 40.0, 120.0))
    yield from named(plant, "spring water", "input_offset(pump)", shifted("pump", 1.5e-3))
    yield from named(
        plant, "sensor lag", "sensor_lag(lower_level)", lag("lower_level", 60.0, 200.0)
    )
    yield from named(
        plant, "sensor offset", "sensor_offset(upper_level)", shifted("upper_level", 0.2)
    )
    yield from named(plant, "sensor drift", "sensor_drift(lower_level)", drift("lower_level", 0.15))
    yield from named(plant, OUTSIDE, "", outside("draining", 1.5e-3, 200.0, 3e-3))


def _house() -> Iterator[Variation]:
    plant = "House"
    yield from named(
        plant,
        "heavy walls",
        "envelope remembering room; envelope remembering outdoor",
        _stores("walls", (0.3, 0.9), (2e4, 8e4), 291.0),
    )
    yield from named(
        plant,
        "heat loss",
        "envelope over room; envelope over outdoor",
        {
            "convection": lambda d: static(
                "envelope", curves.power(d.size(1.0, 2.5), 16.0, d.plain(1.5, 1.7))
            ),
            "draught": lambda d: static(
                "envelope", curves.power(d.size(1.0, 2.5), 16.0, d.plain(2.2, 2.6))
            ),
        },
    )
    yield from named(
        plant, "radiator lag", "input_lag(heating); sensor_lag(indoor)", lag("heating", 5e3, 1.5e4)
    )
    yield from named(
        plant, "boiler levels off", "input_saturation(heating)", levelling("heating", 5.0, 8.0)
    )
    yield from named(
        plant,
        "people",
        "input_offset(heating); input_offset(outdoor); sensor_offset(indoor)",
        shifted("heating", 0.8),
    )
    yield from named(plant, "sensor drift", "sensor_drift(indoor)", drift("indoor", 1.5))
    yield from named(plant, OUTSIDE, "", outside("envelope", 1.0, 43200.0, 0.1))


def _lithium_cell() -> Iterator[Variation]:
    plant = "LithiumCell"
    pair = "inner remembering load"
    volts = "inner over load"
    curve = "sag over drawn"

    def plateau(d: Dice) -> Change:
        size = d.size(0.03, 0.08)
        return static("sag", lambda q: size * (1.0 - exp(-q / 0.6)))

    def knee(d: Dice) -> Change:
        return static("sag", curves.stop_rounded(d.size(0.1, 0.3), d.plain(1.0, 1.6), 0.15))

    yield from named(plant, "open circuit", curve, {"plateau": plateau, "knee": knee})
    yield from named(plant, "slow pair", pair, _spread("inner", (0.015, 0.04), (400.0, 1200.0)))
    yield from named(plant, "fast pair", pair, _spread("inner", (0.015, 0.04), (40.0, 120.0)))
    yield from named(
        plant,
        "charge transfer",
        volts,
        {
            "Butler and Volmer": lambda d: static(
                "inner", curves.butler_volmer(d.size(0.03, 0.06), 2.0, d.plain(0.15, 0.5))
            ),
            "exponent": lambda d: static(
                "inner", curves.power(d.size(0.03, 0.06), 2.0, d.plain(0.4, 0.6))
            ),
        },
    )
    yield from named(
        plant, "sensor delay", "transport_delay(terminal)", delayed("terminal", 20.0, 60.0)
    )
    yield from named(plant, OUTSIDE, "", outside("inner", 0.015, 300.0, 0.02))


def _gear_motor() -> Iterator[Variation]:
    plant = "GearMotor"
    rubbing = "bearing over shaft; bearing remembering shaft"
    bridge = "armature over supply"
    yield from named(plant, "dry friction", rubbing, dry("bearing", 0.3, 0.9, 0.2, 0.005))
    yield from named(plant, "fan", "bearing over shaft", drag("bearing", 0.5, 1.5, 10.0))
    yield from named(plant, "one-way gear", "bearing over shaft", uneven("bearing", 0.5, 1.5, 10.0))
    yield from named(
        plant,
        "dead bridge",
        f"dead_zone(supply); asymmetric_dead_zone(supply); {bridge}",
        zone("supply", 0.8, 2.5),
    )
    yield from named(
        plant,
        "bridge levels off",
        f"input_saturation(supply); {bridge}",
        levelling("supply", 9.0, 14.0),
    )
    yield from named(plant, "bridge lag", "input_lag(supply)", lag("supply", 0.08, 0.3))
    yield from named(plant, "hanging load", "force_offset", shifted("bearing", 0.6))
    yield from named(plant, "sensor lag", "sensor_lag(tachometer)", lag("tachometer", 0.06, 0.25))
    yield from named(plant, "sensor offset", "sensor_offset(ammeter)", shifted("ammeter", 0.6))
    yield from named(plant, OUTSIDE, "", outside("bearing", 0.8, 0.4, 0.1))


def _train() -> Iterator[Variation]:
    plant = "Train"
    falls = "resistance over pace; resistance remembering pace"

    def brakes(d: Dice) -> Change:
        size = d.size(0.02, 0.06)
        return static("resistance", lambda v: size * exp(-v / 40.0))

    yield from named(plant, "air drag", falls, drag("resistance", 0.04, 0.12, 120.0))
    yield from named(plant, "dragging brakes", falls, {"falling with speed": brakes})
    yield from named(
        plant, "worn wheel", "sensor_gain(speedometer)", _gain("speedometer", 0.02, 0.06)
    )
    yield from named(
        plant, "sensor offset", "sensor_offset(speedometer)", shifted("speedometer", 3.0)
    )
    yield from named(plant, "sensor drift", "sensor_drift(speedometer)", drift("speedometer", 3.0))
    yield from named(plant, OUTSIDE, "", outside("resistance", 0.03, 60.0, 3e-4))
