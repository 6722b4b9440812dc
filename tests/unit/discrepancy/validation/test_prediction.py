"""Claims: a record that a model does not predict is no confirmation of it, and one of the same
specimen is predicted; errors are those of free runs.

The records are exact solutions of the cell's equations, written without the kit.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.validation.prediction import model_errors, predict
from tests.support.diagnosis import coloured
from tests.support.regression_model import GAIN, SPREAD, Amplifier
from tests.support.several import (
    OCVS,
    STARTS,
    STEP,
    TRUE,
    Cell,
    current,
    measured,
    several,
    voltage,
)

NOISE = 1e-3  # V
ASTRAY = (NoteCode.NOT_FOLLOWED, NoteCode.END_NOT_FOLLOWED)


def diagnosed(holdout: Dataset | None, data: Dataset | None = None, **options):
    data = measured(0, STARTS["a"]) if data is None else data
    return diagnose(Cell, data, [], TRUE, holdout=holdout, **options)


def astray(diagnosis):
    return [note for note in diagnosis.notes if note.code in ASTRAY]


@pytest.mark.parametrize("seed", range(1, 6))
def test_another_record_of_the_same_specimen_is_followed(seed):
    diagnosis = diagnosed(measured(seed, STARTS["c"]))
    assert astray(diagnosis) == []
    assert diagnosis.verdict is Verdict.CONSISTENT


def test_a_record_of_another_specimen_is_not_followed_and_no_model_is_consistent_with_it():
    other = measured(3, STARTS["c"], R0=2.0 * TRUE["R0"])
    diagnosis = diagnosed(other)
    (note,) = astray(diagnosis)
    assert note.code is NoteCode.NOT_FOLLOWED
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    # the missing 30 mohm, beside the current that they carry
    expected = TRUE["R0"] * np.std(other.inputs["current"]) / NOISE
    assert note.facts["errors"]["voltage"] == pytest.approx(expected, rel=0.4)


@pytest.mark.slow
def test_what_the_fitted_record_leaves_open_is_no_fault_where_it_matters():
    """A current that hardly moves leaves the resistances open by far more than the noise."""
    weak = measured(0, 0.0)
    inputs = {"current": 0.01 * weak.inputs["current"]}
    clean = 3.3 - (3.3 - measured(0, 0.0, noise=0.0).measured["voltage"]) * 0.01
    noise = weak.measured["voltage"] - measured(0, 0.0, noise=0.0).measured["voltage"]
    data = Dataset(weak.time, inputs, {"voltage": clean + noise})
    for seed in range(1, 6):
        assert astray(diagnosed(measured(seed, STARTS["c"]), data)) == []


@pytest.mark.slow
def test_what_is_said_to_differ_from_record_to_record_may():
    records = several("ab", OCVS)
    assert astray(diagnose(Cell, records, [], TRUE, holdout=several("ef", OCVS)))
    assert not astray(diagnose(Cell, records, [], TRUE, holdout=several("ef", OCVS), each=["ocv"]))


def test_what_a_record_has_for_itself_makes_up_for_what_is_uncertain():
    """Of 100 A that flow throughout, an error of R0 is one of the open circuit voltage, and hides
    no fault.
    """
    i = 100.0 + current(7)
    noise = NOISE * np.random.default_rng(7).standard_normal(400)
    y = voltage(i, 100.0, 3.3, **TRUE | {"R0": TRUE["R0"] + 0.01}) + noise
    other = Dataset.joined({"b": Dataset(STEP * np.arange(400), {"current": i}, {"voltage": y})})
    assert astray(diagnosed(other, several("a"), each=["ocv"]))


@pytest.mark.slow
def test_of_several_records_those_that_are_not_followed_are_told():
    records = several("abcdef", {**dict.fromkeys("abcde", 3.3), "f": 3.5})
    (note,) = astray(diagnose(Cell, records, [], TRUE, held=["ocv"]))
    assert note.facts["records"] == ("f",)


def test_an_end_that_is_not_followed_is_told():
    data = measured(0, STARTS["a"], samples=900)
    late = (
        data.measured["voltage"]
        - np.where(data.time > 70.0, TRUE["R0"], 0.0) * data.inputs["current"]
    )
    (note,) = astray(diagnosed(None, Dataset(data.time, data.inputs, {"voltage": late})))
    assert note.code is NoteCode.END_NOT_FOLLOWED
    assert astray(diagnosed(None, data)) == []


def test_single_samples_are_no_course():
    other = measured(3, STARTS["c"])
    other.measured["voltage"][[100, 200, 300]] += 0.5
    assert astray(diagnosed(other)) == []


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_of_a_higher_level_is_no_fault(colour):
    clean = measured(3, STARTS["c"], noise=0.0)
    factor = 1.0 if colour == 0.0 else np.sqrt(1.0 - colour**2)
    fitted = measured(0, STARTS["a"], noise=0.0)
    for data, level, seed in ((fitted, 1.0, 5), (clean, 5.0, 6)):
        data.measured["voltage"][:] += level * NOISE * factor * coloured(colour, seed, 400)
    assert astray(diagnosed(clean, fitted)) == []


def test_under_an_input_that_changes_with_every_sample_a_fault_is_none_of_the_noise():
    def moved(seed, **other):
        i = np.random.default_rng(seed).standard_normal(400)
        noise = NOISE * np.random.default_rng(50 + seed).standard_normal(400)
        return Dataset(
            STEP * np.arange(400),
            {"current": i},
            {"voltage": voltage(i, 0.0, 3.3, **TRUE | other) + noise},
        )

    assert astray(diagnosed(moved(2), moved(1))) == []
    assert astray(diagnosed(moved(2, R0=2.0 * TRUE["R0"]), moved(1)))


def test_errors_are_those_of_the_model_as_it_came_and_of_the_fit():
    """Of a regression on one signal, which is solved by hand."""
    random = np.random.default_rng(3)
    signal = random.standard_normal(900)
    shown = 1.5 * GAIN * signal + SPREAD * random.standard_normal(900)
    data = Dataset(STEP * np.arange(900), {"signal": signal}, {"shown": shown})
    estimation, validation = ValidationData.split(data)
    model = Search(estimation, Amplifier, ["gain"]).nominal()
    fitted, judged = model_errors([predict(validation, model)], validation)

    def error(gain, first, last):
        y = shown[first:last]
        return np.linalg.norm(y - gain * signal[first:last]) / np.linalg.norm(y - y.mean())

    gain = signal[:600] @ shown[:600] / (signal[:600] @ signal[:600])
    assert list(fitted) == list(judged) == ["untouched", "least_squares", "refitted"]
    assert fitted["untouched"]["shown"] == pytest.approx(error(GAIN, 0, 600))
    assert judged["untouched"]["shown"] == pytest.approx(error(GAIN, 600, 900))
    for name in ("least_squares", "refitted"):
        assert fitted[name]["shown"] == pytest.approx(error(gain, 0, 600), rel=1e-3)
        assert judged[name]["shown"] == pytest.approx(error(gain, 600, 900), rel=1e-3)
