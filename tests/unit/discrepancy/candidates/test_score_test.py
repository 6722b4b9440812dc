"""Claims: score directions are what an effect does to the residual, to first order, in every run.

Oracle: the compiled model with the effect and without it, whose difference is taken; for a little
of the effect, and for any size of it where nothing comes back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fmus.kit import Component, Effect, Input, Output, Parameter, State, stack
from fmus.kit.arms import lag_effect
from fmus.kit.curves import curve
from fmus.kit.errors import UserError
from fmus.kit.inputs import backlash, input_lag, input_offset, input_saturation
from fmus.kit.record import CompiledModel
from fmus.kit.sensors import sensor_drift, sensor_gain, sensor_lag, sensor_offset, transport_delay
from fmus.voice_coil_dma.effects import (
    AmplifierSaturation,
    CoulombFriction,
    PositionDependentForceConstant,
)
from fmus.voice_coil_dma.model import VoiceCoilDma
from orchestration.discrepancy.candidates import score_test
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.candidates.score_test import (
    ScoreDirection,
    ScoreDirections,
    score_directions,
    simulated_directions,
)
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.identify.fitting import Problem
from tests.support.regression_model import OFFSET, Amplifier, offset_record
from tests.support.scored import at
from tests.support.several import Cell, several

COUNT = 400
RNG = np.random.default_rng(3)
LEVELS = np.repeat(RNG.uniform(-1.0, 1.0, COUNT // 20), 20)


class Oscillator(Component):
    """A mass on a spring that hardens, pulled by a motor that is fast."""

    name = "oscillator"
    m = Parameter(0.5, "kg", min=1e-6)
    b = Parameter(0.4, "N*s/m", min=0)
    k = Parameter(3.0, "N/m", min=0)
    command = Input("N")
    place = State("m", rate="place_rate", output=True)
    speed = State("m/s", rate="speed_rate", start=0.5)
    pull = State("N", rate="pull_rate")

    def place_rate(self):
        return self.speed

    def pull_rate(self):
        return (self.command - self.pull) / 0.002

    def spring(self):
        return self.k * self.place * (1.0 + self.place * self.place)

    def friction(self):
        return self.b * self.speed

    def speed_rate(self):
        return (self.pull - self.spring() - self.friction()) / self.m

    @Output("N")
    def shown(self):
        """Of the spring, and some of the command."""
        return self.spring() + 0.1 * self.command


class Growing(Effect):
    """A current that grows with the time."""

    id = "growing"
    neutral = "growth"
    assumption = "nothing grows"
    growth = Parameter(0.0, "A/s^2", nominal=1.0)

    def relaxed_rate(self):
        """More of it."""
        return super().relaxed_rate() + self.growth * self.time


EFFECTS = {
    "cubic": curve(Oscillator, "spring", "place", "cubic", "N", 1.0),
    "coulomb": curve(Oscillator, "friction", "speed", "sign", "N", 1.0),
    "lagging": lag_effect(Oscillator, "spring", "place", "lagging", 0.5, "N"),
    "hysteresis": lag_effect(Oscillator, "spring", "place", "hysteresis", 0.3, "N"),
    "heating": lag_effect(Oscillator, "friction", "speed", "heating", 0.4, "N"),
    "saturation": input_saturation(Oscillator, "command"),
    "offset": input_offset(Oscillator, "command"),
    "input lag": input_lag(Oscillator, "command"),
    "gain": sensor_gain(Oscillator, "shown"),
    "bias": sensor_offset(Oscillator, "shown"),
    "drift": sensor_drift(Oscillator, "shown"),
    "sensor lag": sensor_lag(Oscillator, "shown"),
}
STIFF = {"sensor lag"}  # its slope jumps with the input: a difference is taken of very little


def record(linear: bool = False, step: float = 0.01) -> Dataset:
    """A record of which only clock and inputs count; steps of the input are held or are slopes."""
    measured = dict.fromkeys(("shown", "place"), np.zeros(COUNT))
    smooth = frozenset({"command"}) if linear else frozenset()
    return Dataset(step * np.arange(COUNT), {"command": LEVELS}, measured, smooth)


def only(model: Any, effect: Any, linear: Any = ()) -> ScoreDirections:
    ((known, found),) = score_directions(model, [effect], linear)
    assert known is effect
    assert found is not None
    return found


def simulated(cls, data, values, linear=()):
    """Simulate one run, straight from the compiled model."""
    return CompiledModel(cls).run(data.time, data.inputs, values, frozenset(linear)).signals


def little_of(model, effect, setting, data, linear=(), amount=1e-4):
    """What a little of an effect adds to outputs, over the amount: nearly its derivative."""
    cls = stack(model.candidate.cls, effect)
    neutral = effect.declared[effect.neutral].start
    known = model.problem.start | setting.values
    base, moved = (
        simulated(cls, data, known | {effect.neutral: neutral + some}, linear)
        for some in (0.0, amount)
    )
    return {o: (moved[o] - base[o]) / amount for o in data.measured}


def size_of(effect):
    """Of the searched coordinate of a switch that starts at zero, or at one in its size."""
    declared = effect.declared[effect.neutral]
    return abs(float(declared.start)) or float(declared.nominal)


@pytest.mark.parametrize("linear", [(), ("command",)], ids=["held", "linear"])
@pytest.mark.parametrize("name", EFFECTS)
def test_a_derivative_is_what_a_little_of_an_effect_does(name, linear):
    effect = EFFECTS[name]
    data = record(bool(linear))
    model = at(Oscillator, data)
    found = only(model, effect, linear)
    places = [k for k, one in enumerate(found.settings) if one.least <= 0.0]
    for k in places[:: max(len(places) - 1, 1)]:
        amount = 1e-6 if name in STIFF else 1e-4
        expected = little_of(model, effect, found.settings[k], data, linear, amount)
        for output, change in expected.items():
            gradient = -found.gradient[output][:, k]
            scale = size_of(effect)
            assert gradient == pytest.approx(
                scale * change, abs=0.025 * scale * np.abs(change).max() + 1e-7
            )
    assert places


@pytest.mark.parametrize("name", ["cubic", "saturation", "input lag", "gain"])
def test_simulated_directions_are_the_same_to_first_order(name):
    effect = EFFECTS[name]
    data = record()
    model = at(Oscillator, data)
    first_order = only(model, effect)
    cls = stack(Oscillator, effect)
    problem = Problem(cls, data.time, data.inputs, data.measured, own_parameters(effect), {})
    in_full = simulated_directions(problem, effect)
    assert [one.values for one in in_full.settings] == [s.values for s in first_order.settings]
    for output, gradient in in_full.gradient.items():
        for k, one in enumerate(in_full.settings):
            if one.least <= 0.0:
                largest = float(np.abs(gradient[:, k]).max())
                assert first_order.gradient[output][:, k] == pytest.approx(
                    gradient[:, k], abs=0.025 * largest + 1e-7
                )


def test_a_difference_is_all_of_it_where_nothing_comes_back():
    """An input that levels off, before a cell that is linear: of any size."""
    saturation = input_saturation(Cell, "current")
    data = several("a")
    model = at(Cell, data)
    found = only(model, saturation)
    differences = [k for k, one in enumerate(found.settings) if one.least > 0.0]
    assert len(differences) == 3
    base = simulated(Cell, data, {})["voltage"]
    for k in differences:
        moved = simulated(stack(Cell, saturation), data, found.settings[k].values)["voltage"]
        assert found.gradient["voltage"][:, k] == pytest.approx(base - moved, abs=1e-6)
        assert np.abs(base - moved).max() > 1e-4


def test_a_play_is_seen_in_steps_longer_than_it_follows_in():
    """In steps of 0.1 s, of a hundredth of a second."""
    play = backlash(Cell, "current")
    data = several("a")
    found = only(at(Cell, data), play)
    base = simulated(Cell, data, {})["voltage"]
    (k, *_) = (k for k, one in enumerate(found.settings) if one.least > 0.0)
    moved = simulated(stack(Cell, play), data, found.settings[k].values)["voltage"]
    difference = base - moved
    assert np.abs(difference).max() > 1e-3
    assert found.gradient["voltage"][:, k] == pytest.approx(
        difference, abs=0.02 * np.abs(difference).max()
    )


def test_every_run_starts_anew_from_its_own_state():
    """Three runs, one after the other: each as if it were a record by itself, with its own time
    constant.
    """
    data = several("abc")
    effect = lag_effect(Cell, "voltage", "current", "lagging", 2.0, "V")
    values = -0.5, 1.0, 0.25
    names = [run.own("relaxed_start") for run in data.several]
    starts = dict(zip(names, values, strict=True))
    times = {run.own("tau1"): 2.0 + k for k, run in enumerate(data.several)}
    starts |= times
    names += times
    joined = only(at(Cell, data, names, starts), effect)
    saturation = curve(Cell, "relaxed_rate", "relaxed", "cubic", "A/s", 1.0)
    bent = only(at(Cell, data, names, starts), saturation)
    growing = only(at(Cell, data, names, starts), Growing)
    assert data.several[2].ahead > 0.0
    for run in data.several:
        part = slice(run.first, run.last)
        clock = data.time[part] - run.ahead
        inputs = {"current": data.inputs["current"][part]}
        alone = Dataset(clock, inputs, {"voltage": data.measured["voltage"][part]})
        own = {name: starts[run.own(name)] for name in ("relaxed_start", "tau1")}
        single = at(Cell, alone, (), own)
        for whole, one in ((joined, effect), (bent, saturation), (growing, Growing)):
            expected = little_of(single, one, whole.settings[0], alone)["voltage"]
            largest = np.abs(expected).max()
            assert largest > 1e-3
            change = -whole.gradient["voltage"][part_of(data, run), 0]
            assert change == pytest.approx(size_of(one) * expected, abs=0.02 * largest)


def part_of(data, run):
    """Return the measured samples of a run, of all that are measured."""
    present = np.isfinite(data.measured["voltage"])
    return slice(int(present[: run.first].sum()), int(present[: run.last].sum()))


def test_gaps_in_outputs_are_left_out():
    data = record()
    missing = np.arange(COUNT) % 7 == 3
    holes = {"shown": np.where(missing, np.nan, 0.0), "place": np.zeros(COUNT)}
    full = only(at(Oscillator, data), EFFECTS["cubic"])
    found = only(
        at(Oscillator, Dataset(data.time, data.inputs, holes, frozenset())), EFFECTS["cubic"]
    )
    assert np.array_equal(found.gradient["shown"], full.gradient["shown"][~missing])
    assert np.array_equal(found.gradient["place"], full.gradient["place"])


# --- delays
# --------------------------------------------------------------------------------------------------


def test_a_delay_shows_what_was_before_at_every_length():
    """Half a sample more than a whole number of samples shows the input that many and one ago."""
    delay = transport_delay(Amplifier, "shown")
    data = offset_record(30.0, 1)
    u = data.inputs["signal"]
    found = only(at(Amplifier, data, ["gain"]), delay)
    assert len(found.settings) > 3
    assert all(one.least > 0.0 for one in found.settings)
    for k, one in enumerate(found.settings):
        (seconds,) = one.values.values()
        late = int(np.ceil(seconds / 0.1 - 1e-9))
        expected = 2.0 * (u[late:] - u[:-late])
        assert found.gradient["shown"][late:, k] == pytest.approx(expected, abs=1e-5)
        before = 2.0 * (u[:late] - u[0])
        assert found.gradient["shown"][:late, k] == pytest.approx(before, abs=1e-5)


def test_a_delay_of_a_dynamic_output_is_that_of_the_simulation():
    """Read between samples, with a step of the input within the delay."""
    output = "shown"
    delay = transport_delay(Oscillator, output)
    data = record()
    found = only(at(Oscillator, data), delay)
    fine = np.linspace(0.0, data.time[-1], 50 * (COUNT - 1) + 1)
    held = {"command": data.inputs["command"][np.minimum(np.arange(fine.size) // 50, COUNT - 1)]}
    course = CompiledModel(Oscillator).run(fine, held, {}).signals[output]
    for k, one in enumerate(found.settings):
        (seconds,) = one.values.values()
        then = np.maximum(data.time - seconds, 0.0)
        expected = course[::50] - course[np.rint(then / fine[1]).astype(int)]
        assert found.gradient[output][:, k] == pytest.approx(
            expected, abs=0.01 * np.abs(expected).max() + 1e-6
        )


def test_a_delay_of_what_was_not_measured_has_no_trace():
    data = record()
    alone = Dataset(data.time, data.inputs, {"place": np.zeros(COUNT)}, frozenset())
    found = only(at(Oscillator, alone), transport_delay(Oscillator, "shown"))
    assert found.settings == []
    assert found.gradient["place"].shape == (COUNT, 0)


# --- what is sampled
# --------------------------------------------------------------------------------------------------


def bench(controlled: bool, step: float = 1.0 / 3000.0):
    """A bench whose loop is open or closed, a hundred samples in its period."""
    time = step * np.arange(COUNT)
    inputs = {"force_reference": 1.0 + LEVELS, "tension": 2.0 * np.sin(7.0 * time)}
    outputs = ("coil_current", "velocity", "position_measured")
    data = Dataset(time, inputs, dict.fromkeys(outputs, np.zeros(COUNT)), frozenset({"tension"}))
    return data, at(VoiceCoilDma, data, (), {"controller_on": float(controlled)})


@pytest.mark.parametrize("effect", [CoulombFriction, PositionDependentForceConstant])
def test_an_open_loop_that_samples_its_inputs_needs_no_simulation(effect):
    data, model = bench(False)
    found = only(model, effect, ("tension",))
    setting = next(one for one in found.settings if one.least <= 0.0)
    k = found.settings.index(setting)
    amount = 1e-4 if effect is CoulombFriction else 1.0
    expected = little_of(model, effect, setting, data, ("tension",), amount)
    for output, change in expected.items():
        largest = size_of(effect) * np.abs(change).max()
        assert largest > 0.0
        assert -found.gradient[output][:, k] == pytest.approx(
            size_of(effect) * change, abs=0.1 * largest
        )


def test_what_acts_on_a_sampled_command_is_seen():
    """The amplifier levels off behind it, and the command is what is fed, sampled."""
    data, model = bench(False)
    found = only(model, AmplifierSaturation, ("tension",))
    setting = found.settings[0]
    expected = little_of(model, AmplifierSaturation, setting, data, ("tension",), 1e-5)
    current = size_of(AmplifierSaturation) * expected["coil_current"]
    largest = np.abs(current).max()
    assert largest > 0.0
    assert -found.gradient["coil_current"][:, 0] == pytest.approx(current, abs=0.02 * largest)


def test_what_comes_back_through_samples_has_to_be_simulated():
    effects = [CoulombFriction, input_offset(VoiceCoilDma, "tension")]
    _, closed = bench(True)
    assert list(score_directions(closed, effects, ())) == [(e, None) for e in effects]
    _, opened = bench(False)
    commanded = input_offset(VoiceCoilDma, "force_reference")
    found = dict(score_directions(opened, [*effects, commanded], ()))
    assert found[commanded] is None
    assert all(found[effect] is not None for effect in effects)


# --- settings
# --------------------------------------------------------------------------------------------------


def test_a_switch_that_goes_both_ways_is_scored_by_its_derivative():
    """An offset takes off of the residual what it adds to the output, per searched coordinate."""
    data = offset_record(30.0, 1)
    found = only(at(Amplifier, data, ["gain"]), OFFSET)
    size = size_of(OFFSET)
    (one,) = found.settings
    assert found.gradient["shown"][:, 0] == pytest.approx(np.full(data.time.size, -size), rel=1e-6)
    assert one.least == pytest.approx(OFFSET.declared[OFFSET.neutral].min / size)
    assert one.most == pytest.approx(OFFSET.declared[OFFSET.neutral].max / size)
    assert found.start_values(0, 0.3) == {OFFSET.neutral: pytest.approx(0.3 * size)}


def test_a_fit_starts_within_the_range_and_a_difference_where_it_was_taken():
    gain = sensor_gain(Amplifier, "shown")
    made = {gain.neutral: 1.0}
    both = ScoreDirections(
        gain, [ScoreDirection(made, -9.0, 9.0), ScoreDirection({gain.neutral: 4.0}, 0.3, 3.0)], {}
    )
    assert both.start_values(0, 0.25) == {gain.neutral: pytest.approx(1.25)}
    assert both.start_values(0, 1e30) == {gain.neutral: gain.declared[gain.neutral].max}
    assert both.start_values(1, 0.5) == {gain.neutral: 4.0}


def test_a_switch_that_goes_one_way_is_scored_by_differences_too_on_a_grid():
    """Sizes are multiples of the nominal; times go from two samples to a tenth of the record."""
    data = record()
    friction = EFFECTS["lagging"]
    amount, constant = own_parameters(friction)
    found = only(at(Oscillator, data), friction)
    nominal = friction.declared[amount].nominal
    sizes = sorted({one.values[amount] for one in found.settings})
    assert sizes == pytest.approx([0.0, nominal, 4.0 * nominal, 16.0 * nominal])
    times = np.array(sorted({one.values[constant] for one in found.settings}))
    step = data.time[1] - data.time[0]
    assert times[[0, -1]] == pytest.approx([2.0 * step, (data.time[-1] - data.time[0]) / 10.0])
    apart = times[1:] / times[:-1]
    assert apart == pytest.approx(np.full(len(apart), apart[0]))
    assert 2.0 < apart[0] <= 3.0
    assert len(found.settings) == len(times) * len(sizes)
    for one in found.settings:
        trusted = (one.least, one.most) == pytest.approx((1.0 / 3.0, 3.0))
        assert trusted == (one.values[amount] > 0.0)


def test_settings_without_a_trace_or_a_number_are_left_out(monkeypatch):
    data = record()
    alone = Dataset(data.time, data.inputs, {"place": np.zeros(COUNT)}, frozenset())
    assert only(at(Oscillator, alone), EFFECTS["bias"]).settings == []
    of = score_test.EffectForcing.of

    def broken(self, settings):
        forcing = of(self, settings)
        forcing.begin[5, :, 1] = np.nan
        return forcing

    whole = only(at(Oscillator, data), EFFECTS["lagging"])
    monkeypatch.setattr(score_test.EffectForcing, "of", broken)
    found = only(at(Oscillator, data), EFFECTS["lagging"])
    assert found.settings == [one for k, one in enumerate(whole.settings) if k != 1]
    kept = np.delete(whole.gradient["shown"], 1, axis=1)
    assert np.array_equal(found.gradient["shown"], kept)


def test_an_effect_that_fails_to_simulate_at_all_says_why(monkeypatch):
    effect = EFFECTS["cubic"]
    data = record()
    cls = stack(Oscillator, effect)
    problem = Problem(cls, data.time, data.inputs, data.measured, own_parameters(effect), {})

    def fails(self, q):
        raise UserError("not finite")

    monkeypatch.setattr(Problem, "evaluate", fails)
    with pytest.raises(UserError, match="not finite"):
        simulated_directions(problem, effect)
