"""The sizes of an effect are what its law shows: roots, limits and slopes of the law itself."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fmus.degradation_estimator.effects import EFFECTS as OF_ESTIMATOR
from fmus.foot.effects import EFFECTS as OF_FOOT
from fmus.galvanostat.effects import EFFECTS as OF_GALVANOSTAT
from fmus.galvanostat.model import Galvanostat
from fmus.isotonic_stand.effects import EFFECTS as OF_STAND
from fmus.kit import stack
from fmus.ppy_actuator.effects import EFFECTS as OF_ACTUATOR
from fmus.ppy_actuator.model import PpyActuator
from fmus.voice_coil_dma.effects import EFFECTS as OF_BENCH
from fmus.voice_coil_dma.model import VoiceCoilDma

FAR = 1e6
LARGE = 1e4  # of a load, in N: still far below where differences drown in rounding
CATALOGUES = (OF_ACTUATOR, OF_BENCH, OF_GALVANOSTAT, OF_FOOT, OF_ESTIMATOR, OF_STAND)


def size(effect, values, number=0):
    told = effect.sizes[number]
    return told.quantity(*(np.float64(values[name]) for name in told.parameters))


def law_of(base, effect, values, law, over="", settings=None):
    """The law as a function of one of its signals, or of its argument."""

    def at(x):
        one = stack(base, effect)(**values, **(settings or {}))
        if over:
            setattr(one, over, x)
        return getattr(one, law)() if over else getattr(one, law)(x)

    return at


def of_actuator(name, values, law, over="", settings=None):
    return law_of(PpyActuator, OF_ACTUATOR[name], values, law, over, settings)


def test_strain_levels_off_at_the_charge_said():
    values = {"strain_saturation_coefficient": 0.16}
    strain = of_actuator("strain_saturation", values, "charge_elongation")
    slope = strain(1e-6) / 1e-6
    assert size(OF_ACTUATOR["strain_saturation"], values) == pytest.approx(strain(FAR) / slope)


def test_half_of_the_strain_is_lost_at_the_charge_said():
    values = {"strain_levelling": 0.2}
    strain = of_actuator("strain_saturation(slow)", values, "charge_elongation")
    slope = strain(1e-9) / 1e-9
    half = brentq(lambda q: strain(q) - 0.5 * slope * q, 0.1, 100.0)
    assert size(OF_ACTUATOR["strain_saturation(slow)"], values) == pytest.approx(half)


@pytest.mark.parametrize(
    ("name", "parameter", "law", "state", "ratio"),
    [
        (
            "resistance_growth",
            "resistance_growth_rate",
            "series_resistance",
            "throughput",
            2.0,
        ),
        (
            "capacitance_fade",
            "capacitance_fade_rate",
            "capacitance",
            "fading_throughput",
            0.5,
        ),
    ],
)
def test_ageing_has_changed_it_by_two_after_the_charge_said(name, parameter, law, state, ratio):
    values = {parameter: 0.02}
    aged = of_actuator(name, values, law, state)
    after = brentq(lambda q: aged(q) - ratio * aged(0.0), 1.0, 1e4)
    assert size(OF_ACTUATOR[name], values) == pytest.approx(after)


def test_a_kelvin_and_a_watt_do_what_is_said():
    values = {
        "conductance_rise_per_kelvin": 0.02,
        "thermal_resistance": 30.0,
        "thermal_time": 40.0,
    }
    warm = of_actuator("self_heating", values, "series_resistance", "temperature_rise")
    better = 100.0 * (warm(0.0) / warm(1.0) - 1.0)
    assert size(OF_ACTUATOR["self_heating"], values) == pytest.approx(better)


def test_a_quadratic_strain_adds_at_a_coulomb_what_is_said():
    values = {"beta": 7e-6}
    strain = of_actuator("quadratic_strain", values, "charge_elongation")
    added = 0.5 * (strain(1.0) + strain(-1.0))
    assert size(OF_ACTUATOR["quadratic_strain"], values) == pytest.approx(added)


def test_stages_are_late_on_a_ramp_by_their_sum():
    values = {"staged_lag_time": 1.3}
    effect = OF_ACTUATOR["strain_lag(two_stages)"]
    one = stack(PpyActuator, effect)(**values)
    # on a ramp of 1 C/s both states settle at the same charge, D; what is missing is the delay
    one.first_stage_charge = one.second_stage_charge = one.stage_time()
    missing = -one.charge_elongation(0.0) / one.alpha
    assert 2.0 * size(effect, values) == pytest.approx(missing)


def test_a_loop_is_as_wide_and_starts_as_flat_as_is_said():
    values = {"hysteresis_share": 0.3, "hysteresis_width": 0.4}
    effect = OF_ACTUATOR["strain_hysteresis"]
    up = of_actuator(
        effect.id, values, "charge_elongation", settings={"trailing_charge_start": 0.4}
    )
    down = of_actuator(
        effect.id, values, "charge_elongation", settings={"trailing_charge_start": -0.4}
    )
    width = brentq(lambda q: up(q), -9.0, 9.0) - brentq(lambda q: down(q), -9.0, 9.0)
    assert size(effect, values) == pytest.approx(width)
    one = stack(PpyActuator, effect)(**values, trailing_charge_start=-0.4, current=1.0)
    trailing = one.trailing_charge_rate() / one.capacitor_current()
    assert size(effect, values, 1) == pytest.approx(100.0 * 0.3 * trailing)


def test_a_coulomb_softens_by_the_share_said():
    values = {"softening_per_charge": 0.1}
    effect = OF_ACTUATOR["charge_dependent_stiffness"]
    soft = of_actuator(effect.id, values, "softening", "charge")
    assert size(effect, values) == pytest.approx(100.0 * (soft(1.0) / soft(0.0) - 1.0))


def test_diffusion_is_the_share_said_of_the_resistance():
    values = {"diffusion_share": 0.6, "diffusion_time": 7.0}
    one = stack(PpyActuator, OF_ACTUATOR["diffusion"])(**values)
    terms = 2.0 / ((np.arange(1, 6) - 0.5) * np.pi) ** 2
    built_up = 1.0 - one.immediate_resistance() / one.series_resistance()
    assert size(OF_ACTUATOR["diffusion"], values) == pytest.approx(100.0 * built_up / terms.sum())


def test_leakage_draws_above_its_onset_what_is_said():
    values = {"leakage_growth": 0.3, "leakage_onset": 0.5}
    effect = OF_ACTUATOR["nonlinear_leakage"]

    def state(q):
        one = stack(PpyActuator, effect)(**values)
        one.charge = q
        return one

    q = brentq(lambda q: state(q).terminal_voltage() - 0.6, 0.0, 100.0)
    drawn = -state(q).supply_current()  # nothing is fed
    assert size(effect, values) == pytest.approx(drawn)
    assert size(effect, values, 1) == 0.5


@pytest.mark.parametrize(
    ("name", "parameter"),
    [
        ("charge_dependent_capacitance", "capacitance_falloff"),
        ("charge_dependent_capacitance(modulus)", "capacitance_falloff_either_way"),
    ],
)
@pytest.mark.parametrize("value", [0.15, -0.12])
def test_the_differential_capacitance_at_a_coulomb_is_as_said(name, parameter, value):
    volts = of_actuator(name, {parameter: value}, "film_voltage", "charge")
    step = 1e-4
    there = 2 * step / (volts(1.0 + step) - volts(1.0 - step))
    at_zero = step / volts(0.5 * step) / 2.0
    change = 100.0 * (there / at_zero - 1.0)
    assert size(OF_ACTUATOR[name], {parameter: value}) == pytest.approx(change, rel=1e-3)


@pytest.mark.parametrize("value", [0.07, -0.07])
def test_the_charge_per_voltage_at_a_coulomb_is_as_said(value):
    name, values = "charge_dependent_capacitance(even)", {"capacitance_bend": value}
    volts = of_actuator(name, values, "film_voltage", "charge")
    ratio = (1.0 / volts(1.0)) / (1e-6 / volts(1e-6))
    assert size(OF_ACTUATOR[name], values) == pytest.approx(100.0 * (ratio - 1.0))


def test_springs_give_by_the_shares_said():
    def compliance(name, values, low, high):
        spring = of_actuator(name, values, "spring_elongation")
        plain = PpyActuator().spring_elongation(1.0)
        return (spring(high) - spring(low)) / (high - low) / plain

    bent = {"load_softening": 0.3, "softening_load": 0.8}
    more = compliance("nonlinear_stiffness", bent, LARGE, 2.0 * LARGE) - 1.0
    assert size(OF_ACTUATOR["nonlinear_stiffness"], bent) == pytest.approx(100.0 * more, rel=1e-4)
    slack = {"slack_compliance": 0.4, "preload": 0.7}
    more = compliance("slack", slack, 0.0, 0.7) - 1.0
    assert size(OF_ACTUATOR["slack"], slack) == pytest.approx(100.0 * more)
    assert compliance("slack", slack, 0.7, 1.0) == pytest.approx(1.0)
    fading = {"fading_compliance": 0.4, "fading_load": 0.7}
    more = compliance("slack(smooth)", fading, 0.0, 1e-7) - 1.0
    assert size(OF_ACTUATOR["slack(smooth)"], fading) == pytest.approx(100.0 * more, rel=1e-5)
    at_scale = compliance("slack(smooth)", fading, 0.0, 0.7) - 1.0
    assert at_scale == pytest.approx(0.5 * more, rel=1e-5)


def test_recovery_takes_as_many_times_as_long_as_is_said():
    values = {"recovery_slowness": 0.5}
    rate = of_actuator("asymmetric_creep", values, "kelvin_rate", "force")
    assert size(OF_ACTUATOR["asymmetric_creep"], values) == pytest.approx(rate(1.0) / -rate(-1.0))


def test_nothing_flows_below_the_force_said():
    values = {"yield_force": 0.3}
    flow = of_actuator("yield_threshold", values, "flow_force", "force")
    most = size(OF_ACTUATOR["yield_threshold"], values)
    assert flow(0.999 * most) == 0.0
    assert flow(1.001 * most) > 0.0


def test_the_bench_is_as_said():
    falloff = {"force_constant_falloff": 1e4}
    effect = OF_BENCH["position_dependent_force_constant"]
    constant = law_of(VoiceCoilDma, effect, falloff, "force_constant", "position")
    half = brentq(lambda x: constant(x) - 0.5 * constant(0.0), 1e-4, 1.0)
    assert size(effect, falloff) == pytest.approx(half)

    coefficient = {"amplifier_saturation_coefficient": 0.04}
    effect = OF_BENCH["amplifier_saturation"]
    most = FAR * np.tanh(0.2 * FAR) / (0.2 * FAR)  # V_s tanh(u / V_s), 1 / V_s^2 = 0.04
    assert size(effect, coefficient) == pytest.approx(most)


def test_a_warm_coil_is_as_said():
    effect = OF_BENCH["coil_heating"]
    words = effect.sizes[0].phrase.split()
    assert words[:3] == ["{}", "more", "at"]
    values = {"coil_heating": 0.3}
    settled = float(words[3]) ** 2  # what the state comes to under such a current
    warm = law_of(VoiceCoilDma, effect, values, "coil_resistance", "coil_mean_square")
    assert size(effect, values) == pytest.approx(warm(settled) - warm(0.0))


def test_the_galvanostat_is_as_said():
    def ratio(name, values, law):
        given = getattr(
            stack(Galvanostat, OF_GALVANOSTAT[name])(**values, current_command=0.5), law
        )
        return 100.0 * given() / getattr(Galvanostat(current_command=0.5), law)()

    values = {"current_limit_loss": 0.2}
    clipped = ratio("current_saturation", values, "maximum_current")
    assert size(OF_GALVANOSTAT["current_saturation"], values) == pytest.approx(clipped)
    values = {"drive_gain_error": 0.03}
    scaled = ratio("current_gain", values, "tolerated_current")
    assert size(OF_GALVANOSTAT["current_gain"], values) == pytest.approx(scaled)


def test_a_tendon_that_is_drawn_out_has_the_tension_said():
    values = {"tendon_wrap_friction": 0.2}
    w, fast = 0.2, 1.0
    more = 100.0 * (np.exp(w * np.tanh(fast / 1e-3)) - 1.0)  # Euler and Eytelwein
    assert size(OF_FOOT["tendon_friction"], values) == pytest.approx(more)


def test_the_estimator_is_as_said():
    values = {"voltage_gain_error": 0.05}
    assert size(OF_ESTIMATOR["voltage_gain"], values) == pytest.approx(100.0 * 1.05 * 0.7 / 0.7)
    values = {"voltage_skew": 0.25}
    ramp = 3.0  # V/s, sampled every 0.1 s: old by s of the period
    late = (ramp * 0.1 - (ramp * 0.1 + 0.25 * (0.0 - ramp * 0.1))) / ramp
    assert size(OF_ESTIMATOR["sampling_skew"], values) == pytest.approx(100.0 * late / 0.1)


@pytest.mark.parametrize("effects", CATALOGUES)
def test_sizes_have_a_place_for_the_quantity_and_parameters_of_the_effect(effects):
    for name, effect in effects.items():
        assert effect.sizes, name
        for told in effect.sizes:
            assert told.phrase.count("{}") == 1, name
            assert set(told.parameters) <= {*effect.declared}, name
