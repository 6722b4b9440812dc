"""Claims: what is written of a diagnosis of a system is documented."""

from __future__ import annotations

import json

from fmus.ppy_actuator.effects import EFFECTS
from orchestration.discrepancy.report import system_summary
from tests.support.reference import documented, fields
from tests.support.system.closed_loop import watched


def test_the_fields_documented_of_a_system_are_those_written(tmp_path):
    saturation = {"actuator.strain_saturation_coefficient": 0.3}
    diagnosis = watched(tmp_path, hidden=EFFECTS["strain_saturation"], values=saturation)
    written = json.loads(json.dumps(system_summary.summary(diagnosis), allow_nan=False))
    assert {path for path, _ in fields(written)} == set(documented(system=True))
