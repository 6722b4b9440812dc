"""Claims: an FMU is called as the state machine of its standard allows, and is told all it may
need. Oracles: the tables of the standards in `tests.support.fmi_states`, fmpy, closed forms.
"""

from __future__ import annotations

import fmpy
import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu import Fmu
from orchestration.fmu.model import find_model
from orchestration.fmu.simulation import (
    EndedSimulation,
    FmuSource,
    RepeatedFmu,
    simulate,
    with_changes,
)
from orchestration.records import Record
from tests.support.archive import edited
from tests.support.fmi_states import faults
from tests.support.recording import INTERFACES, by_instance, recorded, recorder, values_set

TIME = 0.25 * np.arange(-4, 5)
U = np.where(TIME < 0.0, 2.0, 3.0)
TAU = 1.5
KINDS = [(version, interface) for version in (2, 3) for interface in INTERFACES]


def lag(time=TIME, u=U):
    """The state on paper: at rest with its first input, which is then held from point to point."""
    x = np.empty_like(time)
    x[0] = u[0]
    for k, step in enumerate(np.diff(time)):
        x[k + 1] = x[k] - np.expm1(-step / TAU) * (u[k] - x[k])
    return x


def lives_of(calls, version):
    lives = by_instance(calls)
    assert [fault for life in lives for fault in faults(life, version)] == []
    return lives


def first_values(calls):
    """The values that calls have set, by name."""
    values = {}
    for call in calls:
        if call.function == "SetReal":
            values |= values_set(call)
    return values


def setup_of(life, version):
    """Return the arguments for tolerance, start and stop."""
    name = "SetupExperiment" if version == 2 else "EnterInitializationMode"
    return next(list(map(float, c.arguments)) for c in life if c.function == name)


@pytest.mark.parametrize(("version", "interface"), KINDS)
def test_a_run_tells_its_times_tolerance_and_first_inputs_and_ends_properly(version, interface):
    model = find_model(str(recorder(version, (interface,))))
    settings = {"k": 1.7, "tau": TAU}
    found, calls = recorded(lambda: simulate(model, TIME, {"u": U}, settings))
    (life,) = lives_of(calls, version)
    assert setup_of(life, version) == [1.0, 1e-7, -1.0, 1.0, 1.0]
    assert found["y"] == pytest.approx(1.7 * lag(), abs=1e-5)
    names = [call.function for call in life]
    before = life[: names.index("ExitInitializationMode")]
    first = first_values(before)
    assert first == {"k": 1.7, "tau": TAU, "u": 2.0}
    assert names[-2:] == ["Terminate", "FreeInstance"]


def test_what_is_told_is_what_fmpy_tells():
    path = recorder(2)
    columns = np.array([*zip(TIME, U, strict=True)], dtype=[("time", "f8"), ("u", "f8")])
    options = {"start_values": {"k": 1.7}, "input": columns, "output_interval": 0.25}
    _, theirs = recorded(lambda: fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", **options))
    _, ours = recorded(lambda: simulate(find_model(str(path)), TIME, {"u": U}, {"k": 1.7}))

    def told(calls):
        life = [c for c in calls if c.function != "GetReal"]
        begin = [c.function for c in life].index("ExitInitializationMode")
        values = first_values(life[:begin])
        steps = [[*map(float, c.arguments)] for c in life if c.function == "DoStep"]
        return setup_of(life, 2), values, steps, [c.function for c in life[-2:]]

    assert told(ours) == told(theirs)


def test_a_tolerance_of_the_user_is_told():
    _, calls = recorded(lambda: run_once(recorder(2), tolerance=1e-9))
    assert setup_of(calls, 2)[:2] == [1.0, 1e-9]


def run_once(path, tolerance=None):
    with RepeatedFmu(path, tolerance) as fmu:
        return fmu.run(TIME, {"u": U}, {}, ["y"])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("keeps", [0.0, 1.0])
def test_a_reset_is_judged_by_the_first_run(version, keeps):
    """An FMU that keeps its state over a reset gives the numbers of new instances all the same."""
    cases = [{"tau": TAU, "k": k, "keeps": keeps} for k in (1.0, 2.0, 3.0)]

    def swept():
        with RepeatedFmu(recorder(version)) as fmu:
            return [fmu.run(TIME, {"u": U}, one, ["y"])[:, 0] for one in cases], fmu.remarks

    (found, remarks), calls = recorded(swept)
    assert np.array(found) == pytest.approx(np.outer((1.0, 2.0, 3.0), lag()))
    lives = lives_of(calls, version)
    assert len(lives) == (3 if keeps else 1)
    assert ["fmi2Reset" in line for line in remarks] == [True] * bool(keeps)


@pytest.mark.parametrize(("version", "interface"), KINDS)
def test_an_end_that_the_fmu_asks_for_keeps_its_last_values(version, interface):
    model = find_model(str(recorder(version, (interface,))))
    settings = {"tau": TAU, "ends": 0.4}

    def ended():
        with pytest.raises(EndedSimulation, match="asks to end") as caught:
            simulate(model, TIME, {"u": U}, settings)
        return caught.value

    found, calls = recorded(ended)
    lives_of(calls, version)
    if interface == "CoSimulation":
        reached = np.append(TIME[TIME < 0.4], 0.4)
        assert found.time == pytest.approx(reached)
        assert found.outputs["y"] == pytest.approx(lag(reached, np.where(reached < 0.0, 2.0, 3.0)))
    else:  # at a step of the solver
        assert 0.4 < found.time[-1] <= 0.5


@pytest.mark.parametrize("version", [2, 3])
def test_after_an_error_it_is_freed_and_not_terminated(version):
    model = find_model(str(recorder(version)))

    def failed():
        with pytest.raises(UserError, match="failed"):
            simulate(model, TIME, {"u": U}, {"fails": 0.4})

    _, calls = recorded(failed)
    (life,) = lives_of(calls, version)
    assert [call.function for call in life][-2:] == ["DoStep", "FreeInstance"]


def test_a_refused_value_leaves_an_fmu_that_is_terminated():
    def refused():
        with Fmu(recorder(2)) as fmu:
            fmu.start(0.0, 1.0)
            raise UserError("of something else")

    def tried():
        with pytest.raises(UserError, match="of something else"):
            refused()

    _, calls = recorded(tried)
    assert [c.function for c in calls][-2:] == ["Terminate", "FreeInstance"]


def test_an_fmu_with_one_step_makes_no_other():
    """Samples of another rate and with jitter: its steps are its own, outputs are taken between."""
    path = recorder(2, fixed_step=True)
    time = np.array([0.0, 0.33, 0.61, 1.02, 1.3])
    u = np.full(5, 2.0)

    def ran():
        with RepeatedFmu(path) as fmu:
            return fmu.run(time, {"u": u}, {"tau": TAU, "k": 3.0}, ["y"])[:, 0]

    found, calls = recorded(ran)
    steps = {float(c.arguments[1]) for c in calls if c.function == "DoStep"}
    assert steps == {0.25}
    assert setup_of(calls, 2)[2:] == [0.0, 1.0, 1.5]
    assert found == pytest.approx(np.full(5, 6.0))
    assert FmuSource(path).points(time).tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]


def test_steps_end_where_a_recorded_input_changes():
    time = 0.1 * np.arange(21)
    u = np.where(time < 0.75, 1.0, 2.0)
    record = Record.__new__(Record)
    object.__setattr__(record, "time", time)
    object.__setattr__(record, "signals", {"u": u})
    grid = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    assert with_changes(record, grid) == pytest.approx([0.0, 0.5, 0.8, 1.0, 1.5, 2.0])
    constant = np.array([0.0, 0.4, 0.8, 1.2])
    assert with_changes(record, constant) is constant


@pytest.mark.parametrize(
    ("declared", "expected"),
    [
        ('startTime="-1" stopTime="0"', (-1.0, 0.0, 0.25)),
        ('startTime="-3" stopTime="-1"', (-3.0, -1.0, 0.25)),
        ('startTime="1e9" stopTime="1000000001"', (1e9, 1000000001.0, 0.25)),
        ('startTime="0" stopTime="0"', (0.0, None, 0.25)),
        ('stopTime="2"', (0.0, 2.0, 0.25)),
    ],
)
def test_declared_times_are_taken_as_they_are(tmp_path, declared, expected):
    def edit(name, contents):
        return name, contents.replace(b'startTime="-1" stopTime="1"', declared.encode())

    path = edited(recorder(2), tmp_path / "other.fmu", edit)
    assert FmuSource(path).default_experiment == expected
