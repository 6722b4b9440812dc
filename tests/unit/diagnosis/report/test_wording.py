"""Claims: the answer is in percent, an open interval says so, and every verdict has a next step."""

from __future__ import annotations

import re
from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Parameter, Size
from fmus.kit.effects import make_effect
from orchestration.diagnosis.remainder import Remainder
from orchestration.diagnosis.report import wording
from orchestration.diagnosis.terms import NamedTerm, Shape
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import in_shell
from tests.support.oscillator import (
    diagnosis_without_terms,
    oscillator_record,
    telling_apart,
    with_group,
)
from tests.support.oscillator_model import Oscillator


def test_headline_gives_each_cause_its_percent_and_the_rest(dry):
    ambiguous = with_group(dry, "ambiguous", 0.82, 0.15)
    assert wording.headline(ambiguous) == (
        "82 % friction over velocity; 15 % friction over elongation; 3 % something else"
    )
    step = wording.next_step(ambiguous)
    assert "velocity and elongation do not move together, such" in step
    assert step.endswith("and diagnose both records together.")
    several = replace(ambiguous, records=2 * ambiguous.records)
    assert wording.next_step(several).endswith("and diagnose all records together.")


@pytest.mark.parametrize(
    ("value", "high", "ending"),
    [(100.0, 100.4, ", at its bound 100 N*s/m"), (100.0, 100.0, "100"), (99.9, 100.3, "100.3")],
)
def test_a_value_at_its_bound_says_so_if_its_interval_goes_on(value, high, ending, dry):
    estimate = Estimate(value, 1.0, (99.0, high), "N*s/m")
    (damping,) = (p for p in dry.subject.problem.model.parameters if p.name == "damping")
    bounded = copy(damping)
    bounded.max = 100.0
    model = SimpleNamespace(parameters=[bounded])
    problem = SimpleNamespace(model=model)
    diagnosis = SimpleNamespace(subject=SimpleNamespace(problem=problem))
    assert (
        wording.interval(diagnosis, "damping", estimate)
        .removesuffix(" N*s/m")
        .endswith(ending.removesuffix(" N*s/m"))
    )


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_a_headline_has_two_lines_at_most(dry, count, monkeypatch):
    """Of 62 characters each, as a page of 64 rem has; all causes are in the table below."""
    cause = with_group(dry, "ambiguous", 0.5, 0.1).causes[0]
    group = tuple(replace(cause, probability=0.9 / count) for _ in range(count))
    several = replace(dry, conclusion=replace(dry.conclusion, verdict="ambiguous", causes=group))
    monkeypatch.setattr(wording, "cause_with_size", lambda *_: "strain: " + 80 * "x")
    monkeypatch.setattr(wording, "cause_text", lambda *_: "friction over velocity")
    said = wording.headline(several)
    assert len(said) <= 124
    assert said.startswith(f"{90.0 / count:.0f} % friction over velocity")
    assert count < 4 or "others; 10 % something else" in said


def test_an_effect_says_how_large_it_is_and_a_law_does_not(dry, monkeypatch):
    """A strain that levels off at ``c ** -0.5``, of which 0.16 lies within 0.1 and 0.25."""
    levelling = make_effect(
        "Levelling",
        {"c": Parameter(0.0, "1/C^2", min=0.0)},
        id="levelling",
        neutral="c",
        sizes=(Size("beyond {}", ("c",), "C", lambda c: c**-0.5),),
    )
    term = NamedTerm("strain", "charge", Shape.LINEAR, effect="levelling", title="Levelling strain")
    model = SimpleNamespace(effects={"levelling": levelling}, cls=Oscillator)
    subject = SimpleNamespace(problem=SimpleNamespace(model=model))
    cause = SimpleNamespace(parts=(term,), terms=(term,), judged=SimpleNamespace(fit=None))
    fitted = {"c": Estimate(0.16, 0.0, (0.1, 0.25), "1/C^2")}
    monkeypatch.setattr(wording, "estimates", lambda fit, terms: fitted)
    text = wording.cause_with_size(SimpleNamespace(subject=subject, cls=Oscillator), cause)
    assert text == "levelling strain: beyond 2.5 C (95 %: 2.0 … 3.2 C)"
    assert wording.cause_with_size(dry, dry.causes[0]) == wording.cause_text(dry, dry.causes[0])


def test_the_next_step_is_the_experiment_with_what_it_should_tell(dry):
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    for verdict, second in (("ambiguous", 0.35), ("unexplained", 0.2)):
        with in_shell():
            step = wording.next_step(
                replace(with_group(dry, verdict, 0.6, second), experiment=experiment)
            )
        assert "make the experiment that --experiment next.toml writes" in step
        assert "> 99 % if it is friction(velocity), 60 % if it is friction(elongation)." in step


def test_an_experiment_between_causes_that_gain_nothing_is_not_promised_to_tell(dry):
    """They are likely by their shares, and explain too little."""
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    one = replace(with_group(dry, "unexplained", 0.83, 0.14), experiment=experiment)
    step = wording.next_step(one)
    assert step.endswith("What is missing is not among what was tried.")
    assert "With the experiment" not in step


def test_where_no_experiment_tells_causes_apart_another_signal_does(dry):
    note = ("futile_experiment", "", "no experiment tells them apart")
    one = replace(with_group(dry, "ambiguous", 0.6, 0.35), notes=(note,))
    assert wording.next_step(one).startswith("record another signal as well")


def test_no_headline_is_certain():
    assert wording.percent(0.9999) == "> 99 %"
    assert wording.percent(1e-9) == "< 1 %"
    assert wording.percent(0.456) == "46 %"


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        ((1.0, 2.0), "1 … 2 kg"),
        ((1.0, float("inf")), "at least 1 kg"),
        ((0.0, 2.0), "0 … 2 kg"),
        ((float("-inf"), 2.0), "at most 2 kg"),
        ((0.0, float("inf")), "not determined"),
    ],
)
def test_an_open_interval_says_at_least(dry, interval, words):
    estimate = replace(dry.parameters["mass"], interval=interval)
    assert wording.interval(dry, "mass", estimate) == words


def test_a_misread_file_is_to_be_corrected_and_diagnosed_again(flipped):
    assert flipped.verdict == "cause"
    assert "force has the opposite sign in oscillator_1.csv" in wording.headline(flipped)
    with in_shell():
        step = wording.next_step(flipped)
    assert step.startswith("multiply force by -1 (oscillator_1.csv), and diagnose it again;")
    assert "--fmu fitted.fmu" in step
    doubtful = replace(flipped, conclusion=replace(flipped.conclusion, verdict="ambiguous"))
    assert wording.next_step(doubtful).startswith("check file and wiring; if it is so, multiply")


@pytest.mark.parametrize(
    ("verdict", "step"),
    [
        ("consistent", "use the model as it is, within"),
        ("recalibrate", "use the model with mass="),
        ("cause", "build the extended model with --fmu extended.fmu"),
        ("ambiguous", "record a run in which velocity reaches other levels and rates"),
        ("unexplained", "look where measured minus simulated of position is largest"),
    ],
)
def test_every_verdict_has_a_next_step(dry, verdict, step):
    one = replace(dry)
    one.__dict__.update(verdict=verdict, changed=("mass",))
    with in_shell():
        assert wording.next_step(one).startswith(step)


@pytest.mark.parametrize(
    ("verdict", "written", "step"),
    [
        ("cause", {"fmu": "x.fmu"}, "test the extended model on a record that it has not seen"),
        ("cause", {"ssp": "x.ssp"}, "compare the corrected system, x.ssp, with a record"),
        ("recalibrate", {"fmu": "x.fmu"}, "use the model with mass=1.0: x.fmu has them."),
        ("ambiguous", {"experiment": "x.toml"}, "make the experiment x.toml, and diagnose both"),
    ],
)
def test_what_was_just_written_is_not_advised(dry, verdict, written, step):
    one = replace(dry, experiment=telling_apart("friction(velocity)", "friction(elongation)"))
    one.__dict__.update(verdict=verdict, changed=("mass",))
    with in_shell():
        told = wording.next_step(one, written)
    told = re.sub(r"mass=[\d.]+", "mass=1.0", told)
    assert told.startswith(step)
    assert not re.search("--(fmu|ssp|experiment) ", told)
    (name,) = written.values()
    assert name in told


def test_an_answer_that_was_held_against_another_record_asks_for_no_other(dry):
    one = replace(dry, holdouts=dry.records)
    with in_shell():
        assert wording.next_step(one) == "build the extended model with --fmu extended.fmu."
        assert wording.next_step(one, {"fmu": "x.fmu"}) == "use the extended model, x.fmu."


@pytest.mark.parametrize(
    ("correlation", "pairs", "widths", "end"),
    [
        (0.9, 400, 3.0, "slow (neighbouring samples correlate by 0.90): more than noise."),
        (0.02, 400, 3.0, "fast (neighbouring samples correlate by 0.02)."),
        (0.9, 400, 1.2, "slow (neighbouring samples correlate by 0.90)."),
        (1.0, 8, 3.0, "slow or fast (8 pairs of neighbouring samples do not tell)."),
    ],
)
def test_what_is_left_is_said_to_be_more_than_noise_if_it_is(correlation, pairs, widths, end):
    text = wording.remainder_sentence(
        Remainder("position", 0.05, widths, {"correlation": correlation}, pairs)
    )
    assert text == f"Left in position: 5 % of its standard deviation, {widths} noise widths, {end}"


def test_a_run_that_starts_elsewhere_is_to_be_started_there():
    """Of a mass that moves already, at the velocity that its position says."""
    whole = oscillator_record(1, noise=1e-5)
    signals = {name: values[200:] for name, values in whole.signals.items()}
    record = replace(whole, time=whole.time[:-200], signals=signals)
    moving = diagnosis_without_terms(record)
    assert (moving.verdict, moving.causes) == ("recalibrate", ())
    assert wording.headline(moving) == "the laws hold with other values of the start states"
    with in_shell():
        step = wording.next_step(moving)
    velocity = float(re.search(r"--set velocity_start=(\S+?),? ", step).group(1))
    slope = np.gradient(whole.signals["position"], whole.time)[200]
    assert velocity == pytest.approx(slope, rel=0.05)
    assert step.endswith("or begin a record at rest; --fmu fitted.fmu builds it so.")


def test_what_is_more_than_noise_is_said_before_what_is_larger(dry):
    noise = Remainder("position", 0.3, 1.0, {"correlation": 0.0}, 400)
    slow = Remainder("force", 0.1, 4.0, {"correlation": 0.9}, 400)
    one = replace(dry)
    one.__dict__.update(remainders=(noise, slow))
    assert "Left in force: 10 %" in wording.support(one)
    assert "It does not explain all of force yet." in wording.next_step(one)
    one.__dict__.update(verdict="consistent")
    assert "within 30 % of position" in wording._NEXT["consistent"](one, {})


@pytest.mark.parametrize("verdict", ["consistent", "recalibrate", "cause", "ambiguous"])
@pytest.mark.parametrize("code", ["copied", "moves_ahead"])
def test_a_file_that_cannot_be_believed_is_the_next_step(dry, verdict, code):
    one = replace(dry)
    one.__dict__.update(verdict=verdict, changed=("mass",))
    doubt, harmless = (code, "force", "force: is no force"), ("quantised", "force", "coarse")
    plain = wording.next_step(one)
    one.__dict__["notes"] = (harmless,)
    assert wording.next_step(one) == plain
    one.__dict__["notes"] = (harmless, doubt)
    step = wording.next_step(one)
    assert step.startswith("put the record right, and diagnose it again: force: is no force.")
