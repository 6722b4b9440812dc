"""What a member is fed between samples."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.systems.cut import InputOrigin, InputSource
from orchestration.discrepancy.systems.member import MemberInputs
from orchestration.system import Port

TIME = 0.1 * np.arange(1000)


def inputs():
    """A force and a switch that are measured, and a temperature that stays."""
    force, switch = np.sin(TIME), (TIME > 50.0).astype(float)
    return MemberInputs(
        {
            "force": InputSource(InputOrigin.MEASURED, Port("m", "force"), force, continuous=True),
            "temperature": InputSource(InputOrigin.SETTING, value=20.0),
            "switch": InputSource(InputOrigin.UPSTREAM, Port("other", "on"), switch),
        },
        TIME,
    )


def test_only_continuous_inputs_change_between_samples():
    fed = inputs()
    assert (fed.names, fed.constant) == (["force", "switch"], {"temperature": 20.0})
    assert fed.linear == ["force"]
    values = fed.at_samples()
    assert fed.changes(values)[:, 0] == pytest.approx(np.diff(np.sin(TIME)))
    assert not fed.changes(values)[:, 1].any()
    fed.held.add("force")
    assert fed.linear == []
    assert not fed.changes(values).any()


def test_what_is_held_is_never_thinned_out_nor_are_switches_noisy():
    fed = inputs()
    thinned = fed.at_samples(thinning=2)
    assert thinned[::2] == pytest.approx(fed.columns[::2])
    assert thinned[1:-2:2, 0] == pytest.approx(0.5 * (fed.columns[:-2:2, 0] + fed.columns[2::2, 0]))
    assert np.all(thinned[:, 1] == fed.columns[:, 1])
    noisy = fed.at_samples(noise=np.random.default_rng(1))
    assert np.any(noisy[:, 0] != fed.columns[:, 0])
    assert np.all(noisy[:, 1] == fed.columns[:, 1])
    fed.held.add("force")
    assert np.all(fed.at_samples(thinning=2) == fed.columns)


def test_a_member_may_have_no_measured_input():
    fed = MemberInputs({"temperature": InputSource(InputOrigin.DEFAULT, value=20.0)}, TIME)
    assert fed.at_samples(2, np.random.default_rng(1)).shape == fed.columns.shape == (TIME.size, 0)
    assert fed.first == {}
