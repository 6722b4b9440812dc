"""Claims: late, silent, gone, safe or unwilling rigs are handled as promised, in both builds."""

from __future__ import annotations

import contextlib
import itertools
import time

import pytest

from tests.contract.raw import ERROR, OK, WARNING, Instance, instance
from tests.support.rig.proxies import OUTPUTS, actuator_rig, answered, connected

pytestmark = pytest.mark.real_time

CONNECTED, REFUSED, STALE, LOST = range(4)
STEP = 0.02
FAST = {"communication_timeout": 0.4, "deadline": 0.03, "max_age": 0.15}


@pytest.fixture
def one(fmu, runtime):
    with instance(fmu("rig_proxy", runtime)) as created:
        yield created


def link(one: Instance) -> tuple[float, float, float]:
    """Age of the voltage, missed deadlines, and state of the link."""
    age, missed, state = one.get("voltage_age", "missed_deadlines", "link_state")
    return age, missed, state


def step_until(one: Instance, state: int, longest: float = 5.0) -> float:
    """Step until the link has a state; return the seconds it took."""
    begin = time.monotonic()
    while one.get("link_state")[0] != state:
        assert time.monotonic() - begin < longest, link(one)
        one.step(STEP)
    return time.monotonic() - begin


def fails(one: Instance) -> tuple[float, str]:
    """Step until a step is an error; return how long that step took, and what it said."""
    for _ in range(200):
        begin = time.monotonic()
        status = one.call("fmi2DoStep", one.time, STEP, 1)
        if status == ERROR:
            return time.monotonic() - begin, one.messages[-1]
        assert status == OK
        one.time += STEP
    raise AssertionError(f"200 steps without an error: {link(one)}")


def test_values_are_those_of_the_commands_of_the_step(one):
    with actuator_rig(period=0.002) as rig:
        connected(one, rig, FAST)
        for current in (0.5, -0.5, 1.0):
            one.set({"current": current, "force": 2.0})
            one.step(STEP)
            assert one.get("voltage", "displacement") == pytest.approx(
                [0.6 * current, 2e-5 * current + 2e-4]
            )
        age, missed, state = link(one)
        assert (missed, state) == (0, CONNECTED)
        assert 0.0 <= age < FAST["max_age"]
        assert 0.0 < one.get("round_trip_time")[0] < STEP


def test_silence_is_held_with_growing_age_then_stale_then_lost(one):
    with actuator_rig() as rig:
        connected(one, rig, FAST | {"current": 1.0}, on_stale="hold")
        one.step(STEP), one.step(STEP)
        voltage = one.get("voltage")
        rig.answers = False
        began, ages = time.monotonic(), []
        for _ in range(3):
            one.step(STEP)
            ages.append(link(one)[0])
        assert ages == sorted(ages)
        assert ages[-1] > 2 * STEP
        assert link(one)[1] >= 2
        step_until(one, STALE)
        assert time.monotonic() - began < FAST["max_age"] + 0.3
        step_until(one, LOST)
        assert time.monotonic() - began < FAST["communication_timeout"] + 0.5
        assert one.get("voltage") == voltage
        held = link(one)[0]
        begin = time.monotonic()
        one.step(STEP)
        assert time.monotonic() - begin < FAST["communication_timeout"]
        assert link(one)[0] > held
        rig.answers = True  # and the session lives on, for the watchdog is longer
        step_until(one, CONNECTED)
        one.step(STEP), one.step(STEP)
        assert one.get("voltage") == voltage
        assert len(rig.of_type("connect")) == 1


def test_the_clock_runs_from_the_first_step_on(one):
    """However long a master takes between initialization and the first step, that step waits for
    its end.
    """
    with actuator_rig(period=0.002) as rig:
        connected(one, rig)
        time.sleep(0.3)
        one.set({"current": 1.0})
        begin = time.monotonic()
        one.step(0.1)
        assert time.monotonic() - begin > 0.09
        assert one.get("voltage") == [pytest.approx(0.6)]


def test_silence_fails_within_the_timeout(one):
    with actuator_rig() as rig:
        connected(one, rig, FAST, on_stale="fail")
        one.step(STEP)
        rig.answers = False
        begin = time.monotonic()
        took, said = fails(one)
        assert took < FAST["communication_timeout"] + 0.05, (
            "the farewell after an error is within the timeout too"
        )
        assert time.monotonic() - begin < FAST["max_age"] + 1.0
        assert "voltage" in said or "no answer" in said
        assert "s old; max_age is 0.15 s" in said or "no answer" in said
        one.do("fmi2Terminate")


def test_a_server_in_the_place_of_a_killed_one_gets_no_command(one):
    """Whoever has seen to the rig after the crash has it at rest until somebody wants otherwise."""
    with actuator_rig() as rig:
        answered(connected(one, rig, FAST | {"current": 1.0}, on_stale="hold"), voltage=0.6)
        port = rig.port
    step_until(one, LOST)
    with actuator_rig(port=port) as rig:
        for _ in range(20):
            one.step(STEP)
        age, _, state = link(one)
        assert state == LOST
        passed = time.monotonic() - one.get("charge")[0]
        assert age == pytest.approx(passed, abs=0.1)
        assert one.get("voltage") == [pytest.approx(0.6)]
        assert rig.of_type("connect") == []
        assert {current["current"] for _, current in rig.applied} == {0.0}


def test_a_session_that_was_taken_away_is_over_and_told_once(one):
    with actuator_rig() as rig:
        connected(one, rig, FAST | {"current": 1.0}, on_stale="hold").step(STEP)
        rig.session = "another's"
        for _ in range(5):
            one.step(STEP)
        assert link(one)[2] == LOST
        refusals = [text for text in one.messages if "no such session" in text]
        assert len(refusals) == 1
        assert one.levels[one.messages.index(refusals[0])] == WARNING
        assert len(rig.of_type("connect")) == 1


@pytest.mark.parametrize(
    ("settling", "bound", "said"),
    [
        (60.0, 60.0, "on the way to its safe state: the emergency stop was pressed"),
        (0.0, 60.0, "in its safe state: the emergency stop was pressed"),
        (60.0, -1.0, "HAS NOT REACHED ITS SAFE STATE AND MAY STILL BE ENERGISED: the emergency"),
    ],
)
def test_a_latch_is_an_error_with_its_reason(one, settling, bound, said):
    with actuator_rig() as rig:
        connected(one, rig, FAST, on_stale="hold").step(STEP)
        rig.settling, rig.bound = settling, bound
        rig.safe("the emergency stop was pressed")
        assert said in fails(one)[1]
        assert one.call("fmi2DoStep", one.time, STEP, 1) == ERROR


@pytest.mark.parametrize("how", ["silent", "latched", "dead", "terminated"])
def test_what_a_host_reads_after_the_end_is_as_old_as_it_says(one, how):
    """The rig's charge is the time at which it was measured."""
    with actuator_rig() as rig:
        connected(one, rig, FAST | {"current": 1.0}, on_stale="fail")
        one.step(STEP), one.step(STEP)
        if how == "silent":
            rig.answers = False
        elif how == "latched":
            rig.safe("the emergency stop was pressed")
        elif how == "terminated":
            one.do("fmi2Terminate")
        if how in ("silent", "latched"):
            fails(one)
    if how == "dead":
        fails(one)
    reads = []
    for _ in range(3):
        time.sleep(0.2)
        start = time.monotonic()
        ages = one.get("charge_age", "voltage_age", "round_trip_time")
        end = time.monotonic()
        reads.append((start, ages, end))
        measured = one.get("charge")[0]
        assert start - measured - 1e-3 <= ages[0] <= end - measured + 0.1
        assert one.get("link_state") == [LOST]
    for (began, first, ended), (start, second, end) in itertools.pairwise(reads):
        for before, after in zip(first, second, strict=True):
            assert start - ended - 1e-3 <= after - before <= end - began + 1e-3


def test_nothing_looks_fresh_before_there_is_anything(one):
    one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    one.do("fmi2EnterInitializationMode")
    age, _, state = link(one)
    assert state == LOST
    assert age > 3.2e7, "a year at least"


def test_a_second_instance_is_refused_and_the_first_goes_on(fmu, runtime):
    with (
        actuator_rig() as rig,
        instance(fmu("rig_proxy", runtime)) as one,
        instance(fmu("rig_proxy", runtime)) as other,
    ):
        connected(one, rig, FAST | {"current": 1.0})
        with pytest.raises(AssertionError, match="the rig serves rig_proxy"):
            connected(other, rig, FAST)
        one.step(STEP), one.step(STEP)
        assert link(one)[1:] == (0, CONNECTED)
        first, second = (message["instance"] for message in rig.of_type("connect"))
        assert first != second


def test_a_first_command_may_come_later_than_the_watchdog(one):
    """Masters that read their other members for a while before they begin."""
    with actuator_rig(watchdog=0.2) as rig:
        connected(one, rig, FAST | {"current": 1.0})
        time.sleep(0.6)
        one.step(STEP), one.step(STEP)
        assert link(one)[2] == CONNECTED
        assert one.get("voltage") == [pytest.approx(0.6)]


def test_a_refused_command_is_a_warning_and_a_state(fmu, runtime):
    limits = {"current": {"min": -1.3, "max": 1.3, "rate": None}}
    with actuator_rig(limits=limits) as rig, instance(fmu("rig_proxy", runtime)) as one:
        connected(one, rig, FAST | {"current": 0.5})
        one.step(STEP), one.step(STEP)
        one.set({"current": 5.0})
        one.step(STEP)
        assert link(one)[2] == REFUSED
        assert WARNING in one.levels
        assert "current = 5 is beyond its limit" in one.messages[-1]
        one.step(STEP)
        assert one.get("voltage") == [pytest.approx(0.3)]
        one.set({"current": 1.0})
        one.step(STEP), one.step(STEP)
        assert link(one)[2] == CONNECTED
        assert one.get("voltage") == [pytest.approx(0.6)]


def test_a_value_that_is_missing_is_held_and_grows_older(one):
    def half(inputs, now):
        return dict.fromkeys(OUTPUTS, 1e-3) | {"voltage": None if gone else 0.25}

    gone = False
    with actuator_rig(plant=half) as rig:
        connected(one, rig, FAST | {"max_age": 10.0})
        one.step(STEP)
        gone = True
        time.sleep(3 * rig.period)
        before = one.get("voltage_age")[0]
        for _ in range(4):
            one.step(STEP)
        voltage, age, other = one.get("voltage", "voltage_age", "charge_age")
        assert voltage == 0.25
        assert age > before + 3 * STEP > other


def test_a_rig_without_a_value_is_refused_at_the_start(one):
    silent = actuator_rig(plant=lambda inputs, now: dict.fromkeys(OUTPUTS))
    with silent as rig, pytest.raises(AssertionError, match="no value of voltage"):
        connected(one, rig, FAST)


def test_other_signals_and_units_are_refused_with_the_reason(one):
    other = actuator_rig(inputs={"current": "mA", "force": "N"})
    with other as rig, pytest.raises(AssertionError, match="other signals or units"):
        connected(one, rig, FAST)


def test_a_long_step_does_not_trip_the_watchdog(one):
    with actuator_rig(watchdog=0.2) as rig:
        connected(one, rig, {"communication_timeout": 2.0, "current": 1.0})
        one.step(1.0)
        assert rig.state == "running"
        assert one.get("voltage") == [pytest.approx(0.6)]
        assert len(rig.of_type("exchange")) >= 5


def test_a_fast_master_is_slowed_to_the_rigs_clock(one):
    with actuator_rig() as rig:
        connected(one, rig)
        begin = time.monotonic()
        for _ in range(30):
            one.step(0.01)
        assert 0.3 - 0.005 < time.monotonic() - begin < 0.8


def test_a_simulation_that_is_late_by_steps_does_not_race(one):
    """Its values would be as old as ever in a time that goes faster."""
    with actuator_rig() as rig:
        connected(one, rig)
        one.step(STEP)
        time.sleep(0.3)
        begin = time.monotonic()
        for _ in range(10):
            one.step(STEP)
        assert time.monotonic() - begin > 9 * STEP - 1e-3


def test_several_proxies_of_one_master_are_as_fast_as_one(fmu, runtime):
    """While one waits for the clock it goes on for the others, too."""
    with contextlib.ExitStack() as opened:
        proxies = []
        for _ in range(3):
            rig = opened.enter_context(actuator_rig())
            proxy = opened.enter_context(instance(fmu("rig_proxy", runtime)))
            proxies.append(connected(proxy, rig))
        begin = time.monotonic()
        for _ in range(20):
            for proxy in proxies:
                proxy.step(STEP)
        lasted = time.monotonic() - begin
    assert 20 * STEP - 1e-3 < lasted < 35 * STEP


def test_in_lockstep_nobody_waits_for_a_clock_and_silence_is_an_error(one):
    with actuator_rig(mode="lockstep") as rig:
        connected(one, rig, FAST | {"communication_timeout": 0.3}, on_stale="hold")
        begin = time.monotonic()
        for _ in range(50):
            one.step(0.2)
        assert time.monotonic() - begin < 5.0  # of 10 s
        assert [m["time"] for m in rig.of_type("exchange")] == pytest.approx(
            [0.2 * k for k in range(50)]
        )
        rig.answers = False
        took, said = fails(one)
        assert took < 1.0
        assert "no answer within 0.3 s" in said
