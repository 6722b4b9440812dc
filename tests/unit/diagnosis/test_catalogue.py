"""Claims: the effects of a catalogue are proposed, named, and one cause with laws alike."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.arrays import Array
from fmus.kit.generic import force_offset
from orchestration.diagnosis import Found, Shape, Term
from orchestration.diagnosis.catalogue import named_terms, usable_effects
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.conclude import conclude
from orchestration.diagnosis.courses import courses_of
from orchestration.diagnosis.extension import extended_component
from orchestration.diagnosis.fitting import Fit, Problem, StartPrior, nominal_point
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.screening import screen_of
from orchestration.diagnosis.search import search
from orchestration.diagnosis.subject import subject_of
from orchestration.diagnosis.terms import NamedTerm, Released
from orchestration.fmu import find_model
from orchestration.identify.fitting import Scale
from tests.support.diagnosed_tank import START, drawn, tank

SPREAD = np.array([0.5, 0.3])
RNG = np.random.default_rng(3)
WHITE, SEEN = RNG.standard_normal((300, 2)), RNG.standard_normal((200, 2))


def proposed() -> list:
    starts = (StartPrior(np.array([START]), np.ones(1)),)
    problem = Problem(tank(), (drawn(),), SPREAD, starts, substeps=4)
    point = nominal_point(problem)
    fitted = Fit(problem, (), point, (), 0.0, np.zeros((3, 3)))
    along = courses_of(fitted, problem.records, point.starts)
    assert along is not None
    return list(named_terms(along))


def test_the_response_at_null_is_that_of_small_runs() -> None:
    silting = [one for one in proposed() if one.term.effect == "silting"]
    assert len({one.term.constants for one in silting}) > 1, "several time constants are tried"
    base = drawn().outputs
    for one in silting:
        size = one.term.released[0].scale.size
        h = 1e-3
        moved = drawn(silt=h * size, time=one.term.constants[0]).outputs
        expected = (moved - base) / h
        gap = np.sqrt(np.mean(((one.response - expected) / SPREAD) ** 2))
        assert gap < 0.03
        assert np.sqrt(np.mean((one.response / SPREAD) ** 2)) == pytest.approx(1.0)


class Level(Component):
    """A tank of which the level is shown as it is."""

    name = "level"
    inflow = Input("1/s")
    opening = Parameter(1.0, "1/s", min=0.1, max=10.0)
    height = State("1", rate="filling", output=True)

    def filling(self):
        """Balance."""
        return self.inflow - self.outflow()

    @Output("1/s")
    def outflow(self):
        """As measured."""
        return self.opening * self.height


def test_effects_are_proposed_where_a_state_is_shown() -> None:
    """An offset of a balance is one of the level that it ends at, of which 1 - exp(-t) is there."""
    model = LawModel(Level, {"spring": force_offset(Level, "filling", unit="1/s")})
    time = 0.05 * np.arange(100)
    record = Record(time, np.ones((100, 1)), np.zeros((100, 2)), (False,))
    problem = Problem(model, (record,), np.ones(2), (StartPrior(np.zeros(1), np.ones(1)),))
    point = nominal_point(problem)
    fitted = Fit(problem, (), point, (), 0.0, np.zeros((2, 2)))
    along = courses_of(fitted, problem.records, point.starts)
    assert along is not None
    (one, *_) = named_terms(along)
    assert one.response.shape == (100, 2)
    settling = 1.0 - np.exp(-time)
    for response in one.response.T:
        assert response / response[-1] == pytest.approx(settling / settling[-1], abs=0.01)


def test_a_time_constant_is_no_shorter_than_a_tenth_of_a_step() -> None:
    step = float(np.median(np.diff(drawn().time)))
    lows = [one.low for n in proposed() for one in n.term.released if one.unit == "s"]
    assert lows
    assert min(lows) == pytest.approx(0.1 * step)


def test_an_effect_whose_response_vanishes_at_null_is_proposed_by_its_size() -> None:
    swirl = [one for one in proposed() if one.term.effect == "swirl"]
    assert swirl
    assert all(np.isfinite(one.response).all() for one in swirl)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_outputs_that_were_not_measured_do_not_hide_what_is_proposed() -> None:
    record = drawn(silt=0.4, noise=1e-3)
    outputs = record.outputs.copy()
    outputs[:, 1] = np.nan
    subject = subject_of(tank(), [replace(record, outputs=outputs)])
    assert subject is not None
    fitted = subject.base
    along = courses_of(fitted, fitted.problem.records, fitted.point.starts)
    assert along is not None
    screen = screen_of(along, named=True)
    value, _ = screen.propose(1)[0]
    assert value > 3.0


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search over a few laws beside the catalogue."""
    from orchestration.diagnosis import screening

    monkeypatch.setattr(screening, "_PLAIN", (Shape.LINEAR, Shape.CUBE))
    monkeypatch.setattr(screening, "_REMEMBERED", {})
    monkeypatch.setattr(screening, "_FACTORS", {})
    monkeypatch.setattr("orchestration.diagnosis.search._PIECES", (1,))
    monkeypatch.setattr("orchestration.diagnosis.search.replacements", lambda along, term: ())


@pytest.mark.slow
@pytest.mark.usefixtures("few")
def test_a_hidden_effect_is_named_with_its_size() -> None:
    subject = subject_of(tank(), [drawn(240, silt=0.4, time=5.0, noise=2e-3)])
    assert subject is not None
    found = search(subject)
    assert found is not None
    conclusion = conclude(found)
    assert conclusion.verdict == "cause"
    cause = conclusion.causes[0]
    assert cause.name == "silting"
    made = extended_component(cause.judged.fit)
    values = {p.name: p.start for p in made.layout.parameters}
    assert values["silt"] == pytest.approx(0.4, rel=0.1)
    assert values["silt_time"] == pytest.approx(5.0, rel=0.2)


def judged(errors: Array, *terms: Term) -> Judged:
    fit = SimpleNamespace(
        errors=(0.5 * WHITE,),
        terms=terms,
        misfit=0.5,
        distance=0.0,
        freedom=len(terms),
        explanations=len(terms),
        problem=SimpleNamespace(
            model=tank(), spread=np.ones(2), records=(SimpleNamespace(phases=None),)
        ),
    )
    return Judged(fit, errors, errors, errors, 0.0)


NAMED = NamedTerm("drained", "height", Shape.LINEAR, effect="swirl", family="swirl")
ELSEWHERE = Term("inlet", "inflow", Shape.CUBE)


SCALE = Scale(False, 1.0)
PLAIN = SimpleNamespace(
    errors=(WHITE,),
    terms=(),
    misfit=1.0,
    distance=0.0,
    freedom=0,
    explanations=0,
    problem=SimpleNamespace(
        model=SimpleNamespace(outputs=tank().outputs),
        spread=np.ones(2),
        records=(SimpleNamespace(outputs=WHITE, phases=None),),
    ),
)
BASE = Judged(PLAIN, SEEN, SEEN, SEEN, 0.0)
SUBJECT = SimpleNamespace(sizes=np.full(9, np.nan))  # nothing is measured that moves


def concluded(*fits: Judged):
    return conclude(Found(SUBJECT, BASE, fits))


def test_a_law_that_acts_like_an_effect_is_one_cause_with_it() -> None:
    alike = 0.5 * SEEN + 0.01 * RNG.standard_normal((200, 1))
    conclusion = concluded(judged(alike, ELSEWHERE), judged(0.5 * SEEN, NAMED))
    assert conclusion.verdict == "cause"
    assert [c.name for c in conclusion.causes] == ["swirl"]
    assert conclusion.causes[0].aliases == ("inlet(inflow)",)


def test_a_law_that_acts_otherwise_is_a_rival() -> None:
    other = 0.5 * RNG.permutation(SEEN)
    conclusion = concluded(judged(other, ELSEWHERE), judged(0.5 * SEEN, NAMED))
    assert {c.name for c in conclusion.causes} == {"swirl", "inlet(inflow)"}


def test_a_law_over_the_signal_of_an_effect_is_one_cause_with_it() -> None:
    other = 0.5 * RNG.permutation(SEEN)
    law = Term("drained", "height", Shape.ROOT)
    conclusion = concluded(judged(other, law), judged(0.5 * SEEN, NAMED))
    assert [c.name for c in conclusion.causes] == ["swirl"]


def test_an_effect_is_as_far_ahead_as_the_law_that_is_one_cause_with_it() -> None:
    """The law has a better shape; without its score the effect would be behind itself."""
    law = Term("drained", "height", Shape.ROOT)
    better, worse = judged(0.4 * SEEN, law), judged(0.42 * SEEN, NAMED)
    (cause,) = concluded(better, worse).causes
    assert cause.name == "swirl"
    assert cause.score == max(
        entry.score for entry in Found(SUBJECT, BASE, (better, worse)).compared()
    )


def test_an_effect_is_instant_without_a_time_constant() -> None:
    size, time = Released("size", "m", SCALE, 0.0, 1.0), Released("time", "s", SCALE, 0.0, 1.0)
    assert replace(NAMED, released=(size,)).is_instant
    assert not replace(NAMED, released=(size, time)).is_instant


def test_effects_of_random_numbers_or_discrete_states_are_none_of_a_free_run() -> None:
    usable = usable_effects(find_model("voice_coil_dma").cls)
    assert "coulomb_friction" in usable
    assert not {"bridge_noise", "clock_jitter", "winding_protection"} & usable.keys()
