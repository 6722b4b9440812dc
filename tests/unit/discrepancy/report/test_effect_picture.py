"""Claims: an effect is drawn as its law along the record, with it and without, computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.generic import cubic_stiffness
from fmus.kit.sensors import sensor_lag
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.report import effect_picture
from orchestration.discrepancy.report.effect_picture import LawValues, Quantity
from tests.support.pages import charts_of, words_of

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
        Quantity("amplified", "V"),
        Quantity("control signal", "V"),
    )
    assert values.is_function


def test_it_is_drawn_over_the_signal_with_names_for_people(cubed):
    chart = effect_picture.effect_chart(cubed, cubed.selection.steps[0].chosen)
    words = words_of(chart.drawn)
    assert words.startswith("without the effect with the effect amplified [V]")
    assert words.endswith("control signal [V]")
    assert "a spring that hardens" in chart.caption


def test_a_memory_is_drawn_over_time():
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
    assert values.without == pytest.approx(2.0 * signal[: len(values.time)], abs=0.02)
    assert values.with_effect == pytest.approx(2.0 * lagged[: len(values.time)], abs=0.1)
    assert not values.is_function
    assert words_of(effect_picture.effect_chart(diagnosis, step.chosen).drawn).endswith("time [s]")


@pytest.mark.parametrize(("lag", "is_function"), [(0, True), (25, False)])
def test_a_function_of_the_signal_is_told_from_a_memory(lag, is_function):
    time = STEP * np.arange(COUNT)
    x = np.sin(0.3 * time)
    more = np.roll(x**2, lag)
    quantity = Quantity("law", "1")
    assert LawValues(quantity, quantity, time, x, x + more, x).is_function is is_function


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


def test_the_part_of_the_record_is_drawn_in_which_the_effect_does_most():
    time = STEP * np.arange(600)
    more = np.where((time > 40.0) & (time < 45.0), 1.0, 0.0)
    quantity = Quantity("law", "V")
    values = LawValues(quantity, Quantity("", "1"), time, time, more, np.zeros(600))
    text = f"{effect_picture._over_time(values)}</figure>"
    ((panel,),) = charts_of(text)
    ticks = [float(word) for word in words_of(text.split('<div class="x">')[1]).split()[:-2]]
    assert 35.0 <= ticks[0] < 45.0
    assert panel.title == "law [V]"
