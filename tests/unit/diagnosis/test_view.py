"""Claims: what is shown is plain data, which JSON keeps; another field or type is refused."""

from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from orchestration.diagnosis.view import CurveView, LawRow

CURVE = CurveView(
    added="added to friction [N]",
    signal="velocity [m/s]",
    caption="",
    x=(0.0, None, 1e-300),
    y=(1.0, 2.0, 3.0),
    samples=(),
)


def test_json_keeps_it():
    kept = json.loads(json.dumps(CURVE.model_dump(mode="json"), allow_nan=False))
    assert CurveView.model_validate(kept) == CURVE


@pytest.mark.parametrize("change", [{"gain": "much"}, {"colour": "red"}])
def test_a_wrong_type_and_an_unknown_field_are_refused(change):
    row = {"law": "a", "signal": "b", "text": "c", "shape": "d", "memory": "", "gain": 1.0}
    assert LawRow.model_validate(row).gain == 1.0
    with pytest.raises(ValidationError):
        LawRow.model_validate(row | change)
