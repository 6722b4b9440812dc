"""Claims: ppy.age finds a circuit window by window with intervals that hold it, over a record or a
folder; its impedance is that of the circuit, and derating comes where the change is.
"""

import json

import numpy as np
import pytest

import ppy_rig as ppy
from fmus.kit.errors import UserError

STEP = 0.2  # s
R2, C = 2.35, 3.2
FREQUENCY = 0.1  # Hz


def growing(t):
    """R1 that grows by a quarter in 600 s."""
    return 0.4 * (1.0 + t / 2400.0)


def impedance(r1):
    """Magnitude of eq. 4.10, by complex numbers."""
    branch = r1 + 1.0 / (2j * np.pi * FREQUENCY * C)
    return abs(R2 * branch / (R2 + branch))


def drawn(duration, r1_at=growing, seed=0):
    """Return columns of R2 across R1 and C in series, with 2 mV of noise; solved exactly."""
    time = STEP * np.arange(round(duration / STEP))
    current = np.where((time + 2.5) % 10.0 < 5.0, 1.3, -1.3)
    noise = 2e-3 * np.random.default_rng(seed).standard_normal(time.size)
    charge = 0.0
    voltage = np.empty(time.size)
    for k, (t, i) in enumerate(zip(time, current, strict=True)):
        r1 = r1_at(t)
        voltage[k] = R2 * (r1 * i + charge / C) / (r1 + R2)
        decay = np.exp(-STEP / ((r1 + R2) * C))
        charge = charge * decay + (1.0 - decay) * R2 * C * i
    return {"time [s]": time, "current [A]": current, "voltage [V]": voltage + noise}


@pytest.fixture(scope="module")
def aged():
    return ppy.age(drawn(600.0), window="60s", rise=25, derating={"impedance_step": "1 %"})


@pytest.mark.slow
def test_intervals_hold_the_circuit_of_each_window(aged):
    assert aged.time == pytest.approx(60.0 * np.arange(10) + 30.0, abs=STEP)
    for name, truth in (
        ("R1", growing(aged.time)),
        ("R2", np.full(10, R2)),
        ("C", np.full(10, C)),
        ("voltage/current", impedance(growing(aged.time))),
    ):
        course = aged.courses[name]
        assert np.sum((course.low <= truth) & (truth <= course.high)) >= 8, name
        assert course.value == pytest.approx(truth, rel=0.02), name


@pytest.mark.slow
def test_a_window_that_does_not_tell_the_circuit_has_no_end_of_its_impedance():
    """A second of current tells no time constant of 9 s: an interval reaches beyond all values."""
    columns = drawn(40.0)
    columns["voltage [V]"] += 5e-3 * np.random.default_rng(50).standard_normal(200)
    aged = ppy.age(columns, window="1s")
    assert max(aged.courses[name].high.max() for name in ("R1", "R2", "C")) > 1e12
    assert np.isinf(aged.courses["voltage/current"].high).any()


@pytest.mark.slow
def test_the_forecast_holds_the_life(aged):
    times = np.arange(0.0, 6000.0)
    truth = times[np.argmax(impedance(growing(times)) > 1.25 * impedance(growing(0.0)))]
    low, high = aged.forecast.interval
    assert low <= truth <= high
    assert "25.0 % above its first value after" in aged.headline()


@pytest.mark.slow
def test_derating_steps_follow_the_change(aged):
    """A step of 50 mV for each percent, after the true change and within two memories of 260 s."""
    steps = aged.derating.steps()
    assert steps
    times = np.arange(0.0, 600.0)
    first = impedance(growing(0.0))
    crossed = times[np.argmax(impedance(growing(times)) > 1.01 * first)]
    assert crossed < steps[0][0] < crossed + 2 * 260.0
    assert steps[0][1] == pytest.approx(1.45)


@pytest.mark.slow
def test_page_figures_table_and_picture_have_all_windows(aged, tmp_path):
    page = aged.report(tmp_path / "aged.html", "ppy age").read_text()
    assert "25.0 % above" in page
    assert page.count("<tr>") >= 11
    figures = json.loads(json.dumps(aged.to_dict(), allow_nan=False))
    assert [*figures["windows"]] == ["R1", "R2", "C", "voltage/current"]  # states are no parameters
    assert len(aged.to_frame()) == 10
    assert len(aged.plot().axes) == 4
    assert "charge_start" not in page
    assert "voltage/current" in str(aged)


@pytest.mark.slow
def test_a_folder_is_one_life_in_hours_of_operation(tmp_path):
    for k in range(2):
        columns = drawn(120.0, lambda t, k=k: growing(t + 120.0 * k), seed=k)
        head = ",".join(columns)
        rows = np.column_stack([*columns.values()])
        np.savetxt(tmp_path / f"{k}.csv", rows, "%.9g", ",", header=head, comments="")
    aged = ppy.age(tmp_path, window=60.0, fit=["R1", "charge_start"], settings={"R2": R2, "C": C})
    assert aged.labels == ("0", "0", "1", "1")
    assert aged.time == pytest.approx([30.0, 90.0, 149.8, 209.8], abs=0.2)
    assert aged.courses["R1"].value == pytest.approx(growing(aged.time), rel=5e-3)
    assert aged.forecast is None
    assert "too few for a forecast" in aged.headline()
    assert aged.derating.time[-1] < 240.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"of": "R3"}, "nothing is fitted named 'R3'"),
        ({"of": "volts/current"}, "ppy_actuator has no output named 'volts'"),
        ({"of": "voltage/amps"}, "ppy_actuator has no input named 'amps'"),
        ({"window": 0.0}, r"^window=.0.: a time above 0 s$"),
        ({"frequency": 0.0}, "frequency"),
    ],
)
def test_what_cannot_be_followed_is_told(options, said):
    with pytest.raises(UserError, match=said):
        ppy.age(drawn(10.0), **options)
