"""What a residual goes along with, where it is largest and whether it wanders: in noise of known colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.discrepancy.residuals.correlation import Regressor, cross_correlations, regressors
from orchestration.discrepancy.residuals.operating_regions import regions, told
from orchestration.discrepancy.residuals.random_walk import slow
from orchestration.discrepancy.residuals.regression import explained
from orchestration.discrepancy.selection.search import Dataset, Search
from orchestration.experiment.waveforms import multilevel
from orchestration.identify.noise import estimate
from orchestration.rig.emulator.records import draw

N, STEP = 3000, 0.1
TIME = STEP * np.arange(N)
EVERY = np.ones(N, dtype=bool)
COLOURS = pytest.mark.parametrize("colour", [0.0, 0.9])


def noise(colour: float, seed: int, n: int = N) -> np.ndarray:
    white = np.random.default_rng(seed).standard_normal(n + 300)
    return np.asarray(lfilter([1.0], [1.0, -colour], white))[300:]


def bench(seed: int) -> list[Regressor]:
    """Signals of a bench with a charge that follows a multilevel current and a creep that follows a force."""
    current = multilevel(TIME, [-1.0, -0.5, 0.2, 1.0], (1.0, 6.0), seed)
    force = multilevel(TIME, [0.4, 1.0, 2.0, 3.0], (8.0, 30.0), seed + 1)
    charge, creep = lfilter([0.1], [1.0, -0.98], current), lfilter([0.1], [1.0, -0.999], force)
    units = {"current": "A", "force": "N", "charge": "C", "creep": "m", "voltage": "V"}
    return regressors(
        TIME, {"current": current, "force": force}, {"charge": charge, "creep": creep},
        {"voltage": current + charge}, units,
    )  # fmt: skip


def test_what_may_explain():
    time = np.array([0.0, 1.0, 3.0])
    inputs = {"u": np.array([1.0, -2.0, 5.0]), "still": np.ones(3)}
    units = {"u": "A", "x": "1", "still": "N"}
    found = {s.name: s for s in regressors(time, inputs, {"x": np.array([0.0, 1.0, 5.0])}, {}, units)}
    assert list(found) == ["u", "throughput of u", "throughput of still", "x", "square of x", "rate of x", "time"]
    assert found["throughput of u"].values == pytest.approx([0.0, 1.0, 5.0])
    assert found["throughput of u"].unit == "A·s"
    assert found["rate of x"].unit == "1/s"


@COLOURS
def test_false_alarms_are_as_rare_as_they_say(colour):
    outside, alarms, loud, powers = [], 0, 0, 0
    runs = 60
    for seed in range(runs):
        residual, signals = noise(colour, seed), bench(seed)
        found = cross_correlations("y", residual, EVERY, estimate(residual, EVERY), signals, STEP)
        outside.append(np.mean([np.mean(np.abs(a.correlation) > a.band) for a in found]))
        alarms += any(a.significant for a in found)
        loud += any(r.significant for r in regions("y", residual, EVERY, signals))
        plain = [s for s in signals if not s.name.startswith("square of")]
        powers += explained(residual, EVERY, plain).significant if seed < 20 else 0
    assert np.mean(outside) == pytest.approx(0.01, abs=0.004)
    assert max(alarms, loud, powers) <= 2  # of 60, 60 and 20, at 1 %


@COLOURS
def test_an_association_is_found_at_its_lag(colour):
    signals = {s.name: s for s in bench(3)}
    hidden = np.roll(signals["square of charge"].values, 4)
    residual = noise(colour, 5) + 0.3 * hidden / hidden.std() / (1.0 - colour)
    best = cross_correlations("y", residual, EVERY, estimate(residual, EVERY), list(signals.values()), STEP)[0]
    assert best.signal in ("square of charge", "rate of charge", "speed of voltage")
    assert best.significant
    alone = cross_correlations("y", residual, EVERY, estimate(residual, EVERY), [signals["square of charge"]], STEP)[0]
    assert alone.lag == pytest.approx(0.4, abs=0.11)
    assert "later" in alone.text


def test_a_correlation_over_a_gap_uses_the_pairs_there_are():
    residual, present = noise(0.0, 1), EVERY.copy()
    present[1000:1400] = False
    signal = Regressor("u", np.concatenate([[0.0, 0.0], residual[:-2]]), "A")  # two samples after the residual
    (found,) = cross_correlations("y", residual[present], present, estimate(residual[present], present), [signal], STEP)
    assert found.lag == pytest.approx(-2 * STEP)
    assert found.strength == pytest.approx(1.0, abs=0.1)


def test_without_an_even_clock_the_samples_are_correlated_as_they_are():
    residual, present = noise(0.0, 1), EVERY.copy()
    present[1000:1400] = False
    left, other = residual[present], noise(0.0, 2) + residual
    kind = estimate(left, present, even=False)
    (found,) = cross_correlations("y", left, present, kind, [Regressor("u", other, "A")], STEP)
    assert found.lag == 0.0
    assert found.strength == pytest.approx(np.corrcoef(left, other[present])[0, 1], abs=0.01)


def test_where_a_residual_is_larger_is_told():
    signals = bench(7)
    charge = next(s for s in signals if s.name == "charge").values
    edge = np.quantile(charge, 7 / 8)
    residual = noise(0.0, 2) * np.where(charge >= edge, 3.2, 1.0)
    first = regions("displacement", residual, EVERY, signals)[0]
    assert (first.signal, first.high) == ("charge", np.inf)
    assert first.low == pytest.approx(edge)
    assert first.rms_ratio == pytest.approx(3.2, rel=0.1)
    assert not first.band[0] <= first.rms <= first.band[1]
    assert told([first]) == [f"displacement is {first.times:.1f}× worse where charge is above {edge:.3g} C"]


def test_all_signals_together_explain_what_each_alone_does_not():
    signals = bench(9)
    charge = next(s for s in signals if s.name == "charge").values
    hidden = (charge / charge.std()) ** 3
    hidden -= np.polyval(np.polyfit(charge, hidden, 1), charge)
    hidden *= 1.5 / hidden.std()
    found = explained(noise(0.0, 4) + hidden, EVERY, signals)
    assert found.significant
    assert found.rms == pytest.approx(1.5, rel=0.15)
    assert np.corrcoef(found.path, hidden)[0, 1] > 0.97


@pytest.mark.parametrize("colour", [0.0, 0.5, 0.9, 0.95])
def test_noise_does_not_wander(colour):
    assert not any(slow(noise(colour, seed)).significant for seed in range(300))


@COLOURS
def test_a_walk_beneath_noise_is_found_and_followed(colour):
    walk = np.cumsum(np.random.default_rng(8).standard_normal(N)) * 0.15 / (1.0 - colour)
    walk -= walk.mean()
    found = slow(noise(colour, 1) + walk)
    assert found.significant
    assert found.rms == pytest.approx(walk.std(), rel=0.2)
    assert np.corrcoef(found.path, walk)[0, 1] > 0.95


def test_nothing_is_said_of_too_little():
    for residual in (np.zeros(500), np.empty(0), np.ones(20)):
        assert slow(residual).ratio == 0.0


@COLOURS
def test_restless_air_is_slow_and_a_clean_bench_is_not(colour):
    from fmus.ppy_actuator.model import PpyActuator
    from orchestration.discrepancy.diagnosis import searched

    for hidden, wanders in ((None, False), ("restless_air", True)):
        drawn = draw(hidden, 1, noise_colour=colour, duration=300.0, rate=5.0)
        data = Dataset(drawn.time, drawn.inputs, drawn.outputs)
        fitted = Search(data, PpyActuator, searched(PpyActuator)).nominal().fit
        assert slow(fitted.residual["displacement"]).significant is wanders
        assert not slow(fitted.residual["voltage"]).significant
