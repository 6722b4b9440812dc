"""Claims: several lags are told as several, one beside the other, and all are written.

The oracle is the plant: two nodes behind the outer one of a wall, their time constants and their
sizes.
"""

from __future__ import annotations

import runpy
from dataclasses import replace

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import Effect, stack
from orchestration.fmu.model import find_model
from studies.clean.records import KINDS, conditions, draw
from studies.plants.change import remembered
from studies.plants.library import PLANTS, altered

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]
SHARE, TIMES = 0.8, (45.0, 450.0)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    path = tmp_path_factory.mktemp("wall") / "nodes.csv"
    case = replace(
        conditions(PLANTS["ThermalNodes"], KINDS[0], 4, np.random.default_rng(4)), at_rest=True
    )
    drawn = draw(
        case,
        plant=altered("ThermalNodes", remembered("outer", SHARE, list(TIMES), 293.0, ahead=True)),
    )
    drawn.write(path)
    return path, drawn


@pytest.fixture(scope="module")
def result(drawn):
    path, plant = drawn
    return ppy.laws(path, plant.plant.model)


def test_two_relaxations_are_told_as_two(result):
    spectrum = result.to_dict()["spectrum"]
    assert [one["constant"] for one in spectrum] == pytest.approx(TIMES, rel=0.15)
    assert [one["amount"] for one in spectrum] == pytest.approx([SHARE / 2, SHARE / 2], rel=0.15)
    assert "Together these are relaxations of 0.3" in result.sentence
    assert "broad" not in result.sentence


def test_each_stands_in_the_map_beside_the_other(result):
    (first, second) = (row for row in result.law_map if row["confirmed"])
    assert first["beside"] == []
    assert second["beside"] == [first["effect"]]
    assert (second["law"], second["signal"], second["memory"]) == (
        first["law"],
        first["signal"],
        first["memory"],
    )
    assert second["effect"].endswith("_2)")
    assert [row["effect"] for row in result.law_map].count(second["effect"]) == 1, (
        "whatever constant a fit began with"
    )


def test_the_error_falls_with_each(result):
    before, after = (
        result.to_dict()["errors"][f"holdout_nrmse_{when}"] for when in ("before", "after")
    )
    beside = [row for row in result.law_map if row["confirmed"]][1]
    assert beside["delta_bic"] > 20.0
    assert after["outer_temperature"] < 0.1 * before["outer_temperature"]


def test_the_file_has_both_and_the_model_too(drawn, result, tmp_path):
    names = runpy.run_path(str(result.effect(tmp_path / "wall.py")))
    effects = [
        c
        for c in names.values()
        if isinstance(c, type) and issubclass(c, Effect) and c is not Effect
    ]
    assert len(effects) == 2
    path, record = drawn
    by_hand = stack(find_model(record.plant.model).cls, *effects, defaults=names["FITTED"])
    data = ppy.read_record(path, record.plant.model)
    inputs = {name: data.signals[name] for name in ("power", "ambient")}
    theirs, ours = (ppy.simulate(cls, inputs, time=data.time) for cls in (result.model, by_hand))
    # the catalogue's effect, which stands for the first in the model, begins in equilibrium; the
    # file as it was fitted
    assert ours["outer_temperature"] == pytest.approx(theirs["outer_temperature"], abs=0.01)
    assert np.std(ours["outer_temperature"] - data.signals["outer_temperature"]) < 0.1


def test_the_page_tells_each(result, tmp_path):
    page = result.report(tmp_path / "laws.html").read_text(encoding="utf-8")
    assert page.count("Corrections that were fitted") == 2
    assert "Corrections that were fitted, beside" in page
