"""Claims: fronts are those of closed forms, also concave ones and those with kinks; no point of a
grid or of a large sample is better; what has many optima is searched globally.
"""

import numpy as np
import pytest

from fmus.foot.design import FootDesign
from fmus.kit import Component, Output, Parameter, UserError, cos
from orchestration.sweeps.pareto import Objective, Objectives, pareto_front
from orchestration.sweeps.ranges import Range

FORCES = Objective(("ankle_limited_force", "toe_limited_force"), "N", 1.0)
STROKE = Objective(("toe_stroke",), "m", 1.0)


class Waves(Component):
    """Rastrigin's function: 10 (x, y) waves on a bowl, lowest in the middle."""

    name = "waves"

    x = Parameter(3.0, "1", min=-5.12, max=5.12, doc="first parameter")
    y = Parameter(3.0, "1", min=-5.12, max=5.12, doc="second parameter")

    @Output("1")
    def height(self):
        """Height of the surface."""
        return sum(v * v + 10.0 - 10.0 * cos(6.283185307179586 * v) for v in (self.x - 0.3, self.y))


def between(name, low, high):
    return Range(name, "m", np.array([low, high]), counted=False)


@pytest.mark.slow
def test_a_concave_front_is_the_closed_form(bells):
    """The front of Fonseca and Fleming's bells is between their middles, x = y; weighted sums of
    both would find its ends only.
    """
    front = pareto_front(bells, 21)
    x, y = front.parameters["x"], front.parameters["y"]
    assert len(x) == 21
    assert x == pytest.approx(y, abs=1e-4)
    assert [x.min(), x.max()] == pytest.approx([-(2.0**-0.5), 2.0**-0.5], abs=1e-4)
    one = front.values[:, 0]
    root = np.sqrt(-np.log(1.0 - one))
    exact = 1.0 - np.exp(-((2.0 - root) ** 2))
    assert front.values[:, 1] == pytest.approx(exact, abs=1e-8)


def test_the_lowest_of_many_waves_is_found():
    ranges = [Range(name, "1", np.array([-5.12, 5.12]), counted=False) for name in "xy"]
    search = Objectives(Waves, ranges, [Objective(("height",), "1", -1.0)], np.zeros(1), {}, {})
    front = pareto_front(search)
    assert front.values == pytest.approx(np.zeros((1, 1)), abs=1e-9)
    assert [*front.parameters["x"], *front.parameters["y"]] == pytest.approx([0.3, 0.0], abs=1e-5)


@pytest.fixture(scope="module")
def foot():
    """Force against stroke of the toe over both attachment radii."""
    ranges = [between("r_po", 0.03, 0.045), between("r_pl", 0.005, 0.03)]
    return pareto_front(Objectives(FootDesign, ranges, [FORCES, STROKE], np.zeros(1), {}, {}))


@pytest.mark.slow
def test_force_against_stroke_of_the_foot_is_the_closed_form(foot):
    """F = T min(a, b) and s = d (1 / a + 1 / b) of gains a and b with a smallest value each: at a
    force both gains are what it needs, or their smallest.
    """
    ankle_lever = 1e-3 * (50.8 * np.sin(np.radians(49.0)) + 62.5 * np.sin(np.radians(79.9)) + 23.6)
    least = 0.03 * np.sin(np.radians(57.7 - 12.9)) / ankle_lever, 5.0 / 23.6
    force, stroke = foot.values.T
    exact = 1.8e-4 * sum(1.0 / np.maximum(force / 3.0, smallest) for smallest in least)
    assert stroke == pytest.approx(exact, rel=1e-6)
    most = 3.0 * 0.045 * np.sin(np.radians(44.8)) / ankle_lever
    assert [force.min(), force.max()] == pytest.approx([3.0 * least[0], most], rel=1e-6)


def dominated_by(front, force, stroke, share=1e-6):
    """Points of a front than which a drawn one is better in both by more than a share."""
    better = [(force > f * (1 + share)) & (stroke > s * (1 + share)) for f, s in front.values]
    return [k for k, one in enumerate(better) if np.any(one)]


def test_no_point_of_a_grid_dominates_the_front(foot):
    r_po, r_pl = np.meshgrid(np.linspace(0.03, 0.045, 400), np.linspace(0.005, 0.03, 400))
    design = FootDesign(r_po=r_po.ravel(), r_pl=r_pl.ravel())
    assert dominated_by(foot, design.toe_force(), design.toe_stroke()) == []
    assert len(foot.values) == 21


@pytest.mark.slow
def test_no_point_of_a_million_dominates_a_front_over_the_whole_geometry():
    names = (
        "r_po",
        "r_pl",
        "l1",
        "l2",
        "l3",
        "beta_pf",
        "beta_df",
        "beta_p",
        "beta_po",
        "gamma_po",
    )
    spans = {p.name: (p.min, p.max) for p in FootDesign.layout.parameters if p.name in names}
    ranges = [between(name, *ends) for name, ends in spans.items()]
    search = Objectives(FootDesign, ranges, [FORCES, STROKE], np.zeros(1), {}, {})
    front = pareto_front(search, 11)
    random = np.random.default_rng(1)
    design = FootDesign(**{n: random.uniform(*ends, 1_000_000) for n, ends in spans.items()})
    force, stroke = design.toe_force(), design.toe_stroke()
    assert len(front.values) >= 8
    assert dominated_by(front, force, stroke) == []
    nominal = FootDesign()
    assert (front.values > [nominal.toe_force(), nominal.toe_stroke()]).all(axis=1).any()


def test_progress_is_told_to_the_end(bells):
    told = []
    pareto_front(bells, 5, progress=lambda done, whole: told.append((done, whole)))
    assert told[-1] == (5, 5)


def test_where_no_run_gives_numbers_is_told(decay, monkeypatch):
    def fails(shares):
        raise UserError("it fails")

    monkeypatch.setattr(decay, "evaluate", fails)
    with pytest.raises(UserError, match="it fails"):
        pareto_front(decay)
