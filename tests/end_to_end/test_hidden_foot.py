"""Claims: the emulated foot is the component's in all that is not hidden, and what is hidden in it
is named.

The plant is made of points in the plane and moments (`studies/plants/foot.py`) and integrated
by Runge and Kutta's method; the component has Jacobians, the law of cosines and an integrator of
its own.
"""

from __future__ import annotations

from math import exp, tanh

import numpy as np
import pytest

import orchestration as ppy
from fmus.foot.effects import EFFECTS
from fmus.foot.model import FootDynamic
from fmus.kit import stack
from fmus.kit.record.compiled import CompiledModel
from studies.clean.records import Case, draw
from studies.hidden.records import HiddenCase, cases, draw_hidden
from studies.hidden.variations import OUTSIDE, VARIATIONS
from studies.plants.change import NOTHING, remembered, static
from studies.plants.library import DRAWN, ON_REQUEST, PLANTS, altered

FOOT = PLANTS["Foot"]
# The formula of the catalogue, for once, at a place of the plant.
SAME = {
    "": (NOTHING, {}),
    "coulomb_friction(ankle_friction)": (
        static("ankle_friction", lambda v: 4e-3 * tanh(v / 0.05), 1e-3),
        {"ankle_friction_coulomb": 4e-3, "ankle_friction_coulomb_velocity": 0.05},
    ),
    "coulomb_friction(mtp_friction)": (
        static("mtp_friction", lambda v: 4e-4 * tanh(v / 0.1), 1e-3),
        {"mtp_friction_coulomb": 4e-4, "mtp_friction_coulomb_velocity": 0.1},
    ),
    "plantar_tendon_across_arch": (
        static("arch_radius", lambda angle: 0.01),
        {"pl_arch_radius": 0.01},
    ),
    "tendon_stretch": (
        remembered("stretch", 2e-4, (0.08,)),
        {"tendon_compliance": 2e-4, "tendon_time": 0.08},
    ),
    "tendon_friction": (
        static("guide", lambda v: exp(0.03 * tanh(v / 2e-3)) - 1.0, 5e-4),
        {"tendon_wrap_friction": 0.03, "tendon_friction_velocity": 2e-3},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SAME)
def test_the_plant_is_the_component_by_other_equations(name):
    change, values = SAME[name]
    drawn = draw(Case("Foot", "PRBS", "Gaussian", 5), plant=altered("Foot", change))
    plain = draw(Case("Foot", "PRBS", "Gaussian", 5))
    cls = stack(FootDynamic, EFFECTS[name]) if name else FootDynamic
    truth = {
        n: drawn.truth[n] for n in (*FOOT.nominal, *(f"{state}_start" for state in FOOT.states))
    }
    found = CompiledModel(cls).run(drawn.time, drawn.inputs, truth | values).signals
    for output, y in drawn.clean.items():
        assert np.max(np.abs(found[output] - y)) < 1e-6 * np.ptp(y), output
    assert bool(name) == any(
        np.ptp(drawn.clean[o] - y) > 1e-3 * np.ptp(y) for o, y in plain.clean.items()
    )


def test_the_foot_is_drawn_when_it_is_asked_for():
    assert ON_REQUEST == ("Foot",)
    assert "Foot" not in DRAWN
    drawn = cases(40, 1, ON_REQUEST)
    assert {case.plant for case in drawn} == {"Foot"}
    own = [v for v in VARIATIONS.values() if v.plant == "Foot"]
    families = {v.family for v in own}
    assert {case.variation.family for case in drawn} == families
    assert len(families - {OUTSIDE}) >= 5
    assert all(sum(v.family == family for v in own) >= 2 for family in families)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "cause"),
    [
        ("dry friction of the ankle, root", "coulomb_friction(ankle_friction)"),
        ("tendon across the arch, opening", "plantar_tendon_across_arch"),
    ],
)
def test_what_is_hidden_in_the_foot_is_named(hidden, cause, tmp_path):
    drawn = draw_hidden(HiddenCase("Foot", "PRBS", "Gaussian", 6, hidden=f"Foot, {hidden}"))
    path = drawn.write(tmp_path / "record.csv")
    result = ppy.diagnose(
        path, FOOT.model, settings=FOOT.settings, hold=FOOT.known, time=np.inf, laws=False
    )
    assert (result.verdict, result.causes) == ("cause", [cause])
