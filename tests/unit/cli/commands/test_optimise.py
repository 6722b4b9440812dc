"""Claims: ``ppy optimise`` writes a front as a picture and as JSON, and refuses what cannot be."""

import json
import signal
import time

import pytest

from orchestration.journal import count_done
from tests.support.command import here, posix, refused, running, works

CALL = ("optimise", "foot_design", "--over", "r_po=30..45mm", "--over", "r_pl=5..30mm")
BOTH = ("--maximise", "ankle_limited_force & toe_limited_force,toe_stroke", "--levels", "5")


@pytest.mark.slow
def test_a_front_is_told_drawn_and_written(tmp_path):
    said = works(*CALL, *BOTH, "--plot", "f.png", "--json", "f.json", cwd=tmp_path)
    assert "5 points" in said
    assert (tmp_path / "f.png").stat().st_size > 10_000
    told = json.loads((tmp_path / "f.json").read_text(encoding="utf-8"))
    assert len(told["points"]) == 5
    assert told["parameters"] == {"r_po": "m", "r_pl": "m"}
    alone = works(*CALL, *BOTH, "--json", "-", cwd=tmp_path)
    assert json.loads(alone) == told


LONG = (*CALL, *BOTH[:2])


@pytest.mark.slow
@posix
def test_an_interrupt_keeps_what_is_done_and_the_same_command_goes_on(tmp_path):
    call = (*LONG, "--levels", 400, "--json", "f.json")
    process = running(*call, cwd=tmp_path)
    part = tmp_path / "f.json.part"
    while count_done(part)[0] < 265:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    last = told.splitlines()[-1]
    done, whole = count_done(part)
    assert whole == 256 + 800
    assert 265 <= done < whole
    assert last == (
        f"interrupted: {done:,} of {whole:,} points are kept in f.json.part, and the same command"
        " goes on from there"
    )
    refused(tmp_path, *call, "--seed", 1, parts=["f.json.part", "another optimisation", "search"])


def test_without_a_file_an_interrupt_says_what_would_keep_the_points(tmp_path, monkeypatch):
    def press(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("orchestration.sweeps.pareto.search._ParetoSearch.front", press)
    done = here(*LONG, cwd=tmp_path)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == (
        "interrupted: nothing is kept; with --json FILE the same command would go on"
    )


def test_a_front_that_is_written_leaves_no_part_behind(tmp_path):
    works(*CALL, *BOTH, "--json", "f.json", cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["f.json"]


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
