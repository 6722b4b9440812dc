"""Claims: records become what the kernel takes, and the verdict says what is left beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, UserError
from fmus.kit.registry import Excitation
from orchestration.diagnosis import (
    Found,
    Options,
    Subject,
    diagnose,
    engine,
    fit,
    nominal_point,
    weights_of,
)
from orchestration.diagnosis import Record as KernelRecord
from orchestration.diagnosis.conclude import Conclusion
from orchestration.diagnosis.options import Deadline
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.terms import Memory
from orchestration.fmu.model import declared_model_of
from orchestration.records import Record
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record, with_group
from tests.support.oscillator_model import Oscillator

MODEL = declared_model_of(Oscillator)


class Counter(Component):
    """Counts samples."""

    name = "counter"
    count = Discrete("1", update="next_count", period=1.0)

    def next_count(self):
        """One more."""
        return self.count + 1.0

    @Output("1")
    def shown(self):
        """The count."""
        return self.count


def test_dry_friction_is_the_cause_with_the_size_that_was_hidden():
    diagnosis = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,), (CUBE,))
    assert diagnosis.verdict == "cause"
    assert [cause.name for cause in diagnosis.causes] == ["friction(velocity)"]
    low, high = diagnosis.parameters["friction_of_velocity"].interval
    assert low < 1.5 < high
    assert high - low < 0.5
    before = diagnosis.errors(diagnosis.found.base)["position"]
    after = diagnosis.errors(diagnosis.final)["position"]
    assert after < 0.1 * before


@pytest.mark.slow
def test_a_search_over_all_terms_finds_the_friction():
    diagnosis = diagnose([oscillator_record(1, dry=1.5)], MODEL, [oscillator_record(2, dry=1.5)])
    assert diagnosis.verdict == "cause"
    assert diagnosis.causes[0].name == "friction(velocity)"


def joint_record(seed: int) -> Record:
    """Return a record of a load that follows a shaft at ±13.1 mrad, over some 20 rad."""
    rng = np.random.default_rng(seed)
    time = 0.02 * np.arange(800)
    drive = np.repeat(rng.uniform(-12.0, 12.0, 800), rng.integers(5, 60, 800))[:800]
    shaft = np.append(0.0, np.cumsum(1.04 * 0.02 * drive[:-1]))
    load, place = np.zeros(800), 0.0
    for k, angle in enumerate(shaft):
        place = min(max(place, angle - 0.0131), angle + 0.0131)
        load[k] = place
    load += 3.5e-4 * rng.standard_normal(800)
    values, units = {"drive": drive, "load_angle": load}, {"drive": "rad/s", "load_angle": "rad"}
    return Record(time, values, units, Path(f"joint{seed}.csv"), [])


class Joint(Component):
    """A shaft that turns as it is driven, and the load on it."""

    name = "joint"
    ratio = Parameter(1.0, "1", min=0.1, max=10.0)
    drive = Input("rad/s", nominal=10.0)
    angle = State("rad", rate="speed", nominal=10.0)

    def speed(self):
        """Of the shaft."""
        return self.ratio * self.drive

    def load_position(self):
        """Of the load, which is that of the shaft."""
        return self.angle

    @Output("rad", nominal=10.0)
    def load_angle(self):
        """Angle of the load."""
        return self.load_position()


@pytest.mark.slow
def test_the_play_of_a_joint_that_turns_many_times_is_named_with_its_width():
    """A thousandth of the angle, it is no smaller for the error that it makes."""
    diagnosis = diagnose([joint_record(1), joint_record(2)], declared_model_of(Joint))
    assert diagnosis.verdict == "cause"
    (lead, *_) = diagnosis.causes[0].parts
    assert (lead.name, lead.memory) == ("load_position(angle)", Memory.BACKLASH)
    way = diagnosis.parameters["load_position_of_angle_backlash_way"]
    assert way.value == pytest.approx(0.0131, rel=0.05)
    assert diagnosis.parameters["load_position_of_angle_backlash"].value == pytest.approx(
        -1.0, abs=0.05
    )


def test_another_damping_is_no_cause():
    diagnosis = diagnosis_with(oscillator_record(1, damping=1.1), (DRY,))
    assert diagnosis.verdict == "recalibrate"
    assert diagnosis.changed == ("damping",)
    low, high = diagnosis.parameters["damping"].interval
    assert low < 1.1 < high


def test_the_same_plant_is_consistent():
    diagnosis = diagnosis_with(oscillator_record(1), (DRY,), (CUBE,))
    assert diagnosis.verdict == "consistent"
    assert diagnosis.causes == ()
    assert diagnosis.terms == {}


def test_a_large_slow_error_is_never_consistent():
    record = oscillator_record(1)
    wave = 0.6 * np.std(record.signals["position"]) * np.sin(3.0 * record.time)
    signals = record.signals | {"position": record.signals["position"] + wave}
    diagnosis = diagnosis_with(replace(record, signals=signals))
    assert diagnosis.verdict == "unexplained"
    (left,) = diagnosis.remainders
    assert left.pace == "slow"
    assert left.share > 0.15


def test_slow_noise_of_a_record_that_rests_is_consistent():
    """It is five times what the output moves there, and a twentieth of what it moved before."""
    diagnosis = diagnosis_with(oscillator_record(1), (DRY,))
    found = diagnosis.found
    slow = np.cumsum(np.random.default_rng(2).standard_normal(len(found.base.measuring)))
    slow *= 0.05 / np.sqrt(np.mean(slow**2))
    base = replace(found.base, measuring=slow[:, np.newaxis])
    (one,) = found.subject.left_out
    rest = replace(one, record=replace(one.record, outputs=0.01 * one.record.outputs))
    subject = replace(found.subject, left_out=(rest,))
    resting = replace(diagnosis, found=replace(found, subject=subject, base=base))
    assert resting.remainders[0].share > 1.0
    assert resting.remainders[0].pace == "slow"
    assert resting.verdict == "consistent"


@pytest.fixture
def without_search(monkeypatch):
    """Fit the model as it is, and nothing else."""
    monkeypatch.setattr(
        engine, "search", lambda subject, *_, **__: Found(subject, subject.judge(subject.base))
    )


def _with_gap(record: Record, after: int) -> Record:
    time = record.time + np.where(np.arange(record.time.size) >= after, 100.0, 0.0)
    return replace(record, time=time)


@pytest.mark.usefixtures("without_search")
def test_a_gap_makes_two_records_and_a_note():
    diagnosis = diagnose([_with_gap(oscillator_record(1, samples=80), 35)], MODEL)
    labels = [record.label for record in diagnosis.subject.problem.records]
    assert labels == ["oscillator_1.1", "oscillator_1.2"]
    assert [code for code, _, _ in diagnosis.notes] == ["gaps"]
    lengths = [one.record.time.size for one in diagnosis.subject.left_out]
    assert lengths == [35, 45]
    assert {"velocity_start@oscillator_1.1", "velocity_start@oscillator_1.2"} < {
        *diagnosis.parameters
    }


@pytest.mark.usefixtures("without_search")
def test_an_absent_input_stands_at_its_start_value():
    record = oscillator_record(1, samples=60)
    free = replace(record, signals={"position": 0.1 * np.cos(4.4 * record.time)})
    diagnosis = diagnose([free], MODEL)
    assert not diagnosis.subject.problem.records[0].inputs.any()
    noted = {(code, subject) for code, subject, _ in diagnosis.notes}
    short = ("short", "oscillator")  # it hardly decays
    assert noted == {("absent_input", "force"), ("free_response", "oscillator_1"), short}


@pytest.mark.usefixtures("without_search")
def test_an_input_that_is_given_is_constant():
    record = oscillator_record(1, samples=60)
    free = replace(record, signals={"position": 0.1 * np.cos(4.4 * record.time)})
    given = diagnose([free], MODEL, options=Options(given={"force": 0.5}))
    assert (given.subject.problem.records[0].inputs == 0.5).all()
    assert [code for code, _, _ in given.notes] == ["free_response", "short"]


@pytest.mark.usefixtures("without_search")
def test_a_clock_begins_with_its_record_and_runs_on_over_a_gap():
    time = np.concatenate([np.arange(20.0), 120.5 + np.arange(30.0)]) + 7.0
    record = Record(time, {"shown": np.ceil(time - 7.0)}, {"shown": "1"}, Path("c.csv"))
    diagnosis = diagnose([record], declared_model_of(Counter))
    assert [one.begin for one in diagnosis.subject.problem.records] == [0.0, -120.5]


def test_a_model_that_cannot_run_is_refused_in_one_line():
    record = Record(np.arange(50.0), {"shown": np.arange(50.0)}, {"shown": "1"}, Path("c.csv"))
    rare = replace(record, time=4000.0 * record.time)
    with pytest.raises(UserError, match=r"counter: 4000 sample instants .* 1000 are allowed"):
        diagnose([rare], declared_model_of(Counter))
    without = replace(MODEL, cls=None, notes=("motor.fmu: its equations are unknown",))
    with pytest.raises(UserError, match=r"motor.fmu: its equations are unknown, so that"):
        diagnose([record], without)


def test_a_record_without_outputs_is_refused():
    record = oscillator_record(1, samples=50)
    only = replace(record, signals={"force": record.signals["force"]})
    with pytest.raises(UserError, match="oscillator: no record has any of position"):
        diagnose([only], MODEL)
    with pytest.raises(UserError, match="no parameter named 'mas'"):
        diagnose([record], MODEL, options=Options(hold=["mas"]))


@pytest.mark.usefixtures("without_search")
def test_a_record_is_refused_by_its_information_alone() -> None:
    """26 samples tell three parameters and two start states; three samples tell three of them."""
    free = oscillator_record(1, samples=700)

    def thinned(step: int, count: int) -> Record:
        chosen = slice(0, step * count, step)
        signals = {name: values[chosen] for name, values in free.signals.items()}
        return replace(free, time=free.time[chosen], signals=signals)

    diagnosis = diagnose([thinned(10, 26)], MODEL)
    assert diagnosis.subject.samples == 17
    with pytest.raises(UserError, match=r"oscillator_1.csv: 3 measured values are fitted.*hold"):
        diagnose([thinned(25, 5)], MODEL)


def test_no_terms_are_judged_that_take_more_than_the_record_tells() -> None:
    """Of seven values that are fitted three or more tell the parameters."""
    diagnosis = diagnosis_with(oscillator_record(1, samples=40))
    subject = diagnosis.subject
    few = replace(subject, problem=replace(subject.problem, records=(_first(subject, 7),)))
    weights = weights_of(subject.base.errors)
    terms = (DRY, CUBE, replace(DRY, signal="elongation"))
    fitted = fit(subject.problem, terms, [nominal_point(subject.problem, terms)], weights)
    assert subject.judge(fitted) is not None
    assert few.rank >= 2
    assert few.judge(fitted) is None


def _first(subject: Subject, count: int) -> KernelRecord:
    return subject.problem.records[0].part(0, count)


def test_without_effects_and_laws_only_the_parameters_are_fitted():
    """Even of a plant with dry friction, whose error is then left and said."""
    options = Options(effects=[], laws=False)
    diagnosis = diagnose([oscillator_record(1, dry=1.5)], MODEL, options=options)
    assert not diagnosis.found.fits
    assert diagnosis.causes == ()
    right = diagnose([oscillator_record(1, damping=1.1)], MODEL, options=options)
    assert (right.verdict, right.changed) == ("recalibrate", ("damping",))


@pytest.mark.usefixtures("without_search")
@pytest.mark.parametrize("interpolate", [False, True])
def test_inputs_are_between_samples_as_the_user_says(interpolate):
    options = Options(interpolate=interpolate)
    diagnosis = diagnose([oscillator_record(1, samples=80)], MODEL, options=options)
    assert diagnosis.subject.problem.records[0].smooth == (interpolate,)


@pytest.mark.usefixtures("without_search")
def test_only_parameters_that_are_to_be_fitted_move():
    record = oscillator_record(1, damping=1.1)
    diagnosis = diagnose([record], MODEL, options=Options(fit=["damping"]))
    fitted = diagnosis.parameters
    assert {"mass", "stiffness"}.isdisjoint(fitted)
    low, high = fitted["damping"].interval
    assert low < 1.1 < high


def test_a_search_without_time_has_no_fits_and_a_note():
    options = Options(time=0.0)
    diagnosis = diagnose([oscillator_record(1, samples=100)], MODEL, options=options)
    assert not diagnosis.found.fits
    (note,) = diagnosis.notes
    assert note[0] == "time"
    assert "time is up after 0 s of processor time" in note[2]


def test_a_record_of_which_the_beginning_alone_is_used_is_noted():
    found = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,)).found
    (record,) = found.subject.problem.records
    end = found.subject.beginnings[0]
    longer = replace(record, time=np.append(record.time, 3.0 * end), label="long")
    ((code, label, text),) = engine._cut_off(found.subject, [longer])
    assert (code, label) == ("beginning", "long")
    assert f"first {end:.6g} s of {3.0 * end:.6g} s" in text
    assert not [*engine._cut_off(found.subject, [replace(record, time=np.array([0.0, end]))])]


@pytest.mark.usefixtures("without_search")
def test_a_clock_whose_noise_is_left_out_is_noted():
    record = oscillator_record(1, samples=120)
    step = np.diff(record.time).mean()
    late = 0.4 * step * np.random.default_rng(0).uniform(-1.0, 1.0, record.time.size)
    diagnosis = diagnose([replace(record, time=record.time + late)], MODEL)
    ((code, column, text),) = diagnosis.notes
    assert (code, column) == ("denoised", "time")
    assert "its steps are taken to be even" in text
    assert not diagnose([record], MODEL).notes


def test_single_values_that_are_left_out_are_counted():
    subject = diagnosis_with(oscillator_record(1, dry=1.5), (DRY,)).found.subject
    problem = subject.problem
    spoilt = [replace(record, denoised=("position",) * 3) for record in problem.records]
    read = replace(subject, problem=replace(problem, records=tuple(spoilt)), left_out=())
    ((_, column, text),) = engine._denoised(read)
    assert column == "position"
    assert text.endswith("far from those beside them, which are left out: 3")


def test_an_experiment_is_as_long_as_the_longest_record_within_its_range():
    long, short = oscillator_record(1, dry=1.5), oscillator_record(2, samples=300)
    dry = diagnosis_with(long, (DRY,))
    group = with_group(dry, "ambiguous", 0.5, 0.45).conclusion
    designed = engine._designed(dry.found, group, [short, long], Options())
    experiment = designed.experiment
    assert experiment.duration == pytest.approx(long.time[-1])
    assert experiment.step == pytest.approx(0.02)
    force = long.signals["force"]
    assert experiment.limits == {"force": (force.min(), force.max())}
    given = engine._designed(dry.found, group, [long], Options(given={"force": 0.0}))
    assert given.notes == [
        ("no_experiment", "", "no experiment is designed: no input of the model may move")
    ]
    held = engine._designed(dry.found, group, [long], Options(hold={"force", "mass"}))
    assert held.notes == given.notes
    wrong = Options(excitation=Excitation({"push": (0.0, 1.0)}, 1.0))
    refused = engine._designed(dry.found, group, [long], wrong)
    assert "limits of push: there is no such input" in refused.reason


@pytest.mark.parametrize("follows", [False, True])
def test_silent_predictions_end_a_search_unless_a_free_run_follows_in_another_reading(
    follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    predicts = SimpleNamespace(observer=SimpleNamespace(is_small=True))
    runs = SimpleNamespace(observer=None, base=None, judge=lambda base: "drifts")
    found = {
        id(one): SimpleNamespace(subject=one, base=base, compared=list)
        for one, base in ((predicts, "stays"), (runs, "drifts"))
    }
    for name, stub in {
        "predicted": lambda subject: predicts,
        "search": lambda subject, *_, **__: found[id(subject)],
        "conclude": lambda one: Conclusion(
            "consistent" if one.subject is predicts else "cause", (), 0.0, None
        ),
        "drifts": lambda judged: judged == "drifts",
        "_follows_otherwise": lambda subject, begun: follows,
        "_is_open": lambda answer: False,
    }.items():
        monkeypatch.setattr(engine, name, stub)
    options = SimpleNamespace(recalibrates=False, is_candidate=None, thorough=True)
    answer = engine._answer(runs, options, print, Deadline(None))
    assert answer[0].subject is (runs if follows else predicts)


@pytest.mark.parametrize(
    ("levels", "drifts", "follows"), [((), False, True), ((0.0,), False, False), ((), True, False)]
)
def test_a_free_run_follows_by_a_plain_reading_alone(
    levels: tuple[float, ...], drifts: bool, follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One with values to fit may take up a drift."""
    reading = Reading(ReadingKind.SIGN, ("force",), levels=levels)
    read = SimpleNamespace(reading=reading, base=None, judge=lambda base: "judged")
    monkeypatch.setattr(engine, "misreadings", lambda subject, base: [read])
    monkeypatch.setattr(engine, "drifts", lambda judged: drifts)
    assert engine._follows_otherwise(None, "begun") == follows
    assert not engine._follows_otherwise(None, None)


def test_causes_are_joined_until_one_is_sure_or_none_are_equivalent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Further causes enter a group when others are joined; a sure answer is left as it is."""
    base = SimpleNamespace(choosing=None)
    steps = [{frozenset("ab")}, {frozenset("ac")}, set()]
    asked = []

    def concluded(found, equivalent=frozenset()):
        asked.append(frozenset(equivalent))
        verdict = found.verdicts[len(equivalent)]
        return SimpleNamespace(verdict=verdict, causes=len(equivalent))

    monkeypatch.setattr(engine, "conclude", concluded)
    monkeypatch.setattr(engine, "equivalent_pairs", lambda causes, errors: steps[causes])
    never = SimpleNamespace(base=base, verdicts=["unexplained", "ambiguous", "unexplained"])
    assert engine._concluded(never).verdict == "unexplained"
    assert asked == [
        frozenset(),
        frozenset({frozenset("ab")}),
        frozenset(map(frozenset, ("ab", "ac"))),
    ]
    soon = SimpleNamespace(base=base, verdicts=["ambiguous", "cause"])
    assert engine._concluded(soon).verdict == "cause"
    sure = SimpleNamespace(base=base, verdicts=["cause"])
    asked.clear()
    assert engine._concluded(sure).verdict == "cause"
    assert asked == [frozenset()]
