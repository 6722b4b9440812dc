"""Claims: every hidden variation is the base rig at size zero and obeys its law; records are scaled
as they promise.

Oracles: solutions on paper, quadrature, root finding, the impedance of finite-length diffusion, and
for the scaling the fit of the actuator model, which shares no code with the rig.
"""

from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from demonstrations import records
from demonstrations.bench import NOISE
from demonstrations.emulator.emulator import EmulatedRig, Physics
from demonstrations.emulator.hidden_coupling import (
    ChargedSoftness,
    EvenStrain,
    LaggingStrain,
    LoadDependentVoltage,
    PlayingStrain,
    SaturatingStrain,
)
from demonstrations.emulator.hidden_electrical import (
    ChargeDependentCapacitance,
    DiffusionLayer,
    DoubleLayer,
    FadingCapacitance,
    GrowingResistance,
    OnsettingLeakage,
    SelfHeating,
)
from demonstrations.emulator.hidden_mechanical import (
    CreepSpectrum,
    LoadDependentSpring,
    ReluctantRecovery,
    SaggingFilm,
    YieldingFlow,
)
from demonstrations.emulator.hidden_sensor import (
    BiasedSensor,
    DriftingSensor,
    LateSensor,
    MisscaledSensor,
    SluggishSensor,
)
from demonstrations.emulator.hidden_unknown import (
    Hum,
    LooseContact,
    LooseFixture,
    RestlessAir,
    SlippingClamp,
)
from demonstrations.emulator.physics import RigParameters, Transition, together
from demonstrations.emulator.variations import CATALOGUE, UNKNOWN, VARIATIONS
from demonstrations.records import draw, draw_cached, write
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.sensors import MEASUREMENTS
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.experiment.waveforms import multilevel
from orchestration.identify.grey_box import fit_grey_box
from orchestration.records import read_record
from tests.support.completeness import check_complete

NOMINAL = RigParameters()
TIGHT = RigParameters(R2=1e12)  # nothing leaks: all of the current charges the films
RIGID = RigParameters(b1=1e15, b2=1e15)  # the spring k1 only
TIME: np.ndarray = 0.1 * np.arange(600)
CURRENT = multilevel(TIME, [-1.2, -0.4, 0.0, 0.7, 1.2], (2.0, 8.0), 1)
FORCE = multilevel(TIME, [0.4, 1.0, 1.7, 2.8], (4.0, 12.0), 2)
STARTS = ["charge_start", "kelvin_elongation_start", "maxwell_elongation_start"]


def truth(hidden=None, parameters=NOMINAL, time=TIME, current=CURRENT, force=FORCE, **more):
    rig = EmulatedRig(parameters, hidden=hidden, **more)
    rig.run(time, current, force)
    return rig.truth


def test_every_effect_of_the_catalogue_has_a_variation():
    ids = {effect.id for effect in EFFECTS.values()} | set(MEASUREMENTS)
    where = "CATALOGUE of demonstrations/emulator/variations.py, with a class of a module hidden_*"
    check_complete(CATALOGUE, ids, where)
    assert not set(UNKNOWN) & set(CATALOGUE)
    assert len(UNKNOWN) >= 4


def test_every_variation_is_held_against_its_law():
    """By a test of this module: what it imports it uses, or the linter objects."""
    kinds = {variation.physics.__name__ for variation in VARIATIONS.values()}
    check_complete(
        [name for name in kinds if name in globals()],
        kinds,
        "the classes that a test of tests/end_to_end/test_hidden_effects.py holds against a"
        " closed form",
    )


@pytest.mark.parametrize("name", VARIATIONS)
def test_without_size_there_is_no_effect(name):
    lively = RigParameters(b2=1e5)  # creep comes and goes within the minute
    variation, base = VARIATIONS[name], truth(parameters=lively)
    for output in variation.limits:
        chosen: dict[str, Any] = {variation.output: output} if output else {}
        for size, same in ((0.0, True), (0.5 * variation.limits[output], False)):
            hidden = truth(partial(variation.physics, **(chosen | {variation.size: size})), lively)
            error = [
                np.max(np.abs(hidden[o] - base[o])) / np.ptp(base[o])
                for o in ("voltage", "displacement")
            ]
            assert (max(error) < 1e-8) == same


@pytest.mark.parametrize("name", VARIATIONS)
def test_a_variation_says_rightly_whether_it_is_linear(name):
    physics = VARIATIONS[name].physics(NOMINAL)
    states = 1e-2 * np.random.default_rng(3).standard_normal((physics.order, 2))
    inputs = np.array([[0.9, -0.7], [1.1, 2.3]])
    one, two = (np.array(physics.rates(states[:, k], *inputs[:, k])) for k in (0, 1))
    both = np.array(physics.rates(states.sum(axis=1), *inputs.sum(axis=1)))
    scale = 1e-9 * (np.abs(one) + np.abs(two))
    assert bool(np.all(np.abs(both - one - two) <= scale)) == physics.is_linear


def test_the_double_layer_charges_and_bends():
    step = partial(truth, parameters=TIGHT, current=0.9, force=0.5)
    wide = step(partial(DoubleLayer, transfer_resistance=0.2, layer_time=0.5, bending_voltage=1e6))
    charge = 0.9 * TIME
    expected = TIGHT.R1 * 0.9 + charge / TIGHT.C + 0.2 * 0.9 * (1 - np.exp(-TIME / 0.5))
    np.testing.assert_allclose(wide["voltage"], expected, rtol=1e-8)
    bent = step(partial(DoubleLayer, transfer_resistance=0.2, layer_time=0.5, bending_voltage=0.1))
    left = bent["voltage"][-1] - TIGHT.R1 * 0.9 - charge[-1] / TIGHT.C
    assert left == pytest.approx(0.1 * np.arcsinh(0.2 * 0.9 / 0.1), rel=1e-8)


def test_diffusion_has_the_impedance_of_a_finite_layer():
    physics = DiffusionLayer(TIGHT, diffusing_share=0.6, diffusion_time=8.0)
    n = physics.order
    units = np.eye(n + 2)
    row = [float(physics.terminal_voltage(unit[:n], unit[n], unit[n + 1])) for unit in units]
    system = Transition(physics, 0.1).system
    for frequency in np.geomspace(0.001, 2.0, 9):
        s = 2j * np.pi * frequency
        electrical = [0, *range(3, n)]
        a, b = system[np.ix_(electrical, electrical)], system[electrical, n]
        impedance = np.array(row)[electrical] @ np.linalg.solve(s * np.eye(n - 2) - a, b) + row[n]
        z = np.sqrt(8.0 * s)
        expected = 0.4 * TIGHT.R1 + 0.6 * TIGHT.R1 * np.tanh(z) / z + 1 / (s * TIGHT.C)
        assert abs(impedance - expected) < 2e-3 * TIGHT.R1


def test_the_second_leakage_balances_and_has_an_onset():
    hidden = partial(OnsettingLeakage, leakage_rise=0.3, onset_voltage=0.7, onset_width=0.05)
    settled = [
        truth(hidden, current=amps, force=0.5, time=0.5 * np.arange(400))["voltage"][-1]
        for amps in (0.9, 0.1)
    ]

    def excess(volts):
        return (
            volts / NOMINAL.R2 + 0.3 * (0.05 * np.log1p(np.exp((volts - 0.7) / 0.05))) ** 1.5 - 0.9
        )

    assert settled[0] == pytest.approx(
        brentq(excess, 0, 3), rel=1e-6
    )  # what it leaks at zero is left out
    assert settled[1] == pytest.approx(0.1 * NOMINAL.R2, rel=1e-3)


def test_the_capacitance_depends_on_the_charge():
    hidden = partial(ChargeDependentCapacitance, stiffening=-0.2, levelling_charge=2.0)
    volts = truth(hidden, parameters=TIGHT, current=0.1, force=0.5)["voltage"]
    expected = quad(lambda q: (1 - 0.2 * q / np.hypot(1, q / 2.0)) / TIGHT.C, 0, 0.1 * TIME[-1])[0]
    assert volts[-1] - 0.1 * TIGHT.R1 == pytest.approx(expected, rel=1e-8)


def test_resistance_and_capacitance_age_with_throughput():
    grown = truth(
        partial(GrowingResistance, growth=0.8, endurance=30.0),
        parameters=TIGHT,
        current=0.9,
        force=0.5,
    )
    moved = 0.9 * TIME
    expected = moved / TIGHT.C + TIGHT.R1 * (1 + 0.8 * moved / (30.0 + moved)) * 0.9
    np.testing.assert_allclose(grown["voltage"], expected, rtol=1e-8)
    faded = truth(
        partial(FadingCapacitance, fade=0.4, fading_charge=20.0),
        parameters=TIGHT,
        current=0.9,
        force=0.5,
    )
    left = TIGHT.C * (1 - 0.4 * (1 - np.exp(-moved / 20.0)))
    np.testing.assert_allclose(faded["voltage"], moved / left + TIGHT.R1 * 0.9, rtol=1e-8)


def test_a_warm_actuator_conducts_as_arrhenius_says():
    time = 0.5 * np.arange(2000)
    current = np.where(time < 900, 1.0, 0.0)
    hidden = partial(
        SelfHeating, activation_temperature=2000.0, heat_resistance=15.0, heat_time=40.0
    )
    volts = truth(hidden, time=time, current=current, force=0.5)["voltage"]
    heat = 1.0**2 * NOMINAL.R2  # all of the current leaks in the end
    rise = brentq(lambda k: k * (1 + (k / 10.0) ** 1.25) - 15.0 * heat, 0, 100)
    resistance = NOMINAL.R1 * np.exp(2000.0 * (1 / (296.0 + rise) - 1 / 296.0))
    dropped = volts[time < 900][-1] - volts[time >= 900][0]
    assert dropped == pytest.approx(resistance * NOMINAL.R2 / (resistance + NOMINAL.R2), rel=1e-6)


def test_a_load_raises_the_voltage_less_and_less():
    hidden = partial(LoadDependentVoltage, sensitivity=0.02, levelling_load=4.0)
    share = NOMINAL.R2 / (NOMINAL.R1 + NOMINAL.R2)
    for load, films in (
        (1e-3, 2e-5),
        (4.0, 0.04),
        (1e6, 0.08),
    ):  # proportional, half of that, levelled
        assert truth(hidden, current=0.0, force=load)["voltage"][0] == pytest.approx(
            share * films, rel=1e-3
        )


def test_the_even_strain_is_even_and_starts_as_a_square():
    law = EvenStrain(NOMINAL, evenness=3e-6, cosine_charge=2.0).electrochemical_length
    assert law(1.7) - law(-1.7) == pytest.approx(2 * NOMINAL.alpha * 1.7, rel=1e-12)
    assert law(0.01) + law(-0.01) == pytest.approx(2 * 3e-6 * 0.01**2, rel=1e-4)
    assert law(4.0) + law(-4.0) > 2 * 3e-6 * 4.0**2


def test_the_strain_levels_off():
    levelled = truth(partial(SaturatingStrain, saturation=1 / 2.0), current=1.0, force=0.5)
    plain = truth(current=1.0, force=0.5)
    np.testing.assert_array_equal(levelled["voltage"], plain["voltage"])
    charge = plain["charge"]
    np.testing.assert_allclose(
        levelled["electrochemical_displacement"],
        NOMINAL.alpha * charge / (1 + (charge / 2.0) ** 3) ** (1 / 3),
        rtol=1e-12,
        atol=1e-18,
    )
    law = SaturatingStrain(NOMINAL, 1 / 2.0).electrochemical_length
    assert law(-1.3) == -law(1.3)
    assert law(1e-4) == pytest.approx(NOMINAL.alpha * 1e-4, rel=1e-12)
    assert law(1e6) == pytest.approx(NOMINAL.alpha * 2.0, rel=1e-12)  # alpha Qs


def test_the_lagging_strain_follows_a_ramp_late_by_its_lag():
    late = truth(
        partial(LaggingStrain, lag=2.0, late_share=0.25), parameters=TIGHT, current=0.1, force=0.5
    )
    ramp = TIGHT.alpha * 0.1 * (TIME[-1] - 2.0)
    assert late["electrochemical_displacement"][-1] == pytest.approx(ramp, rel=1e-8)
    # two stages in series, 1.5 s and 0.5 s: partial fractions
    first, second = (tau * (1 - np.exp(-TIME / tau)) * tau for tau in (1.5, 0.5))
    expected = TIGHT.alpha * 0.1 * (TIME - (first - second) / (1.5 - 0.5))
    np.testing.assert_allclose(
        late["electrochemical_displacement"], expected, rtol=1e-7, atol=1e-14
    )


def test_play_is_rate_independent_and_its_loop_closes():
    charge = 2.0 * np.sin(np.linspace(0, 4 * np.pi, 801))
    law = PlayingStrain(NOMINAL, playing_share=0.3, widest_play=1.0).electrochemical_length
    warped = 2.0 * np.sin(np.linspace(0, 2 * np.sqrt(np.pi), 801) ** 2)
    unwarped = np.interp(
        np.linspace(0, 4 * np.pi, 801), np.linspace(0, 2 * np.sqrt(np.pi), 801) ** 2, law(warped)
    )
    np.testing.assert_allclose(unwarped, law(charge), atol=2e-3 * NOMINAL.alpha)
    np.testing.assert_allclose(law(charge)[401:], law(charge)[1:401], atol=0.3 * NOMINAL.alpha)
    np.testing.assert_allclose(
        law(charge)[601:], law(charge)[201:401], atol=1e-15
    )  # from the first crest on: closed
    # on the large loop every operator trails by its radius; the mean radius is (1 + 1/8) / 2 of the
    # widest
    rising, falling = law(charge)[800], law(charge)[600 - 200]
    assert rising == pytest.approx(falling, abs=1e-15)
    down = law(np.array([0.0, 2.0, 0.0]))[-1]
    assert down == pytest.approx(NOMINAL.alpha * 0.3 * (1 + 1 / 8) / 2, rel=1e-12)


def test_charge_softens_both_springs():
    parameters = RigParameters(R2=1e12, b1=1e15, b2=1e4)
    time = 0.1 * np.arange(400)
    current = np.where(time < 20, 0.1, 0.0)  # 2 C, kept
    hidden = partial(ChargedSoftness, softness=0.1, softness_charge=3.0)
    settled = truth(hidden, parameters=parameters, time=time, current=current, force=2.0)[
        "mechanical_displacement"
    ][-1]
    compliance = 1 + 0.1 * 3.0 * np.tanh(2.0 / 3.0)
    assert settled == pytest.approx(
        2.0 * compliance * (1 / parameters.k1 + 1 / parameters.k2), rel=1e-8
    )


def test_more_creep_is_a_sum_of_exponentials():
    hidden = partial(CreepSpectrum, spectral_compliance=4e-5, middle_time=12.0, time_ratio=2.0)
    crept = truth(hidden, parameters=RIGID, current=0.0, force=1.5)["displacement"]
    parts = sum(
        w * (1 - np.exp(-TIME / tau)) for w, tau in ((0.25, 6.0), (0.5, 12.0), (0.25, 24.0))
    )
    np.testing.assert_allclose(crept, 1.5 / RIGID.k1 + 1.5 * 4e-5 * parts, rtol=1e-8)


def test_the_spring_softens_and_the_film_straightens():
    spring = LoadDependentSpring(NOMINAL, softening=-0.4, middle_load=1.0).spring_length
    film = SaggingFilm(NOMINAL, sag=0.7, taut_load=0.8).spring_length
    state, step = np.zeros(3), 1e-6

    def slope(law, load):
        return (law(state, load + step) - law(state, load - step)) / (2 * step) * NOMINAL.k1

    assert slope(spring, 0.0) == pytest.approx(1.0, rel=1e-5)
    assert spring(state, 1.0) * NOMINAL.k1 == pytest.approx(1 - 0.4 / 2, rel=1e-12)
    assert slope(spring, 1e3) == pytest.approx(0.6, rel=1e-4)
    assert slope(film, 0.1) == pytest.approx(1.7, rel=1e-4)
    assert slope(film, 10.0) == pytest.approx(1.0, rel=1e-4)
    assert film(state, 10.0) * NOMINAL.k1 == pytest.approx(10.0 + 0.7 * 0.8, rel=1e-6)


def test_recovery_is_reluctant_and_creep_is_not():
    parameters = RigParameters(b1=1e15, b2=1e5)
    time = 0.1 * np.arange(1000)
    loaded = time < 50
    hidden = partial(ReluctantRecovery, reluctance=2.0, reluctance_force=0.3)
    crept = truth(
        hidden, parameters=parameters, time=time, current=0.0, force=np.where(loaded, 2.0, 0.0)
    )
    length = crept["displacement"] - np.where(loaded, 2.0, 0.0) / parameters.k1
    expected = 2.0 / parameters.k2 * (1 - np.exp(-time[loaded] * parameters.k2 / parameters.b2))
    np.testing.assert_allclose(length[loaded], expected, rtol=1e-7, atol=1e-14)

    def seconds_per_newton(spring):
        return parameters.b2 / parameters.k2 / spring * (1 + 2.0 * spring / (spring + 0.3))

    start, end = (parameters.k2 * length[k] for k in (500, 700))
    assert quad(seconds_per_newton, end, start)[0] == pytest.approx(time[700] - time[500], rel=1e-6)


def test_flow_yields():
    loads, yielding = np.array([-2.5, -0.4, 0.0, 0.3, 0.9, 1.0, 1.1, 3.0]), 1.0
    viscous = YieldingFlow(NOMINAL, yield_load=yielding, rounding=0.02).flow_drive(loads)
    law = viscous + np.sign(viscous) * yielding * (1 - np.exp(-np.abs(viscous) / 0.02))
    np.testing.assert_allclose(law, loads, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(viscous[[0, -1]], [-1.5, 2.0], rtol=1e-12)
    assert np.all(np.abs(viscous[1:4]) < 0.02)


def test_a_sluggish_sensor_follows_ramps_and_steps():
    hidden = partial(SluggishSensor, lag_output="displacement", sensor_time=0.6)
    ramp = truth(hidden, parameters=replace(TIGHT, b1=1e15, b2=1e15), current=0.1, force=0.0)[
        "displacement"
    ]
    assert ramp[-1] == pytest.approx(TIGHT.alpha * 0.1 * (TIME[-1] - 0.6), rel=1e-8)
    step = truth(hidden, parameters=RIGID, current=0.0, force=np.where(TIME < 5, 0.0, 2.0))[
        "displacement"
    ]
    age = np.maximum(TIME - 5, 0.0) / 0.3
    np.testing.assert_allclose(
        step, 2.0 / RIGID.k1 * (1 - (1 + age) * np.exp(-age)), rtol=1e-6, atol=1e-11
    )


@pytest.mark.parametrize("output", ["voltage", "displacement"])
def test_a_late_sensor_shifts_exactly(output):
    fine = 0.01 * np.arange(5991)
    held = np.maximum(np.searchsorted(TIME, fine + 1e-9, side="right") - 1, 0)
    base = truth(time=fine, current=CURRENT[held], force=FORCE[held])[output]
    for samples in (10, 23, 7):  # of 10 ms
        late = truth(partial(LateSensor, late_output=output, delay=0.01 * samples))[output]
        shifted = base[np.maximum(np.arange(600) * 10 - samples, 0)]
        np.testing.assert_allclose(late, shifted, rtol=1e-9, atol=1e-14)


def test_sensors_scale_shift_and_drift():
    base = truth()
    scaled = truth(partial(MisscaledSensor, gain_output="voltage", gain_error=0.1))
    np.testing.assert_allclose(scaled["voltage"], 1.1 * base["voltage"])
    np.testing.assert_array_equal(scaled["displacement"], base["displacement"])
    biased = truth(partial(BiasedSensor, bias_output="displacement", bias=1e-5))
    np.testing.assert_allclose(biased["displacement"] - base["displacement"], 1e-5, rtol=1e-9)
    drifted = truth(partial(DriftingSensor, drift_output="voltage", drift=1e-4, warming_time=20.0))
    drift = drifted["voltage"] - base["voltage"]
    assert drift[1] == pytest.approx(1e-5, rel=1e-2)
    assert drift[-1] == pytest.approx(2e-3 * (1 - np.exp(-TIME[-1] / 20.0)), rel=1e-9)


def test_mains_hum_is_folded():
    hum = partial(Hum, hum_output="voltage", hum_amplitude=0.01, hum_phase=0.4)
    folded, slow = (truth(partial(hum, hum_frequency=f))["voltage"] for f in (50.05, 0.05))
    np.testing.assert_allclose(folded, slow, atol=1e-9)


def test_disturbances_of_the_bench_are_what_they_are_called():
    base = truth()
    slipped = np.diff(
        truth(partial(SlippingClamp, slip=1e-5, slip_seed=4))["displacement"] - base["displacement"]
    )
    assert 3 <= np.sum(slipped > 1e-10) <= 8
    assert np.all(slipped[np.abs(slipped) > 1e-10] > 0)
    extra = (
        truth(partial(LooseContact, contact_resistance=0.05, contact_dwell=10.0))["voltage"]
        - base["voltage"]
    )
    bad = np.isclose(extra, 0.05 * CURRENT, atol=1e-12)
    good = np.isclose(extra, 0.0, atol=1e-12)
    assert np.all(bad | good)
    assert 0.1 < np.mean(good[CURRENT != 0]) < 0.9
    loose = (
        truth(partial(LooseFixture, fixture_compliance=1e-5, loosening=0.4))["displacement"]
        - base["displacement"]
    )
    np.testing.assert_allclose(
        loose, 1e-5 * FORCE * np.greater_equal(TIME, 0.4 * TIME[-1]), atol=1e-15
    )


def test_the_air_walks_and_the_frame_follows():
    time = 0.5 * np.arange(40000)
    still = {"time": time, "current": 0.0, "force": 0.0}
    walk = truth(partial(RestlessAir, expansion=1e-5, frame_time=0.1), **still)["displacement"]
    minutes = walk[120::120] - walk[:-120:120]
    assert np.std(minutes) == pytest.approx(1e-5, rel=4 / np.sqrt(2 * minutes.size))
    calm = truth(partial(RestlessAir, expansion=1e-5, frame_time=60.0), **still)["displacement"]
    assert np.std(np.diff(calm)) < 0.2 * np.std(np.diff(walk))


def test_variations_combine_and_keep_their_states_apart():
    kinds = [GrowingResistance, FadingCapacitance, CreepSpectrum, LateSensor]
    both = truth(together(kinds))
    electrical, mechanical = truth(together(kinds[:2])), truth(together(kinds[2:]))
    np.testing.assert_allclose(both["voltage"], electrical["voltage"], rtol=1e-9)
    assert (
        np.max(np.abs(both["mechanical_displacement"] - mechanical["mechanical_displacement"]))
        < 1e-15
    )
    assert together([]) is Physics


def widths_by_fit(drawn):
    """Noise widths that the actuator model leaves, all parameters and start values fitted to the
    noisy record.
    """
    names = [*asdict(NOMINAL), *STARTS]
    values = fit_grey_box(PpyActuator, drawn.time, drawn.inputs, drawn.outputs, names).values
    signals = CompiledModel(PpyActuator, []).run(drawn.time, drawn.inputs, values).signals
    return {
        o: np.sqrt(np.mean((signals[o] - y) ** 2)) / NOISE[o]
        for o, y in drawn.truth.outputs.items()
    }


@pytest.mark.parametrize(
    ("name", "strength"), [("strain_saturation", 1.0), ("diffusion", 0.3), ("hum.voltage", 1.0)]
)
def test_a_variation_leaves_what_was_wanted(name, strength):
    drawn = draw(name, 2, strength=strength)
    (hidden,) = drawn.truth.hidden
    assert 1.3 * strength <= hidden.wanted <= 20 * strength
    assert hidden.widths == pytest.approx(hidden.wanted, rel=0.05)
    assert max(widths_by_fit(drawn).values()) == pytest.approx(hidden.wanted, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("strength", [1.0, 0.3])
@pytest.mark.parametrize("name", VARIATIONS)
def test_every_variation_leaves_what_was_wanted(name, strength):
    drawn = draw(name, 7, strength=strength)
    (hidden,) = drawn.truth.hidden
    found = max(widths_by_fit(drawn).values())
    if hidden.alike:
        assert found < 0.1
    else:
        assert 1.3 * strength <= hidden.wanted <= 20 * strength
        assert found == pytest.approx(hidden.wanted, rel=0.2)


def test_a_clean_record_is_the_base_rig_and_noise():
    drawn = draw(None, 3, noise_colour=0.9)
    assert drawn.truth.ids == ()
    assert max(drawn.truth.widths.values()) < 1e-3
    off = np.array(list(asdict(drawn.truth.parameters).values())) / list(asdict(NOMINAL).values())
    assert np.all(np.abs(off - 1) <= 0.15)
    assert np.ptp(off) > 0.05
    assert drawn.time.size == 6000
    assert np.abs(drawn.inputs["current"]).max() <= 1.3
    assert 0.3 <= drawn.inputs["force"].min() < drawn.inputs["force"].max() <= 3.0
    for output, deviation in NOISE.items():
        noise = (drawn.outputs[output] - drawn.truth.outputs[output]) / deviation
        # Bartlett: what an AR(1) series of 6000 is worth, for its variance and its lag-one
        # correlation
        assert abs(np.var(noise) - 1) < 4 * np.sqrt(2 * (1 + 0.9**2) / (1 - 0.9**2) / 6000)
        assert np.mean(noise[1:] * noise[:-1]) / np.var(noise) == pytest.approx(
            0.9, abs=4 * np.sqrt(0.19 / 6000) + 0.01
        )


def test_a_seed_draws_the_same_record_and_another_one_does_not(tmp_path):
    options = {"duration": 60.0, "rate": 5.0, "outputs": ("displacement",)}
    one, again = (draw_cached(tmp_path, "hum", 5, **options) for _ in range(2))
    assert len(list(tmp_path.glob("*.pickle"))) == 1
    same, other = (draw("hum", seed, **options) for seed in (5, 6))
    for signals in (again, same):
        np.testing.assert_array_equal(one.outputs["displacement"], signals.outputs["displacement"])
        assert one.truth.hidden == signals.truth.hidden
    assert list(one.outputs) == ["displacement"]
    assert one.time.size == 300
    assert one.truth.hidden != other.truth.hidden


def test_a_record_may_start_in_the_middle_and_hide_two_effects():
    drawn = draw(
        ("charge_dependent_stiffness", "sensor_offset.voltage"), 1, duration=180.0, at_rest=False
    )
    assert drawn.truth.ids == ("charge_dependent_stiffness", "sensor_offset")
    assert drawn.time[0] == 0
    assert drawn.time.size == 1800
    assert abs(drawn.truth.outputs["displacement"][0]) > 10 * NOISE["displacement"]
    stiffness, offset = drawn.truth.hidden
    assert drawn.truth.widths["voltage"] == pytest.approx(offset.widths, rel=0.5)
    assert drawn.truth.widths["displacement"] == pytest.approx(stiffness.widths, rel=0.5)


def test_changed_parameters_are_exact():
    drawn = draw(None, 1, changed={"R1": 1.4, "k2": 0.7}, spread=0.0, duration=60.0)
    assert drawn.truth.parameters == replace(NOMINAL, R1=1.4 * NOMINAL.R1, k2=0.7 * NOMINAL.k2)


def test_what_cannot_be_told_from_parameters_says_so():
    drawn = draw("sensor_gain", 1, duration=120.0)
    (hidden,) = drawn.truth.hidden
    assert hidden.alike
    assert hidden.widths < 1e-3
    assert np.max(np.abs(hidden.parameters["gain_error"])) >= 0.02


@pytest.mark.slow
def test_a_yield_load_lies_above_the_bias():
    drawn = draw("yield_threshold", 0)
    assert drawn.truth.hidden[0].parameters["yield_load"] > drawn.inputs["force"].min()


def test_the_file_holds_the_measurement_and_nothing_else(tmp_path):
    drawn, path = draw("hum", 1, duration=30.0), tmp_path / "record.csv"
    write(drawn, path)
    header, *rows = path.read_text().splitlines()
    assert header == "time [s],current [A],force [N],voltage [V],displacement [m]"
    assert len(rows) == drawn.time.size
    record = read_record(path, records.UNITS)
    assert not any(repair.changed_data for repair in record.repairs)
    for name, values in (drawn.inputs | drawn.outputs).items():
        np.testing.assert_array_equal(record.signals[name], values)


@pytest.mark.parametrize("hidden", ["gremlin", ("hum", "gremlin"), "slack.voltage"])
def test_refusals(hidden):
    with pytest.raises(ValueError, match="gremlin" if "gremlin" in hidden else "slack.voltage"):
        draw(hidden, 1, duration=20.0)
