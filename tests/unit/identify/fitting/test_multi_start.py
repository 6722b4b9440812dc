"""Claims: searches begin at several points where a deeper minimum may exist, and only there.

Oracle: a sine, whose frequency is known.
"""

import signal

import numpy as np
import pytest

from fmus.kit import stack
from fmus.kit.sensors import transport_delay
from orchestration.identify.fitting import Assumptions, FitData
from orchestration.identify.grey_box import fit_records
from tests.support.linear_fits import Decay, Wave, columns, fitted, noisy, plane_data
from tests.support.relaxation import Relaxation


def test_more_starts_find_the_deepest_valley():
    time = np.linspace(0.0, 20.0, 200)
    data = [FitData(time, {"t": time}, {"y": np.sin(3.0 * time)})]
    start = {"w": 1.0}
    one = fitted(data, ["w"], Wave, start, starts=1)
    several = fitted(data, ["w"], Wave, start, starts=None)
    assert one.values["w"] != pytest.approx(3.0, rel=0.1)
    assert several.values["w"] == pytest.approx(3.0, rel=1e-6)
    assert several.searches > 1
    assert "several minima" in several.warnings[0]


def test_a_residual_that_is_white_ends_the_searches():
    x = columns(400)
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))], starts=None)
    assert fit.searches == 1


def test_a_residual_of_the_solver_ends_the_searches():
    time = np.linspace(0.0, 3.0, 300)
    data = [FitData(time, {}, {"y": np.exp(-0.7 * time)})]
    assert fitted(data, ["rate"], Decay, starts=None).searches == 1


def late_record(delay):
    """Return a first-order answer to held inputs, in closed form, that is shown late."""
    rng = np.random.default_rng(4)
    step, tau = 0.1, 0.7
    time = step * np.arange(600)
    u = np.repeat(rng.uniform(-1.0, 1.0, 600), rng.integers(5, 25, 600))[:600]
    x = np.zeros(600)
    for k in range(599):
        x[k + 1] = u[k] + (x[k] - u[k]) * np.exp(-step / tau)
    then = np.maximum(time - delay, 0.0)
    k = np.minimum((then / step + 1e-9).astype(int), 599)
    shown = u[k] + (x[k] - u[k]) * np.exp(-(then - time[k]) / tau)
    return [FitData(time, {"u": u}, {"y": shown + 1e-3 * rng.standard_normal(600)})]


def test_a_delay_of_many_samples_is_found_in_few_simulations():
    """One without the delay tells which sample it ends at: 12.4 samples are no 12 searches."""
    late = stack(Relaxation, transport_delay(Relaxation, "y"))
    fit = fit_records(late, late_record(1.24), ["tau", "y_delay"], {"y_delay": 0.03, "tau": 0.4})
    assert fit.values["y_delay"] == pytest.approx(1.24, abs=0.01)
    assert fit.values["tau"] == pytest.approx(0.7, rel=0.01)
    assert fit.evaluations < 100


def test_an_interrupt_ends_the_searches_with_the_best_so_far():
    """The first one is over when it is told which are next; none of these is made."""
    time = np.linspace(0.0, 20.0, 200)
    data = [FitData(time, {"t": time}, {"y": np.sin(3.0 * time)})]
    told = []

    def press(text):
        told.append(text)
        signal.raise_signal(signal.SIGINT)

    fit = fit_records(Wave, data, ["w"], {"w": 1.0}, Assumptions(starts=None), progress=press)
    one = fitted(data, ["w"], Wave, {"w": 1.0}, starts=1)
    assert fit.is_interrupted
    assert not one.is_interrupted
    assert fit.values["w"] == pytest.approx(one.values["w"], rel=1e-9)
    (text,) = told
    assert text.startswith("search 2 of 5; best so far: w=")
    assert "interrupted: the values are the best so far" in fit.warnings
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert fit.profile("w").interval[0] < fit.values["w"]
