"""Claims: ``ppy run hil_displacement_loop`` holds the displacement of an emulated rig's films.

Oracle: the rig's own log of what it measured; with nominal films, the loop of a model.
"""

from __future__ import annotations

import numpy as np
import pytest

import ppy_rig as ppy
from tests.support.rig.process import Server

pytestmark = pytest.mark.slow
MICRON = 1e-6  # m


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with Server(tmp_path_factory.mktemp("rig"), "emulator", "--lockstep") as server:
        server.wait_ready()
        return ppy.run("hil_displacement_loop", settings={"proxy.endpoint": server.endpoint})


def test_the_displacement_is_wanted_again_after_a_step_and_a_load(run):
    settled = np.searchsorted(run["time"], [5.9, 11.9, 19.9])
    displacement = np.asarray(run["proxy.displacement"])
    # the rig's sensor has noise of microns, and its load creeps
    np.testing.assert_allclose(displacement[settled], [5e-5, 1e-4, 1e-4], atol=15 * MICRON)
    assert np.abs(run["proxy.voltage"]).max() <= 1.05


def test_the_films_of_the_rig_and_of_the_model_answer_alike(run):
    modelled = ppy.run("displacement_loop")
    apart = np.asarray(run["proxy.charge"]) - np.asarray(modelled["actuator.charge"])
    assert np.abs(apart).max() < 0.15 * np.abs(modelled["actuator.charge"]).max()
