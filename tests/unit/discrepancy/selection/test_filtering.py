"""Claims: outputs that were filtered both ways are told, with the cut-off; a lag is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import MIXED_UP, NoteCode
from orchestration.discrepancy.report import wording
from tests.support.gain import Gain

STEP = 0.1
RNG = np.random.default_rng(8)


def stepped(processed, noise: float = 1e-3) -> Dataset:
    """A gain under steps too close to one another to see what comes before them."""
    u = np.repeat(RNG.uniform(-1.0, 1.0, 150), 10)
    y = processed(2.0 * u + noise * RNG.standard_normal(len(u)))
    return Dataset(STEP * np.arange(len(u)), {"u": u}, {"y": y})


def test_outputs_that_were_filtered_both_ways_are_told():
    """Oracle: SciPy's filter, of order four, which has half of the amplitude at its cut-off."""
    cutoff = 0.08  # of half the sampling rate
    sections = butter(4, cutoff, output="sos")
    diagnosis = diagnose(Gain, stepped(lambda y: sosfiltfilt(sections, y)), [])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert note.code is NoteCode.FILTERED
    assert note.facts["frequency"] == pytest.approx(cutoff * 0.5 / STEP, rel=0.3)
    assert note.facts["instead"] < 0.5 * note.facts["share"]
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert "filtered forwards and backwards" in wording.sentence(diagnosis)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_what_lags_was_not_filtered_both_ways(noise):
    def lagging(y: np.ndarray) -> np.ndarray:
        late = lfilter([0.2], [1.0, -0.8], y)
        return late + noise * RNG.standard_normal(len(y))

    diagnosis = diagnose(Gain, stepped(lagging, 0.0), [])
    assert NoteCode.FILTERED not in {note.code for note in diagnosis.notes}
