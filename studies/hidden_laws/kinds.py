"""Terms that may be missing in the laws of each plant, with all answers that are right.

Sizes as in `studies.hidden`.

An answer is right if it does the same to the outputs: a torque may be added anywhere in a balance
of torques, and what is ahead of its own lag is a lag of its rate. The signal and what is remembered
of it decide.
"""

from __future__ import annotations

from studies.hidden import Dice
from studies.hidden_laws import shapes as of
from studies.hidden_laws.place import Curve, Lack, after_lag
from studies.hidden_laws.shapes import Kind, Maker, Missing


def _lags(place: str, low: float, high: float, short: float, long: float) -> dict[str, Maker]:
    """Return one lag, two, and a spectrum of three.

    The size is between two, the times are about one that is drawn.
    """

    def maker(*shares: float) -> Maker:
        def make(d: Dice) -> Lack:
            amount = d.size(low, high)
            time = d.plain(short, long)
            return after_lag(place, lambda x: amount * x, tuple(time * share for share in shares))

        return make

    return {
        "one": maker(1.0),
        "two": maker(0.4, 1.6),
        "spectrum of three": maker(0.2, 0.7, 2.5),
    }


_WARM = "winding_current x winding_current"


def _warming(*times: float, levels: bool = False) -> Maker:
    def make(d: Dice) -> Lack:
        share = d.size(0.06, 0.15)
        time = d.plain(3.0, 10.0)
        at = d.plain(3.0, 6.0)
        rise: Curve = lambda h: share * h / (1.0 + h / at) if levels else share * h  # noqa: E731
        curve: Curve = lambda h: 1.0 / (1.0 + rise(h)) - 1.0  # noqa: E731
        return after_lag(_WARM, curve, tuple(time * t for t in times), squared=True)

    return make


_ANGLE = "gravity, position"
_CHARGE = "film_voltage, capacitor_voltage, charge_elongation, electrochemical_displacement"
_POSITION = "position_filtered"

_MISSING: dict[str, tuple[Missing, ...]] = {
    "Motor": (
        Missing(
            "drag of another power",
            "friction + omega",
            of.odd_powers(0.06, 0.15, 150.0),
            multiplied="friction",
        ),
        Missing(
            "torque levels with the current",
            "acceleration + winding_current",
            of.levelling(1.5, 4.0, 100.0),
            signals="current",
        ),
        Missing("induced voltage bends", "winding_current + omega", of.odd_bends(1.0, 2.5, 150.0)),
        Missing(
            "warm winding",
            _WARM,
            {
                "one mass": _warming(1.0),
                "two masses": _warming(0.4, 1.6),
                "levelling": _warming(1.0, levels=True),
            },
            "heat",
            signals="current",
        ),
    ),
    "Pendulum": (
        Missing(
            "drag of another power",
            "friction + velocity",
            of.odd_powers(0.2, 0.6, 0.6),
            signals="friction, angle_rate",
            multiplied="friction",
        ),
        Missing(
            "spring of an odd shape",
            "gravity + angle",
            of.odd_bends(0.3, 1.0, 0.3),
            signals=_ANGLE,
            multiplied="gravity",
        ),
        Missing(
            "friction by angle",
            "friction x angle",
            of.even(1.5, 4.0, 0.3),
            signals=_ANGLE,
            coefficient=("damping", 1.0),
        ),
        Missing(
            "inertia by angle",
            "acceleration x angle",
            of.rising(0.15, 0.4, 0.3),
            signals=_ANGLE,
            coefficient=("inertia", -1.0),
        ),
        # a straight part in the angle is the weight's, so that a lag of the angle and what it is
        # ahead of it are the same
        Missing(
            "relaxing arm",
            "gravity + angle",
            _lags("gravity + angle", -3.0, -1.0, 0.5, 1.5),
            "lagged",
            signals=_ANGLE,
            memories="lagged, leading",
            also="gravity, friction, acceleration + velocity, friction, angle_rate [lagged]",
        ),
    ),
    "ThermalNodes": (
        # relative to what the linear loss would be, W
        Missing("convection", "loss + loss", of.odd_powers(1.5, 4.0, 8.0), multiplied="loss"),
        Missing(
            "cooling by power",
            "loss x power",
            of.positive(0.4, 1.0, 10.0),
            coefficient=("R2", -1.0),
        ),
        Missing(
            "conduction by temperature",
            "conduction x inner",
            of.rising(0.2, 0.6, 12.0, 303.0),
            signals="inner_temperature",
            coefficient=("R12", -1.0),
        ),
        # K/s, of W: a few watts over 40 J/K
        Missing("heat of the heater", "inner_rate + power", of.positive(0.03, 0.08, 10.0)),
        Missing(
            "insulation gets wet",
            "loss x time",
            of.growing(0.2, 0.6, 3000.0),
            coefficient=("R2", -1.0),
        ),
    ),
    "Cell": (
        Missing(
            "resistance grows with use",
            "drop x current",
            of.growing(0.15, 0.4, 800.0),
            "throughput",
            coefficient=("R0", 1.0),
        ),
        Missing("resistance by direction", "drop + current", of.one_sided(0.015, 0.04, 2.0)),
        Missing(
            "three relaxations",
            "drop + current",
            _lags("drop + current", 0.01, 0.03, 60.0, 200.0),
            "lagged",
            signals="relaxed",
            memories="lagged, leading",
            also="drop, voltage + relaxed_rate, relaxed [leading, lagged]",
        ),
        Missing(
            "resistance by depletion",
            "drop x relaxed",
            of.even(0.2, 0.6, 1.5),
            coefficient=("R0", 1.0),
        ),
        # V, of A*s
        Missing(
            "open-circuit voltage over charge",
            "drop + current",
            of.rising(0.01, 0.04, 60.0),
            "integrated",
        ),
    ),
    "Actuator": (
        Missing(
            "creep rate by charge",
            "kelvin_rate x charge",
            of.rising(0.5, 0.9, 2.0),
            signals=_CHARGE,
            coefficient=("b2", -1.0),
        ),
        Missing(
            "leakage by force",
            "capacitor_current + force",
            of.even(0.03, 0.1, 2.0),
            signals="load, flow_force, maxwell_rate",
        ),
        Missing(
            "capacitance of time",
            "capacitance x time",
            of.growing(0.1, 0.3, 300.0),
            also="film_voltage, capacitor_voltage x time; capacitance + time",
            coefficient=("C", 1.0),
        ),
        Missing(
            "stiffness by charge",
            "spring_elongation x charge",
            of.rising(0.1, 0.3, 2.0),
            signals=_CHARGE,
            coefficient=("k1", -1.0),
        ),
        Missing(
            "strain of an odd shape",
            "charge_elongation + charge",
            of.odd_bends(2e-5, 6e-5, 2.0),
            signals=_CHARGE,
            multiplied="charge_elongation, electrochemical_displacement",
        ),
        Missing(
            "resistance by charge",
            "series_resistance + charge",
            of.even(0.1, 0.25, 2.0),
            signals=_CHARGE,
            multiplied="series_resistance, immediate_resistance",
        ),
    ),
    "VoiceCoil": (
        Missing(
            "friction by position",
            "slide_friction x position",
            of.even(0.3, 0.8, 0.01),
            signals=_POSITION,
            coefficient=("b_vc", 1.0),
        ),
        Missing(
            "spring of an odd shape",
            "slide_friction + position",
            of.odd_powers(0.3, 1.0, 0.012),
            signals=_POSITION,
        ),
        Missing(
            "force levels with the current",
            "coil_force + coil_current",
            of.levelling(0.7, 1.5, 3.9),
            multiplied="coil_force",
        ),
    ),
}

KINDS: dict[str, Kind] = {
    f"{kind.plant}, {kind.kind}, {kind.shape}": kind
    for plant, several in _MISSING.items()
    for missing in several
    for kind in missing.kinds(plant)
}

NAMES = tuple(_MISSING)
"""Plants in which a law may lack something."""
