"""Claims: candidates are held against each other in noise of one distribution, which is looked at anew with each cause.

Otherwise a change of the distribution passes for evidence: on a record whose noise varies in level, one effect that is
not there had a fall of BIC of 88.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection.search import Search


class Gain(Component):
    """What is fed, times a factor."""

    name = "gain"
    factor = Parameter(1.0, "1", min=0)
    u = Input("1")

    @Output("1")
    def y(self):
        return self.factor * self.u


def recorded(noise):
    time = 0.1 * np.arange(len(noise))
    u = np.random.default_rng(1).uniform(-1.0, 1.0, len(noise))
    return Dataset(time, {"u": u}, {"y": 2.0 * u + 0.1 * noise}, frozenset())


def test_the_noise_of_every_fit_is_of_the_distribution_of_the_first():
    random = np.random.default_rng(2)
    heavy, gaussian = recorded(random.standard_t(3.0, 4000)), recorded(random.standard_normal(4000))
    search = Search(heavy, Gain, ["factor"])
    base = search.nominal()
    assert base.fit.noise["y"].freedom == pytest.approx(3.0, rel=0.35)
    other = replace(search, data=gaussian)
    again = other.refit(base)
    assert again.fit.noise["y"].freedom == base.fit.noise["y"].freedom
    renewed = other.renewed(again)
    assert renewed.fit.noise["y"].freedom == np.inf
    assert other.refit(renewed).fit.noise["y"].freedom == np.inf
