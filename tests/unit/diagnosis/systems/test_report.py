"""Claims: a system is told in words and figures, also where nothing can be judged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.diagnosis.systems.diagnosis import (
    Judgement,
    MemberDiagnosis,
    SystemDiagnosis,
)
from orchestration.diagnosis.systems.parts import InputOrigin, InputSource, Part
from orchestration.diagnosis.systems.report import (
    overview,
    reason,
    sentence,
    source_text,
    summary,
    view_of,
)
from orchestration.records import Record
from orchestration.reporting.console import out
from orchestration.system import Port


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (InputSource(InputOrigin.DEFAULT, value=0.25), "0.25 (value in the system)"),
        (InputSource(InputOrigin.SETTING, value=1.0), "1 (setting)"),
        (InputSource(InputOrigin.MEASURED, Port("a", "u"), np.zeros(3)), "measured"),
        (InputSource(InputOrigin.UPSTREAM, Port("b", "x"), np.zeros(3)), "b.x"),
        (InputSource(InputOrigin.LOOP, Port("b", "x")), "b.x, computed"),
    ],
)
def test_an_input_says_where_it_is_from(source: InputSource, text: str) -> None:
    assert source_text(source) == text


def test_what_cannot_be_judged_says_why() -> None:
    class Named:
        """A member of which its name matters alone."""

        name = "a"

    member: Any = Named()
    fed = {Port("a", "u"): InputSource(InputOrigin.DEFAULT, value=0.5)}
    part = Part((member,), (), fed, {}, ())
    judged = Judgement(part, reason="none of its outputs is measured")
    one = MemberDiagnosis("a", "a.fmu", "lag", judged)
    found = SystemDiagnosis("alone", Record(np.zeros(2), {}, {}, Path("r.csv")), [one])
    assert sentence(found) == "Nothing can be judged from this record."
    assert reason(one) == "none of its outputs is measured"
    with out.capture() as shown:
        out.print(overview(view_of(found)))
    assert "cannot be judged" in shown.get()
    figures = json.loads(json.dumps(summary(found), allow_nan=False))
    assert figures["verdict"] == "cannot be judged"
    assert figures["suspects"] == []
    (of_member,) = figures["members"]
    assert of_member["fed"] == {"u": "0.5 (value in the system)"}
    assert (of_member["ours"], of_member["causes"], of_member["outputs"]) == (False, [], {})
