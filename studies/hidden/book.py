"""Effects that may be hidden in the plants by the book, and the names that are right for each.

Declared before any record was judged. In a linear plant of one input and one output a lag of the
input and one of the sensor are the same, as are offsets of both: either name is right there.
"""

from __future__ import annotations

from math import exp, sin

from studies.hidden import curves
from studies.hidden.shapes import (
    OUTSIDE,
    Dice,
    Family,
    backlash,
    charge_transfer,
    drag,
    dry,
    gain,
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
    zone,
)
from studies.plants import Change, static


def _wind(d: Dice) -> Change:
    tilt = d.sign() * d.size(0.01, 0.03)
    return static("pull", lambda x: 9.81 / 9.0 * (sin(x - tilt) - sin(x)))


def _overflow(d: Dice) -> Change:
    crest = d.plain(1.2, 1.5)
    return static("draining", curves.stop_hertz(d.size(0.01, 0.03), crest, 0.1))


def _plateau(d: Dice) -> Change:
    size = d.size(0.03, 0.08)
    return static("sag", lambda q: size * (1.0 - exp(-q / 0.6)))


def _knee(d: Dice) -> Change:
    return static("sag", curves.stop_rounded(d.size(0.1, 0.3), d.plain(1.0, 1.6), 0.15))


def _brakes(d: Dice) -> Change:
    size = d.size(0.02, 0.06)
    return static("resistance", lambda v: size * exp(-v / 40.0))


_SHAKEN = "input_lag(shake); sensor_lag(deflection)"
_TILTED = "input_offset(shake); sensor_offset(deflection)"
_LOSSES = "losses over cone_speed; losses remembering cone_speed"
_STORE = stores("store", (0.5, 1.5), (10.0, 40.0))
_AIR = "air over sway; air remembering sway"
_RUDDER = "steering over rudder"
_WALLS = "envelope remembering room; envelope remembering outdoor"
_HEAT = "envelope over room; envelope over outdoor"
_PEOPLE = "input_offset(heating); input_offset(outdoor); sensor_offset(indoor)"
_BEARING = "bearing over shaft; bearing remembering shaft"
_BRIDGE = "armature over supply"
_COASTING = "resistance over pace; resistance remembering pace"


def _dead(name: str, law: str) -> str:
    return f"dead_zone({name}); asymmetric_dead_zone({name}); {law}"


BOOK: dict[str, list[Family]] = {
    "Accelerometer": [
        ("hard spring", "spring over travel", hardening("spring", 1e7, 3e7, 0.25)),
        ("stop", "spring over travel", stop("spring", 2e8, 8e8, (0.1, 0.2), 0.1 * 0.1)),
        ("uneven film", "film over slip", uneven("film", 3e6, 8e6, 3e3)),
        ("sensor lag", _SHAKEN, lag("deflection", 2e-5, 8e-5)),
        sensor("delay", "deflection", 7e-5, 1.5e-4),
        ("tilt", _TILTED, shifted("shake", 10.0)),
        sensor("drift", "deflection", 0.05),
        (OUTSIDE, "", outside("film", 1e7, 1e-3, 1e4)),
    ],
    "Loudspeaker": [
        ("hard suspension", "suspension over cone", hardening("suspension", 1.0, 3.0, 5.0)),
        ("stop", "suspension over cone", stop("suspension", 1.0, 5.0, (2.0, 4.0), 0.1 * 2.0)),
        (
            "creeping suspension",
            "suspension remembering cone",
            stores("suspension", (0.3, 0.9), (0.02, 0.08)),
        ),
        ("dry losses", _LOSSES, dry("losses", 0.2, 0.6, 0.01, 5e-4)),
        ("air losses", "losses over cone_speed", drag("losses", 0.3, 1.0, 0.5)),
        (
            "clipping",
            "input_saturation(amplifier); coil over amplifier",
            levelling("amplifier", 4.0, 6.0),
        ),
        sensor("lag", "excursion", 2e-3, 6e-3),
        sensor("gain", "excursion", 0.08, 0.2),
        sensor("drift", "excursion", 1.0),
        (OUTSIDE, "", outside("losses", 0.5, 0.02, 0.8)),
    ],
    "Vessel": [
        (
            "orifice",
            "outflow over pressure",
            powers(
                "outflow",
                1.5,
                turbulent=(0.6, 1.5, 0.45, 0.6),
                compressible=(0.6, 1.5, 1.5, 2.2),
            ),
        ),
        ("second volume", "outflow remembering pressure", _STORE),
        (
            "valve levels off",
            "input_saturation(opening); inflow over opening",
            levelling("opening", 0.6, 0.9),
        ),
        ("valve lag", "input_lag(opening); inflow remembering opening", lag("opening", 1.0, 4.0)),
        sensor("lag", "gauge", 1.0, 4.0),
        sensor("offset", "gauge", 0.2),
        sensor("drift", "gauge", 0.2),
        (OUTSIDE, "", outside("outflow", 0.5, 15.0, 0.4)),
    ],
    "Crane": [
        ("dry friction", _AIR, dry("air", 2e-3, 5e-3, 0.01, 0.1)),
        ("drag", "air over sway", drag("air", 5e-3, 1.5e-2, 0.3)),
        ("stiff rope", "pull over swing", hardening("pull", 0.01, 0.03, 0.3)),
        ("guide", "pull over swing", stop("pull", 0.1, 0.4, (0.05, 0.15), 0.1 * 0.05)),
        ("steady wind", "sensor_offset(inclination)", {"tilt": _wind}),
        (OUTSIDE, "", outside("air", 0.01, 6.0, 0.02)),
    ],
    "Ship": [
        ("drag", "hull over yaw", drag("hull", 0.15, 0.4, 0.6)),
        ("uneven hull", "hull over yaw", uneven("hull", 0.1, 0.3, 0.6)),
        ("slack gear", _dead("rudder", _RUDDER), zone("rudder", 1.0, 3.0)),
        (
            "rudder levels off",
            f"input_saturation(rudder); {_RUDDER}",
            levelling("rudder", 10.0, 16.0),
        ),
        ("backlash", "backlash(rudder)", backlash("rudder", 1.0, 3.0, 0.5)),
        ("rudder lag", "input_lag(rudder); steering remembering rudder", lag("rudder", 8.0, 25.0)),
        ("wind", "input_offset(rudder)", shifted("rudder", 2.0)),
        sensor("offset", "turn", 0.05),
        sensor("drift", "turn", 0.08),
        (OUTSIDE, "", outside("hull", 0.15, 90.0, 0.3)),
    ],
    "Tanks": [
        (
            "outlet",
            "draining over lower",
            powers("draining", 1.2, turbulent=(2e-3, 5e-3, 0.45, 0.6), weir=(2e-3, 5e-3, 1.4, 1.6)),
        ),
        ("overflow", "draining over lower", {"after Poleni": _overflow}),
        ("pump levels off", "input_saturation(pump)", levelling("pump", 0.012, 0.018)),
        ("pump lag", "input_lag(pump)", lag("pump", 40.0, 120.0)),
        ("spring water", "input_offset(pump)", shifted("pump", 1.5e-3)),
        sensor("lag", "lower_level", 60.0, 200.0),
        sensor("offset", "upper_level", 0.2),
        sensor("drift", "lower_level", 0.15),
        (OUTSIDE, "", outside("draining", 1.5e-3, 200.0, 3e-3)),
    ],
    "House": [
        ("heavy walls", _WALLS, stores("walls", (0.3, 0.9), (2e4, 8e4), 291.0)),
        (
            "heat loss",
            _HEAT,
            powers("envelope", 16.0, convection=(1.0, 2.5, 1.5, 1.7), draught=(1.0, 2.5, 2.2, 2.6)),
        ),
        ("radiator lag", "input_lag(heating); sensor_lag(indoor)", lag("heating", 5e3, 1.5e4)),
        ("boiler levels off", "input_saturation(heating)", levelling("heating", 5.0, 8.0)),
        ("people", _PEOPLE, shifted("heating", 0.8)),
        sensor("drift", "indoor", 1.5),
        (OUTSIDE, "", outside("envelope", 1.0, 43200.0, 0.1)),
    ],
    "LithiumCell": [
        ("open circuit", "sag over drawn", {"plateau": _plateau, "knee": _knee}),
        (
            "slow pair",
            "inner remembering load",
            slow_pair("inner", (0.015, 0.04), (400.0, 1200.0), (400.0, 1200.0)),
        ),
        (
            "fast pair",
            "inner remembering load",
            slow_pair("inner", (0.015, 0.04), (40.0, 120.0), (40.0, 120.0)),
        ),
        ("charge transfer", "inner over load", charge_transfer("inner", 0.03, 0.06)),
        sensor("delay", "terminal", 20.0, 60.0),
        (OUTSIDE, "", outside("inner", 0.015, 300.0, 0.02)),
    ],
    "GearMotor": [
        ("dry friction", _BEARING, dry("bearing", 0.3, 0.9, 0.2, 0.005)),
        ("fan", "bearing over shaft", drag("bearing", 0.5, 1.5, 10.0)),
        ("one-way gear", "bearing over shaft", uneven("bearing", 0.5, 1.5, 10.0)),
        ("dead bridge", _dead("supply", _BRIDGE), zone("supply", 0.8, 2.5)),
        (
            "bridge levels off",
            f"input_saturation(supply); {_BRIDGE}",
            levelling("supply", 9.0, 14.0),
        ),
        ("bridge lag", "input_lag(supply)", lag("supply", 0.08, 0.3)),
        ("hanging load", "bearing()", shifted("bearing", 0.6)),
        sensor("lag", "tachometer", 0.06, 0.25),
        sensor("offset", "ammeter", 0.6),
        (OUTSIDE, "", outside("bearing", 0.8, 0.4, 0.1)),
    ],
    "Train": [
        ("air drag", _COASTING, drag("resistance", 0.04, 0.12, 120.0)),
        ("dragging brakes", _COASTING, {"falling with speed": _brakes}),
        ("worn wheel", "sensor_gain(speedometer)", gain("speedometer", 0.02, 0.06)),
        sensor("offset", "speedometer", 3.0),
        sensor("drift", "speedometer", 3.0),
        (OUTSIDE, "", outside("resistance", 0.03, 60.0, 3e-4)),
    ],
}
"""By plant."""
