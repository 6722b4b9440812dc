"""Disturbances of the bench: bridge noise, mains hum, a late controller, a winding protection.

They are effects like those of :mod:`.effects`; each equals the base model to the last bit at its
neutral value. Random numbers come from multiplicative congruential generators that are exact in
doubles: the same seed gives the same numbers in every build and at every communication step.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any

from ..kit import (
    Constant,
    Discrete,
    Effect,
    Parameter,
    Size,
    State,
    Term,
    cos,
    exp,
    floor,
    log,
    logical_and,
    sin,
    sqrt,
    where,
)
from .model import VoiceCoilDma

if TYPE_CHECKING:

    class BenchEffect(Effect, VoiceCoilDma):
        """Laws of the bench that an effect overrides."""
else:
    BenchEffect = Effect

# Multipliers and moduli of the two generators of L'Ecuyer, Communications of the ACM 31(6), 1988;
# the product of multiplier and modulus is below 2^53.
_FIRST = (Constant(40014.0, "1"), Constant(2147483563.0, "1"))
_SECOND = (Constant(40692.0, "1"), Constant(2147483399.0, "1"))
_CLOCK: dict[str, Any] = {"period": "sample_period", "shift": ("sample_shift",)}
_REGISTER: dict[str, Any] = {**_CLOCK, "nominal": 1e9}


def _next(register: Any, generator: tuple[float, float]) -> Any:
    """Return the next value of a register: multiplier times register, modulo the modulus."""
    multiplier, modulus = generator
    product = multiplier * register
    return product - modulus * floor(product / modulus)


def _uniform(register: Any, generator: tuple[float, float]) -> Any:
    """Return a number in the open interval from 0 to 1 for any value of a register."""
    _, modulus = generator
    return (register - modulus * floor(register / modulus) + 0.5) / (modulus + 1.0)


class BridgeNoise(BenchEffect):
    """White noise of the bridge and of the amplifier's input, new at every sample of the
    controller.

    The noise of the force is ``s n / S``, with ``n`` a normal number by Box and Muller from two
    registers. The start value of the first one is the seed; the first sample has no noise. Relaxes
    assumption 9, that the amplifier adds nothing; ``s = 0`` is the base model.
    """

    id = "bridge_noise"
    title = "Noise of the load cell's bridge"
    neutral = "bridge_noise"
    term = Term("amplified", "", "s n / S", "amplified noise")
    assumption = 9
    sizes = (Size("{} rms", ("bridge_noise",)),)
    is_random = True

    bridge_noise = Parameter(
        0.0, "V", min=0, max=1.0, nominal=1e-6, doc="rms noise at the input of the amplifier (s)"
    )
    bridge_sample = Discrete(
        "1",
        update="next_bridge_sample",
        doc="normal number until the next sample (n)",
        **_CLOCK,
    )
    bridge_register = Discrete(
        "1",
        update="next_bridge_register",
        start=12345.0,
        doc="register of amplitude and angle, a whole number from 1 to 2147483562",
        **_REGISTER,
    )
    bridge_angle_register = Discrete(
        "1",
        update="next_bridge_angle_register",
        start=67890.0,
        doc="register of the angle alone, a whole number from 1 to 2147483398",
        **_REGISTER,
    )

    def next_bridge_sample(self) -> Any:
        """Normal number, sqrt(-2 ln u) cos(2 pi (u + w)) with u and w of the two registers."""
        share = _uniform(self.bridge_register, _FIRST)
        turn = share + _uniform(self.bridge_angle_register, _SECOND)
        return sqrt(-2.0 * log(share)) * cos(2.0 * pi * turn)

    def next_bridge_register(self) -> Any:
        """Next value of the first register."""
        return _next(self.bridge_register, _FIRST)

    def next_bridge_angle_register(self) -> Any:
        """Next value of the second register."""
        return _next(self.bridge_angle_register, _SECOND)

    def amplified(self, force: Any) -> Any:
        """Force plus the noise at the input, s n / S."""
        noise = self.bridge_noise * self.bridge_sample
        return super().amplified(force) + noise / self.load_cell_sensitivity


class MainsHum(BenchEffect):
    """Mains hum that both inputs of the amplifier have in common, ``V_m sin(2 pi f t + p)``.

    The amplifier reads ``V / (G S)`` of it as force, ``G`` being the common-mode rejection, 106 dB
    at 60 Hz. Sampling at 30 Hz aliases 60 Hz to an offset and 50 Hz to 10 Hz. Relaxes assumption 9,
    that the amplifier adds nothing; ``V_m = 0`` is the base model.
    """

    id = "mains_hum"
    title = "Mains hum in the force"
    neutral = "common_mode_voltage"
    term = Term("amplified", "", "V_m sin(2 pi f t + p) / (G S)", "amplified over time")
    assumption = 9
    sizes = (Size("{} at both inputs", ("common_mode_voltage",)),)

    common_mode_voltage = Parameter(
        0.0,
        "V",
        min=0,
        max=100.0,
        nominal=1.0,
        doc="amplitude of the hum that both inputs of the amplifier have in common (V_m)",
    )
    common_mode_rejection = Parameter(
        10.0**5.3,
        "1",
        min=1.0,
        max=1e12,
        nominal=1e5,
        source="thesis section 2.2.2: 106 dB at 60 Hz (INA101HP)",
        doc="common-mode rejection of the amplifier as a ratio (G)",
    )
    mains_frequency = Parameter(
        60.0, "Hz", min=1.0, max=1e3, nominal=50.0, doc="frequency of the mains (f)"
    )
    mains_phase = Parameter(
        0.0, "rad", min=-10.0, max=10.0, display="deg", doc="phase of the mains at time 0 (p)"
    )

    def amplified(self, force: Any) -> Any:
        """Force plus the hum that the common-mode rejection leaves, V / (G S)."""
        hum = self.common_mode_voltage * sin(
            2.0 * pi * self.mains_frequency * self.time + self.mains_phase
        )
        return super().amplified(force) + hum / (
            self.common_mode_rejection * self.load_cell_sensitivity
        )


class ClockJitter(BenchEffect):
    """Controller with a random delay at each sample, up to ``J``: it reads late, and its command
    goes out late.

    The delay is ``d = J u``, with ``u`` uniform between 0 and 1 from a register whose start value
    is the seed. The reading is ``F + (F_f - F) exp(-2 pi f_F d)``, the filtered force d later at
    constant tension F; the previous command lasts d longer. Relaxes assumption 8, that the
    controller runs at its instants; ``J = 0`` is the base model.
    """

    id = "clock_jitter"
    title = "A controller that comes late at random"
    neutral = "clock_jitter"
    term = Term("held_command", "", "V(t - d), d up to J", "held_command late")
    assumption = 8
    sizes = (Size("up to {} late", ("clock_jitter",)),)
    is_random = True

    clock_jitter = Parameter(
        0.0,
        "s",
        min=0,
        max=10.0,
        nominal=1e-3,
        display="ms",
        doc="largest lateness of the controller, less than its sample period (J)",
    )
    clock_register = Discrete(
        "1",
        update="next_clock_register",
        start=24680.0,
        doc="register of the lateness, a whole number from 1 to 2147483562",
        **_REGISTER,
    )
    late_share = Discrete(
        "1",
        update="next_late_share",
        doc="lateness at the latest sample, as a share of the largest (u)",
        **_CLOCK,
    )
    command_instant = Discrete(
        "s",
        update="next_command_instant",
        doc="time of the latest sample",
        **_CLOCK,
    )
    previous_command = Discrete(
        "V",
        update="next_previous_command",
        doc="controller output before the latest sample",
        **_CLOCK,
    )

    def next_clock_register(self) -> Any:
        """Next value of the register."""
        return _next(self.clock_register, _FIRST)

    def next_late_share(self) -> Any:
        """Delay at this sample as a share of the largest, u."""
        return _uniform(self.clock_register, _FIRST)

    def next_command_instant(self) -> Any:
        """Next sampled instant: the time of this sample, s."""
        return self.time

    def next_previous_command(self) -> Any:
        """Command until the next one goes out."""
        return self.voltage_command

    def sampled_force(self) -> Any:
        """Filtered force when the controller reads it, d after the sample instant."""
        delay = self.clock_jitter * self.next_late_share()
        response = 1.0 - exp(-2.0 * pi * self.force_cutoff * delay)
        return super().sampled_force() + response * (self.tension - self.force_filtered)

    def held_command(self) -> Any:
        """Previous command during the delay, then that of the latest sample."""
        delay = self.clock_jitter * self.late_share
        is_delayed = logical_and(delay > 0.0, self.time - self.command_instant < delay)
        return where(is_delayed, self.previous_command, super().held_command())


class WindingProtection(BenchEffect):
    """Thermal protection of the coil, which takes a share ``p`` off the command while the winding
    is too hot.

    The temperature rise ``q`` obeys ``T dq/dt = R_th R i^2 - q`` and is compared at each sample of
    the controller: the protection trips above ``R_th R (F_c / K)^2``, the steady rise under the
    continuous force ``F_c``, and releases below a share of it. Relaxes assumption 10, that nothing
    protects the coil; ``p = 0`` is the base model, ``p = 1`` switches off.
    """

    id = "winding_protection"
    title = "A protection of the coil's winding"
    neutral = "protection_share"
    term = Term(
        "issued_command",
        "coil_current",
        "(1 - p h) V",
        "issued_command remembering coil_current",
    )
    assumption = 10
    sizes = (
        Size("takes {} of the command", ("protection_share",), "%", lambda p: 100.0 * p),
        Size("beyond {} for long", ("continuous_force",)),
    )

    protection_share = Parameter(
        0.0, "1", min=0, max=1.0, display="%", doc="share of the command that is taken away (p)"
    )
    continuous_force = Parameter(
        4.9,
        "N",
        min=1e-3,
        max=1e4,
        nominal=1.0,
        source="thesis section 2.2.2: 4.9 N continuous force",
        doc="force that the coil may give for as long as one likes (F_c)",
    )
    winding_thermal_resistance = Parameter(
        20.0,
        "K/W",
        min=1e-3,
        max=1e4,
        nominal=10.0,
        source="assumed: 95 K at the continuous force",
        doc="rise of the winding's temperature per power (R_th)",
    )
    winding_time = Parameter(
        60.0,
        "s",
        min=1e-2,
        max=1e6,
        nominal=10.0,
        source="assumed",
        doc="thermal time constant of the winding (T)",
    )
    release_share = Parameter(
        0.8,
        "1",
        min=0.01,
        max=1.0,
        display="%",
        source="assumed",
        doc="share of the temperature rise of the trip below which the protection lets go",
    )
    winding_rise = State(
        "K",
        rate="winding_rise_rate",
        nominal=10.0,
        min=0,
        doc="temperature of the winding above that of its surroundings (q)",
    )
    winding_hot = Discrete(
        "1",
        update="next_winding_hot",
        type="boolean",
        doc="whether the protection has tripped (h)",
        **_CLOCK,
    )

    def winding_rise_rate(self) -> Any:
        """Heating by the current, dq/dt = (R_th R i^2 - q) / T."""
        power = self.coil_resistance() * self.coil_current * self.coil_current
        return (self.winding_thermal_resistance * power - self.winding_rise) / self.winding_time

    def trip_rise(self) -> Any:
        """Rise at which the protection trips: the steady one under the continuous force."""
        current = self.continuous_force / self.K
        return self.winding_thermal_resistance * self.R * current * current

    def next_winding_hot(self) -> Any:
        """True above the trip rise, false below its release share, unchanged in between."""
        cool = self.winding_rise < self.release_share * self.trip_rise()
        below_trip = where(cool, 0.0, self.winding_hot)
        return where(self.winding_rise > self.trip_rise(), 1.0, below_trip)

    def issued_command(self) -> Any:
        """Command, less the share p while the winding is too hot."""
        return super().issued_command() * (1.0 - self.protection_share * self.winding_hot)
