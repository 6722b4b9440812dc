"""Claims: a free response of which the start is unknown tells a hidden law, and a clean one none.

Records are simulated by SciPy; the models that are judged know nothing of what is hidden.
"""

from __future__ import annotations

import json

import pytest

from studies.decays import DecayCase
from studies.judging import decays

SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("kind", "runs"),
    [
        pytest.param("pendulum", 1, marks=SLOW),
        pytest.param("pendulum", 2, marks=SLOW),
        ("car", 1),
        pytest.param("capacitor", 2, marks=SLOW),
        ("cooling", 1),
        pytest.param("torsion", 1, marks=SLOW),
        pytest.param("recovery", 1, marks=SLOW),
    ],
)
@pytest.mark.parametrize("hidden", [True, False])
def test_a_hidden_law_is_named_and_a_clean_decay_is_left_alone(kind, runs, hidden):
    row = decays.judge(DecayCase(kind, hidden, runs, 51))
    assert row["outcome"] == decays.RIGHT, row["said"]
    if hidden:
        assert row["verdict"] in ("cause", "ambiguous")
    else:
        assert row["causes"] == []


def test_answers_are_counted_and_kept(tmp_path):
    case = {"kind": "car", "hidden": True, "runs": 1, "seed": 3}
    rows = [
        case | {"outcome": decays.RIGHT, "said": "drag"},
        case | {"outcome": decays.WRONG, "said": "an offset"},
    ]
    text = str(decays.report(rows))
    assert "an offset" in text
    assert "50" in text
    kept = tmp_path / "kept.jsonl"
    kept.write_text(
        "".join(json.dumps(asdict_row) + "\n" for asdict_row in _as_kept()), encoding="utf-8"
    )
    decays.main(["--each", "1", "--seed", "2", "--only", "car, clean", "--kept", str(kept)])


def _as_kept():
    """Rows of the case that the command line is asked for, so that nothing is judged anew."""
    seed = 2 * 100_000 + 1_000
    yield {"kind": "car", "hidden": False, "runs": 1, "seed": seed} | {
        "outcome": decays.RIGHT,
        "said": "nothing",
    }
