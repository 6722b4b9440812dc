"""Claims: which of several corrections is the likelier one before a record is asked, and which are
worth a fit.

The oracle is a motor, of which anybody can say what hangs on what.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.laws.entry import Entry
from orchestration.discrepancy.laws.evidence import Basis, Curve
from orchestration.discrepancy.laws.plausible import Plausibility
from orchestration.discrepancy.laws.signals import LawSignal
from studies.plants.models.motor import Motor

NOTHING = np.zeros((2, 2))


def entry(law, signal, memory="", kind="add", gain=100.0, direction=0, driven="acceleration"):
    """What it does to the outputs is a direction of its own for every whole number, and alike in
    between.
    """
    away = np.zeros(8)
    away[int(direction)], away[7] = np.cos(direction % 1.0), np.sin(direction % 1.0)
    curve = Curve(gain, np.zeros(2), NOTHING, NOTHING, 0.0)
    signal = LawSignal(signal, memory, 1.0 if memory in ("lagged", "leading", "heat") else 0.0)
    return Entry(
        driven,
        law,
        signal,
        kind,
        Basis(np.array([0.0, 1.0])),
        curve,
        away,
        np.zeros(2),
        0.0,
        np.zeros(2),
    )


def plausible(families=()):
    return Plausibility(PerturbedLaws(Motor), set(), {}, set(families))


def labels(entries):
    return [one.label for one in entries]


@pytest.mark.parametrize(
    ("likelier", "other"),
    [
        (entry("friction", "omega"), entry("friction", "omega", "lagged")),
        (entry("friction", "omega"), entry("friction", "winding_current")),
        (entry("friction", "omega"), entry("friction", "omega", kind="multiply")),
        (entry("friction", "omega", "leading"), entry("friction", "omega", "heat")),
        (entry("acceleration", "winding_current"), entry("acceleration", "acceleration")),
        (
            entry("friction", "time", kind="multiply"),
            entry("friction", "omega", "lagged", "multiply"),
        ),
        (entry("friction", "omega", "lagged"), entry("friction", "time")),
    ],
    ids=lambda one: one.label.replace(" ", "_"),
)
def test_what_is_the_likelier_one(likelier, other):
    order = plausible().prior_rank
    assert order(likelier) < order(other)


def test_what_is_known_goes_before():
    known, other = entry("acceleration", "omega"), entry("acceleration", "winding_current")
    assert plausible(["acceleration over omega"]).prior_rank(known) < plausible().prior_rank(other)


def test_of_what_is_the_same_in_a_record_the_likelier_one_is_fitted():
    """Signals that only run in proportion there, whichever of them stands in the list before."""
    drifting, driven = entry("friction", "time", gain=50.0), entry("friction", "voltage", gain=50.0)
    for several in ([drifting, driven], [driven, drifting]):
        assert labels(plausible().worth_a_fit(several)) == labels([driven])


def test_the_best_and_the_likeliest_of_its_like_are_both_fitted():
    best = entry("friction", "winding_current", "lagged", gain=1000.0, direction=1)
    nearer = entry("friction", "load", gain=990.0, direction=1.05)
    weaker = entry("friction", "voltage", gain=900.0, direction=1.02)
    other = entry("friction", "voltage", "heat", gain=500.0, direction=2)
    assert labels(plausible().worth_a_fit([best, nearer, weaker, other])) == labels(
        [best, nearer, other]
    )


def test_courses_take_turns():
    one = [entry("friction", "load", "lagged", gain=1000.0 - k, direction=k % 7) for k in range(7)]
    two = [entry("winding_current", "load", gain=1.0, direction=6, driven="winding_current")]
    chosen = labels(plausible().worth_a_fit([*one, *two]))
    assert "winding_current over load" in chosen


def test_a_lag_is_fitted_once_whatever_its_constant():
    lags = [entry("friction", "omega", "lagged", gain=9.0 - k, direction=k) for k in range(3)]
    assert len(plausible().worth_a_fit(lags)) == 1
