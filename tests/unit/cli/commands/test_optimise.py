"""Claims: ``ppy optimise`` writes a front as a picture and as JSON, and refuses what cannot be."""

import json

import pytest

from tests.support.command import refused, works

CALL = ("optimise", "foot_design", "--over", "r_po=30..45mm", "--over", "r_pl=5..30mm")
BOTH = ("--maximise", "ankle_limited_force & toe_limited_force,toe_stroke", "--levels", "5")


def test_a_front_is_told_drawn_and_written(tmp_path):
    said = works(*CALL, *BOTH, "--plot", "f.png", "--json", "f.json", cwd=tmp_path)
    assert "5 points" in said
    assert (tmp_path / "f.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert len(told["points"]) == 5
    assert told["parameters"] == {"r_po": "m", "r_pl": "m"}
    alone = works(*CALL, *BOTH, "--json", "-", cwd=tmp_path)
    assert json.loads(alone) == told


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((*BOTH[:1], "toe_strok"), ["--maximise", "no output named 'toe_strok'"]),
        ((*BOTH, "--plot", "f.txt"), ["--plot", ".png"]),
        ((*BOTH, "--levels", "1"), ["--levels"]),
        ((*BOTH, "--levels", "1000000000"), ["--levels", "10000"]),
        ((*BOTH, "--starts", "2097152"), ["--starts", "1048576"]),
        ((*BOTH, "--over", "r_do=20mm"), ["--over", "write parameter=from..to"]),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, options, said):
    refused(tmp_path, *CALL, *options, parts=said)
