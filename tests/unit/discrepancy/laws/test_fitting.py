"""Claims: what is remembered is found as the plant has it, however it begins; what is one thing in
two forms is told as
the one that is known.

The oracle is the plant: the node that is hidden in it, its time constant and its size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.api.records import read_record
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.laws.discovery import discover
from orchestration.discrepancy.laws.fitting import Fitting
from orchestration.discrepancy.laws.map import LawMap
from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose_only
from orchestration.fmu.model import find_model
from studies.clean.records import KINDS, conditions, draw
from studies.plants.change import remembered
from studies.plants.library import PLANTS, altered
from tests.support.pace import slow_but

pytestmark = pytest.mark.timeout(180)
SHARE, TIME = 0.8, 150.0


@pytest.fixture(scope="module", params=slow_but([False, True], False), ids=["from rest", "moving"])
def wall(tmp_path_factory, request):
    """Two thermal nodes with a third one behind the outer, which stores and gives back."""
    path = tmp_path_factory.mktemp("wall") / "nodes.csv"
    case = replace(
        conditions(PLANTS["ThermalNodes"], KINDS[0], 4, np.random.default_rng(4)),
        at_rest=not request.param,
    )
    hidden = remembered("outer", SHARE, [TIME], 293.0, ahead=True)
    drawn = draw(case, plant=altered("ThermalNodes", hidden))
    drawn.write(path)
    subject = find_model(drawn.plant.model)
    return diagnose_only(
        [read_record(path, subject)], subject, None, DiagnosisOptions(effects=[])
    ).diagnosis


@pytest.mark.slow
def test_a_node_behind_is_what_a_loss_remembers(wall):
    best = discover(wall).corrections[0]
    assert (best.entry.law, best.entry.signal.name, best.shape) == ("loss", "outer", "linear")
    assert best.entry.signal.memory in ("lagged", "leading")
    assert best.confirmed
    values = best.model.fit.values
    amount, constant = (values[n] for n in own_parameters(best.model.effect))
    assert abs(amount) == pytest.approx(SHARE, rel=0.15)
    assert constant == pytest.approx(TIME, rel=0.15)
    assert best.entry.signal.constant == pytest.approx(constant, rel=0.05)


@pytest.mark.slow
def test_what_is_in_proportion_is_a_straight_curve_with_the_band_of_its_amount(wall):
    base, search = wall.selection.base, search_of(wall)
    found = LawMap(search, base, {"loss remembering outer"})
    entry = next(e for e in found.entries() if e.family == "loss remembering outer")
    one = Fitting(search, base, found).first(entry)
    assert one is not None
    assert one.straight is not None
    knots = one.entry.basis.knots
    slope = one.values[one.straight.effect.neutral]
    assert one.curve.values == pytest.approx(slope * knots)
    estimate, k = one.straight, one.straight.problem.names.index(one.straight.effect.neutral)
    spread = np.sqrt(estimate.fit.covariance.matrix[k, k]) * estimate.problem.scales[k].slope(
        estimate.fit.q[k]
    )
    assert np.sqrt(np.diag(one.curve.covariance)) == pytest.approx(np.abs(spread * knots))


@pytest.mark.slow
def test_a_lag_is_longer_than_a_sample_and_shorter_than_the_record(wall):
    base, search = wall.selection.base, search_of(wall)
    found = LawMap(search, base)
    several = [
        e for e in found.entries() if e.law == "loss" and e.signal.memory in ("lagged", "leading")
    ][:3]
    fitted = [one for e in several if (one := Fitting(search, base, found).first(e)) is not None]
    assert fitted
    step, whole = np.median(np.diff(search.data.time)), np.ptp(search.data.time)
    assert all(step < one.entry.signal.constant < whole for one in fitted)
    values = [
        one.straight.fit.values[n] for one in fitted for n in own_parameters(one.straight.effect)
    ]
    assert len(values) == 2 * len(fitted)
