"""One sign: a residual is measured minus simulated in the figures, in the words and in the picture
beside them.
"""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.pipeline import Result
from orchestration.discrepancy.report.page import diagnosis_page
from orchestration.fmu.model import find_model
from orchestration.identify.comparison import read_for
from studies.emulator.records import draw, write
from tests.support.pace import slow_but

SIZE = 1e-4  # m
QUIET = 3.0  # s on either side of the jump in which no input moves


def quiet_time(drawn):
    """The instant in the part that is fitted to that is furthest from every step of an input."""
    moves = np.any(
        [np.diff(values, prepend=values[0]) != 0.0 for values in drawn.inputs.values()], axis=0
    )
    steps = drawn.time[moves]
    candidates = drawn.time[(drawn.time > 60.0) & (drawn.time < 150.0)]
    distance = np.abs(candidates[:, np.newaxis] - steps).min(axis=1)
    assert distance.max() > QUIET
    return float(candidates[distance.argmax()])


@pytest.fixture(scope="module", params=slow_but([1.0, -1.0], -1.0), ids=["up", "down"])
def jumped(request, tmp_path_factory):
    """A diagnosis of a clean record of the rig, whose measured displacement jumps once, and when
    and by how much.
    """
    drawn = draw(None, 1, duration=300.0, rate=5.0)
    time, size = quiet_time(drawn), request.param * SIZE
    displacement = drawn.outputs["displacement"] + np.where(drawn.time >= time, size, 0.0)
    path = tmp_path_factory.mktemp("sign") / "record.csv"
    write(replace(drawn, outputs=drawn.outputs | {"displacement": displacement}), path)
    model = find_model("ppy_actuator")
    record = read_for(model, path)
    diagnosis = diagnose(PpyActuator, dataset_of(record, model, {}), [])
    return Result([record], [], model, [], diagnosis, None, None, None, []), time, size


@pytest.fixture(scope="module")
def text(jumped):
    return "\n".join(diagnosis_page(jumped[0], "ppy diagnose record.csv").parts)


def drawn_residual(text, output, model):
    """What is drawn below an output as measured minus simulated: time (s) and values, as a browser
    unpacks them.
    """
    figure, *_ = (
        json.loads(data)
        for data in re.findall(r'<script type="application/json">(.*?)</script>', text)
    )
    titles = [note["text"] for note in figure["layout"]["annotations"]]
    panel = 1 + next(k for k, title in enumerate(titles) if title.startswith(output))
    assert titles[panel].startswith("measured − simulated [mm]")
    (trace,) = (t for t in figure["data"] if (t["yaxis"], t["name"]) == (f"y{panel + 1}", model))
    return (
        np.frombuffer(base64.b64decode(trace[axis]["bdata"]), trace[axis]["dtype"]) for axis in "xy"
    )


def test_a_jump_has_the_sign_of_what_was_measured(jumped):
    result, time, size = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    assert shift.time == pytest.approx(time)
    assert shift.size == pytest.approx(size, rel=0.1)


def test_the_words_have_the_sign_of_the_number(jumped, text):
    result, time, _ = jumped
    (shift,) = result.diagnosis.residuals["displacement"].level_shifts
    words = html.unescape(re.sub(r"<[^>]+>", "", text))
    ((sign, size, at),) = re.findall(r"A jump of ([-−]?)(0\.\d+)\smm at ([\d.]+) s\.", words)
    assert bool(sign) == (shift.size < 0.0)
    assert float(size) == pytest.approx(1e3 * abs(shift.size), abs=5e-4)
    assert float(at) == pytest.approx(time)


def test_the_picture_steps_as_the_words_say(jumped, text):
    _, time, size = jumped
    at, residual = drawn_residual(text, "displacement", "refitted")
    before, after = (at > time - QUIET) & (at < time), (at >= time) & (at < time + QUIET)
    assert residual[after].mean() - residual[before].mean() == pytest.approx(1e3 * size, rel=0.1)
