"""Claims: a diagnosed system has values by ``member.name``; what is of one model is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import ppy_rig as ppy
from orchestration.api.system_results import SystemResult
from tests.support.system.judged import rubbing_system
from tests.support.system.lags import lags


def test_values_are_by_member_and_name(tmp_path: Path) -> None:
    result = SystemResult(rubbing_system(tmp_path), ["ppy", "diagnose", "rubbing.csv"])
    assert (result.verdict, result.suspects) == ("wrong", ["plant"])
    assert result.verdicts == {"plant": "wrong", "drive": "cannot be judged"}
    assert result.causes == ["plant.friction(velocity)"]
    assert result.probabilities["plant.friction(velocity)"] > 0.9
    low, high = result.parameters["plant.friction_of_velocity"].interval
    assert low < 1.5 < high
    assert set(result.changed) <= set(result.parameters)
    assert set(result.to_frame().index) == set(result.parameters)
    assert json.loads(json.dumps(result.to_dict()))["suspects"] == ["plant"]
    assert "plant.friction(velocity)" in repr(result)
    assert "The laws of plant are wrong." in str(result)
    assert len(result.draw().axes) == 2
    page = result.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "ppy diagnose rubbing.csv" in page


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"model": "ppy_actuator"}, "model= is about one model"),
        ({"effects": ["coulomb_friction"], "each": []}, "effects= is about one model"),
        ({"holdout": {"time [s]": np.arange(3.0)}}, "holdout= is about one model"),
        ({"record": ["a.csv", "b.csv"]}, "one record, and there are 2"),
        ({"system": "dma_bank"}, "dma_bank"),
    ],
    ids=str,
)
def test_what_is_about_one_model_is_refused(given: dict[str, object], message: str) -> None:
    usual: dict[str, object] = {"record": "a.csv", "system": "dma_bench"}
    with pytest.raises(ppy.UserError, match=re.escape(message)):
        ppy.diagnose(**usual | given)  # type: ignore[call-overload]


@pytest.mark.parametrize(
    ("hold", "message"),
    [("bench.mass", "bench has no parameter named 'mass'"), ("pump.m", "no member named 'pump'")],
)
def test_what_is_held_must_be_there(hold: str, message: str) -> None:
    time = 0.01 * np.arange(200)
    record = {"time [s]": time, "bench.position [m]": np.zeros(200)}
    with pytest.raises(ppy.UserError, match=message):
        ppy.diagnose(record, system="dma_bench", hold=[hold])


@pytest.mark.slow
def test_a_system_is_diagnosed_from_python(tmp_path: Path) -> None:
    system = lags(tmp_path, 0.0, a=1.4)
    result = ppy.diagnose(tmp_path / "record.csv", system=system)
    assert (result.verdict, result.changed) == ("recalibrate", ["a.tau"])
    low, high = result.parameters["a.tau"].interval
    assert low < 1.4 < high
    held = ppy.diagnose(tmp_path / "record.csv", system=system, hold=["a.tau"])
    assert "a.tau" not in held.changed
    assert held.verdicts["a"] == "wrong", "nothing else explains it"
