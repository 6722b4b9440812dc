"""A system of one oscillator that rubs, diagnosed, with its record as a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from orchestration.diagnosis.systems.diagnosis import Judgement, MemberDiagnosis, SystemDiagnosis
from orchestration.diagnosis.systems.parts import Part
from tests.support.oscillator import CUBE, DRY, diagnosis_with, oscillator_record


def rubbing_system(folder: Path) -> SystemDiagnosis:
    """Return a system of an oscillator that rubs, and of a member that cannot be judged."""
    record = oscillator_record(1, dry=1.5)
    source = folder / "rubbing.csv"
    np.savetxt(source, np.column_stack([record.time, *record.signals.values()]))
    record = replace(record, source=source)
    judged = diagnosis_with(record, (DRY,), (CUBE,))
    members = []
    for name, diagnosis, why in (
        ("plant", judged, ""),
        ("drive", None, "none of its outputs is measured"),
    ):
        member: Any = SimpleNamespace(name=name)
        part = Part((member,), (), {}, {}, ())
        judgement = Judgement(part, diagnosis, why)
        members.append(MemberDiagnosis(name, f"{name}.fmu", "oscillator", judgement))
    return SystemDiagnosis("rig", record, members)
