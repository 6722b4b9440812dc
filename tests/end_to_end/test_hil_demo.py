"""The loop closed on an emulated rig: what is hidden in it is found, and the extended model runs
beside it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fmus import effects
from fmus.kit.titles import effect_title

pytestmark = pytest.mark.slow  # more than a minute of real time


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("hil")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "orchestration.cli",
            "rig",
            "demo",
            "--out",
            str(folder),
            "--seed",
            "1",
        ],
        capture_output=True,
        text=True,
        timeout=240,
        env=os.environ | {"COLUMNS": "200"},
    )
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_the_hidden_effect_is_the_one_that_was_found(made):
    folder, said = made
    hidden = re.search(r"what the rig hides: (\w+)", said)
    assert hidden
    assert hidden[1] in said.partition("what the rig hides")[0]
    title = effect_title(effects("ppy_actuator")[hidden[1]])
    cause = title[0].lower() + title[1:]
    assert f" % {cause}: " in (folder / "hil.html").read_text(encoding="utf-8")


def test_the_extended_model_is_far_nearer_to_the_rig_in_real_time(made):
    _, said = made
    errors = dict(re.findall(r"error of (\w+) [\d.]+ % nominal -> ([\d.]+) % extended", said))
    before = dict(re.findall(r"error of (\w+) ([\d.]+) % nominal", said))
    assert set(errors) == {"voltage", "displacement"}
    gained = {name: float(before[name]) / float(errors[name]) for name in errors}
    assert max(gained.values()) > 2.0
    assert all(float(error) < 10.0 for error in errors.values())


def test_it_leaves_everything_that_can_be_used_again(made):
    folder, _ = made
    assert {"record.nc", "extended.fmu", "diagnosis.html", "hil.html", "beside.png"} <= {
        p.name for p in folder.iterdir()
    }
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "orchestration.cli",
            "compare",
            str(folder / "record.nc"),
            "--model",
            str(folder / "extended.fmu"),
            "--json",
            "-",
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)
