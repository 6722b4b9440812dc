"""Claims: the foot with the mechanical model of its actuators is the free foot under the tensions
of springs between points, and keeps their energy.
"""

from functools import cache

import numpy as np
import pytest

from fmus.foot.model import FootDisplacementDriven, FootFree
from fmus.kit.record.compiled import CompiledModel
from tests.support.foot import ACTUATORS, JOINTS, RANGES, lengths_at

K, B = 6300.0, 9e5
REFERENCE = np.array(lengths_at(0.0, 0.0))
compiled = cache(CompiledModel)


def drawn(seed):
    """Posture, rates, flows, displacements that leave half of the actuators slack, and a force."""
    random = np.random.default_rng(seed)
    values = {f"{j}_angle_start": random.uniform(*RANGES[j]) for j in JOINTS}
    values |= {f"{j}_rate_start": random.normal() for j in JOINTS}
    values |= {"leg_height_start": random.uniform(0.02, 0.05), "leg_force_y": 0.3}
    flows = {f"{a}_flow_start": 1e-3 * random.normal() for a in ACTUATORS}
    displacements = {f"{a}_displacement": 1e-3 * random.normal() for a in ACTUATORS}
    springs = {f"k_{a}": K for a in ACTUATORS} | {f"b_{a}": B for a in ACTUATORS}
    return values, flows, displacements, springs


def spring_forces(values, flows, displacements):
    """Of springs between the points of the attachments, as if they could push."""
    lengths = np.array(lengths_at(values["ankle_angle_start"], values["mtp_angle_start"]))
    free = np.add([*flows.values()], [*displacements.values()])
    return K * (lengths - REFERENCE - free)


def test_it_moves_as_the_free_foot_under_tensions_of_springs_between_points():
    slack = 0
    for seed in range(100):
        values, flows, displacements, springs = drawn(seed)
        forces = spring_forces(values, flows, displacements)
        pulls = np.maximum(forces, 0.0)
        foot = FootDisplacementDriven(**values, **flows, **displacements, **springs)
        given = {f"{a}_tension": float(pull) for a, pull in zip(ACTUATORS, pulls, strict=True)}
        free = FootFree(**values, **given)
        assert [getattr(foot, f"{a}_force")() for a in ACTUATORS] == pytest.approx(pulls, abs=1e-9)
        assert [getattr(foot, f"{a}_flow_rate")() for a in ACTUATORS] == pytest.approx(pulls / B)
        rates = [getattr(free, state.rate)() for state in FootFree.layout.states]
        found = [getattr(foot, state.rate)() for state in FootFree.layout.states]
        assert found == pytest.approx(rates, rel=1e-7, abs=1e-6)
        margins = [getattr(foot, f"{a}_compression_margin")() for a in ACTUATORS]
        assert margins == pytest.approx(forces, abs=1e-9)
        slack += np.count_nonzero(pulls == 0.0)
    assert 100 < slack < 300


def test_energy_goes_into_springs_dashpots_and_joints():
    """In the air, from tensions out of balance: what is gone is b times the rate of flow squared,
    and what the joints lose.
    """
    time = 1e-4 * np.arange(2001)
    values = {f"k_{a}": K for a in ACTUATORS} | {f"b_{a}": 5e3 for a in ACTUATORS}
    values |= {f"{a}_flow_start": -1e-4 * (i + 1) for i, a in enumerate(ACTUATORS)}
    values |= {"leg_velocity_x_start": -2.0, "ground_stiffness": 0.0}
    found = (
        compiled(FootDisplacementDriven)
        .run(
            time,
            {v.name: np.zeros(time.size) for v in FootDisplacementDriven.layout.inputs},
            values,
        )
        .signals
    )
    pulls = np.array([found[f"{a}_force"] for a in ACTUATORS])
    stored = (pulls**2).sum(axis=0) / (2.0 * K)
    power = (pulls**2).sum(axis=0) / 5e3
    flowed = np.append(0.0, np.cumsum(0.5e-4 * (power[1:] + power[:-1])))
    total = found["kinetic_energy"] + found["potential_energy"] + found["joint_loss"] + stored
    assert flowed[-1] > 1e-5
    assert np.ptp(total + flowed) < 1e-3 * flowed[-1]
