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

PPY = (sys.executable, "-m", "orchestration.cli")


def said_by(*arguments: str) -> str:
    """Return what the command prints, which must succeed."""
    wide = os.environ | {"COLUMNS": "200"}
    done = subprocess.run([*PPY, *arguments], capture_output=True, text=True, timeout=240, env=wide)
    assert done.returncode == 0, done.stderr
    return done.stdout


# more than a minute of real time, in the test itself: it is not judged if the machine paused
@pytest.mark.slow
@pytest.mark.real_time
def test_what_is_hidden_is_found_and_runs_beside_the_rig(tmp_path: Path) -> None:
    said = said_by("rig", "demo", "--out", str(tmp_path), "--seed", "1")
    the_cause_is_named(tmp_path, said)
    the_extended_model_is_far_nearer(said)
    everything_can_be_used_again(tmp_path)


def the_cause_is_named(folder: Path, said: str) -> None:
    hidden = re.search(r"what the rig hides: (\w+)", said)
    assert hidden
    assert hidden[1] in said.partition("what the rig hides")[0]
    title = effect_title(effects("ppy_actuator")[hidden[1]])
    cause = title[0].lower() + title[1:]
    assert f" % {cause}: " in (folder / "hil.html").read_text(encoding="utf-8")


def the_extended_model_is_far_nearer(said: str) -> None:
    errors = dict(re.findall(r"error of (\w+) [\d.]+ % nominal -> ([\d.]+) % extended", said))
    before = dict(re.findall(r"error of (\w+) ([\d.]+) % nominal", said))
    assert set(errors) == {"voltage", "displacement"}
    gained = {name: float(before[name]) / float(errors[name]) for name in errors}
    assert max(gained.values()) > 2.0
    assert all(float(error) < 10.0 for error in errors.values())


def everything_can_be_used_again(folder: Path) -> None:
    assert {"record.nc", "extended.fmu", "diagnosis.html", "hil.html", "beside.png"} <= {
        path.name for path in folder.iterdir()
    }
    model = ("--model", str(folder / "extended.fmu"))
    assert json.loads(said_by("compare", str(folder / "record.nc"), *model, "--json", "-"))
