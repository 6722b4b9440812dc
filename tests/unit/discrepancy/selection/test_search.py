"""Claims: candidates are held against each other in noise of one distribution, which is looked at
anew with each cause.

Otherwise a change of the distribution passes for evidence: on a record whose noise varies in level,
one effect that is not there had a fall of BIC of 88.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.ndimage import uniform_filter1d

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.arms import lag_effect
from fmus.kit.curves import curve
from fmus.kit.functions import minimum
from fmus.kit.generic import extra_kelvin
from fmus.kit.sensors import measurement_effects, sensor_drift, sensor_lag, transport_delay
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.candidate import Candidate
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection.scoring import score, screen
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import select
from orchestration.identify.fitting.prediction_error import fit_prediction_error
from tests.support.gain import Gain
from tests.support.pushed_mass import DAMPER, MASS
from tests.support.regression_model import OFFSET, Amplifier
from tests.support.several import Cell, measured


class Twisting(Component):
    """A torsion balance that nothing drives."""

    name = "twisting"
    stiffness = Parameter(150.0, "1/s^2", min=1e-6, max=1e6)
    damping = Parameter(0.2, "1/s", min=0, max=1e6)
    angle = State("rad", rate="velocity_of_angle")
    velocity = State("rad/s", rate="acceleration")

    def velocity_of_angle(self):
        return self.velocity

    def restoring(self):
        return self.stiffness * self.angle

    def acceleration(self):
        return -self.restoring() - self.damping * self.velocity

    @Output("rad")
    def y(self):
        return self.angle


@pytest.mark.slow
def test_an_effect_that_changes_the_period_is_met_in_a_free_response():
    """Oracle: SciPy's integrator. The linear model is out of step after the first periods, so that
    what it predicts of a cubic stiffness is of no use; the beginning of the record leads there.
    """
    time = np.linspace(0.0, 24.0, 2400)
    ran = solve_ivp(
        lambda _, x: [x[1], -110.0 * x[0] - 45.0 * x[0] ** 3 - 0.2 * x[1]],
        (0.0, time[-1]),
        [1.3, 0.3],
        t_eval=time,
        rtol=1e-9,
        atol=1e-9,
    )
    noise = 0.003 * np.random.default_rng(4).standard_normal(time.size)
    data = Dataset(time, {}, {"y": ran.y[0] + noise})
    names = ["stiffness", "damping", "angle_start", "velocity_start"]
    search = Search(data, Twisting, names, free=True)
    base = search.nominal()
    cubic = curve(Twisting, "restoring", "angle", "cubic", "rad/s^2", 100.0)
    start = screen(score(search, base, [cubic]), [cubic])[0]
    fitted = search.fit_extended(start, base)
    assert search.loses_step(base)
    assert not replace(search, free=False).loses_step(base)
    assert np.std(fitted.fit.residual["y"]) < 0.0035
    assert fitted.fit.values["restoring_cubic"] == pytest.approx(45.0, rel=0.01)


def recorded(noise):
    time = 0.1 * np.arange(len(noise))
    u = np.random.default_rng(1).uniform(-1.0, 1.0, len(noise))
    return Dataset(time, {"u": u}, {"y": 2.0 * u + 0.1 * noise}, frozenset())


def test_the_noise_of_every_fit_is_of_the_distribution_of_the_first():
    random = np.random.default_rng(2)
    heavy, gaussian = recorded(random.standard_t(3.0, 4000)), recorded(random.standard_normal(4000))
    search = Search(heavy, Gain, ["factor"])
    base = search.nominal()
    assert base.fit.noise["y"].freedom == pytest.approx(3.0, rel=0.35)
    other = replace(search, data=gaussian)
    again = other.refit(base)
    assert again.fit.noise["y"].freedom == base.fit.noise["y"].freedom
    renewed = other.renewed(again)
    assert renewed.fit.noise["y"].freedom == np.inf
    assert other.refit(renewed).fit.noise["y"].freedom == np.inf


def test_noise_that_makes_a_record_likely_does_not_lead_a_fit_away_from_it():
    """The slow part of the input acts twice as much as the fast one, of which innovations tell by
    themselves.
    """
    random = np.random.default_rng(3)
    time, u = 0.1 * np.arange(4000), np.cumsum(random.standard_normal(4000))
    y = u + uniform_filter1d(u, 201) + 0.01 * random.standard_normal(4000)
    search = Search(Dataset(time, {"u": u}, {"y": y}, frozenset()), Gain, ["factor"])
    base = search.nominal()
    least = float(np.linalg.norm(y - (u @ y) / (u @ u) * u))
    increments = float(np.diff(u) @ np.diff(y)) / float(np.diff(u) @ np.diff(u))
    assert np.linalg.norm(y - increments * u) > 1.4 * least
    assert np.linalg.norm(base.fit.residual["y"]) == pytest.approx(1.25 * least, rel=0.02)
    assert np.linalg.norm(search.trusted(base).fit.residual["y"]) < 1.02 * least


def test_a_delayed_sensor_shows_at_first_what_was_before_the_record():
    """A resistance and a capacitor in series, on paper; the current turns round as the record
    begins.
    """
    step, late, lead = 0.1, 5, 60
    current = np.where(np.arange(1060) % 120 < 60, 0.5, -0.5)
    voltage = 0.8 * current + np.concatenate([[0.0], np.cumsum(current[:-1])]) * step / 2.0
    shown = voltage[lead - late : -late] + 0.003 * np.random.default_rng(2).standard_normal(1000)
    data = Dataset(
        step * np.arange(1000), {"current": current[lead:]}, {"voltage": shown}, linear=False
    )
    search = Search(
        data, PpyActuator, ["R1", "C", "charge_start"], {"R1": 0.8, "R2": 1e12, "C": 2.0}
    )
    effects = [make(PpyActuator, "voltage") for make in (transport_delay, sensor_lag)]
    (first,) = select(search, effects).steps
    assert first.chosen.effect_name == "transport_delay(voltage)"
    assert (
        np.abs(first.chosen.fit.residual["voltage"]).max() < 0.02
    )  # else the first half second is off by 0.8 V


class Pair(Component):
    """A resistance, and a lag behind another."""

    name = "pair"
    R0 = Parameter(0.03, "ohm", min=1e-6, max=10.0, nominal=0.01)
    R1 = Parameter(0.02, "ohm", min=1e-6, max=10.0, nominal=0.01)
    T1 = Parameter(20.0, "s", min=1e-3, max=1e6)
    current = Input("A")
    relaxed = State("A", rate="relaxing")

    def relaxing(self):
        """Go to the current."""
        return (self.current - self.relaxed) / self.T1

    def drop(self):
        """Return the voltage of both."""
        return self.R0 * self.current + self.R1 * self.relaxed

    @Output("V")
    def voltage(self):
        """Return the voltage."""
        return self.drop()


def lagged(current, step, constant, start):
    """The exact first-order lag of a current that is held within every step."""
    values = [start]
    for held in current[:-1]:
        values.append(held + (values[-1] - held) * np.exp(-step / constant))
    return np.array(values)


@pytest.mark.parametrize(("start", "free"), [(4.0, True), (0.0, False)])
def test_what_a_model_lacks_moves_at_the_start_of_a_record_where_the_model_does(start, free):
    """A pair more, whose current at the start is what the other one had gone to, or nothing."""
    random = np.random.default_rng(3)
    step = 0.5
    current = np.repeat(random.uniform(-3.0, 3.0, 100), 20)
    clean = 0.03 * current + 0.02 * lagged(current, step, 25.0, 1.0)
    clean += 0.01 * lagged(current, step, 2.0, start)
    shown = clean + 1e-4 * random.standard_normal(len(clean))
    data = Dataset(step * np.arange(len(clean)), {"current": current}, {"voltage": shown})
    search = Search(data, Pair, ["R0", "R1", "T1", "relaxed_start"])
    more = extra_kelvin(Pair, "drop", "current", "second", 3.0, unit="V", nominal=0.05)
    (first,) = select(search, [more]).steps
    assert bool(first.chosen.candidate.starts) is free
    assert np.std(first.chosen.fit.residual["voltage"]) == pytest.approx(1e-4, rel=0.05)


def test_a_clock_of_an_effect_starts_with_the_record():
    """A drift that began before would be an offset as well."""
    time = 0.5 * np.arange(600)
    current = np.repeat(np.random.default_rng(3).uniform(-3.0, 3.0, 30), 20)
    shown = 0.03 * current + 0.02 * lagged(current, 0.5, 20.0, 1.0) + 1e-4 * time
    data = Dataset(time, {"current": current}, {"voltage": shown})
    search = Search(data, Pair, ["R0", "R1", "T1", "relaxed_start"])
    (first,) = select(search, [sensor_drift(Pair, "voltage")]).steps
    assert first.chosen.candidate.starts == ()


def test_a_constant_of_an_effect_is_no_longer_than_the_record():
    """A slow lag whose state may begin anywhere would be an offset."""
    data = Dataset(0.5 * np.arange(401), {"current": np.ones(401)}, {"voltage": np.ones(401)})
    search = Search(data, Pair, ["T1"])
    candidate = Candidate((), Pair).with_effect(
        extra_kelvin(Pair, "drop", "current", "second", 3.0, unit="V")
    )
    problem = search.problem(candidate, ["T1", "second_drop_time"], {})
    most = problem.values(problem.bounds()[1])
    assert most["second_drop_time"] == pytest.approx(200.0)
    assert most["T1"] == pytest.approx(1e6)  # that of a model may be known


class Deaf(Gain):
    """A gain, and a level that the record never comes to."""

    level = Parameter(5.0, "1", min=1.0, max=9.0, doc="beyond which it would level off")

    @Output("1")
    def y(self):
        """What comes out."""
        return minimum(self.factor * self.u, self.level)


def test_what_leaves_no_trace_is_not_searched_and_comes_back_at_the_end():
    data = recorded(np.random.default_rng(4).standard_normal(600))
    search = Search(data, Deaf, ["factor", "level"])
    base = search.nominal()
    assert base.problem.names == ["factor", "level"]
    kept, again = search.drop_insensitive(base)
    assert again.free_run.q.shape == again.fit.q.shape
    assert (list(kept.parameters), again.problem.names) == (["factor"], ["factor"])
    assert again.fit.values["factor"] == pytest.approx(base.fit.values["factor"], rel=1e-6)
    assert again.fit.parameters == base.fit.parameters - 1
    within = Search(data, Gain, ["factor"])
    assert within.drop_insensitive(within.nominal())[0] is within
    for holdout in (None, data):
        said = diagnose(Deaf, data, [], holdout=holdout)
        assert set(said.estimates) == {"factor", "level"}
        undetermined = [
            note.facts["names"] for note in said.notes if note.code is NoteCode.UNDETERMINED
        ]
        assert undetermined == [("level",)]


@pytest.mark.parametrize("spent", [True, False], ids=["no time left", "time enough"])
def test_an_extended_model_is_no_farther_from_the_record_than_the_one_below(spent):
    """A search whose time is spent where it begins leaves a drift of 10 mV/s that is not there."""
    search = Search(measured(5, 1.0), Cell, ["R0", "R1", "tau1", "relaxed_start"])
    base = search.nominal()
    (drift,) = [effect for effect in measurement_effects(Cell) if effect.id == "sensor_drift"]
    candidate = base.candidate.with_effect(drift)
    problem = search.problem(candidate, [*search.parameters, *candidate.parameters], {})
    problem.out_of_time = lambda: True
    begun = problem.position(problem.start | base.fit.values | {"voltage_drift": 1e-2})
    lost = FittedCandidate(candidate, problem, fit_prediction_error(problem, begun))
    assert lost.fit.values["voltage_drift"] == pytest.approx(1e-2)
    problem.out_of_time = lambda: spent
    found = search.trusted(lost, base)
    errors = [float(np.linalg.norm(model.fit.residual["voltage"])) for model in (found, base)]
    assert errors[0] <= 1.02 * errors[1]


def extended(fault):
    """A model with an effect that is not there, its fit worse by so much of BIC, and its base."""
    signal = np.random.default_rng(4).standard_normal(500)
    shown = 2.0 * signal + 0.1 * np.random.default_rng(5).standard_normal(500)
    data = Dataset(0.1 * np.arange(500), {"signal": signal}, {"shown": shown})
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    fitted = search.fit_from(base.candidate.with_effect(OFFSET), base)
    worse = replace(fitted, fit=replace(fitted.fit, deviance=fitted.fit.deviance + fault))
    return search, base, fitted, worse


def test_an_extended_model_scores_no_less_than_its_base_less_its_price():
    """It contains the base, so that it is as likely at rest; one parameter costs log(500)."""
    search, base, fitted, worse = extended(100.0)
    assert search.containing(fitted, base) is fitted
    assert worse.fit.bic > base.fit.bic + np.log(500)
    better = search.containing(worse, base)
    assert better.fit.bic <= base.fit.bic + np.log(500) + 1e-6
    assert better.candidate is worse.candidate


def test_a_search_that_leaves_an_extension_below_its_base_is_logged_as_a_fault(monkeypatch, caplog):
    search, base, _, worse = extended(100.0)
    monkeypatch.setattr(Search, "_again", lambda *given: worse)
    assert search.containing(worse, base).fit is worse.fit
    (logged,) = caplog.records
    assert logged.levelname == "WARNING"
    assert "force_offset" in logged.getMessage()
    caplog.clear()


def test_a_base_that_stands_in_noise_of_another_model_is_held_against_it_in_its_own(caplog):
    """A colour that another model left may make it likelier by hundreds; it is no better for it."""
    search, base, fitted, _ = extended(100.0)
    problem = copy(base.problem)
    problem.colour = {"shown": np.array([0.5])}
    elsewhere = replace(base, problem=problem, fit=replace(base.fit, deviance=-1e6))
    assert search.containing(fitted, elsewhere) is fitted
    assert not caplog.records


class Growing(Component):
    """It grows without bounds from where it starts."""

    name = "growing"
    rate = Parameter(1.0, "1/s", min=0.9, max=1.1)
    level = State("m", rate="growth", start=1.0, min=0.5)

    def growth(self):
        """In proportion."""
        return self.rate * self.level

    @Output("m")
    def shown(self):
        """As measured."""
        return self.level


def test_a_model_that_runs_away_is_refused_with_its_name():
    time = np.linspace(0.0, 300.0, 300)
    data = Dataset(time, {}, {"shown": np.sin(time)})
    with pytest.raises(UserError, match="growing cannot be simulated over the record from where"):
        Search(data, Growing, ["rate"]).nominal()


def test_a_slide_gives_no_sooner_than_samples_can_tell():
    """A tenth of the way between two samples, 0.02 s apart, at its typical velocity of 5 m/s."""
    slide = lag_effect(MASS, *DAMPER, "sliding", 0.1, "N", scale=5.0)
    time = 0.02 * np.arange(50)
    data = Dataset(time, {"force": np.sin(time)}, {"position": np.sin(time)})
    candidate = Candidate((), MASS).with_effect(slide)
    problem = Search(data, MASS, []).problem(candidate, candidate.parameters, {})
    way = candidate.parameters.index("damper_force_sliding_constant")
    low, _ = problem.bounds()
    assert problem.scales[way].value(low[way]) == pytest.approx(0.1 * 5.0 * 0.02)
