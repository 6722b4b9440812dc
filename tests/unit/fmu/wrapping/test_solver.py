"""Claims: an FMU for model exchange alone is integrated with its events. Oracle: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu import Fmu, find_model
from orchestration.fmu.model import declared_model
from orchestration.fmu.simulation import EndedSimulation, FmuSource, RepeatedFmu, simulate
from tests.support.fmi3_fmus import foreign, of_interface


def test_events_of_model_exchange_are_found(tmp_path):
    """A sawtooth, which falls at time events: its values and its count on paper."""
    path = of_interface(foreign("sawtooth"), "ModelExchange", tmp_path)
    time = 0.07 * np.arange(20)
    with RepeatedFmu(path) as fmu:
        found = fmu.run(time, {}, {"slope": 2.0}, ["x", "count"])
    assert found[:, 0] == pytest.approx(2.0 * (time % 0.3), abs=1e-5)
    assert found[:, 1].tolist() == (time // 0.3).tolist()


def test_a_state_brings_back_time_events_and_inputs(tmp_path):
    """A sawtooth that is stepped from a state at 0.5 s a second time, and from its bytes."""
    path = of_interface(foreign("sawtooth"), "ModelExchange", tmp_path)
    with Fmu(path) as fmu:
        fmu.start()
        fmu.step(0.0, 0.5)
        state, contents = fmu.save(), fmu.serialized_state()
        rows = []
        for go_on in (lambda: None, lambda: fmu.restore(state), lambda: fmu.resume(contents)):
            go_on()
            fmu.step(0.5, 0.25)
            row = np.empty(2)
            fmu.reader(["x", "count"])(row)
            rows.append(row)
        fmu.release(state)
    np.testing.assert_allclose(rows, 3 * [[0.15, 2.0]], atol=1e-5)


@pytest.mark.parametrize(("step", "count"), [(0.15, 3), (0.2, 2)])
def test_one_that_ends_its_simulation_has_values_at_its_end(step, count, tmp_path):
    """It ends at 0.3 s, at the end of a step and within one."""
    model = find_model(str(of_interface(foreign("sawtooth"), "ModelExchange", tmp_path)))
    points = step * np.arange(8)
    with pytest.raises(EndedSimulation, match=r"its simulation ends at 0\.3 s") as ended:
        simulate(model, points, {}, {"manner": 3})
    reached = points[:count] if step == 0.15 else [*points[:count], 0.3]
    np.testing.assert_allclose(ended.value.time, reached, rtol=0, atol=1e-12)
    assert ended.value.outputs["count"][-1] == 1


def test_robertsons_problem_is_solved_over_eleven_decades(tmp_path):
    """Oracle: the test set for initial value problems (F. Mazzia, C. Magherini), problem ROBER."""
    path = of_interface(foreign("roberts"), "ModelExchange", tmp_path)
    start, stop, step = FmuSource(path).default_experiment
    with RepeatedFmu(path) as fmu:
        found = fmu.run(np.arange(start, stop + step, step), {}, {}, ["y[1]", "y[2]", "y[3]"])
    expected = [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050]
    assert found[-1] == pytest.approx(expected, rel=1e-4)


def test_of_both_interfaces_model_exchange_is_taken_if_asked_for(tmp_path):
    """The FMU's own solver stands still."""
    model = find_model(str(foreign("roberts"))).with_options({"model_exchange": True})
    found = simulate(model, np.array([0.0, 0.4]), {}, {})
    # A. C. Hindmarsh and others, the example cvRoberts_dns of SUNDIALS, at t = 0.4
    expected = [9.8517e-01, 3.3864e-05, 1.4794e-02]
    assert [found[f"y[{k}]"][-1] for k in (1, 2, 3)] == pytest.approx(expected, rel=1e-4)
    alone = find_model(str(of_interface(foreign("lag"), "CoSimulation", tmp_path)))
    with pytest.raises(UserError, match="it has no model exchange"):
        alone.by_model_exchange()
    with pytest.raises(UserError, match="ppy_actuator is no FMU file"):
        declared_model("ppy_actuator").by_model_exchange()
