"""Two lags in series are two in parallel with other amounts: effects that come to the same are one,
and the plainest is named. What an input can tell apart is not one.

Oracle: partial fractions, on paper.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.effects import effect_name
from fmus.kit.symbolic import families_for
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection.equivalence import as_another
from orchestration.discrepancy.selection.ranking import ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from tests.support.cell_record import drive, lagged

SAMPLES = 600
SERIES, FAST, SLOW = 0.03, (0.02, 5.0), (0.015, 60.0)  # ohm, and ohm and s


class Circuit(Component):
    """A resistance and one RC pair."""

    name = "circuit"

    R0 = Parameter(0.03, "ohm", min=1e-6, max=10, nominal=0.01)
    R1 = Parameter(0.02, "ohm", min=1e-6, max=10, nominal=0.01)
    T1 = Parameter(10.0, "s", min=1e-3, max=1e6)
    current = Input("A", nominal=2.5)
    pair = State("V", rate="pair_rate", nominal=0.05)

    def pair_rate(self):
        """Return the rate of the pair."""
        return (self.R1 * self.current - self.pair) / self.T1

    def drop(self):
        """Return the voltage lost."""
        return self.R0 * self.current + self.pair

    @Output("V", nominal=0.1)
    def voltage(self):
        """Return the voltage."""
        return self.drop()


EFFECTS = {effect_name(effect): effect for effect in families_for(Circuit)}
PAIR = EFFECTS["rc_pair(drop, current)"]
IN_SERIES = EFFECTS["lagging_law(drop, pair)"]
BENT = EFFECTS["cubic_resistance(drop, current)"]


@pytest.fixture(scope="module")
def search():
    """Of a record of two pairs with a little noise."""
    random = np.random.default_rng(5)
    current = drive(random, SAMPLES)
    voltage = SERIES * current + sum(r * lagged(current, t) for r, t in (FAST, SLOW))
    measured = {"voltage": voltage + 1e-4 * random.standard_normal(SAMPLES)}
    data = Dataset(np.arange(float(SAMPLES)), {"current": current}, measured)
    return Search(data, Circuit, ["R0", "R1", "T1"])


@pytest.fixture(scope="module")
def ranking(search):
    base = search.nominal()
    effects = [IN_SERIES, BENT, PAIR]
    return base, ranked(search, base, [score(search, base, effects)], effects)


def test_lags_in_series_are_lags_in_parallel_in_other_parameters(search, ranking):
    """R1 / (1 + T1 s) + a R1 / ((1 + T1 s) (1 + T s)), where the pairs are those of the record."""
    base, found = ranking
    pair, series = found.near[PAIR], found.near[IN_SERIES]
    values = as_another(search, series, pair, base)
    assert values is not None
    amount, first, second = (
        values[n] for n in ("drop_of_pair_lagging_law", "T1", "drop_of_pair_lagging_law_constant")
    )
    in_first = values["R1"] * (1.0 + amount * first / (first - second))
    in_second = -values["R1"] * amount * second / (first - second)
    parts = sorted([(first, in_first), (second, in_second)])
    expected = sorted([FAST[::-1], SLOW[::-1]])
    np.testing.assert_allclose(parts, expected, rtol=0.05)


def test_what_another_input_tells_apart_is_not_equivalent(search, ranking):
    base, found = ranking
    bent = search.in_white_noise().fit_with(
        [BENT], base, {"drop_of_current_cubic_resistance": 1e-3}
    )
    assert bent is not None
    assert as_another(search, found.near[PAIR], bent, base) is None
    assert as_another(search, bent, found.near[PAIR], base) is None


def test_the_one_with_a_name_in_its_field_stands_for_both(ranking):
    _, found = ranking
    assert found.rows[0][0].effect is PAIR
    assert IN_SERIES not in [fitted.effect for fitted, _ in found.rows]
    assert [fitted.effect for fitted, _ in found.equivalents[PAIR]] == [IN_SERIES]
