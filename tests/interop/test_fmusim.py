"""Claims: fmusim integrates our FMUs to what they compute by themselves, and steps them to the bit.

It starts its solver again only where an FMU says that values or nominals have changed.
"""

from __future__ import annotations

from functools import partial

import pytest

from tests.support import fmusim
from tests.support.exchange import both_ways, distance
from tests.support.pace import FREE_FEET
from tests.support.stimuli import STIMULI

pytestmark = pytest.mark.skipif(not fmusim.BINARY, reason=fmusim.MISSING)
# the error in tolerances that is allowed; where a leg hits the ground it is of the instant, too
ALLOWED = dict.fromkeys(STIMULI, 1e3) | dict.fromkeys(FREE_FEET, 1e4)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", STIMULI)
def test_cvode_computes_what_co_simulation_does(fmu, name, fmi, tolerance):
    for output, (found, expected) in both_ways(
        *(fmu(name, "native", fmi), fmu(name, "native")),
        *STIMULI[name],
        simulate=fmusim.simulate_fmu,
        relative_tolerance=tolerance,
    ).items():
        assert distance(found, expected) <= ALLOWED[name] * tolerance, output


@pytest.mark.parametrize(("fmi", "flags"), [(2, ()), (3, ()), (3, fmusim.EVENT_MODE)])
@pytest.mark.parametrize("name", STIMULI)
def test_co_simulation_gives_the_numbers_of_our_master(fmu, name, runtime, fmi, flags):
    """To the 16 digits that it writes."""
    for output, (found, expected) in both_ways(
        *(fmu(name, runtime, fmi), fmu(name, runtime)),
        *STIMULI[name],
        simulate=partial(fmusim.simulate_fmu, flags=flags),
        fmi_type="CoSimulation",
    ).items():
        assert distance(found, expected) <= 1e-15, output
