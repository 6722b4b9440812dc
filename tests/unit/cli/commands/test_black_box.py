"""Claims: ``ppy black-box`` tells what it chose, and writes a page, figures and a component, over
nothing.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.support.command import refused, works


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A record of ``y[k] = 0.8 y[k-1] + 0.5 u[k-1]``."""
    folder = tmp_path_factory.mktemp("black_box")
    rng = np.random.default_rng(1)
    u = rng.normal(size=400)
    y = lfilter([0.0, 0.5], [1.0, -0.8], u) + 0.01 * rng.normal(size=400)
    table = np.column_stack([0.5 * np.arange(400), u, y])
    header = "time [s],u [V],lambda [mm]"
    np.savetxt(folder / "r.csv", table, delimiter=",", header=header, comments="")
    return folder


CALL = ["black-box", "r.csv", "--output", "lambda", "--structures", "ARX,OE", "--orders", "1,2"]


@pytest.mark.slow
def test_everything_is_written_and_can_be_gone_on_with(folder):
    files = ["--report", "r.html", "--json", "r.json", "--out", "mine.py"]
    said = works(*CALL, "--delays", "1", *files, cwd=folder)
    assert "An OE model" in said
    assert "% fit validation data" in said
    model = ["simulate", "mine.py:Mine", "--stop", "5s", "--step", "0.5s", "--out", "m.csv"]
    works(*model, cwd=folder)
    assert (folder / "r.html").stat().st_size > 10_000
    models = json.loads((folder / "r.json").read_text(encoding="utf-8"))["models"]
    assert len(models) == 4  # two structures of two orders


def test_json_alone_goes_to_standard_output(folder):
    text = works(*CALL, "--json", "-", cwd=folder)
    assert {model["structure"] for model in json.loads(text)["models"]} == {"ARX", "OE"}


@pytest.mark.parametrize(
    ("option", "name", "said"),
    [
        ("--report", "r.txt", ".html"),
        ("--json", "r.csv", "this is the record itself"),
        ("--out", "mine.fmu", ".py"),
    ],
)
def test_a_name_that_cannot_be_is_refused_before_any_work(folder, option, name, said):
    refused(folder, *CALL, option, name, parts=[f"{option} {name}", said])
