"""Claims: what is left out is never fitted, and starts are what the record and the model say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.diagnosis import Record, Shape, Term, subject_of
from orchestration.diagnosis.local_values import COMMON, LocalValues
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.subject import (
    Subject,
    _unseen,
    depends,
    divided_as_read,
    likelihood_gain,
    predicted,
    start_prior,
    thinned,
)
from orchestration.diagnosis.term_names import estimates
from tests.support.diagnosed_mass import START, D, K, M, exact, integrated, mass, problem_of, pushed

TRUTH = (2.5, 24.0, 2.2)


def drawn(count: int = 240, start: np.ndarray = START, seed: int = 1) -> Record:
    record = pushed(count)
    states = exact(record, TRUTH, start, record.inputs[:, 0])
    noise = 0.005 * np.random.default_rng(seed).standard_normal((count, 1))
    return replace(record, outputs=states[:, :1] + noise)


def made(*records: Record, **options: object) -> Subject:
    subject = subject_of(mass(), records, **options)
    assert subject is not None
    return subject


def test_the_last_third_is_left_out() -> None:
    subject = made(drawn())
    (fitted,), (out,) = subject.problem.records, subject.left_out
    assert len(fitted.time) == 160
    assert (len(out.record.time), out.first, out.of) == (240, 160, 0)
    assert [len(e) for e in subject.base.errors] == [160]


def test_of_a_free_response_blocks_in_between_are_left_out() -> None:
    """Every sample is fitted or left out, and errors are those of the exact solution there."""
    record = pushed(240)
    record.inputs[:] = 0.0
    record.inputs[:20] = 30.0
    noise = 0.005 * np.random.default_rng(1).standard_normal((240, 1))
    states = exact(record, TRUTH, START, record.inputs[:, 0])
    record = replace(record, outputs=states[:, :1] + noise)
    subject = made(record)
    (fitted,), (out,) = subject.problem.records, subject.left_out
    assert out.is_between
    assert (out.of, out.first) == (0, 0)
    seen, unseen = np.isfinite(fitted.outputs[:, 0]), np.isfinite(out.record.outputs[:, 0])
    assert np.array_equal(seen, ~unseen)
    starts = np.flatnonzero(np.diff(unseen.astype(int)) == 1) + 1
    assert starts.tolist() == [10 + 30 * k for k in range(8)]
    assert unseen.sum() == 80
    point = subject.base.point
    values = tuple(subject.problem.parameters(point.q)[:3])
    run = exact(record, values, point.starts[0], record.inputs[:, 0])
    expected = (record.outputs - run[:, :1])[unseen] / subject.problem.spread
    judged = subject.judge(subject.base)
    shown = np.concatenate([judged.choosing, judged.measuring])
    shown = np.sort(shown[np.isfinite(shown)])
    assert shown == pytest.approx(np.sort(expected[:, 0]), abs=1e-4)
    assert predicted(subject) is None
    pushed_on = replace(record, inputs=record.inputs.copy())
    pushed_on.inputs[120:] = 1.0
    assert not made(pushed_on).left_out[0].is_between


def test_what_is_left_out_is_never_fitted() -> None:
    """No bit of the fit changes with it, nor does the spread."""
    record = drawn()
    wrong = replace(record, outputs=record.outputs.copy())
    wrong.outputs[160:] += 7.0
    one, other = made(record), made(wrong)
    assert np.array_equal(one.base.point.q, other.base.point.q)
    assert one.problem.spread == other.problem.spread
    assert other.judge(other.base).left_out > 10.0 * one.judge(one.base).left_out


def test_a_run_goes_on_over_what_is_left_out() -> None:
    """The errors are those of the exact solution with the fitted values, from the fitted start."""
    record = drawn()
    subject = made(record)
    fitted = subject.base.point
    values = tuple(subject.problem.parameters(fitted.q)[:3])
    states = exact(record, values, fitted.starts[0], record.inputs[:, 0])
    expected = (record.outputs - states[:, :1])[160:] / subject.problem.spread
    judged = subject.judge(subject.base)
    shown = np.concatenate([judged.choosing, judged.measuring])
    shown = np.sort(shown[np.isfinite(shown)])[:, np.newaxis]
    assert shown == pytest.approx(np.sort(expected, axis=0), abs=1e-4)
    assert len(judged.choosing) == pytest.approx(len(judged.measuring), abs=8)


def test_a_held_out_record_starts_by_its_own_first_samples() -> None:
    """Only those give the start; the errors after them count."""
    other = drawn(240, np.array([0.2, -0.8]), 4)
    subject = made(drawn(), held_out=[other])
    assert [len(r.time) for r in subject.problem.records] == [240]
    (out,) = subject.left_out
    assert (out.first, out.of) == (40, None)
    judged = subject.judge(subject.base)
    assert judged.left_out * subject.problem.spread[0] < 0.008
    wrong = replace(other, outputs=other.outputs.copy())
    wrong.outputs[40:] += 7.0
    moved = made(drawn(), held_out=[wrong])
    errors = moved.judge(moved.base)
    assert errors.measuring == pytest.approx(
        judged.measuring + 7.0 / subject.problem.spread, nan_ok=True
    )


@pytest.mark.parametrize("local", [True, False])
def test_a_held_out_record_gives_its_local_values_by_a_sixth_of_every_tenth(local: bool) -> None:
    """Another stiffness there: errors are those of the noise only if it is its own."""
    other = replace(drawn(240, seed=4), group=1)
    states = exact(other, (TRUTH[0], 31.0, TRUTH[2]), START, other.inputs[:, 0])
    noise = 0.005 * np.random.default_rng(4).standard_normal((240, 1))
    other = replace(other, outputs=states[:, :1] + noise)
    of_each = LocalValues(("first",), each=("stiffness",)) if local else COMMON
    subject = made(drawn(), held_out=[other], local=of_each)
    judged = subject.judge(subject.base)
    errors = np.concatenate([judged.choosing, judged.measuring])
    told = int(np.isnan(errors).sum())
    gaps = 4  # behind blocks
    assert told - gaps == (8 * (24 // 6) if local else 0), "of the last 200 samples"
    size = judged.left_out * subject.problem.spread[0]
    assert (size < 0.008) == local
    assert np.nanmean(judged.beyond**2) <= np.nanmean(judged.choosing**2) * 1.05


def test_a_start_is_read_off_an_output_that_is_the_state() -> None:
    record = drawn(start=np.array([0.3, 0.0]))
    record.outputs[0] = np.nan
    problem = made(record).problem
    prior = start_prior(problem, record)
    assert prior.mean == pytest.approx([record.outputs[1, 0], 0.0])
    moving = start_prior(replace(problem, values={"v_start": 0.7}), record)
    assert moving.mean == pytest.approx([record.outputs[1, 0], 0.7])
    assert prior.deviation == pytest.approx([0.1, 0.1])


def test_a_start_that_is_held_is_known() -> None:
    """Though the record begins elsewhere, and though the output is the state."""
    record = drawn(start=np.array([0.3, 0.0]))
    subject = made(record, hold=["x_start"])
    assert subject.problem.known_starts.tolist() == [True, False]
    (start,) = subject.base.point.starts
    assert start[0] == pytest.approx(0.0, abs=1e-6)
    assert "x_start" not in estimates(subject.base, {})
    (free,) = made(record).base.point.starts
    assert free[0] == pytest.approx(0.3, abs=0.02)


def test_a_run_that_begins_elsewhere_begins_where_the_record_says() -> None:
    """Of a mass that moves already; one at rest is not given more freedom than it needs."""
    moving, resting = (made(drawn(start=np.array([0.1, v]))) for v in (4.0, 0.0))
    assert moving.problem.begins_anywhere
    assert not resting.problem.begins_anywhere
    assert moving.base.point.starts[0] == pytest.approx([0.1, 4.0], abs=0.05)
    assert moving.problem.parameters(moving.base.point.q)[:3] == pytest.approx(TRUTH, rel=0.05)


def test_how_inputs_go_between_samples_is_what_fits_better() -> None:
    for smooth in (False, True):
        record = pushed(150, 0.1, smooth)

        def rates(x: np.ndarray, u: float, t: float) -> list[float]:
            return [x[1], (u - K * x[0] - D * x[1]) / M]

        states = integrated(record, rates, START, 1e-6)
        noise = 0.002 * np.random.default_rng(0).standard_normal((150, 1))
        record = replace(record, outputs=states[:, :1] + noise, smooth=(False,))
        subject = made(record)
        assert subject.problem.records[0].smooth == (smooth,)
        assert subject.left_out[0].record.smooth == (smooth,)


def test_inputs_are_curved_where_that_fits_clearly_better() -> None:
    """Of a force with eight samples to a period; not of one that goes in straight lines."""
    time = 0.1 * np.arange(300)
    fine = 1e-3 * np.arange(30_000)

    def force(t: np.ndarray) -> np.ndarray:
        return 5.0 * np.sin(7.9 * t) + 2.0 * np.sin(3.1 * t)

    noise = 0.0005 * np.random.default_rng(3).standard_normal((300, 1))
    for is_curved in (True, False):
        driven = force(fine) if is_curved else np.interp(fine, time, force(time))
        states = exact(
            Record(fine, driven[:, None], driven[:, None], (False,)), TRUTH, START, driven
        )
        outputs = states[::100, :1] + noise
        subject = made(Record(time, force(time)[:, None], outputs, (False,)))
        assert subject.problem.records[0].smooth == (True,)
        assert subject.problem.records[0].curved == is_curved


def test_how_inputs_go_is_decided_by_runs_from_where_the_record_begins() -> None:
    """Of a slow drive of a mass that moves already, of which the start is the largest error."""
    record = pushed(150, 0.1, True)

    def rates(x: np.ndarray, u: float, t: float) -> list[float]:
        return [x[1], (u - K * x[0] - D * x[1]) / M]

    states = integrated(record, rates, np.array([0.1, 4.0]), 1e-6)
    noise = 0.002 * np.random.default_rng(0).standard_normal((150, 1))
    subject = made(replace(record, outputs=states[:, :1] + noise, smooth=(False,)))
    assert subject.problem.begins_anywhere
    assert subject.problem.records[0].smooth == (True,)


def test_fewer_samples_make_no_difference_beside_the_noise() -> None:
    """A tenth of the noise, within bounds; an output that is not measured does not count."""
    record = pushed(2000, 0.02)
    for noise, unseen in ((0.01, 1e-3), (1.0, 2e-3), (1e-5, 2e-4)):
        values = noise * np.random.default_rng(0).standard_normal((2000, 1))
        noisy = replace(record, outputs=values)
        problem = replace(problem_of([noisy]), spread=np.array([1.0]))
        assert _unseen(problem, noisy) == pytest.approx([unseen], rel=0.1)
    slow = pushed(400, 0.005)
    slow.inputs[:] = 5.0 * np.sin(slow.time)[:, None]
    slow = replace(slow, outputs=np.sin(slow.time)[:, None])
    problem = problem_of([slow])
    assert len(thinned(problem, slow, problem.mean, 100).time) == 100
    assert thinned(problem, slow, problem.mean, 100, np.array([1e-9])) is slow


def subject_leaving(errors: np.ndarray, step: int = 1) -> Subject:
    """A subject that leaves errors (n, ny) of every so many samples, 0.01 s apart."""
    subject = made(drawn())
    record = subject.problem.records[0]
    at = np.arange(0, len(errors), step)
    kept = replace(record, time=0.01 * at, inputs=np.zeros((len(at), 1)), outputs=errors[at])
    problem = replace(subject.problem, records=(kept,))
    return replace(subject, problem=problem, base=replace(subject.base, errors=(errors[at],)))


def test_an_output_in_which_a_law_is_missing_hides_no_other() -> None:
    """Of 1000 independent errors each: half of 1000 times the logarithm of the ratio of squares.

    So many samples are independent within a tenth, as their own correlations say.
    """
    rng = np.random.default_rng(3)
    wrong, exact = 10.0 * rng.standard_normal(1000), rng.standard_normal(1000)
    worse = subject_leaving(np.column_stack([wrong, 1.2 * exact]))
    better = subject_leaving(np.column_stack([1.01 * wrong, exact]))
    expected = 1000.0 * (np.log(1.2) - np.log(1.01))
    assert likelihood_gain(better, worse) == pytest.approx(expected, rel=0.1)
    assert likelihood_gain(worse, better) == pytest.approx(-expected, rel=0.1)
    slow = lfilter([1.0], [1.0, -0.9], rng.standard_normal(1000))
    held = subject_leaving(2.0 * (slow / slow.std())[:, np.newaxis])
    straight = subject_leaving(exact[:, np.newaxis])
    independent = 1000.0 * (1.0 - 0.9) / (1.0 + 0.9)
    expected = independent * np.log(2.0)
    assert likelihood_gain(straight, held) == pytest.approx(expected, rel=0.4), "of the slow ones"


@pytest.mark.parametrize("seed", range(4))
def test_readings_are_compared_by_samples_that_both_kept(seed: int) -> None:
    """The same errors, of which one reading keeps a fourth and another half: none gains.

    Variances of all that each kept would differ by chance, by some ten nats.
    """
    errors = np.random.default_rng(seed).standard_normal((3000, 2))
    few, more = subject_leaving(errors, 4), subject_leaving(errors, 2)
    assert likelihood_gain(few, more) == pytest.approx(0.0, abs=1e-9)
    assert likelihood_gain(more, few) == pytest.approx(0.0, abs=1e-9)
    better = subject_leaving(0.8 * errors, 2)
    assert likelihood_gain(better, few) == pytest.approx(750 * 2 * np.log(1 / 0.8), rel=0.1)


def test_parameters_that_are_held_and_values_that_are_given() -> None:
    subject = made(drawn(), hold=["damping"], values={"damping": 2.2, "mass": 3.0})
    values = subject.problem.parameters(subject.base.point.q)
    assert values[2] == 2.2
    assert subject.problem.nominal[0] == 3.0
    assert values[:2] == pytest.approx(TRUTH[:2], rel=0.05)


def test_a_long_record_is_thinned_where_the_model_sees_no_difference() -> None:
    """Of slow forces some samples do; of forces that change from sample to sample all count."""
    slow = pushed(400, 0.005)
    slow.inputs[:] = 5.0 * np.sin(slow.time)[:, None]
    problem = problem_of([replace(slow, outputs=np.sin(slow.time)[:, None])])
    thin = thinned(problem, slow, problem.mean, 100)
    assert thin.time == pytest.approx(slow.time[::4])
    assert thin.inputs == pytest.approx(slow.inputs.reshape(100, 4).mean(axis=1)[:, None])
    assert thinned(problem, slow, problem.mean, 400) is slow
    fast = pushed(400, 0.02)
    fast.inputs[:] = 50.0 * np.sign(np.sin(9.0 * fast.time))[:, None]
    assert len(thinned(problem, fast, problem.mean, 100).time) > 100


def test_a_record_is_thinned_between_the_jumps_of_its_input() -> None:
    """The force is the same at every instant, and so is the exact solution."""
    record = pushed(400, 0.005)
    force = np.repeat([0.0, 40.0, -25.0, 10.0], [37, 150, 111, 102])
    record.inputs[:] = force[:, None]
    states = exact(record, TRUTH, START, force)
    record = replace(record, outputs=states[:, :1])
    problem = problem_of([record])
    thin = thinned(problem, record, problem.mean, 100)
    assert len(thin.time) <= 104
    before = np.searchsorted(thin.time, record.time, side="right") - 1
    assert np.array_equal(thin.inputs[before, 0], force)


def test_what_is_thinned_for_a_search_has_all_samples_for_the_conclusion() -> None:
    """The same parts of the record are fitted and left out, and its parameters are known better."""
    count = 6000
    record = pushed(count, 0.01)
    record.inputs[:] = 5.0 * np.sin(record.time)[:, None]
    states = exact(record, TRUTH, START, record.inputs[:, 0])
    noise = 0.01 * np.random.default_rng(4).standard_normal((count, 1))
    subject = made(replace(record, outputs=states[:, :1] + noise))
    whole = subject.complete()
    assert whole is not None
    assert len(subject.problem.records[0].time) == 1333
    assert np.array_equal(whole.problem.records[0].time, record.time[:4000])
    assert np.array_equal(whole.left_out[0].record.time, record.time)
    assert whole.left_out[0].first == 4000
    assert whole.base.misfit * whole.problem.spread == pytest.approx([0.01], rel=0.05)
    assert whole.fewer is not None
    assert whole.fewer.problem is subject.problem
    assert made(drawn()).complete() is None


def test_of_a_long_record_that_cannot_be_thinned_the_beginning_is_used() -> None:
    """Of 4,800 samples two thirds are fitted, and a third is left out."""
    count = 6000
    pushes = np.random.default_rng(5).uniform(10.0, 50.0, count) * (-1.0) ** np.arange(count)
    record = replace(pushed(count), inputs=pushes[:, None])
    states = exact(record, TRUTH, START, pushes)
    subject = made(replace(record, outputs=states[:, :1]))
    (fitted,), (out,) = subject.problem.records, subject.left_out
    assert np.array_equal(fitted.time, record.time[:3200])
    assert np.array_equal(out.record.time, record.time[:4800])
    assert subject.beginnings == [record.time[4799]]
    assert made(drawn()).beginnings == [drawn().time[-1]]


def test_what_is_held_out_is_run_on_all_samples() -> None:
    """Of a record that would be cut if it were fitted; its errors are those of its noise."""
    count = 6000
    pushes = np.random.default_rng(5).uniform(10.0, 50.0, count) * (-1.0) ** np.arange(count)
    record = replace(pushed(count), inputs=pushes[:, None])
    noise = 0.005 * np.random.default_rng(6).standard_normal((count, 1))
    outputs = exact(record, TRUTH, START, pushes)[:, :1] + noise
    subject = made(drawn(), held_out=[replace(record, outputs=outputs)])
    (out,) = subject.left_out
    assert np.array_equal(out.record.time, record.time)
    judged = subject.judge(subject.base)
    assert judged.left_out * subject.problem.spread[0] == pytest.approx(0.005, rel=0.2)


def test_a_long_record_is_rather_thinned_coarsely_than_cut() -> None:
    """Its force moves within a sample by what the model sees, and by less than a hundredth."""
    count = 12_000
    record = pushed(count, 0.02)
    force = 5.0 * np.sin(0.7 * record.time) + 5.0 * np.sin(14.0 * record.time)
    record = replace(record, inputs=force[:, None])
    states = exact(record, TRUTH, START, force)
    subject = made(replace(record, outputs=states[:, :1]))
    assert subject.beginnings == [pytest.approx(record.time[-1], abs=0.1)]
    assert len(subject.problem.records[0].time) <= 3200


def test_a_fast_model_gets_substeps() -> None:
    fast = {"mass": 0.1, "damping": 40.0}
    subject = made(drawn(), values=fast, hold=["mass", "damping"])
    assert subject.problem.substeps == np.ceil(0.02 * 400.0 / 0.7)
    assert made(drawn()).problem.substeps == 1


def test_steps_are_those_of_the_fitted_model() -> None:
    """The nominal one asks for twelve, and sees a difference between any samples."""
    force = pushed(7200, 0.005)
    force.inputs[:] = 5.0 * np.sin(force.time)[:, None]
    record = replace(force, outputs=exact(force, TRUTH, START, force.inputs[:, 0])[:, :1])
    subject = made(record, values={"mass": 0.1, "damping": 40.0})
    assert subject.problem.substeps == 1
    assert len(subject.problem.records[0].time) <= 1600
    assert subject.base.misfit < 0.1


def test_a_fit_that_runs_away_over_what_is_left_out_is_not_judged() -> None:
    """It is bounded by time: the term grows after the fitted samples."""
    subject = made(drawn())
    term = Term("friction", "time", Shape.ABOVE, size=1.0, scale=1.0, middle=3.2, factor="friction")
    point = replace(subject.base.point, values=np.array([-3000.0, np.log(0.01)]))
    assert subject.judge(replace(subject.base, terms=(term,), point=point)) is None


@pytest.mark.parametrize("stiffness", [1.0, 1.5])
def test_a_change_at_an_instant_is_before_or_after_another_record(stiffness: float) -> None:
    """Its beginning says which; of neither a record of another stiffness is."""
    other = pushed(240)
    truth = (TRUTH[0], stiffness * TRUTH[1], TRUTH[2])
    outputs = exact(other, truth, START, other.inputs[:, 0])[:, :1]
    record = replace(other, outputs=outputs)
    subject = made(drawn(), held_out=[record])
    changed = Term("spring", "time", Shape.STEP, factor="spring", scale=5.0)
    point = replace(subject.base.point, values=np.array([0.5, np.log(0.4)]))
    errors = subject.errors(
        replace(subject.base, terms=(changed,), point=point), subject.left_out[0]
    )
    base = subject.errors(subject.base, subject.left_out[0])
    assert np.sqrt(np.mean(errors**2)) < 0.03
    assert (np.sqrt(np.mean(base**2)) < 0.03) == (stiffness == 1.0)


def test_a_law_depends_on_its_signals() -> None:
    model = mass()
    assert depends(model, Term("spring", "x", Shape.CUBE))
    assert not depends(model, Term("spring", "v", Shape.CUBE))
    assert depends(model, Term("spring", "", Shape.CONSTANT))
    assert not depends(model, Term("spring", "x", Shape.LINEAR, factor="v"))
    assert depends(model, Term("spring", "x", Shape.LINEAR, factor="spring"))


@pytest.mark.parametrize(
    ("reading", "size"),
    [
        (Reading(ReadingKind.CLOCK, ("time",), 60.0), 1.0),
        (Reading(ReadingKind.UNIT, ("position",), 1000.0), 1000.0),
    ],
)
def test_errors_of_a_reading_are_in_the_spreads_of_the_file_as_it_was_read(
    reading: Reading, size: float
) -> None:
    """Of which the fitted samples are a part, whose own spread is another."""
    subject = made(drawn())
    whole = replace(subject, problem=replace(subject.problem, spread=np.array([0.7])))
    problem, _ = divided_as_read(whole, reading)
    assert problem.spread == pytest.approx([0.7 * size])


def test_errors_of_a_model_that_is_fed_what_was_measured_count_double() -> None:
    """It is fed the position, which moves, and the force is compared."""
    drawn_one = drawn()
    input_name, output_name = (v[0].name for v in (mass().inputs, mass().outputs))
    fed = Reading(ReadingKind.EXCHANGED, (input_name, output_name))
    subject = made(drawn_one)
    problem, _ = divided_as_read(subject, fed)
    (record,) = subject.problem.records
    assert problem.spread[0] == pytest.approx(0.5 * np.std(record.inputs[:, 0]))
