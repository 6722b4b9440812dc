"""Claims: input clocks tick by time, in every interface; of output clocks the ticks are counted; a
state has the clocks. Oracle: the ticks on paper.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu import Fmu, find_model
from orchestration.fmu.simulation import RepeatedFmu
from tests.support.fmi3_fmus import changed, foreign, of_interface

TIME = 0.07 * np.arange(14)  # of which 0 and 0.7 s are ticks
OUTPUTS = ["count", "fired", "changes", "sum"]
INTERFACES = ("CoSimulation", "ModelExchange", "ScheduledExecution")


@pytest.mark.parametrize("interface", INTERFACES)
def test_clocks_tick_when_they_are_due(interface, tmp_path):
    u = np.where(TIME < 0.5, 1, 10)  # jumps at 0.56 s
    with RepeatedFmu(of_interface(foreign("clocked"), interface, tmp_path)) as fmu:
        for _ in range(3):  # the second and third after a reset
            found = fmu.run(TIME, {"u": u}, {}, OUTPUTS)
    slower = np.cumsum(0.1 * np.arange(1, 6))
    count = np.floor(TIME / 0.1 + 1e-9) + 1
    np.testing.assert_array_equal(found[:, 0], count)
    np.testing.assert_allclose(found[:, 1], np.where(TIME > 0.25, 0.25, 0.0), atol=1e-12)
    np.testing.assert_array_equal(found[:, 2], [(slower <= t + 1e-9).sum() for t in TIME])
    np.testing.assert_array_equal(found[:, 3], count + 9 * np.maximum(count - 6, 0))


@pytest.mark.parametrize("interface", INTERFACES)
def test_a_tick_at_a_communication_point_is_before_what_is_read_there(interface, tmp_path):
    time = 0.1 * np.arange(11)
    with RepeatedFmu(of_interface(foreign("clocked"), interface, tmp_path)) as fmu:
        found = fmu.run(time, {}, {}, ["count"])
    assert found[:, 0].tolist() == list(range(1, 12))


@pytest.mark.parametrize("interface", INTERFACES)
def test_the_value_of_an_output_clock_is_how_often_it_was_active(interface, tmp_path):
    with RepeatedFmu(of_interface(foreign("clocked"), interface, tmp_path)) as fmu:
        for _ in range(2):  # the second after a reset
            found = fmu.run(TIME, {}, {}, ["even", "count"])
    np.testing.assert_array_equal(found[:, 0], found[:, 1] // 2)
    assert found[-1, 0] == 5


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_a_state_has_the_next_ticks(interface, tmp_path):
    """The same ticks follow it again, in another instance, too; 0.27 s is before the
    only tick of `once`, which the FMU has told already, and within an interval of `slower`.
    """
    path = of_interface(foreign("clocked"), interface, tmp_path)
    names = ["count", "fired", "changes", "even"]

    def follow(fmu, time):
        read, row = fmu.reader(names), np.zeros(len(names))
        rows = []
        for begin, end in itertools.pairwise(time):
            fmu.step(begin, end - begin)
            read(row)
            rows.append(row.tolist())
        return rows

    time = np.append(0.24, 0.27 + 0.07 * np.arange(12))
    with Fmu(path) as fmu:
        fmu.start(0.0)
        follow(fmu, [0.0, 0.13, 0.22, 0.24])
        state, kept = fmu.save(), fmu.serialized_state()
        first = follow(fmu, time)
        fmu.restore(state)
        assert follow(fmu, time) == first
        fmu.release(state)
    assert first[-1] != first[0]
    with Fmu(path) as other:
        other.resume(kept)
        assert follow(other, time) == first


def test_a_clock_that_nothing_triggers_is_told_of(tmp_path):
    model = find_model(str(of_interface(foreign("clocked"), "CoSimulation", tmp_path)))
    assert model.notes == ("CoSimulation.fmu: never ticked, as nothing triggers them: idle",)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"0.1"', '"soon"', "every: intervalDecimal 'soon' is no time in s"),
        ('"0.1"', '"-1"', "every: intervalDecimal '-1' is no time in s"),
        ('intervalDecimal="0.1"', "", "every: is a clock of a constant interval, which is not"),
        ('priority="1"', 'priority="high"', "every: priority 'high' is no whole number"),
    ],
)
def test_a_clock_that_makes_no_sense_is_refused(old, new, message, tmp_path):
    with pytest.raises(UserError, match=message):
        find_model(str(changed("clocked", tmp_path, old, new)))


@pytest.mark.parametrize("kind", ["fixed", "tunable"])
def test_an_interval_may_be_that_of_the_fmu_or_of_its_description(kind, tmp_path):
    """The FMU has 0.1 s and a shift of 0.05 s."""
    declared = 'intervalVariability="constant"\n        intervalDecimal="0.1"'
    time = 0.05 * np.arange(7)
    for more, counts in (
        ("", [0, 1, 1, 2, 2, 3, 3]),
        (' intervalDecimal="0.2" shiftDecimal="0.1"', [0, 0, 1, 1, 1, 1, 2]),
    ):
        other = f'intervalVariability="{kind}"{more}'
        with RepeatedFmu(changed("clocked", tmp_path, declared, other)) as fmu:
            assert fmu.run(time, {}, {}, ["count"])[:, 0].tolist() == counts


def test_an_interval_may_be_a_ratio(tmp_path):
    ratio = 'intervalCounter="2" resolution="10"'
    with RepeatedFmu(changed("clocked", tmp_path, 'intervalDecimal="0.1"', ratio)) as fmu:
        found = fmu.run(0.1 * np.arange(5), {}, {}, ["count"])
    assert found[:, 0].tolist() == [1, 1, 2, 2, 3]
