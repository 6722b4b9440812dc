"""Notes of a diagnosis: codes, with their facts, for what could not be assessed and why.

The sentences are made of them in one place, `report.wording`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from fmus.kit import UserError


class NoteCode(StrEnum):
    """The subject of a note; `report.wording` says it in a sentence."""

    # faults of the data
    CLIPPED = "clipped"
    CLIPPED_REPEATEDLY = "clipped_repeatedly"
    STUCK = "stuck"
    STUCK_WHILE_DRIVEN = "stuck_while_driven"
    DEAD_CONSTANT = "dead_constant"
    DEAD_TOGGLING = "dead_toggling"
    DEAD_TO_THE_END = "dead_to_the_end"
    DEAD_WHILE_DRIVEN = "dead_while_driven"
    STANDS_STILL = "stands_still"
    COPIED = "copied"
    OUTLIERS = "outliers"
    RESAMPLED = "resampled"
    OVERSAMPLED = "oversampled"
    QUANTISED = "quantised"
    UNUSABLE = "unusable"
    NOTHING_USABLE = "nothing_usable"
    # how far the data reach
    INTERSAMPLE = "intersample"
    INTERSAMPLE_OPEN = "intersample_open"
    INTERSAMPLE_CONTRADICTED = "intersample_contradicted"
    INPUT_NOISE = "input_noise"
    EVEN_CLOCK = "even_clock"
    CONSTANT_INPUT = "constant_input"
    NO_EXCITATION = "no_excitation"
    EXCITATION_BELOW_NOISE = "excitation_below_noise"
    FREE_RESPONSE = "free_response"
    ABSENT_INPUT = "absent_input"
    GAPS = "gaps"
    TOO_FEW_SAMPLES = "too_few_samples"
    ENDS_EARLY = "ends_early"
    MANY_GAPS = "many_gaps"
    SEARCHED_IN_PART = "searched_in_part"
    NOT_IN_VALIDATION_DATA = "not_in_validation_data"
    # effects
    NO_TRACE = "no_trace"
    UNIDENTIFIABLE = "unidentifiable"
    NOT_SIMULATED = "not_simulated"
    NOT_IN_ALL_SAMPLES = "not_in_all_samples"
    NOT_VALIDATED = "not_validated"
    MAY_BE_NEUTRAL = "may_be_neutral"
    INPUT_NOISE_DOES_THE_SAME = "input_noise_does_the_same"
    CONFOUNDED = "confounded"
    # what is left
    SOMETHING_LEFT = "something_left"
    OUTLYING_RESIDUALS = "outlying_residuals"
    VARYING_NOISE = "varying_noise"
    FEEDBACK = "feedback"
    NOT_FOLLOWED = "not_followed"
    END_NOT_FOLLOWED = "end_not_followed"
    LARGE_ERROR = "large_error"
    UNRELATED = "unrelated"
    SOLVER_ERROR = "solver_error"
    EXCHANGED = "exchanged"
    OTHER_SIGN = "other_sign"
    OTHER_UNIT = "other_unit"
    DIFFERENTIATED = "differentiated"
    INTEGRATED = "integrated"
    MOVES_AHEAD = "moves_ahead"
    FILTERED = "filtered"
    RUNS_AHEAD = "runs_ahead"
    OTHER_CLOCK = "other_clock"
    UNSIGNED = "unsigned"
    PIECED = "pieced"
    OTHER_SPECIMEN = "other_specimen"
    # results
    UNDETERMINED = "undetermined"
    DETERMINED_TOGETHER = "determined_together"
    STRAIGHT_PART = "straight_part"
    AT_BOUND = "at_bound"
    NOT_CONVERGED = "not_converged"
    NOT_MOVED = "not_moved"
    IMPLAUSIBLE = "implausible"
    NO_GAIN = "no_gain"
    FMU_FAILED = "fmu_failed"
    NO_EXPERIMENT = "no_experiment"
    NOT_REFITTED = "not_refitted"
    TIME_SPENT = "time_spent"


# the record may be wired otherwise, or be of something that was made of what was measured
MIXED_UP = (
    NoteCode.EXCHANGED,
    NoteCode.OTHER_SIGN,
    NoteCode.OTHER_UNIT,
    NoteCode.DIFFERENTIATED,
    NoteCode.INTEGRATED,
    NoteCode.MOVES_AHEAD,
    NoteCode.FILTERED,
    NoteCode.RUNS_AHEAD,
    NoteCode.OTHER_CLOCK,
    NoteCode.UNSIGNED,
    NoteCode.PIECED,
    NoteCode.OTHER_SPECIMEN,
    NoteCode.COPIED,
)


class Action(StrEnum):
    """Advice that belongs to a note."""

    CHECK = "Check columns, units, signs and clocks"
    MEASURE = "Measure again, or something else"
    CHOOSE = "Set, hold or choose what you know"
    WAIT = "Give the search more time"
    NONE = "Nothing to do, but good to know"


_ACTIONS = {
    Action.CHECK: (
        *MIXED_UP,
        NoteCode.UNRELATED,
        NoteCode.LARGE_ERROR,
        NoteCode.IMPLAUSIBLE,
        NoteCode.AT_BOUND,
        NoteCode.NOT_MOVED,
    ),
    Action.MEASURE: (
        NoteCode.CLIPPED,
        NoteCode.CLIPPED_REPEATEDLY,
        NoteCode.STUCK,
        NoteCode.STUCK_WHILE_DRIVEN,
        NoteCode.DEAD_CONSTANT,
        NoteCode.DEAD_TOGGLING,
        NoteCode.DEAD_TO_THE_END,
        NoteCode.DEAD_WHILE_DRIVEN,
        NoteCode.UNUSABLE,
        NoteCode.NOTHING_USABLE,
        NoteCode.QUANTISED,
        NoteCode.CONSTANT_INPUT,
        NoteCode.NO_EXCITATION,
        NoteCode.EXCITATION_BELOW_NOISE,
        NoteCode.TOO_FEW_SAMPLES,
        NoteCode.ENDS_EARLY,
        NoteCode.MANY_GAPS,
        NoteCode.NOT_IN_VALIDATION_DATA,
        NoteCode.UNIDENTIFIABLE,
        NoteCode.CONFOUNDED,
        NoteCode.NOT_FOLLOWED,
        NoteCode.END_NOT_FOLLOWED,
        NoteCode.INPUT_NOISE_DOES_THE_SAME,
        NoteCode.NO_GAIN,
    ),
    Action.CHOOSE: (
        NoteCode.ABSENT_INPUT,
        NoteCode.INTERSAMPLE_OPEN,
        NoteCode.INTERSAMPLE_CONTRADICTED,
        NoteCode.UNDETERMINED,
        NoteCode.DETERMINED_TOGETHER,
        NoteCode.NOT_CONVERGED,
    ),
    Action.WAIT: (NoteCode.TIME_SPENT,),
}
_ACTION_OF = {code: action for action, codes in _ACTIONS.items() for code in codes}


@dataclass(frozen=True)
class Note:
    """A note of a diagnosis.

    Attributes
    ----------
    code : NoteCode
    subject : str
        Signal, parameter or effect that it is about; empty where it is about all of them.
    facts : Mapping of str to Any
        Figures and names that its sentence needs.
    held_out : bool
        Whether it is about the record that was held out.
    """

    code: NoteCode
    subject: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    held_out: bool = False

    @property
    def action(self) -> Action:
        """Advice that belongs to it."""
        return _ACTION_OF.get(self.code, Action.NONE)

    def of_holdout(self) -> Note:
        """Return the same note, about the record that was held out."""
        return replace(self, held_out=True)


def notes_by_action(notes: Sequence[Note]) -> dict[Action, list[Note]]:
    """Return notes grouped by what to do about them, in the order of `Action`."""
    groups = {action: [note for note in notes if note.action is action] for action in Action}
    return {action: group for action, group in groups.items() if group}


class UnusableRecordError(UserError):
    """A record of which nothing can be said; `notes` tell why.

    Parameters
    ----------
    notes : sequence of Note
    """

    def __init__(self, notes: Sequence[Note]):
        self.notes = list(notes)
        super().__init__(
            "; ".join(" ".join(filter(None, (note.subject, note.code))) for note in notes)
        )
