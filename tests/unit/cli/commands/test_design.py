"""Claims: ``ppy design`` prints, writes and draws what it finds, and refuses in a line."""

from __future__ import annotations

import json

import pytest

from tests.support.command import refused, works

CALL = ["design", "ppy_actuator", "--command", "current", "--measured", "displacement"]
SAMPLED = ["--sample-period", "20ms", "--crossover", "500mHz"]


@pytest.mark.slow  # builds a native controller
def test_everything_is_written_and_runs(tmp_path):
    files = ["--json", "d.json", "--plot", "d.svg", "--out", "loop"]
    band = ["--over", "R1=0.3..0.6:3", "--limits", "-1.3..1.3"]
    said = works(*CALL, *SAMPLED, *band, *files, cwd=tmp_path)
    assert "phase margin 60.0° at 0.5 Hz" in said
    assert "over 3 values of parameters" in said
    told = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    assert told["loop"]["margins"]["crossover"] == pytest.approx(0.5, abs=1e-6)
    assert told["limits"] == [-1.3, 1.3]
    assert len(told["band"]) == 3
    assert (tmp_path / "d.svg").stat().st_size > 10_000
    assert "plant.displacement" in works("run", "loop/step.toml", cwd=tmp_path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--delay", "x"], "--delay"),
        (["--crossover", "0"], "--crossover"),
        (["--limits", "2A..1A"], "--limits 2A..1A: the first command must be below the second one"),
        (["--controller", "pdi"], "no kind of controller named 'pdi'"),
    ],
)
def test_what_does_not_fit_is_refused(options, words, tmp_path):
    assert words in refused(tmp_path, *CALL, *SAMPLED, *options)


def test_effects_are_of_a_model(tmp_path):
    said = refused(tmp_path, "design", "dma_bench", "--with", "strain_lag")
    assert "--with is of one model; dma_bench is a system" in said
