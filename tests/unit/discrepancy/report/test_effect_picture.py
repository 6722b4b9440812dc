"""Claims: an effect is drawn as its law along the record, with it and without, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import cubic_stiffness
from fmus.kit.inputs import dead_zone
from fmus.kit.sensors import sensor_lag
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.report import effect_picture
from orchestration.discrepancy.report.effect_picture import AxisLabel, LawValues
from orchestration.reporting import pictures
from tests.support.pages import charts_of, words_of
from tests.support.wired_motor import FRICTION, Motor

COUNT, STEP, NOISE, STRENGTH = 1500, 0.1, 0.02, 0.3


class Amplifier(Component):
    """What goes in, times a gain."""

    name = "amplifier"
    gain = Parameter(2.0, "1", min=1e-6, max=1e6)
    signal = Input("V", title="control signal")

    def amplified(self):
        return self.gain * self.signal

    @Output("V", title="what comes out")
    def shown(self):
        return self.amplified()


class Scale(Component):
    """A law with arguments, which an output shows."""

    name = "scale"
    slope = Parameter(2.0, "m/N", min=0.0)
    load = Input("N")
    settled = State("N", rate="settling")

    def settling(self):
        return self.load - self.settled

    def stretch(self, force):
        return self.slope * force

    @Output("m")
    def length(self):
        return self.stretch(self.load)


CUBE = cubic_stiffness(Amplifier, "amplified", "signal", "V")


def drawn(shown, seed=1):
    """A record of the amplifier, driven by noise."""
    rng = np.random.default_rng(seed)
    signal = rng.uniform(-2.0, 2.0, COUNT)
    measured = shown(signal) + NOISE * rng.normal(size=COUNT)
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": measured})


@pytest.fixture(scope="module")
def cubed():
    return diagnose(Amplifier, drawn(lambda u: 2.0 * u + STRENGTH * u**3), [CUBE])


def test_the_law_is_that_of_the_plant_with_the_effect_and_linear_without(cubed):
    values = effect_picture.law_values(cubed, CUBE)
    u = values.x
    assert np.array_equal(u, cubed.estimation.inputs["signal"])
    assert values.with_effect == pytest.approx(2.0 * u + STRENGTH * u**3, abs=0.02)
    assert values.without == pytest.approx(2.0 * u, abs=0.02)
    assert (values.law, values.signal) == (
        AxisLabel("amplified", "V"),
        AxisLabel("control signal", "V"),
    )
    assert values.is_function


def test_it_is_drawn_over_the_signal_with_names_for_people(cubed):
    chart = effect_picture.effect_chart(cubed, cubed.selection.steps[0].chosen)
    words = words_of(chart.drawn)
    assert words.startswith("measured without the effect with the effect amplified [V]")
    assert words.endswith("control signal [V]")
    assert "a spring that hardens" in chart.caption


def test_the_law_is_measured_where_an_output_shows_it(cubed):
    """What is shown is the law itself, so that the points are what was measured, but fewer."""
    values = effect_picture.law_values(cubed, CUBE)
    measured = cubed.estimation.measured["shown"]
    assert values.measured == pytest.approx(measured, rel=1e-9, abs=1e-9)
    assert values.shown_by == "what comes out"
    chart = effect_picture.effect_chart(cubed, cubed.selection.steps[0].chosen)
    ((panel,),) = charts_of(f"{chart.drawn}</figure>")
    points = panel.lines[pictures.MEASURED]
    assert 250 < len(points) <= 300 < len(measured)
    assert "Points: the what comes out as measured" in chart.caption


def test_a_law_is_measured_by_an_output_that_shows_a_multiple_of_it_beside_others():
    """By hand: y = 3 (2 u) + u, of which the law is (y - u) / 3."""

    class Mixed(Amplifier):
        @Output("V")
        def shown(self):
            return 3.0 * self.amplified() + self.signal

    cubic = cubic_stiffness(Mixed, "amplified", "signal", "V")
    record = drawn(lambda u: 3.0 * (2.0 * u + STRENGTH * u**3) + u)
    diagnosis = diagnose(Mixed, record, [cubic])
    values = effect_picture.law_values(diagnosis, cubic)
    by_hand = (diagnosis.estimation.measured["shown"] - values.x) / 3.0
    assert values.measured == pytest.approx(by_hand, rel=1e-6, abs=1e-6)


def test_an_input_is_drawn_and_measured_over_its_command():
    zone = dead_zone(Amplifier, "signal")
    record = drawn(lambda u: 2.0 * (u - np.clip(u, -0.5, 0.5)))
    diagnosis = diagnose(Amplifier, record, [zone])
    values = effect_picture.law_values(diagnosis, zone)
    u = diagnosis.estimation.inputs["signal"]
    assert np.array_equal(values.x, u)
    assert np.array_equal(values.without, u)
    assert values.with_effect == pytest.approx(u - np.clip(u, -0.5, 0.5), abs=0.02)
    assert values.measured == pytest.approx(values.with_effect, abs=5.0 * NOISE)


@pytest.mark.slow
def test_where_no_output_shows_the_law_the_range_of_the_record_is_marked():
    """Friction acts on the acceleration, and shows only in the course of the speed."""
    rng = np.random.default_rng(4)
    drive = np.repeat(rng.uniform(-1.0, 1.0, COUNT // 30), 30)
    speed = np.zeros(COUNT)
    fine = 100
    for k in range(COUNT - 1):
        v = speed[k]
        for _ in range(fine):
            v += STEP / fine * (2.0 * drive[k] - v - 0.4 * np.tanh(v / 0.01))
        speed[k + 1] = v
    measured = speed + 0.01 * rng.normal(size=COUNT)
    data = Dataset(STEP * np.arange(COUNT), {"drive": drive}, {"shown": measured})
    diagnosis = diagnose(Motor, data, [FRICTION])
    (step,) = diagnosis.selection.steps
    values = effect_picture.law_values(diagnosis, step.chosen.effect)
    assert np.isnan(values.measured).all()
    assert values.shown_by == ""
    chart = effect_picture.effect_chart(diagnosis, step.chosen)
    assert "there are no points. Ticks below: where the record has been." in chart.caption
    ((panel,),) = charts_of(f"{chart.drawn}</figure>")
    ticks = panel.lines[pictures.MEASURED]
    assert len(ticks) <= 300
    assert len({height for _, height in ticks}) == 1
    assert min(x for x, _ in ticks) < 100
    assert max(x for x, _ in ticks) > 1900


def test_a_memory_is_no_function_of_its_signal_and_not_drawn():
    rng = np.random.default_rng(2)
    signal = np.repeat(rng.uniform(-2.0, 2.0, COUNT // 50), 50)
    lagged = np.empty(COUNT)
    lagged[0] = signal[0]
    for k in range(1, COUNT):
        lagged[k] = signal[k - 1] + (lagged[k - 1] - signal[k - 1]) * np.exp(-STEP / 0.5)
    measured = 2.0 * lagged + NOISE * rng.normal(size=COUNT)
    data = Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": measured})
    lag = sensor_lag(Amplifier, "shown")
    diagnosis = diagnose(Amplifier, data, [lag])
    (step,) = diagnosis.selection.steps
    values = effect_picture.law_values(diagnosis, step.chosen.effect)
    assert values.without == pytest.approx(2.0 * signal[: len(values.without)], abs=0.02)
    assert values.with_effect == pytest.approx(2.0 * lagged[: len(values.without)], abs=0.1)
    assert not values.is_function
    assert effect_picture.effect_chart(diagnosis, step.chosen) is None


@pytest.mark.parametrize(("lag", "is_function"), [(0, True), (25, False)])
def test_a_function_of_the_signal_is_told_from_a_memory(lag, is_function):
    time = STEP * np.arange(COUNT)
    x = np.sin(0.3 * time)
    more = np.roll(x**2, lag)
    label = AxisLabel("law", "1")
    assert LawValues(label, label, x, x + more, x, x).is_function is is_function


def test_a_law_with_arguments_has_the_value_and_the_unit_of_the_output_that_shows_it():
    one = Scale()
    one.time, one.load, one.settled = np.arange(3.0), np.array([0.0, 1.0, 3.0]), np.zeros(3)
    values = effect_picture._full(one, effect_picture._called(one, "stretch"))
    assert values.tolist() == [0.0, 2.0, 6.0]
    assert effect_picture._unit(one, Scale, "stretch", values) == "m"


def test_what_cannot_be_evaluated_is_not_drawn(cubed, monkeypatch):
    def fails(*of):
        raise KeyError("state")

    monkeypatch.setattr(effect_picture, "law_values", fails)
    assert effect_picture.effect_chart(cubed, cubed.selection.steps[0].chosen) is None


@pytest.mark.parametrize(
    ("largest", "title", "shown"),
    [(0.8, "charge [C]", 0.8), (0.05, "charge [mC]", 50.0), (1200.0, "charge [kC]", 1.2)],
)
def test_an_axis_has_a_prefix_but_for_tenths_of_a_unit(largest, title, shown):
    axis, (values,) = AxisLabel("charge", "C").scaled(np.array([0.0, -largest]))
    assert (axis, values[1]) == (title, pytest.approx(-shown))
