"""Claims: a record is screened by its values before any fit, and what a model does is no fault."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from fmus.kit import Component, Input, Output, UserError
from orchestration.diagnosis import Found, diagnose, engine
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.pieces import pieces_of
from orchestration.fmu.model import declared_model_of
from orchestration.records import Record
from tests.support.oscillator import oscillator_record
from tests.support.oscillator_model import Oscillator


class Passing(Component):
    """Shows what is fed, and that within limits."""

    name = "passing"
    u = Input("1")

    @Output("1")
    def passed(self):
        """The input."""
        return self.u

    @Output("1")
    def limited(self):
        """The input within limits."""
        return 0.2 * self.u


@cache
def oscillator() -> LawModel:
    return LawModel(Oscillator)


def measured(record: Record) -> tuple[np.ndarray, list[str]]:
    """Return the position as the kernel takes it, and the codes of the notes."""
    (piece,), notes = pieces_of([record], oscillator(), {})
    return piece.outputs[:, 0], [code for code, _, _ in notes]


def with_position(record: Record, position: np.ndarray) -> Record:
    return replace(record, signals=record.signals | {"position": position})


def test_a_record_without_faults_is_as_it_was():
    record = oscillator_record(1)
    position, codes = measured(record)
    assert codes == []
    assert np.array_equal(position, record.signals["position"])


def test_a_record_without_noise_keeps_its_samples():
    record = oscillator_record(1, noise=0.0)
    force = np.sin(0.5 * record.time)
    slow = replace(record, signals={"force": force, "position": 0.05 * np.cos(0.5 * record.time)})
    position, codes = measured(slow)
    assert codes == []
    assert np.array_equal(position, slow.signals["position"])


def test_a_clipped_output_is_fitted_by_what_is_left(monkeypatch):
    """The damping was hidden; two fifths of the samples are cut off."""
    monkeypatch.setattr(
        engine, "search", lambda subject, *_, **__: Found(subject, subject.judge(subject.base))
    )
    record = oscillator_record(1, damping=1.2)
    whole = record.signals["position"]
    level = np.quantile(whole, 0.6)
    clipped = with_position(record, np.minimum(whole, level))
    position, codes = measured(clipped)
    assert codes == ["clipped"]
    assert np.isnan(position[whole > level]).all()
    assert 0.38 < np.isnan(position).mean() < 0.46
    diagnosis = diagnose([clipped], declared_model_of(Oscillator))
    low, high = diagnosis.parameters["damping"].interval
    assert low < 1.2 < high
    assert high - low < 0.1
    assert diagnosis.remainders[0].share < 0.02


def test_a_resampled_record_is_what_was_measured():
    record = oscillator_record(1, samples=300)
    fine = np.linspace(record.time[0], record.time[-1], 4 * 299 + 1)
    lines = {n: np.interp(fine, record.time, y) for n, y in record.signals.items()}
    (piece,), ((code, _, _),) = pieces_of(
        [replace(record, time=fine, signals=lines)], oscillator(), {}
    )
    assert code == "resampled"
    assert piece.time == pytest.approx(record.time, abs=1e-12)
    assert piece.outputs[:, 0] == pytest.approx(record.signals["position"], abs=1e-15)
    assert piece.inputs[:, 0] == pytest.approx(record.signals["force"])


def test_a_record_of_which_nothing_is_left_is_refused_in_one_line():
    record = oscillator_record(1, samples=300)
    copied = with_position(record, record.signals["force"])
    line = (
        r"^oscillator: position: has the very values of force: a column was copied, and it is not"
        r" used; no output is left that could be trusted: nothing can be judged$"
    )
    with pytest.raises(UserError, match=line):
        diagnose([copied], declared_model_of(Oscillator))
    huge = with_position(record, 1e31 * record.signals["position"])
    with pytest.raises(UserError, match=r"^position: values beyond 1e\+30 are no measurement$"):
        diagnose([huge], declared_model_of(Oscillator))


def test_of_several_records_a_note_says_which_it_is_on():
    record = oscillator_record(1, samples=300)
    position = record.signals["position"]
    other = with_position(record, np.minimum(position, np.quantile(position, 0.7)))
    notes = pieces_of([record, replace(other, source=Path("b.csv"))], oscillator(), {})[1]
    assert [text[:45] for _, _, text in notes] == ["in b.csv, position: cut off at its maximum 0."]
    notes = pieces_of([other], oscillator(), {}, "in what was held out, ")[1]
    assert notes[0][2].startswith("in what was held out, position: cut off")


def test_what_a_model_does_itself_is_no_fault():
    """It passes its input on; the other output has no reason to be a copy."""
    time = 0.1 * np.arange(500)
    u = np.repeat(np.random.default_rng(1).normal(size=50), 10)
    signals = {"u": u, "passed": u, "limited": u}
    record = Record(time, signals, dict.fromkeys(signals, "1"), Path("p.csv"))
    (piece,), notes = pieces_of([record], LawModel(Passing), {})
    assert [(code, subject) for code, subject, _ in notes] == [("copied", "limited")]
    assert np.array_equal(piece.outputs[:, 0], u)
    assert np.isnan(piece.outputs[:, 1]).all()


def test_a_coarse_recorder_at_rest_is_no_stuck_sensor():
    """No force, and noise of a tenth of a step: the position stands, as that of the model does."""
    record = oscillator_record(1, samples=900, noise=0.0)
    moving = record.signals["position"]
    rng = np.random.default_rng(2)
    rest = np.full(300, 0.0)
    position = np.round((np.concatenate([rest, moving[:600]]) + 4e-4) / 1e-3) * 1e-3
    noise = 3e-3 * rng.standard_normal(900)
    position[300:] += np.round(noise[300:] / 1e-3) * 1e-3
    force = np.concatenate([rest, record.signals["force"][:600]])
    still = replace(record, signals={"force": force, "position": position})
    assert measured(still)[1] == []
    hanging = position.copy()
    hanging[500:600] = position[500]
    values, codes = measured(with_position(still, hanging))
    assert codes == ["stuck"]
    assert np.isnan(values[501:599]).all()
    assert not np.isnan(values[:300]).any()


def test_what_makes_a_file_doubtful_comes_first():
    time = 0.1 * np.arange(500)
    u = np.repeat(np.random.default_rng(1).normal(size=50), 10)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(500)
    coarse = np.round(0.5 * (u + noise) / 0.2) * 0.2
    signals = {"u": u, "passed": coarse, "limited": u}
    record = Record(time, signals, dict.fromkeys(signals, "1"), Path("p.csv"))
    assert [code for code, _, _ in pieces_of([record], LawModel(Passing), {})[1]] == [
        "copied",
        "quantised",
    ]


def test_what_moves_before_its_input_is_told():
    """Oracle: SciPy's filter, forwards and backwards, which is symmetrical in time."""
    record = oscillator_record(1)
    both_ways = sosfiltfilt(butter(4, 0.2, output="sos"), record.signals["position"])
    assert measured(with_position(record, both_ways))[1] == ["moves_ahead"]
