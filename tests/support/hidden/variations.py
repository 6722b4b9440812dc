"""What may be hidden in which plant: several shapes of every family, sizes drawn at random, and what it is called.

A right answer is the label of an effect or a family of them, as `Term.family` has it: a law over a signal, in whatever
shape. What cannot be told apart by principle, such as a constant torque and an offset of the torque that is commanded,
has both names; what one record cannot tell apart is computed (`benchmarks.floor`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import exp, pi, sin, sqrt

import numpy as np

from tests.support.hidden import curves
from tests.support.hidden.change import Change, in_a_row, ladder, late, of_time, play, remembered, squared, static

OUTSIDE = "outside"  # every family: nothing in the catalogue is right
STRENGTHS = 1.0, 0.3


class Dice:
    """What sizes are drawn with: the strength, the length of the record in s, and chance."""

    def __init__(self, rng: np.random.Generator, strength: float, duration: float):
        self.strength, self.duration, self._rng = strength, duration, rng

    def size(self, low: float, high: float) -> float:
        """A size between two, times the strength."""
        return self.strength * self.plain(low, high)

    def plain(self, low: float, high: float) -> float:
        """A value between two, in the logarithm where both are positive."""
        if low > 0.0:
            return float(np.exp(self._rng.uniform(np.log(low), np.log(high))))
        return float(self._rng.uniform(low, high))

    def sign(self) -> float:
        """Plus or minus one."""
        return float(self._rng.choice([-1.0, 1.0]))


Maker = Callable[[Dice], Change]


@dataclass(frozen=True)
class Variation:
    """A shape of a family in a plant, and what it may be called."""

    plant: str
    family: str
    shape: str
    right: frozenset[str]
    make: Maker

    @property
    def place(self) -> str:
        """Where it is, whatever its size."""
        return self.drawn(np.random.default_rng(0), 1.0, 60.0).place

    def drawn(self, rng: np.random.Generator, strength: float, duration: float) -> Change:
        """Draw sizes."""
        return self.make(Dice(rng, strength, duration))


def _named(plant: str, family: str, right: str, shapes: dict[str, Maker]) -> Iterator[Variation]:
    """Shapes of a family; what is right is separated by semicolons."""
    names = frozenset(name.strip() for name in right.split(";") if name.strip())
    for shape, make in shapes.items():
        yield Variation(plant, family, shape, names, make)


def _dry(place: str, low: float, high: float, width: float, finest: float) -> dict[str, Maker]:
    return {
        "arc tangent": lambda d: static(place, curves.dry_arctan(d.size(low, high), width), finest),
        "root": lambda d: static(place, curves.dry_root(d.size(low, high), width), finest),
        "Stribeck": lambda d: static(place, curves.stribeck(d.size(low, high), width), finest),
    }


def _drag(place: str, low: float, high: float, at: float) -> dict[str, Maker]:
    return {
        "lower power": lambda d: static(place, curves.power(d.size(low, high), at, d.plain(1.7, 1.85))),
        "higher power": lambda d: static(place, curves.power(d.size(low, high), at, d.plain(2.15, 2.3))),
        "tapering": lambda d: static(place, curves.tapering_drag(d.size(low, high), at)),
    }


def _uneven(place: str, low: float, high: float, at: float) -> dict[str, Maker]:
    return {
        "rounded": lambda d: static(place, curves.one_way(d.size(low, high), at)),
        "power": lambda d: static(place, curves.one_way_power(d.size(low, high), at)),
    }


def _zone(place: str, low: float, high: float) -> dict[str, Maker]:
    return {
        "hyperbola": lambda d: static(place, curves.zone_hyperbola(d.size(low, high))),
        "soft": lambda d: static(place, curves.zone_soft(d.size(low, high))),
        "uneven": lambda d: static(place, curves.zone_uneven(d.size(low, high))),
    }


def _levelling(place: str, low: float, high: float) -> dict[str, Maker]:
    def algebraic(d: Dice) -> Change:
        return static(place, curves.level_algebraic(d.plain(low, high), d.strength, d.plain(3.0, 5.0)))

    return {
        "algebraic": algebraic,
        "arc tangent": lambda d: static(place, curves.level_arctan(d.plain(low, high), d.strength)),
        "exponential": lambda d: static(place, curves.level_exponential(d.plain(low, high), d.strength)),
    }


def _play(place: str, low: float, high: float, time: float) -> dict[str, Maker]:
    def rounded(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_soft(width)(e), time)

    def uneven(d: Dice) -> Change:
        width = d.size(low, high)
        return play(place, lambda e: e + curves.zone_uneven(width)(e), time)

    return {"rounded": rounded, "uneven": uneven}


def _lag(place: str, low: float, high: float) -> dict[str, Maker]:
    def spread(d: Dice) -> Change:
        time = d.size(low, high)
        return remembered(place, 1.0, (0.4 * time, 1.6 * time), own=True)

    return {
        "two in a row": lambda d: in_a_row(place, 1.0, d.size(low, high), 2),
        "spread": spread,
    }


def _drift(output: str, size: float) -> dict[str, Maker]:
    def settling(d: Dice) -> Change:
        most, time = d.sign() * d.size(0.6 * size, 1.6 * size), d.plain(0.3, 0.6) * d.duration
        return of_time(output, lambda y, t: most * (1.0 - exp(-t / time)))

    def root(d: Dice) -> Change:
        most = d.sign() * d.size(0.6 * size, 1.6 * size)
        return of_time(output, lambda y, t: most * sqrt(t / d.duration))

    def growing(d: Dice) -> Change:
        most = d.sign() * d.size(0.6 * size, 1.6 * size)
        return of_time(output, lambda y, t: most * (t / d.duration) ** 1.7)

    return {"settling": settling, "root": root, "growing": growing}


def _late(output: str, low: float, high: float) -> dict[str, Maker]:
    return {"whole samples": lambda d: late(output, d.size(low, high))}


def _shifted(place: str, size: float) -> dict[str, Maker]:
    """A constant has one shape only; here it wanders by a tenth."""

    def constant(d: Dice) -> Change:
        most, period = d.sign() * d.size(0.7 * size, 1.5 * size), d.duration
        return of_time(place, lambda x, t: most * (1.0 + 0.05 * sin(2.0 * pi * t / period)))

    return {"constant": constant}


def _outside(place: str, size: float, period: float, per_signal: float) -> dict[str, Maker]:
    """A disturbance that returns, one that jumps, one that ages the law."""

    def returning(d: Dice) -> Change:
        most, time = d.size(0.7 * size, 1.5 * size), d.plain(0.7, 3.0) * period
        return of_time(place, lambda x, t: most * sin(2.0 * pi * t / time))

    def jumping(d: Dice) -> Change:
        most = d.sign() * d.size(0.7 * size, 1.5 * size)
        begin, end = d.plain(0.2, 0.3) * d.duration, d.plain(0.4, 0.55) * d.duration
        return of_time(place, lambda x, t: most if begin < t < end else 0.0)

    def ageing(d: Dice) -> Change:
        most = d.size(0.7, 1.5) * per_signal
        return of_time(place, lambda x, t: most * x * (t / d.duration) ** 2)

    return {"returning": returning, "jumping": jumping, "ageing": ageing}


def _motor() -> Iterator[Variation]:
    friction = "friction over omega; friction remembering omega"
    fed = "winding_current over voltage"
    yield from _named("Motor", "dry friction", friction, _dry("friction", 0.02, 0.06, 1.5, 0.004))
    yield from _named("Motor", "drag", "friction over omega", _drag("friction", 0.02, 0.06, 150.0))
    yield from _named("Motor", "uneven damping", "friction over omega", _uneven("friction", 0.02, 0.05, 150.0))
    yield from _named(
        "Motor", "dead zone", f"dead_zone(voltage); asymmetric_dead_zone(voltage); {fed}", _zone("voltage", 0.8, 2.5)
    )
    yield from _named("Motor", "saturation", f"input_saturation(voltage); {fed}", _levelling("voltage", 9.0, 14.0))
    yield from _named("Motor", "backlash", "backlash(voltage)", _play("voltage", 0.8, 2.5, 0.005))
    yield from _named("Motor", "input lag", "input_lag(voltage)", _lag("voltage", 0.1, 0.4))
    yield from _named("Motor", "offset", "force_offset; input_offset(load)", _shifted("friction", 0.02))
    yield from _named("Motor", "sensor lag", "sensor_lag(speed)", _lag("speed", 0.1, 0.4))
    yield from _named("Motor", "sensor delay", "transport_delay(speed)", _late("speed", 0.1, 0.3))
    yield from _named("Motor", "sensor offset", "sensor_offset(current)", _shifted("current", 0.3))
    yield from _named("Motor", "sensor drift", "sensor_drift(speed)", _drift("speed", 10.0))
    yield from _named("Motor", OUTSIDE, "", _outside("friction", 0.03, 0.6, 3e-4))


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

    yield from _named("Pendulum", "dry friction", friction, _dry("friction", 0.05, 0.15, 0.01, 0.01))
    yield from _named("Pendulum", "drag", "friction over velocity", _drag("friction", 0.1, 0.3, 0.6))
    yield from _named("Pendulum", "uneven damping", "friction over velocity", _uneven("friction", 0.1, 0.3, 0.6))
    yield from _named("Pendulum", "hard spring", spring, {
        "sinh": lambda d: static("gravity", curves.hard_sinh(d.size(0.3, 1.0), 0.3)),
        "rational": lambda d: static("gravity", curves.hard_rational(d.size(0.3, 1.0), 0.3)),
    })  # fmt: skip
    yield from _named("Pendulum", "stop", spring, {
        "rounded": lambda d: stop(False, d), "Hertz": lambda d: stop(True, d),
    })  # fmt: skip
    yield from _named("Pendulum", "offset", "force_offset; input_offset(torque); sensor_offset(position)",
        {"tilt": tilted})  # fmt: skip
    yield from _named("Pendulum", "relaxing spring", "gravity remembering angle", {
        "two arms": lambda d: arms((0.4, 1.6), d), "spectrum": lambda d: arms((0.2, 0.7, 2.5), d),
    })  # fmt: skip
    yield from _named(
        "Pendulum", "dead zone", "dead_zone(torque); asymmetric_dead_zone(torque)", _zone("torque", 0.12, 0.35)
    )
    yield from _named("Pendulum", "saturation", "input_saturation(torque)", _levelling("torque", 1.0, 1.6))
    yield from _named("Pendulum", "backlash", "backlash(torque)", _play("torque", 0.12, 0.35, 0.01))
    yield from _named("Pendulum", "input lag", "input_lag(torque)", _lag("torque", 0.1, 0.4))
    yield from _named("Pendulum", "sensor lag", "sensor_lag(position)", _lag("position", 0.1, 0.3))
    yield from _named("Pendulum", "sensor delay", "transport_delay(position)", _late("position", 0.15, 0.4))
    yield from _named("Pendulum", "sensor drift", "sensor_drift(position)", _drift("position", 0.05))
    yield from _named("Pendulum", OUTSIDE, "", _outside("friction", 0.15, 1.5, 0.4))


def _thermal_nodes() -> Iterator[Variation]:
    def stored(place: str, times: tuple[float, ...], low: float, high: float, d: Dice) -> Change:
        time = d.plain(low, high)
        return remembered(place, d.size(0.4, 1.2), [time * t for t in times], 293.0, ahead=True)

    def neighbour(d: Dice) -> Change:
        warmer, resistance = d.sign() * d.plain(5.0, 12.0), 5.0 / d.strength
        return static("loss", lambda x: (x - warmer) / resistance)

    two, three = (0.4, 1.6), (0.2, 0.7, 2.5)
    yield from _named("ThermalNodes", "heat loss", "loss over outer", {
        "convection": lambda d: static("loss", curves.power(d.size(2.0, 5.0), 8.0, d.plain(1.3, 1.5))),
        "boiling": lambda d: static("loss", curves.power(d.size(1.0, 3.0), 8.0, d.plain(2.5, 3.0))),
    })  # fmt: skip
    yield from _named("ThermalNodes", "conduction", "conduction over inner; conduction over outer", {
        "growing": lambda d: static("conduction", curves.power(d.size(2.0, 5.0), 12.0, d.plain(1.6, 2.3))),
        "levelling": lambda d: static("conduction", curves.hard_rational(d.size(1.0, 3.0), 12.0)),
    })  # fmt: skip
    yield from _named("ThermalNodes", "storage outside", "loss remembering outer; conduction remembering outer", {
        "two nodes": lambda d: stored("outer", two, 100.0, 400.0, d),
        "wall": lambda d: stored("outer", three, 100.0, 400.0, d),
    })  # fmt: skip
    yield from _named("ThermalNodes", "storage inside", "conduction remembering inner", {
        "two nodes": lambda d: stored("inner", two, 60.0, 250.0, d),
        "wall": lambda d: stored("inner", three, 60.0, 250.0, d),
    })  # fmt: skip
    yield from _named("ThermalNodes", "offset", "force_offset; input_offset(ambient)", {"neighbour": neighbour})
    yield from _named("ThermalNodes", "input lag", "input_lag(power)", _lag("power", 15.0, 60.0))
    yield from _named("ThermalNodes", "saturation", "input_saturation(power)", _levelling("power", 11.0, 16.0))
    for output, low, high in (("inner_temperature", 8.0, 25.0), ("outer_temperature", 20.0, 80.0)):
        for family, effect, shapes in (
            ("sensor lag", "sensor_lag", _lag(output, low, high)),
            ("sensor offset", "sensor_offset", _shifted(output, 2.0)),
        ):
            named = {f"{shape} of {output}": make for shape, make in shapes.items()}
            yield from _named("ThermalNodes", family, f"{effect}({output})", named)
    yield from _named("ThermalNodes", "sensor drift", "sensor_drift(inner_temperature)",
        _drift("inner_temperature", 2.0))  # fmt: skip
    yield from _named("ThermalNodes", OUTSIDE, "", _outside("loss", 1.5, 60.0, 0.4))


def _cell() -> Iterator[Variation]:
    def spread(low: float, high: float, d: Dice) -> Change:
        time = d.plain(low, high)
        times = [time * 10.0**k for k in (-0.6, -0.2, 0.2, 0.6)]
        return remembered("drop", d.size(0.012, 0.03), times)

    pair = "drop remembering current; drop remembering relaxed"
    yield from _named("Cell", "slow pair", pair, {
        "diffusion": lambda d: ladder("drop", d.size(0.012, 0.03), d.plain(200.0, 500.0)),
        "stretched": lambda d: spread(100.0, 250.0, d),
    })  # fmt: skip
    yield from _named("Cell", "fast pair", pair, {
        "diffusion": lambda d: ladder("drop", d.size(0.012, 0.03), d.plain(3.0, 8.0)),
        "stretched": lambda d: spread(1.5, 4.0, d),
    })  # fmt: skip
    yield from _named("Cell", "resistance", "drop over current", {
        "Butler and Volmer": lambda d: static(
            "drop", curves.butler_volmer(d.size(0.02, 0.05), 2.0, d.plain(0.15, 0.5))),
        "exponent": lambda d: static("drop", curves.power(d.size(0.02, 0.05), 2.0, d.plain(0.4, 0.6))),
    })  # fmt: skip
    yield from _named("Cell", "uneven resistance", "drop over current", _uneven("drop", 0.015, 0.04, 2.0))
    yield from _named("Cell", "sensor lag", "sensor_lag(voltage)", _lag("voltage", 1.5, 5.0))
    yield from _named("Cell", "sensor delay", "transport_delay(voltage)", _late("voltage", 1.0, 1.2))
    yield from _named("Cell", "sensor drift", "sensor_drift(voltage)", _drift("voltage", 0.015))
    yield from _named("Cell", OUTSIDE, "", _outside("drop", 0.015, 15.0, 0.015))


def _galvanostat() -> Iterator[Variation]:
    command, wanted = "current_command", "wanted_current over current_command"
    lag = f"input_lag({command}); wanted_current remembering {command}"

    def gain(d: Dice) -> Change:
        share = d.size(0.1, 0.2)
        return static("current", lambda y: share * y)

    yield from _named("Galvanostat", "saturation", f"input_saturation({command}); {wanted}",
        _levelling(command, 1.0, 1.7))  # fmt: skip
    yield from _named("Galvanostat", "backlash", f"backlash({command})", _play(command, 0.1, 0.35, 0.01))
    yield from _named("Galvanostat", "input lag", lag, _lag(command, 0.1, 0.4))
    yield from _named("Galvanostat", "offset", f"input_offset({command}); current_offset", _shifted(command, 0.15))
    yield from _named("Galvanostat", "sensor gain", "sensor_gain(current)", {"constant": gain})
    yield from _named("Galvanostat", "sensor offset", "sensor_offset(current)", _shifted("current", 0.1))
    yield from _named("Galvanostat", "sensor drift", "sensor_drift(current)", _drift("current", 0.1))
    yield from _named("Galvanostat", "sensor delay", "transport_delay(current)", _late("current", 0.15, 0.4))
    yield from _named("Galvanostat", OUTSIDE, "", _outside(command, 0.2, 1.5, 0.15))


def _voice_coil() -> Iterator[Variation]:
    friction = (
        "coulomb_friction; asymmetric_friction; slide_friction over velocity; slide_friction remembering velocity"
    )
    constant = "position_dependent_force_constant"
    fed = "force_reference"

    def falling(d: Dice) -> Change:
        share, width, centre = d.size(0.15, 0.35), d.plain(0.008, 0.015), d.plain(0.0, 0.003)
        return static("force_constant", lambda x: -share * (1.0 - exp(-(((x - centre) / width) ** 2))))

    def tilting(d: Dice) -> Change:
        share = d.size(0.1, 0.3)
        return static("force_constant", lambda x: -share * x / 0.01 / (1.0 + abs(x) / 0.02))

    def stop(hertz: bool, d: Dice) -> Change:
        kind = curves.stop_hertz if hertz else curves.stop_rounded
        return static("stop", kind(d.size(300.0, 1000.0), d.plain(0.009, 0.013), 5e-4))

    def warming(share: float, d: Dice) -> Change:
        amount, time = d.size(0.2, 0.6), d.plain(0.8, 2.5)
        return squared("resistance", amount, (time * share, time / share))

    yield from _named("VoiceCoil", "stop", "slide_friction over position", {
        "rounded": lambda d: stop(False, d), "Hertz": lambda d: stop(True, d),
    })  # fmt: skip
    yield from _named("VoiceCoil", "heating", "coil_resistance remembering coil_current", {
        "two masses": lambda d: warming(0.5, d), "coil and frame": lambda d: warming(0.2, d),
    })  # fmt: skip
    yield from _named("VoiceCoil", "dry friction", friction, _dry("friction", 0.2, 0.6, 2e-3, 2e-4))
    yield from _named("VoiceCoil", "drag", friction, _drag("friction", 0.2, 0.6, 0.1))
    yield from _named("VoiceCoil", "force constant", constant, {"bell": falling, "tilted": tilting})
    yield from _named("VoiceCoil", "saturation", f"amplifier_saturation; input_saturation({fed})",
        _levelling(fed, 3.5, 6.0))  # fmt: skip
    yield from _named(
        "VoiceCoil", "offset", f"input_offset({fed}); dead_zone({fed}); asymmetric_dead_zone({fed})", _shifted(fed, 0.3)
    )
    yield from _named("VoiceCoil", "sensor delay", "transport_delay(position_measured)",
        _late("position_measured", 0.008, 0.03))  # fmt: skip
    yield from _named("VoiceCoil", "sensor drift", "sensor_drift(position_measured)",
        _drift("position_measured", 2.5e-3))  # fmt: skip
    yield from _named("VoiceCoil", OUTSIDE, "", _outside("friction", 0.3, 0.1, 6.0))


VARIATIONS: dict[str, Variation] = {
    f"{v.plant}, {v.family}, {v.shape}": v
    for v in (*_motor(), *_pendulum(), *_thermal_nodes(), *_cell(), *_galvanostat(), *_voice_coil())
}
