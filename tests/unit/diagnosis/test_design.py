"""Claims: the designed experiment has in it what tells two causes apart, by as much as a least
squares fit to SciPy's responses leaves, and there is none for two that are one model.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import Component, Input, Output, Parameter, State, UserError
from fmus.kit.arrays import Array
from fmus.kit.registry import Excitation
from orchestration.diagnosis import (
    LawModel,
    Options,
    Record,
    Shape,
    Term,
    diagnose,
)
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import WEIGHTS
from orchestration.diagnosis.conclude import Conclusion
from orchestration.diagnosis.design import Design, design_experiment
from orchestration.diagnosis.fitting import Fit, Point, Problem, StartPrior
from orchestration.diagnosis.terms import Memory
from orchestration.experiment.design import menu
from orchestration.fmu.model import declared_model
from orchestration.records import Record as MeasuredRecord
from tests.support.ambiguous import DULL, HIDDEN, measured
from tests.support.ambiguous import TIME as DULL_TIME
from tests.support.measured import Measured

NOISE = 0.8
LAG = 0.1  # s
STEP, DURATION = 0.05, 100.0
TIME = STEP * np.arange(2001)
SLOW = np.sin(0.1 * TIME[:400])
RIG = Excitation({"u": (-1.0, 1.0)}, np.inf)
TEMPER = 3.0
GAIN, WORDS = 40.0, 2.0


class Gauge(Component):
    """An output in proportion to an input, and a lag of it that the output does not show."""

    name = "gauge"
    u = Input("V", doc="input")
    gain = Parameter(1.0, "1", min=0.01, max=100.0)
    lag = Parameter(LAG, "s", min=0.01, max=10.0)
    x = State("V", rate="following")

    def following(self):
        """First order."""
        return (self.u - self.x) / self.lag

    def shown(self):
        """In proportion."""
        return self.gain * self.u

    @Output("V")
    def y(self):
        """As seen."""
        return self.shown()


DIRECT = Term("shown", "u", Shape.LINEAR)
LAGGED = Term("shown", "x", Shape.LINEAR)
FADING = Term("shown", "u", Shape.LINEAR, Memory.FADING, (LAG,))


@cache
def gauge() -> LawModel:
    return LawModel(Gauge)


def fitted(term: Term, coefficient: float, gain: float, hold: Collection[str]) -> Fit:
    """Return a term fitted to a slow record; the alternating errors are as many as independent."""
    record = Record(TIME[:400], SLOW[:, np.newaxis], np.zeros((400, 1)), (False,))
    prior = StartPrior(np.zeros(1), np.array([0.1]))
    problem = Problem(gauge(), (record,), np.ones(1), (prior,), frozenset(hold))
    q = problem.mean + (np.log(gain) if len(problem.free) else 0.0)
    point = Point(q, term.values(coefficient), (np.zeros(1),))
    errors = NOISE * (-1.0) ** np.arange(400)[:, np.newaxis]
    return Fit(problem, (term,), point, (errors,), 0.0, np.eye(len(q) + len(point.values) + 1))


def designed(
    *fits: Fit, verdict: str = "ambiguous", rig: Excitation = RIG, unseen: float = 1.0
) -> Design:
    """Return a design for causes that leave so many times the noise where nothing was fitted."""
    causes = []
    for fit in fits:
        judged = SimpleNamespace(fit=fit, beyond=unseen * fit.errors[0][:100], words=WORDS)
        (term,) = fit.terms
        gained = SimpleNamespace(gain=GAIN)
        causes.append(Cause(*term.cause, 0.45, judged, fit.terms, gained, 0.0, frozenset()))
    base = SimpleNamespace(fit=fits[0])
    subject = SimpleNamespace(observer=None, problem=fits[0].problem)
    found = SimpleNamespace(subject=subject, base=base, temper=TEMPER)
    conclusion = Conclusion(verdict, tuple(causes), 0.1, base)
    return design_experiment(found, conclusion, {"u": SLOW}, TIME, rig)


def lagged(u: Array) -> Array:
    """Return the lag from rest of an input that is held."""
    decay = np.exp(-STEP / LAG)
    return lfilter([0.0, 1.0 - decay], [1.0, -decay], u)


def left(u: Array, noise: float = NOISE) -> float:
    """Return what a fit leaves of ``x / 2`` against ``u / 2`` on top of u, with its prior, nats.

    By the slow record, and a start state within 0.1 V.
    """
    columns = np.column_stack([lagged(u), 0.05 * np.exp(-TIME / LAG), u]) / noise
    known = np.zeros((800, 3))
    known[:400, 0], known[400:, 2] = lagged(SLOW) / NOISE, SLOW / NOISE
    rows = np.vstack([columns, known, np.diag([0.1, 1.0, 0.1])])
    target = np.concatenate([0.5 * (lagged(u) - u) / noise, np.zeros(803)])
    rest = target - rows @ np.linalg.lstsq(rows, target, rcond=None)[0]
    return 0.5 * float(rest @ rest)


def expected(evidence: float) -> dict[str, float]:
    """Return the probability of each if it is true; the other one is the model without terms.

    By what a likelihood gains whose noise is what is left, of 2000 independent samples.
    """
    lead = 1000.0 * np.log1p(evidence / 1000.0)
    share = 1.0 / (1.0 + np.exp(-evidence / TEMPER))
    weights = WEIGHTS.confidence
    reached = {}
    for name, gain in (("shown(x)", GAIN), ("shown(u)", GAIN + lead)):
        odds = weights["constant"] + weights["share"] * share + weights["words"] * WORDS
        odds += weights["margin"] * min(lead / (gain + 3.0 * TEMPER), 1.0)
        reached[name] = 1.0 / (1.0 + np.exp(-odds))
    return reached


def test_causes_that_differ_above_a_frequency_get_the_stimulus_with_most_of_it() -> None:
    held = ("gain", "lag")
    experiment = designed(fitted(LAGGED, 0.5, 1.0, held), fitted(DIRECT, 0.5, 1.0, held)).experiment
    shapes = menu.shapes_between(
        -1.0, 1.0, 0.0, duration=DURATION, step=STEP, shortest=2.0 * STEP, seed=1
    )
    by_shape = [left(shape.values(TIME)) for shape in shapes]
    best = int(np.argmax(by_shape))
    assert experiment.stimuli == {"u": shapes[best]}
    assert [e.bic for e in experiment.expected] == pytest.approx(
        2 * [2.0 * by_shape[best]], rel=0.02
    )
    assert experiment.probabilities == pytest.approx(expected(by_shape[best]), rel=1e-3)
    above = [np.sum((shape.values(TIME) - lagged(shape.values(TIME))) ** 2) for shape in shapes]
    assert above[best] == max(above)


def test_what_errs_more_where_nothing_was_fitted_tells_less() -> None:
    held = ("gain", "lag")
    fits = fitted(LAGGED, 0.5, 1.0, held), fitted(DIRECT, 0.5, 1.0, held)
    experiment = designed(*fits, unseen=1.5).experiment
    evidence = left(experiment.stimuli["u"].values(TIME), 1.5 * NOISE)
    assert experiment.expected[0].bic == pytest.approx(2.0 * evidence, rel=0.02)


def test_one_model_in_two_parametrisations_has_no_experiment() -> None:
    """``u + x / 2`` is ``3/2 u - (u - x) / 2``."""
    held = ("lag",)
    design = designed(fitted(LAGGED, 0.5, 1.0, held), fitted(FADING, -0.5, 1.5, held))
    assert design.experiment is None
    assert design.is_futile
    assert "tells shown(x), shown(u) apart: the evidence would be 0.0 nat at most" in design.reason


def test_what_a_refit_would_take_up_is_no_evidence() -> None:
    """With a free gain, a slow record does not tell the part of the lag."""
    held = ("lag",)
    design = designed(fitted(LAGGED, 0.5, 1.0, held), fitted(DIRECT, 0.5, 1.0, held))
    assert design.experiment is None
    assert design.reason


def test_a_stimulus_keeps_to_the_rig() -> None:
    held = ("gain", "lag")
    rig = Excitation({"u": (-0.5, 4.0)}, 1.0)
    fits = fitted(LAGGED, 0.5, 1.0, held), fitted(DIRECT, 0.5, 1.0, held)
    stimulus = designed(*fits, rig=rig).experiment.stimuli["u"]
    values = stimulus.values(TIME)
    assert (values.min(), values.max()) == (-0.5, 4.0)
    stays = np.diff(np.flatnonzero(np.diff(values)))
    assert STEP * stays.min() > 0.5 - STEP


def test_where_nothing_is_to_be_told_apart_nothing_is_designed() -> None:
    held = ("gain", "lag")
    fits = fitted(LAGGED, 0.5, 1.0, held), fitted(DIRECT, 0.5, 1.0, held)
    assert designed(*fits, verdict="cause") == Design()
    assert designed(fits[0]) == Design()
    still = designed(*fits, rig=Excitation({"u": (1.0, 1.0)}, 1.0))
    assert still == Design(reason="no experiment is designed: no input of the model may move")
    with pytest.raises(UserError, match="limits of w: there is no such input; there are u"):
        designed(*fits, rig=Excitation({"w": (0.0, 1.0)}, 1.0))


@pytest.mark.slow
def test_what_a_dull_record_leaves_ambiguous_the_experiment_names() -> None:
    """The emulated rig, which shares no code with the models, makes the experiment."""
    actuator = declared_model("ppy_actuator")
    options = Options(
        effects=list(HIDDEN),
        excitation=Excitation({"current": (-1.3, 1.3), "force": (0.0, 3.0)}, 30.0),
    )
    dull = as_record(measured("diffusion", DULL_TIME, DULL), "dull.csv")
    first = diagnose([dull], actuator, options=options)
    assert first.verdict == "ambiguous"
    assert min(first.experiment.probabilities.values()) > 0.9
    inputs = {name: one.values(DULL_TIME) for name, one in first.experiment.stimuli.items()}
    made = as_record(measured("diffusion", DULL_TIME, inputs, seed=2), "made.csv")
    both = diagnose([dull, made], actuator, options=options)
    assert (both.verdict, both.causes[0].name) == ("cause", "diffusion")


def as_record(data: Measured, name: str) -> MeasuredRecord:
    signals = {**data.inputs, **data.outputs}
    units = {"current": "A", "force": "N", "voltage": "V", "displacement": "m"}
    return MeasuredRecord(data.time, signals, {n: units[n] for n in signals}, Path(name))
