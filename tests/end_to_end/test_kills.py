"""Claim: a command killed at any moment leaves nothing that looks whole and is not, and the next
one succeeds.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from orchestration.experiment import results
from orchestration.fmu.check import check_fmu
from tests.support.source import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]
KILLS = 8  # of each of three commands


def whole_result(folder: Path) -> None:
    if (folder / "r.nc").exists():
        assert results.read(folder / "r.nc").attrs["complete"] == 1


def whole_fmu(folder: Path) -> None:
    for path in folder.rglob("*.fmu"):
        assert [finding for finding in check_fmu(path) if finding.severity == "error"] == []


def whole_diagnosis(folder: Path) -> None:
    if (folder / "d.json").exists():
        assert "verdict" in json.loads((folder / "d.json").read_text())


def remove(folder: Path) -> None:
    """Remove a cache, into which a compiler may still write whose parent was killed."""
    begin = time.monotonic()
    while folder.exists():
        shutil.rmtree(folder, ignore_errors=True)
        assert time.monotonic() - begin < 60.0


@pytest.mark.parametrize(
    ("command", "check"),
    [
        (["run", "fig_3_4", "--out", "r.nc"], whole_result),
        (["build", "ppy_actuator", "--out", "fmu", "--platforms", "linux64"], whole_fmu),
        (
            ["diagnose", "record.csv", "--json", "d.json", "--effects", "none", "--no-laws"],
            whole_diagnosis,
        ),
    ],
    ids=["run", "build", "diagnose"],
)
def test_killed_at_any_moment(command, check, tmp_path):
    scratch, cache = tmp_path / "tmp", tmp_path / "cache"
    scratch.mkdir()
    environment = os.environ | {
        "TMPDIR": str(scratch),
        "XDG_CACHE_HOME": str(cache),
        "PYTHONPATH": str(ROOT),
        "OPENBLAS_NUM_THREADS": "1",
    }
    if "record.csv" in command:
        made = [
            "simulate",
            "ppy_actuator",
            "--set",
            "current=0.5",
            "--stop",
            "60s",
            "--step",
            "0.1s",
        ]
        subprocess.run(
            [sys.executable, "-m", "orchestration.cli", *made, "--out", "record.csv"],
            cwd=tmp_path,
            env=environment,
            check=True,
            capture_output=True,
        )
    full = [sys.executable, "-m", "orchestration.cli", *command]
    begin = time.monotonic()
    subprocess.run(full, cwd=tmp_path, env=environment, check=True, capture_output=True)
    lasts = time.monotonic() - begin
    draw = random.Random(command[0])
    for k in range(KILLS):
        if k % 4 == 0:  # the cache is cold, too
            remove(cache)
        with subprocess.Popen(
            full,
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as one:
            time.sleep(draw.uniform(0.0, 1.2 * lasts))
            os.killpg(one.pid, signal.SIGKILL)
        check(tmp_path)
    done = subprocess.run(full, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    check(tmp_path)
    assert list(scratch.iterdir()) == [], "what was left is removed by the next"
