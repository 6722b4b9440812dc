"""Why a member of a system is judged as it is, as codes with their facts. Words are made elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class ReasonCode(StrEnum):
    """What a reason is; `report.system_wording` says it in words."""

    # nothing can be said
    INPUT_NOT_MEASURED = "input_not_measured"
    INPUT_WITH_GAPS = "input_with_gaps"
    NO_OUTPUT_MEASURED = "no_output_measured"
    SIMULATION_FAILED = "simulation_failed"
    LOOP_SIMULATION_FAILED = "loop_simulation_failed"
    TOO_UNCERTAIN = "too_uncertain"
    # something is wrong
    RESIDUAL_BEYOND_NOISE = "residual_beyond_noise"
    PARAMETERS_CHANGED = "parameters_changed"
    # nothing is wrong
    RESIDUAL_IS_NOISE = "residual_is_noise"
    OUTPUTS_UNMOVED = "outputs_unmoved"


@dataclass(frozen=True)
class Reason:
    """One reason for a verdict.

    Attributes
    ----------
    code : ReasonCode
    facts : Mapping of str to Any
        Figures, names and items that its sentence needs.
    """

    code: ReasonCode
    facts: Mapping[str, Any] = field(default_factory=dict)
