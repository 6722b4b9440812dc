"""Terms that may be missing in the laws of each plant, with all answers that are right.

Sizes as in `studies.hidden`.

An answer is right if it does the same to the outputs: a torque may be added anywhere in a balance
of torques, and what is ahead of its own lag is a lag of its rate. The signal and what is remembered
of it decide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from studies.hidden import Dice
from studies.hidden_laws import shapes as of
from studies.hidden_laws.place import Curve, Lack, after_lag, over, over_count
from studies.hidden_laws.shapes import NONE, Kind, Maker, Shapes, kinds

Made = dict[str, tuple[frozenset[str], Maker]]


def _static(place: str, shapes: Shapes, finest: float = float("inf")) -> Made:
    def maker(draw: Callable[[Dice], Curve]) -> Maker:
        return lambda d: over(place, draw(d), finest)

    return {name: (closed, maker(draw)) for name, (closed, draw) in shapes.items()}


def _counted(place: str, memory: str, shapes: Shapes) -> Made:
    def maker(draw: Callable[[Dice], Curve]) -> Maker:
        return lambda d: over_count(place, draw(d), memory)

    return {name: (closed, maker(draw)) for name, (closed, draw) in shapes.items()}


def _lags(place: str, low: float, high: float, short: float, long: float) -> Made:
    """Return one lag, two, and a spectrum of three.

    The size is between two, the times are about one that is drawn.
    """

    def maker(shares: tuple[float, ...]) -> Maker:
        def make(d: Dice) -> Lack:
            amount = d.size(low, high)
            time = d.plain(short, long)
            return after_lag(place, lambda x: amount * x, tuple(time * share for share in shares))

        return make

    return {
        "one": (NONE, maker((1.0,))),
        "two": (NONE, maker((0.4, 1.6))),
        "spectrum of three": (NONE, maker((0.2, 0.7, 2.5))),
    }


def _motor() -> Iterator[Kind]:
    warm = "winding_current x winding_current"

    def warming(times: tuple[float, ...], levels: bool, d: Dice) -> Lack:
        share = d.size(0.06, 0.15)
        time = d.plain(3.0, 10.0)
        at = d.plain(3.0, 6.0)
        rise: Curve = lambda h: share * h / (1.0 + h / at) if levels else share * h  # noqa: E731
        return after_lag(
            warm,
            lambda h: 1.0 / (1.0 + rise(h)) - 1.0,
            tuple(time * t for t in times),
            squared=True,
        )

    yield from kinds(
        "Motor",
        "drag of another power",
        "friction + omega",
        _static("friction + omega", of.odd_powers(0.06, 0.15, 150.0)),
        multiplied="friction",
    )
    torque = "acceleration + winding_current"
    yield from kinds(
        "Motor",
        "torque levels with the current",
        torque,
        _static(torque, of.levelling(1.5, 4.0, 100.0)),
        signals="current",
    )
    emf = "winding_current + omega"
    yield from kinds(
        "Motor", "induced voltage bends", emf, _static(emf, of.odd_bends(1.0, 2.5, 150.0))
    )
    yield from kinds(
        "Motor",
        "warm winding",
        warm,
        {
            "one mass": (NONE, lambda d: warming((1.0,), False, d)),
            "two masses": (NONE, lambda d: warming((0.4, 1.6), False, d)),
            "levelling": (NONE, lambda d: warming((1.0,), True, d)),
        },
        "heat",
        signals="current",
    )


def _pendulum() -> Iterator[Kind]:
    drag = "friction + velocity"
    spring = "gravity + angle"
    yield from kinds(
        "Pendulum",
        "drag of another power",
        drag,
        _static(drag, of.odd_powers(0.2, 0.6, 0.6)),
        signals="friction, angle_rate",
        multiplied="friction",
    )
    yield from kinds(
        "Pendulum",
        "spring of an odd shape",
        spring,
        _static(spring, of.odd_bends(0.3, 1.0, 0.3)),
        signals="gravity, position",
        multiplied="gravity",
    )
    rough = "friction x angle"
    yield from kinds(
        "Pendulum",
        "friction by angle",
        rough,
        _static(rough, of.even(1.5, 4.0, 0.3)),
        signals="gravity, position",
        coefficient=("damping", 1.0),
    )
    heavy = "acceleration x angle"
    yield from kinds(
        "Pendulum",
        "inertia by angle",
        heavy,
        _static(heavy, of.rising(0.15, 0.4, 0.3)),
        signals="gravity, position",
        coefficient=("inertia", -1.0),
    )
    # a straight part in the angle is the weight's, so that a lag of the angle and what it is ahead
    # of it are the same
    yield from kinds(
        "Pendulum",
        "relaxing arm",
        "gravity + angle",
        _lags("gravity + angle", -3.0, -1.0, 0.5, 1.5),
        "lagged",
        signals="gravity, position",
        memories="lagged, leading",
        also="gravity, friction, acceleration + velocity, friction, angle_rate [lagged]",
    )


def _thermal_nodes() -> Iterator[Kind]:
    loss = "loss + loss"
    yield from kinds(
        "ThermalNodes", "convection", "loss + loss", _static(loss, _convection()), multiplied="loss"
    )
    fan = "loss x power"
    yield from kinds(
        "ThermalNodes",
        "cooling by power",
        fan,
        _static(fan, of.positive(0.4, 1.0, 10.0)),
        coefficient=("R2", -1.0),
    )
    warm = "conduction x inner"
    yield from kinds(
        "ThermalNodes",
        "conduction by temperature",
        warm,
        _static(warm, of.rising(0.2, 0.6, 12.0, 303.0)),
        signals="inner_temperature",
        coefficient=("R12", -1.0),
    )
    heater = "inner_rate + power"
    yield from kinds("ThermalNodes", "heat of the heater", heater, _static(heater, _heater()))
    wet = "loss x time"
    yield from kinds(
        "ThermalNodes",
        "insulation gets wet",
        wet,
        _counted(wet, "time", of.growing(0.2, 0.6, 3000.0)),
        coefficient=("R2", -1.0),
    )


def _convection() -> Shapes:
    """Return shapes relative to what the linear loss would be, W."""
    return of.odd_powers(1.5, 4.0, 8.0)


def _heater() -> Shapes:
    """Return shapes in K/s, of W: a few watts over 40 J/K."""
    return of.positive(0.03, 0.08, 10.0)


def _cell() -> Iterator[Kind]:
    worn = "drop x current"
    yield from kinds(
        "Cell",
        "resistance grows with use",
        worn,
        _counted(worn, "throughput", of.growing(0.15, 0.4, 800.0)),
        "throughput",
        coefficient=("R0", 1.0),
    )
    uneven = "drop + current"
    yield from kinds(
        "Cell", "resistance by direction", uneven, _static(uneven, of.one_sided(0.015, 0.04, 2.0))
    )
    yield from kinds(
        "Cell",
        "three relaxations",
        "drop + current",
        _lags("drop + current", 0.01, 0.03, 60.0, 200.0),
        "lagged",
        signals="relaxed",
        memories="lagged, leading",
        also="drop, voltage + relaxed_rate, relaxed [leading, lagged]",
    )
    starved = "drop x relaxed"
    yield from kinds(
        "Cell",
        "resistance by depletion",
        starved,
        _static(starved, of.even(0.2, 0.6, 1.5)),
        coefficient=("R0", 1.0),
    )
    falling = "drop + current"
    yield from kinds(
        "Cell",
        "open-circuit voltage over charge",
        falling,
        _counted(falling, "integrated", _charging()),
        "integrated",
    )


def _charging() -> Shapes:
    """Return shapes in V, of A*s."""
    return of.rising(0.01, 0.04, 60.0)


def _actuator() -> Iterator[Kind]:
    creep = "kelvin_rate x charge"
    charge = "film_voltage, capacitor_voltage, charge_elongation, electrochemical_displacement"
    yield from kinds(
        "Actuator",
        "creep rate by charge",
        creep,
        _static(creep, of.rising(0.5, 0.9, 2.0)),
        signals=charge,
        coefficient=("b2", -1.0),
    )
    pumped = "capacitor_current + force"
    force = "load, flow_force, maxwell_rate"
    yield from kinds(
        "Actuator",
        "leakage by force",
        pumped,
        _static(pumped, of.even(0.03, 0.1, 2.0)),
        signals=force,
    )
    ageing = "capacitance x time"
    yield from kinds(
        "Actuator",
        "capacitance of time",
        ageing,
        _counted(ageing, "time", of.growing(0.1, 0.3, 300.0)),
        also="film_voltage, capacitor_voltage x time; capacitance + time",
        coefficient=("C", 1.0),
    )
    soft = "spring_elongation x charge"
    yield from kinds(
        "Actuator",
        "stiffness by charge",
        soft,
        _static(soft, of.rising(0.1, 0.3, 2.0)),
        signals=charge,
        coefficient=("k1", -1.0),
    )
    strain = "charge_elongation + charge"
    yield from kinds(
        "Actuator",
        "strain of an odd shape",
        strain,
        _static(strain, of.odd_bends(2e-5, 6e-5, 2.0)),
        signals=charge,
        multiplied="charge_elongation, electrochemical_displacement",
    )
    starved = "series_resistance + charge"
    yield from kinds(
        "Actuator",
        "resistance by charge",
        starved,
        _static(starved, of.even(0.1, 0.25, 2.0)),
        signals=charge,
        multiplied="series_resistance, immediate_resistance",
    )


def _voice_coil() -> Iterator[Kind]:
    position = "position_filtered"
    rough = "slide_friction x position"
    yield from kinds(
        "VoiceCoil",
        "friction by position",
        rough,
        _static(rough, of.even(0.3, 0.8, 0.01)),
        signals=position,
        coefficient=("b_vc", 1.0),
    )
    cogging = "slide_friction + position"
    yield from kinds(
        "VoiceCoil",
        "spring of an odd shape",
        cogging,
        _static(cogging, of.odd_powers(0.3, 1.0, 0.012)),
        signals=position,
    )
    force = "coil_force + coil_current"
    yield from kinds(
        "VoiceCoil",
        "force levels with the current",
        force,
        _static(force, of.levelling(0.7, 1.5, 3.9)),
        multiplied="coil_force",
    )


KINDS: dict[str, Kind] = {
    f"{k.plant}, {k.kind}, {k.shape}": k
    for k in (*_motor(), *_pendulum(), *_thermal_nodes(), *_cell(), *_actuator(), *_voice_coil())
}

NAMES = tuple(dict.fromkeys(k.plant for k in KINDS.values()))
"""Plants in which a law may lack something."""
