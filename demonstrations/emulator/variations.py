"""Hidden variation for each effect of the catalogue, with the ranges of its parameters."""

from dataclasses import dataclass, field

from demonstrations.emulator import hidden_coupling as coupling
from demonstrations.emulator import hidden_electrical as electrical
from demonstrations.emulator import hidden_mechanical as mechanical
from demonstrations.emulator import hidden_sensor as sensor
from demonstrations.emulator import hidden_unknown as unknown
from demonstrations.emulator.physics import Physics

Range = tuple[float, float]
VOLTAGE = "voltage"
DISPLACEMENT = "displacement"


@dataclass(frozen=True)
class Variation:
    """A hidden variation: its physics, and the ranges from which its parameters are drawn.

    Parameters
    ----------
    physics : type[Physics]
    size : str
        Parameter that is zero without the effect.
    limits : dict of str to float
        Largest physically plausible size by affected output, or by ``""`` if there is no choice.
    ranges : dict of str to tuple of float
        Ranges of the other parameters, log-uniformly distributed, or uniformly if a range starts
        at zero.
    output, seed : str, optional
        Names of the parameters for the affected output and for a seed.
    signed : bool
        Whether the size may be negative.
    alike : tuple of str
        Outputs (or ``""``) in which parameters or start values of the base model have the same
        effect.
    least : float
        Share of the limit below which the effect of a size is constant, as inputs jump; or zero.
    above_bias : float
        Factor of the lowest load that the size must exceed.
    specimen : dict of str to tuple of float
        Factors of the rig's parameters, for specimens that show the effect.
    """

    physics: type[Physics]
    size: str
    limits: dict[str, float]
    ranges: dict[str, Range] = field(default_factory=dict)
    output: str = ""
    seed: str = ""
    signed: bool = False
    alike: tuple[str, ...] = ()
    least: float = 0.0
    above_bias: float = 0.0
    specimen: dict[str, Range] = field(default_factory=dict)


def _sensor(
    physics: type[Physics], size: str, output: str, volts: float, metres: float, **more: object
) -> Variation:
    return Variation(physics, size, {VOLTAGE: volts, DISPLACEMENT: metres}, output=output, **more)  # type: ignore[arg-type]


CATALOGUE: dict[str, Variation] = {
    "double_layer": Variation(
        electrical.DoubleLayer,
        "transfer_resistance",
        {"": 1.0},
        {"layer_time": (0.15, 0.6), "bending_voltage": (0.4, 1.2)},
    ),
    "diffusion": Variation(
        electrical.DiffusionLayer, "diffusing_share", {"": 0.9}, {"diffusion_time": (4.0, 25.0)}
    ),
    "nonlinear_leakage": Variation(
        electrical.OnsettingLeakage,
        "leakage_rise",
        {"": 2.0},
        {"onset_voltage": (0.5, 0.9), "onset_width": (0.05, 0.12)},
    ),
    "charge_dependent_capacitance": Variation(
        electrical.ChargeDependentCapacitance,
        "stiffening",
        {"": 0.3},
        {"levelling_charge": (2.0, 3.0)},
        signed=True,
    ),
    "resistance_growth": Variation(
        electrical.GrowingResistance, "growth", {"": 3.0}, {"endurance": (200.0, 1500.0)}
    ),
    "capacitance_fade": Variation(
        electrical.FadingCapacitance, "fade", {"": 0.7}, {"fading_charge": (200.0, 1500.0)}
    ),
    "self_heating": Variation(
        electrical.SelfHeating,
        "activation_temperature",
        {"": 9000.0},
        {"heat_resistance": (10.0, 40.0), "heat_time": (100.0, 800.0)},
    ),
    "force_to_voltage": Variation(
        coupling.LoadDependentVoltage,
        "sensitivity",
        {"": 0.3},
        {"levelling_load": (6.0, 15.0)},
        signed=True,
    ),
    "quadratic_strain": Variation(
        coupling.EvenStrain, "evenness", {"": 3e-5}, {"cosine_charge": (2.5, 6.0)}, signed=True
    ),
    "strain_saturation": Variation(coupling.SaturatingStrain, "saturation", {"": 1.0}),
    "strain_lag": Variation(coupling.LaggingStrain, "lag", {"": 10.0}, {"late_share": (0.1, 0.3)}),
    "strain_hysteresis": Variation(
        coupling.PlayingStrain, "playing_share", {"": 0.6}, {"widest_play": (0.5, 1.5)}
    ),
    "charge_dependent_stiffness": Variation(
        coupling.ChargedSoftness,
        "softness",
        {"": 0.25},
        {"softness_charge": (2.0, 3.5)},
        signed=True,
    ),
    "second_kelvin": Variation(
        mechanical.CreepSpectrum,
        "spectral_compliance",
        {"": 2e-4},
        {"middle_time": (6.0, 40.0), "time_ratio": (1.5, 2.5)},
    ),
    "nonlinear_stiffness": Variation(
        mechanical.LoadDependentSpring,
        "softening",
        {"": 0.9},
        {"middle_load": (0.5, 2.0)},
        signed=True,
    ),
    "asymmetric_creep": Variation(
        mechanical.ReluctantRecovery,
        "reluctance",
        {"": 10.0},
        {"reluctance_force": (0.02, 0.1)},
        specimen={"k2": (0.3, 0.6), "b2": (0.1, 0.25)},
    ),
    "yield_threshold": Variation(
        mechanical.YieldingFlow,
        "yield_load",
        {"": 1.6},
        {"rounding": (0.01, 0.04)},
        above_bias=1.1,
        specimen={"b1": (0.05, 0.3)},
    ),
    "slack": Variation(mechanical.SaggingFilm, "sag", {"": 3.0}, {"taut_load": (0.6, 1.1)}),
    "sensor_lag": _sensor(
        sensor.SluggishSensor, "sensor_time", "lag_output", 5.0, 5.0, least=0.004
    ),
    "transport_delay": _sensor(sensor.LateSensor, "delay", "late_output", 1.2, 1.2, least=0.02),
    "sensor_gain": _sensor(
        sensor.MisscaledSensor,
        "gain_error",
        "gain_output",
        0.2,
        0.2,
        alike=(VOLTAGE, DISPLACEMENT),
        signed=True,
    ),
    "sensor_offset": _sensor(
        sensor.BiasedSensor, "bias", "bias_output", 0.5, 5e-4, alike=(DISPLACEMENT,), signed=True
    ),
    "sensor_drift": _sensor(
        sensor.DriftingSensor,
        "drift",
        "drift_output",
        2e-3,
        5e-6,
        ranges={"warming_time": (1000.0, 5000.0)},
        signed=True,
    ),
}
"""Variation by id of the actuator's catalogue of effects."""

UNKNOWN: dict[str, Variation] = {
    "hum": _sensor(
        unknown.Hum,
        "hum_amplitude",
        "hum_output",
        0.3,
        3e-4,
        ranges={"hum_frequency": (0.3, 2.0), "hum_phase": (0.0, 6.28)},
    ),
    "mains_hum": _sensor(
        unknown.Hum,
        "hum_amplitude",
        "hum_output",
        0.3,
        3e-4,
        ranges={"hum_frequency": (50.04, 50.3), "hum_phase": (0.0, 6.28)},
    ),
    "slip_jumps": Variation(unknown.SlippingClamp, "slip", {"": 1e-3}, seed="slip_seed"),
    "restless_air": Variation(
        unknown.RestlessAir, "expansion", {"": 1e-3}, {"frame_time": (5.0, 30.0)}, seed="air_seed"
    ),
    "loose_contact": Variation(
        unknown.LooseContact,
        "contact_resistance",
        {"": 2.0},
        {"contact_dwell": (8.0, 30.0)},
        seed="contact_seed",
    ),
    "loose_fixture": Variation(
        unknown.LooseFixture, "fixture_compliance", {"": 1e-3}, {"loosening": (0.3, 0.7)}
    ),
}
"""Variations that are in no catalogue."""

VARIATIONS = CATALOGUE | UNKNOWN
