"""The voice-coil dynamic mechanical analyzer (DMA): a coil that pulls on the actuator, and its
sampled force loop.

Thesis section 2.2, eqs. 2.1 and 2.2, appendix A1. Equation 2.1 is written as the differential
equations of the coil current and of the moving mass, which slide damping and the tension of the
clamped actuator oppose. The coil pulls, so the position grows as the actuator stretches. Parameter
values are those of A1, whose comments in the source are shifted by one line (``docs/errata.md``,
row 2).

An output returns the value of a law, and no law calls an output.
"""

from __future__ import annotations

from math import pi
from typing import Any

from ..kit import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    PowerPort,
    Preset,
    State,
    floor,
    where,
)

_A1 = "thesis appendix A1 (errata 2)"
_LAW = "thesis eq. 2.2: Tustin of 18 (0.02 s + 1)/s at 30 Hz (errata 3)"
_SECTION = "thesis section 2.2.2"


def _limited(value: Any, low: Any, high: Any) -> Any:
    """Return a value limited to a range; unlike ``clip``, NaN stays NaN, so that it is noticed."""
    return where(value > high, high, where(value < low, low, value))


class VoiceCoilDma(Component):
    """Voice coil, moving mass, sensors and the sampled force controller of the test bench (thesis
    section 2.2).
    """

    name = "voice_coil_dma"
    experiment = (2.0, 1e-3)
    ports = (
        PowerPort("clamp", "translational", "position", "tension", ("flange",), delivers=True),
    )
    unchecked = ("next_command",)  # a force, or a voltage if the controller is off

    R = Parameter(
        3.0,
        "ohm",
        min=1e-3,
        max=1e3,
        source=_A1,
        title="coil resistance",
        doc="resistance of the coil",
    )
    L = Parameter(
        1e-3,
        "H",
        min=1e-5,
        max=10.0,
        nominal=1e-3,
        source=_A1,
        title="coil inductance",
        doc="inductance of the coil",
    )
    K = Parameter(
        3.9,
        "N/A",
        min=0,
        max=1e3,
        source=_A1,
        title="force constant",
        doc="force constant, and back-EMF constant in V*s/m",
    )
    m = Parameter(
        0.03,
        "kg",
        min=1e-4,
        max=1e2,
        nominal=0.01,
        source=_A1,
        title="moving mass",
        doc="moving mass",
    )
    b_vc = Parameter(
        6.0,
        "N*s/m",
        min=0,
        max=1e4,
        source=_A1,
        title="viscous damping of the slide",
        doc="viscous damping of the slide",
    )

    force_cutoff = Parameter(
        100.0,
        "Hz",
        min=1e-2,
        max=1e4,
        nominal=100.0,
        source="thesis A1; section 2.2.2 says about 10 Hz (errata 5)",
        doc="cutoff frequency of the first-order load-cell filter",
    )
    position_cutoff = Parameter(
        100.0,
        "Hz",
        min=1e-2,
        max=1e4,
        nominal=100.0,
        source="as force_cutoff: the same kind of filter",
        doc="cutoff frequency of the first-order potentiometer filter",
    )

    converters_on = Parameter(
        False, "1", type="boolean", doc="whether signals pass converters of finite resolution"
    )
    converter_bits = Parameter(
        16, "1", type="integer", min=4, max=24, source=_SECTION, doc="bits of every converter"
    )
    converter_range = Parameter(
        10.0,
        "V",
        min=0.1,
        max=100.0,
        source="NI PCI-6036: -10 V to 10 V",
        doc="magnitude of the largest voltage the converters handle",
    )
    load_cell_sensitivity = Parameter(
        4.5e-4,
        "V/N",
        min=1e-9,
        max=1e3,
        nominal=1e-4,
        source="assumed: 20 mV at the 44.5 N full scale of section 2.2.2",
        doc="voltage of the load cell bridge per force",
    )
    instrumentation_gain = Parameter(
        1000.0,
        "1",
        min=1.0,
        max=1e4,
        nominal=1000.0,
        source="assumed: resolves 0.001 N as section 2.2.2 says",
        doc="gain of the instrumentation amplifier",
    )
    potentiometer_sensitivity = Parameter(
        196.85,
        "V/m",
        min=1e-3,
        max=1e6,
        nominal=100.0,
        source="10 V over the 50.8 mm stroke of section 2.2.2",
        doc="voltage of the potentiometer per displacement",
    )

    controller_on = Parameter(
        True,
        "1",
        type="boolean",
        doc="whether the loop is closed; if not, force_reference is a coil voltage in V",
    )
    sample_period = Parameter(
        1.0 / 30.0,
        "s",
        min=1e-4,
        max=10.0,
        nominal=0.01,
        source=_SECTION,
        doc="sample period of controller and output",
    )
    sample_shift = Parameter(
        0.0,
        "s",
        min=0,
        max=10.0,
        nominal=0.01,
        source="the clocks of controller and record are not started together",
        doc="time from the start to the first sample of the controller",
    )
    error_gain = Parameter(
        0.66,
        "V/N",
        min=-1e3,
        max=1e3,
        source=_LAW,
        tunable=True,
        doc="controller coefficient of the present error",
    )
    previous_error_gain = Parameter(
        -0.06,
        "V/N",
        min=-1e3,
        max=1e3,
        source=_LAW,
        tunable=True,
        doc="controller coefficient of the previous error",
    )
    voltage_min = Parameter(
        0.0,
        "V",
        min=-100.0,
        max=0,
        source="thesis section 2.2.3",
        tunable=True,
        doc="lowest coil voltage",
    )
    voltage_max = Parameter(
        10.0,
        "V",
        min=0,
        max=100.0,
        source="thesis section 2.2.3",
        tunable=True,
        doc="highest coil voltage",
    )
    anti_windup = Parameter(
        True, "1", type="boolean", doc="whether the controller remembers the voltage as limited"
    )

    force_reference = Input("N", doc="wanted force; a coil voltage in V if the controller is off")
    tension = Input("N", doc="tension of the clamped actuator, at the load cell; opposes the coil")
    hold = Input(
        "1", start=False, type="boolean", doc="freezes the integral part of the controller"
    )

    coil_current = State("A", rate="current_rate", output=True, doc="current in the coil")
    position = State(
        "m",
        rate="position_rate",
        nominal=1e-3,
        display="mm",
        output=True,
        doc="position of the coil",
    )
    velocity = State(
        "m/s", rate="velocity_rate", nominal=1e-2, output=True, doc="velocity of the coil"
    )
    force_filtered = State("N", rate="force_filter_rate", doc="load-cell force behind its filter")
    position_filtered = State(
        "m",
        rate="position_filter_rate",
        nominal=1e-3,
        display="mm",
        doc="potentiometer position behind its filter",
    )

    voltage_command = Discrete(
        "V",
        update="next_command",
        period="sample_period",
        shift=("sample_shift",),
        doc="controller output, V(t)",
    )
    previous_error = Discrete(
        "N",
        update="force_error",
        period="sample_period",
        shift=("sample_shift",),
        doc="force error at the last sample",
    )

    # --- coil
    # ----------------------------------------------------------------------------------------------

    def force_constant(self) -> Any:
        """Force per current, which is also voltage per velocity, K (eq. 2.1)."""
        return self.K

    def held_command(self) -> Any:
        """Command between samples: that of the latest sample, V(t) of eq. 2.2."""
        return self.voltage_command

    def issued_command(self) -> Any:
        """Command at the input of the converter: the whole command between samples."""
        return self.held_command()

    def drive_voltage(self) -> Any:
        """Output voltage of converter and unity-gain amplifier: the command within its limits
        (section 2.2.3).
        """
        return self.converted(_limited(self.issued_command(), self.voltage_min, self.voltage_max))

    def coil_resistance(self) -> Any:
        """Resistance of the coil, R (eq. 2.1)."""
        return self.R

    def current_rate(self) -> Any:
        """Coil circuit (eq. 2.1): L di/dt = v - R i - K dx/dt."""
        back_emf = self.force_constant() * self.velocity
        return (
            self.drive_voltage() - self.coil_resistance() * self.coil_current - back_emf
        ) / self.L

    # --- slide
    # ----------------------------------------------------------------------------------------------

    def coil_force(self) -> Any:
        """Force of the coil, K i; F(s) of eq. 2.1."""
        return self.force_constant() * self.coil_current

    def slide_friction(self) -> Any:
        """Force of the slide against its motion, b_vc dx/dt (eq. 2.1)."""
        return self.b_vc * self.velocity

    def position_rate(self) -> Any:
        """Definition of the velocity."""
        return self.velocity

    def velocity_rate(self) -> Any:
        """Momentum of the moving mass (eq. 2.1): m dv/dt = K i - b_vc v - tension."""
        return (self.coil_force() - self.slide_friction() - self.tension) / self.m

    # --- sensors
    # ----------------------------------------------------------------------------------------------

    def force_filter_rate(self) -> Any:
        """First-order filter of the load cell, 1/(s/(2 pi f_c) + 1) (appendix A1)."""
        return 2.0 * pi * self.force_cutoff * (self.tension - self.force_filtered)

    def position_filter_rate(self) -> Any:
        """First-order filter of the potentiometer (section 2.2.2)."""
        return 2.0 * pi * self.position_cutoff * (self.position - self.position_filtered)

    def converted(self, volts: Any) -> Any:
        """Voltage as a converter passes it: the nearest of 2^bits levels from -range, the same
        voltage if off.
        """
        level = 2.0 * self.converter_range / 2.0**self.converter_bits
        nearest = level * floor(volts / level + 0.5)
        limited = _limited(nearest, -self.converter_range, self.converter_range - level)
        return where(self.converters_on, limited, volts)

    def through_converter(self, value: Any, sensitivity: Any) -> Any:
        """Value after conversion of its voltage and exact calibration (section 2.2.2)."""
        return where(self.converters_on, self.converted(value * sensitivity) / sensitivity, value)

    def amplified(self, force: Any) -> Any:
        """Force as the output of the instrumentation amplifier represents it: unchanged here."""
        return force

    def acquired(self, force: Any) -> Any:
        """Filtered force as the computer reads it: amplified, converted, calibrated."""
        return self.through_converter(
            self.amplified(force), self.load_cell_sensitivity * self.instrumentation_gain
        )

    def acquired_force(self) -> Any:
        """Force as the computer reads it now."""
        return self.acquired(self.force_filtered)

    def acquired_position(self) -> Any:
        """Position as the computer reads it: filtered, converted, calibrated."""
        return self.through_converter(self.position_filtered, self.potentiometer_sensitivity)

    # --- controller
    # ----------------------------------------------------------------------------------------------

    def sampled_force(self) -> Any:
        """Filtered force that the controller samples: that at the sample instant."""
        return self.force_filtered

    def force_error(self) -> Any:
        """Reference less measured force, E(t) of eq. 2.2."""
        return self.force_reference - self.acquired(self.sampled_force())

    def controller_law(self) -> Any:
        """Voltage of eq. 2.2, V(t-1) + b0 E(t) + b1 E(t-1); on hold without its integral part.

        By Tustin's rule, the coefficients b0 and b1 belong to a proportional gain of (b0 - b1)/2.
        """
        error = self.force_error()
        full = self.error_gain * error + self.previous_error_gain * self.previous_error
        proportional = (
            0.5 * (self.error_gain - self.previous_error_gain) * (error - self.previous_error)
        )
        return self.voltage_command + where(self.hold, proportional, full)

    def next_command(self) -> Any:
        """Voltage until the next sample; the anti-windup stores it as limited."""
        wanted = where(self.controller_on, self.controller_law(), self.force_reference)
        return where(self.anti_windup, _limited(wanted, self.voltage_min, self.voltage_max), wanted)

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    @Output("V")
    def coil_voltage(self) -> Any:
        """Voltage across the coil, held between sample instants."""
        return self.drive_voltage()

    @Output("N")
    def force_measured(self) -> Any:
        """Force as the computer reads it."""
        return self.acquired_force()

    @Output("m", nominal=1e-3, display="mm")
    def position_measured(self) -> Any:
        """Position as the computer reads it."""
        return self.acquired_position()

    presets = {
        "as_described": Preset(
            {"force_cutoff": 10.0, "position_cutoff": 10.0, "converters_on": True},
            doc=(
                "the bench in the words of thesis section 2.2.2: filters at about 10 Hz and 16-bit"
                " converters"
            ),
        ),
    }
