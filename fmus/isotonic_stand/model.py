"""The vertical test stand: weights that pull on the actuator, and an LVDT whose core they hang on.

Thesis section 2.1: an actuator hangs in a fixture, discrete weights are put on the core of an LVDT
and taken off it, and LabVIEW samples the displacement and sets it to zero (section 3.3.1). The
source prints no parameters of the stand; every default is an assumption and declared as such.

The tension is a state, so that a force-driven actuator, whose displacement follows its load without
delay, forms no algebraic loop with the stand.

An output returns the value of a law, and no law calls an output.
"""

from __future__ import annotations

from math import pi, sqrt
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
    clip,
    maximum,
    sin,
    where,
)

# factor that scales the largest value of the cubic u - u^3 to 1
_CUBIC_SCALE = 1.5 * sqrt(3.0)


class IsotonicStand(Component):
    """Vertical test stand: weights in kg on an actuator, its displacement by an LVDT (thesis
    section 2.1).
    """

    name = "isotonic_stand"
    experiment = (60.0, 0.1)
    ports = (
        PowerPort("core", "translational", "displacement", "tension", ("flange",), delivers=True),
    )

    gravity = Parameter(
        9.80665,
        "m/s^2",
        min=0.1,
        max=100.0,
        source="standard gravity",
        fitted=False,
        doc="gravity (g)",
    )
    core_mass = Parameter(
        0.0,
        "kg",
        min=0,
        max=100.0,
        nominal=0.1,
        display="g",
        source="assumed: loads that the source states have the core in them",
        doc="mass of core and rod, which pull without any weight (m_c)",
    )
    placing_time = Parameter(
        0.05,
        "s",
        min=1e-4,
        max=1e3,
        nominal=0.05,
        source="assumed: a weight is put on by hand within a quarter of a second",
        doc="time constant with which the tension follows a weight put on or taken off (T_p)",
    )

    full_scale = Parameter(
        25.4e-3,
        "m",
        min=1e-4,
        max=1.0,
        nominal=0.01,
        display="mm",
        source="assumed: the 1000 of DCTH 1000 as thousandths of an inch",
        fitted=False,
        doc="displacement of the core to either side up to which the LVDT is specified (X)",
    )
    lvdt_sensitivity = Parameter(
        196.85,
        "V/m",
        min=1e-3,
        max=1e6,
        nominal=100.0,
        source="assumed: 5 V at full scale",
        fitted=False,
        doc="voltage of the LVDT per displacement of its core (S)",
    )
    linearity = Parameter(
        0.0,
        "1",
        min=-0.1,
        max=0.1,
        nominal=0.005,
        display="%",
        source="assumed: none; a share of 0.5 % in preset dcth_1000",
        fitted=False,
        tunable=True,
        doc="largest deviation of the LVDT from a straight line, as a share of full scale (e)",
    )
    demodulator_cutoff = Parameter(
        200.0,
        "Hz",
        min=1e-2,
        max=1e4,
        nominal=100.0,
        source="assumed",
        fitted=False,
        doc="cutoff frequency of the first-order filter of the demodulator (f_d)",
    )
    carrier_frequency = Parameter(
        5003.0,
        "Hz",
        min=1.0,
        max=1e6,
        nominal=1000.0,
        source="assumed: about 5 kHz, and no multiple of a sample rate",
        fitted=False,
        doc="frequency of the carrier that excites the LVDT (f_c)",
    )
    carrier_shift = Parameter(
        0.0,
        "s",
        min=0,
        max=1.0,
        nominal=2e-5,
        display="us",
        source="assumed: the carrier and the record are not started together",
        fitted=False,
        doc="time from the start to a rising zero of the ripple (t_c)",
    )
    carrier_ripple = Parameter(
        0.0,
        "V",
        min=0,
        max=10.0,
        nominal=0.01,
        display="mV",
        source="assumed: none; 10 mV in preset dcth_1000",
        fitted=False,
        tunable=True,
        doc="amplitude of what the demodulator leaves of the rectified carrier (V_r)",
    )

    sample_period = Parameter(
        0.1,
        "s",
        min=1e-4,
        max=1e3,
        nominal=0.1,
        source="assumed: 10 Hz, as records of the source are read (errata 21)",
        doc="sample period of LabVIEW",
    )
    sample_shift = Parameter(
        0.0,
        "s",
        min=0,
        max=1e3,
        nominal=0.1,
        source="the clocks of LabVIEW and record are not started together",
        doc="time from the start to the first sample of LabVIEW",
    )

    mass = Input("kg", nominal=0.1, min=0, display="g", doc="mass of the weights on the core")
    displacement = Input(
        "m",
        nominal=1e-4,
        display="mm",
        doc="displacement of the lower end of the actuator, which moves the core; down is positive",
    )
    zero = Input(
        "1",
        start=False,
        type="boolean",
        doc="sets the measured displacement to zero at every sample while it is true",
    )

    tension = State(
        "N", rate="tension_rate", output=True, doc="tension of the actuator, which carries the core"
    )
    demodulated_voltage = State(
        "V",
        rate="demodulator_rate",
        nominal=0.1,
        doc="voltage of the LVDT behind the filter of its demodulator",
    )

    sampled_displacement = Discrete(
        "m",
        update="read_displacement",
        period="sample_period",
        shift=("sample_shift",),
        nominal=1e-4,
        display="mm",
        doc="displacement that LabVIEW read at the latest sample, not set to zero",
    )
    zero_displacement = Discrete(
        "m",
        update="next_zero",
        period="sample_period",
        shift=("sample_shift",),
        nominal=1e-4,
        display="mm",
        doc="displacement that is subtracted since it was set to zero",
    )

    # --- weights
    # ----------------------------------------------------------------------------------------------

    def weight(self) -> Any:
        """Weight of mass and core on the actuator, (m + m_c) g; their inertia is neglected."""
        return (self.mass + self.core_mass) * self.gravity

    def carried_load(self) -> Any:
        """Load of the actuator once a weight is in place: all of the weight."""
        return self.weight()

    def tension_rate(self) -> Any:
        """Rate of the tension as a weight is placed, T_p dF/dt = load - F; a load cannot push."""
        return (maximum(self.carried_load(), 0.0) - self.tension) / self.placing_time

    # --- LVDT
    # ----------------------------------------------------------------------------------------------

    def end_position(self) -> Any:
        """Position of the actuator's lower end over the body of the LVDT: its displacement."""
        return self.displacement

    def core_position(self) -> Any:
        """Position of the core along the axis of the LVDT, x: that of the actuator's end."""
        return self.end_position()

    def lvdt_voltage(self) -> Any:
        """Amplitude of the LVDT in volts, S (x + e X c(x / X)), c(u) = 3/2 sqrt(3) (u - u^3).

        The cubic c is zero in the middle and at both ends of the range, and at most 1.
        """
        position = self.core_position()
        share = clip(position / self.full_scale, -1.0, 1.0)
        deviation = _CUBIC_SCALE * (share - share * share * share)
        return self.lvdt_sensitivity * (position + self.linearity * self.full_scale * deviation)

    def demodulator_rate(self) -> Any:
        """Filter of the demodulator, dv/dt = 2 pi f_d (v_lvdt - v)."""
        return 2.0 * pi * self.demodulator_cutoff * (self.lvdt_voltage() - self.demodulated_voltage)

    def ripple(self) -> Any:
        """Rest of the carrier behind a full-wave rectifier, V_r sin(2 pi 2 f_c (t - t_c))."""
        since = self.time - self.carrier_shift
        return self.carrier_ripple * sin(4.0 * pi * self.carrier_frequency * since)

    def sensor_signal(self) -> Any:
        """Voltage of the LVDT behind its demodulator, with ripple."""
        return self.demodulated_voltage + self.ripple()

    # --- LabVIEW
    # ----------------------------------------------------------------------------------------------

    def read_displacement(self) -> Any:
        """Displacement as LabVIEW reads it, v / S: the calibration is exact."""
        return self.sensor_signal() / self.lvdt_sensitivity

    def next_zero(self) -> Any:
        """Displacement to subtract: the present reading while ``zero`` is true, else unchanged."""
        return where(self.zero, self.read_displacement(), self.zero_displacement)

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    @Output("V")
    def sensor_voltage(self) -> Any:
        """Voltage of the LVDT and its demodulator, not sampled."""
        return self.sensor_signal()

    @Output("m", nominal=1e-4, display="mm")
    def displacement_measured(self) -> Any:
        """Displacement as LabVIEW records it, sampled and set to zero."""
        return self.sampled_displacement - self.zero_displacement

    presets = {
        "dcth_1000": Preset(
            {"linearity": 0.005, "carrier_ripple": 0.01},
            doc=(
                "LVDT with a cubic deviation of 0.5 % of full scale and 10 mV of ripple, both"
                " assumed"
            ),
        ),
    }
