"""Claims: ``foot_stance`` with a rig as ``po`` rolls the weight from heel to ball and takes it off.

Oracle: the same system with a component in place of the rig, whose films are nominal.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ppy_rig as ppy
from fmus import component
from orchestration import master
from orchestration.system import Member, library
from tests.support.rig.process import Server

pytestmark = pytest.mark.slow
WEIGHT = 0.031 * 9.80665  # N


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with Server(tmp_path_factory.mktemp("rig"), "emulator", "--lockstep") as server:
        server.wait_ready()
        settings = {"system": "hil_stance", "step": "10 ms", "po.endpoint": server.endpoint}
        return ppy.run("foot_stance", settings=settings)


def signal(run, name):
    return np.asarray(run[name])


def test_the_weight_goes_from_heel_to_ball_with_a_rig_in_the_loop(run):
    time = signal(run, "time")
    heel, ball = signal(run, "foot.heel_pressure"), signal(run, "foot.ball_pressure")
    middle = np.searchsorted(time, 2.0)
    late = np.searchsorted(time, 5.7)
    assert heel[middle] > 0.9 * WEIGHT
    assert ball[late] > 0.6 * WEIGHT
    assert time[heel > 0.0][-1] < time[ball > 0.0][-1] < 7.45
    assert 0.3 < signal(run, "foot.po_force").min() < signal(run, "foot.po_force").max() < 2.0


def test_the_rig_and_nominal_films_answer_alike(run):
    """The rig's films differ by what a specimen does, and its sensor has noise of microns."""
    system = library.system("hil_stance")
    films = Member.of("po", component("ppy_actuator"))
    members = tuple(films if one.name == "po" else one for one in system.members)
    inputs = {name: signal(run, name) for name in system.inputs}
    modelled = master.run(replace(system, members=members), signal(run, "time"), inputs).signals
    apart = signal(run, "foot.po_force") - modelled["foot.po_force"]
    settled = signal(run, "time") > 0.5
    assert np.abs(apart[settled]).max() < 0.15 * np.abs(modelled["foot.po_force"]).max()
