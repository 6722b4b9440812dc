"""What no fit has seen decides what is claimed."""

from __future__ import annotations

from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from tests.support.regression_model import OFFSET, Amplifier, offset_record

OBVIOUS = 300.0  # likelihood ratio of what nobody could doubt


def told(held_out):
    """Causes, and what is not claimed, of a record with an offset that is judged on another."""
    diagnosis = diagnose(
        Amplifier, offset_record(OBVIOUS, 1), [OFFSET], holdout=offset_record(held_out, 2)
    )
    dropped = [note.subject for note in diagnosis.notes if note.code is NoteCode.NOT_VALIDATED]
    return diagnosis.causes, dropped


def test_what_another_record_does_not_confirm_is_not_claimed():
    assert told(held_out=0.0) == ([], ["force_offset"])


def test_what_another_record_confirms_is_claimed():
    assert told(held_out=OBVIOUS) == (["force_offset"], [])
