"""Line 12: for a host that integrates, the FMU has the same laws, events and refusals."""

from __future__ import annotations

import ctypes
import math
import re
from ctypes import byref, c_double, c_int

import numpy as np
import pytest

from fmus import component
from fmus.kit import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    State,
    absolute,
    maximum,
    sqrt,
    stack,
    where,
)
from tests.contract.models import BrokenRate, Sampler, Tuned
from tests.contract.raw import (
    ERROR,
    OK,
    WARNING,
    Instance,
    Library,
    doubles,
    instance,
    integers,
    unzipped,
)

EXCHANGE, COSIMULATION, DISCARD = 0, 1, 2


class Kinks(Component):
    """A ramp, and integrals of it that begin at a dead zone's edge, at zero and above an input."""

    name = "kinks"

    edge = Parameter(1.0, "1", min=-9, max=9, doc="edge of the dead zone")
    level = Input("1", start=2.0, doc="a level")
    ramp = State("1", rate="unity", start=-1.0, output=True, doc="rises by one a second")
    beyond = State("1", rate="excess", output=True, doc="integral of what is beyond the edge")
    relay = State("1", rate="above", output=True, doc="time spent above the level")

    def unity(self):
        return 1.0 + 0.0 * self.ramp

    def excess(self):
        return maximum(self.ramp - self.edge, 0.0)

    def above(self):  # that and the magnitude below switch at zero: one place
        return (
            where(self.ramp < 0.0, 0.0, 1.0)
            * where(self.ramp > self.level, 1.0, 0.0)
            * where(self.edge > 0.0, 1.0, 2.0)
        )

    @Output("1")
    def size(self):
        """Magnitude of the ramp."""
        return absolute(self.ramp)


class Clocked(Component):
    """Laws of the time, and a sample that is no number once its input is negative."""

    name = "clocked"

    u = Input("1", start=4.0, doc="what is sampled")
    x = State("s**2", rate="since", output=True, doc="half of the time squared")
    root = Discrete(
        "1", update="rooted", period=0.5, output=True, doc="root of the input at the latest sample"
    )

    def since(self):
        return self.time

    def rooted(self):
        return sqrt(self.u)

    @Output("s")
    def twice(self):
        """Twice the time."""
        return 2.0 * self.time + 0.0 * self.x


class Rooted(Component):
    """The root of an input, less one."""

    name = "rooted"

    u = Input("1", start=4.0, doc="whose root is taken")
    x = State("1", rate="beyond", doc="integral of what is beyond one")

    def beyond(self):
        return maximum(sqrt(self.u) - 1.0, 0.0)

    @Output("1")
    def twice(self):
        """Twice the integral."""
        return 2.0 * self.x


class _Event(ctypes.Structure):
    _fields_ = (
        *((name, c_int) for name in ("needed", "terminate", "nominals", "values", "defined")),
        ("time", c_double),
    )


class Exchanged(Instance):
    """An instance that the host integrates."""

    def __init__(self, library: Library, **given):
        super().__init__(library, kind=EXCHANGE, **given)

    def array(self, function: str, n: int) -> list[float]:
        values = (c_double * n)()
        self.do(f"fmi2{function}", values, n)
        return list(values)

    def at(self, time: float, *states: float) -> None:
        self.do("fmi2SetTime", time)
        self.do("fmi2SetContinuousStates", doubles(*states), len(states))

    def event(self) -> _Event:
        event = _Event()
        self.do("fmi2NewDiscreteStates", byref(event))
        return event


@pytest.fixture
def exchanged(built):
    """Open an instance of a class for model exchange."""
    opened = []

    def open_one(cls):
        folder = unzipped(built(cls, "native"))
        one = Exchanged(Library(folder.__enter__()))
        opened.extend([folder, one])
        assert one.component is not None, one.messages
        return one

    yield open_one
    for each in reversed(opened):
        each.__exit__(None, None, None)


def test_rates_are_those_of_the_law(exchanged):
    one = exchanged(component("ppy_actuator")).initialize(
        {"R1": 0.5, "R2": 2.0, "C": 3.0, "current": 0.25}
    )
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    one.at(4.0, 1.5, 2e-5, 1e-5)
    rate = one.array("GetDerivatives", 3)
    # eq. 3.5, first row: dQ/dt = (R2 i - Q/C) / (R1 + R2); without load the dashpots creep back
    assert rate == pytest.approx([(2.0 * 0.25 - 0.5) / 2.5, -1e4 * 2e-5 / 2e6, 0.0], rel=1e-14)
    assert one.array("GetContinuousStates", 3) == [1.5, 2e-5, 1e-5]
    assert one.array("GetNominalsOfContinuousStates", 3) == [1.0, 1e-4, 1e-4]
    assert one.get("voltage") == pytest.approx([0.5 * rate[0] + 0.5], rel=1e-14)
    assert one.get("der(charge)") == [rate[0]]
    assert one.tangent(["der(charge)"], ["charge"], [1.0]) == pytest.approx(
        [-1 / 3.0 / 2.5], rel=1e-14
    )
    flags = c_int(7), c_int(7)
    one.do("fmi2CompletedIntegratorStep", 1, byref(flags[0]), byref(flags[1]))
    assert [flag.value for flag in flags] == [0, 0]


def test_laws_of_the_time_follow_it_where_no_state_is_set(exchanged):
    one = exchanged(Clocked).initialize()
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    for time in (0.25, 0.375, 0.125):
        one.do("fmi2SetTime", time)
        assert (one.array("GetDerivatives", 1), one.get("twice")) == ([time], [2.0 * time])


def test_a_sample_that_is_no_number_is_refused_and_told(exchanged):
    one = exchanged(Clocked).initialize()
    one.event()
    assert one.get("root") == [2.0]
    one.set({"u": -1.0})
    one.do("fmi2SetTime", 0.5)
    assert one.call("fmi2NewDiscreteStates", byref(_Event())) == ERROR
    assert one.messages[-1].startswith("'root' is not a finite number at t = 0.5"), one.messages


def test_samples_are_time_events_at_their_instants(exchanged):
    one = exchanged(Sampler).initialize(
        {"u": 1.0, "rate": 3.0, "period": 0.1, "step": 2}, start=5.0
    )

    def lag(time):
        return 1.0 - 0.75 * math.exp(-3.0 * (time - 5.0))

    found, total, last, instants = [], 0.0, 0.0, []
    event = one.event()  # the first sample falls on the start
    for k in range(41):
        time = 5.0 + 0.025 * k
        if k % 4 == 0:
            instants.append(time)
        # groups one after another: the slow one first, as it is declared first
        last = lag(time) if k % 4 == 0 else last
        total += lag(time) - 0.1 * total
        found.append(event.time)
        assert event.needed == event.terminate == event.values == 0
        assert event.defined == 1
        assert one.get("count", "last") == pytest.approx([2.0 * len(instants), last], rel=1e-12)
        assert one.get("instant") == pytest.approx([instants[-1]], abs=1e-12)
        assert one.get("total") == pytest.approx([total], rel=1e-12)
        again = one.event()  # whoever asks twice samples once
        assert again.time == event.time
        assert one.get("count") == [2.0 * len(instants)]
        one.do("fmi2EnterContinuousTimeMode")
        one.at(event.time, lag(event.time))
        one.do("fmi2EnterEventMode")
        event = one.event()
    assert found == pytest.approx([5.0 + 0.025 * (k + 1) for k in range(41)], abs=1e-12)


def test_samples_that_a_host_has_missed_are_caught_up(exchanged):
    """A host of fixed steps comes late: 0.31 s in, 0.1, 0.2 and 0.3 s are still to be sampled.

    The next instant is at 0.325 s.
    """
    one = exchanged(Sampler).initialize({"u": 1.0, "step": 2}, start=5.0)
    assert one.event().needed == 0
    one.do("fmi2EnterContinuousTimeMode")
    one.at(5.31, 0.5)
    one.do("fmi2EnterEventMode")
    calls = 1
    while (event := one.event()).needed:
        assert event.time <= 5.31
        calls += 1
    assert calls == 12  # of the fast group, each 0.025 s
    assert one.get("count") == [8.0]
    assert event.time == pytest.approx(5.325, abs=1e-12)


def test_nothing_sampled_has_no_time_events(exchanged):
    assert exchanged(Kinks).initialize().event().defined == 0


@pytest.mark.parametrize("cls", [Kinks, Sampler])
def test_every_event_tells_the_host_to_start_its_solver_again(exchanged, cls):
    """fmpy up to 0.3.29 and fmusim do so only where values or nominals have changed."""
    one = exchanged(cls).initialize()
    nominals = one.array("GetNominalsOfContinuousStates", len(cls.layout.states))
    assert one.event().nominals == 1
    one.do("fmi2EnterContinuousTimeMode")
    one.do("fmi2EnterEventMode")
    assert one.event().nominals == 1
    assert one.array("GetNominalsOfContinuousStates", len(cls.layout.states)) == nominals


def test_without_states_no_nominal_changes(exchanged):
    """PyFMI asks for the nominals then, and fails if there are none."""
    one = exchanged(component("pid")).initialize()
    assert one.event().nominals == 0


def set_boolean(one, name, value):
    return one.call("fmi2SetBoolean", one.references([name]), 1, integers(value))


def test_a_discrete_input_that_is_set_between_events_waits_for_the_next(exchanged):
    """FMI forbids the call; fmpy makes it wherever it looks for roots."""
    one = exchanged(Tuned).initialize({"switch": 0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    assert set_boolean(one, "switch", 0) == OK
    assert one.messages == []
    assert set_boolean(one, "switch", 1) == WARNING
    assert one.messages == [
        "fmi2SetBoolean: 'switch' is discrete and changes at the next event only"
    ]
    assert one.levels == [WARNING]
    assert one.get("switch", "seen", "twice") == [0, 0, 0]
    state = one.save()
    one.do("fmi2EnterEventMode")
    assert one.get("switch", "seen", "twice") == [1, 0, 2]
    one.do("fmi2SetTime", 0.25)
    one.event()
    assert one.get("seen") == [1]
    one.do("fmi2EnterContinuousTimeMode")
    assert [set_boolean(one, "switch", value) for value in (0, 1)] == [OK, OK]
    one.do("fmi2EnterEventMode")
    assert one.get("switch") == [1], "set back before the event"
    assert len(one.messages) == 1, "one warning is enough"
    one.restore(state)
    assert one.get("switch") == [0]
    one.do("fmi2EnterEventMode")
    assert one.get("switch") == [1], "what waits is part of the state"
    one.forget(state)
    one.do("fmi2Reset")
    one.initialize({"switch": 0})
    one.do("fmi2EnterContinuousTimeMode")
    one.do("fmi2EnterEventMode")
    assert one.get("switch") == [0]


def test_a_tunable_parameter_is_taken_in_event_mode_only(exchanged):
    one = exchanged(Tuned).initialize({"gain": 2.0, "u": 3.0})
    one.event()
    one.set({"gain": 4.0})
    assert one.get("product") == [12.0]
    one.do("fmi2EnterContinuousTimeMode")
    assert one.array("GetDerivatives", 1) == [12.0]
    one.set({"gain": 4.0})  # as it is
    gain = one.references(["gain"])
    assert one.call("fmi2SetReal", gain, 1, doubles(5.0)) == ERROR
    assert one.messages == ["fmi2SetReal: parameter 'gain' can change in event mode only"]
    assert one.array("GetDerivatives", 1) == [12.0]
    one.do("fmi2EnterEventMode")
    one.set({"gain": 5.0})
    one.do("fmi2EnterContinuousTimeMode")
    assert one.array("GetDerivatives", 1) == [15.0]
    assert one.array("GetContinuousStates", 1) == [0.0]


def test_indicators_change_sign_where_laws_switch_and_there_only(exchanged):
    one = exchanged(Kinks).initialize({"edge": 1.0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    places = []
    before = None
    for k in range(-100, 401):  # between the places, so that none is met exactly
        one.at(0.0, ramp := 0.01 * k + 0.005, 0.0, 0.0)
        signs = [z > 0.0 for z in one.array("GetEventIndicators", 3)]
        places += [
            ramp - 0.005 for was, now in zip(before or signs, signs, strict=True) if was != now
        ]
        before = signs
    assert places == pytest.approx([0.0, 1.0, 2.0], abs=1e-9)


NEAR = 1e-10  # to zero an indicator comes no nearer


def indicators(one):
    """Those of `Kinks`: of the edge, of zero and of the level."""
    return one.array("GetEventIndicators", 3)


def test_an_indicator_at_zero_keeps_the_sign_of_the_latest_event(exchanged):
    one = exchanged(Kinks).initialize({"edge": 1.0})
    one.event()
    one.at(0.0, 1.5, 0.0, 0.0)  # beyond the edge and zero, below the level
    one.do("fmi2EnterContinuousTimeMode")
    begun = np.sign(indicators(one))
    for place in (1.0, 0.0, 2.0):
        for deviation in (0.0, 2e-11, -2e-11):
            one.at(0.0, place + deviation, 0.0, 0.0)
            z = np.array(indicators(one))
            (at,) = np.flatnonzero(np.abs(z) == NEAR)
            assert np.sign(z[at]) == begun[at]
    # beyond the place it has the other sign, and after an event keeps that
    one.at(0.0, 2.0 + 1e-6, 0.0, 0.0)
    assert np.prod(indicators(one)) * np.prod(begun) < 0.0
    one.do("fmi2EnterEventMode")
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    one.at(0.0, 2.0, 0.0, 0.0)
    assert np.prod(indicators(one)) * np.prod(begun) < 0.0


def test_what_is_at_zero_from_the_start_is_above_it(exchanged):
    one = exchanged(Kinks).initialize({"ramp_start": 0.0})
    assert NEAR in indicators(one)
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    assert NEAR in indicators(one)


def test_the_sign_at_zero_is_part_of_the_state(exchanged):
    one = exchanged(Kinks).initialize({"ramp_start": -1.0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    state = one.save()
    one.at(0.0, 0.0, 0.0, 0.0)
    below = indicators(one)
    one.at(0.0, 0.5, 0.0, 0.0)
    one.do("fmi2EnterEventMode")
    one.do("fmi2EnterContinuousTimeMode")
    one.at(0.0, 0.0, 0.0, 0.0)
    assert indicators(one) == [NEAR if z == -NEAR else z for z in below] != below
    one.restore(state)
    one.at(0.0, 0.0, 0.0, 0.0)
    assert indicators(one) == below
    one.forget(state)
    one.do("fmi2Reset")
    one.initialize({"ramp_start": 0.0})
    assert NEAR in indicators(one)


def test_an_indicator_that_is_no_number_has_no_side(exchanged):
    """As of the root of a negative trial: it is passed on, and what was known is not lost."""
    one = exchanged(Rooted).initialize({"u": 2.0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    (before,) = one.array("GetEventIndicators", 1)
    assert before > NEAR
    one.set({"u": -1.0})
    assert math.isnan(one.array("GetEventIndicators", 1)[0])
    one.set({"u": 1.0})
    assert one.array("GetEventIndicators", 1) == [NEAR]


def test_a_state_is_saved_and_restored_in_the_middle_and_is_not_of_the_other_kind(built, exchanged):
    one = exchanged(Sampler).initialize({"u": 1.0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    one.at(0.02, 0.4)
    state = one.save()
    before = one.everything()
    one.at(0.025, 0.5)
    one.do("fmi2EnterEventMode")
    one.event()
    assert one.everything() != before
    one.restore(state)
    assert one.everything() == before
    assert one.array("GetContinuousStates", 1) == [0.4]
    block = one.serialize(state)
    one.forget(state)
    with instance(built(Sampler, "native")) as other:
        other.initialize()
        foreign = other.deserialize(block)
        assert other.call("fmi2SetFMUstate", foreign) == ERROR
        assert other.messages == ["fmi2SetFMUstate: the state is of an instance of model exchange"]
        other.forget(foreign)
        own = other.save()
        block = other.serialize(own)
        other.forget(own)
    foreign = one.deserialize(block)
    assert one.call("fmi2SetFMUstate", foreign) == ERROR
    assert one.messages == ["fmi2SetFMUstate: the state is of an instance of co-simulation"]
    one.forget(foreign)


def test_reset_begins_anew(exchanged):
    one = exchanged(Sampler).initialize({"u": 1.0})
    first = one.event().time, one.everything()
    one.do("fmi2EnterContinuousTimeMode")
    one.at(0.02, 0.4)
    one.do("fmi2Reset")
    one.initialize({"u": 1.0})
    assert (one.event().time, one.everything()) == first
    one.do("fmi2Terminate")


REFUSED = {
    "a step": (
        "continuous",
        lambda o: o.call("fmi2DoStep", 0.0, 0.1, 1),
        "fmi2DoStep is not allowed in continuous-",
    ),
    "samples between events": (
        "continuous",
        lambda o: o.call("fmi2NewDiscreteStates", byref(_Event())),
        "not allowed in continuous-time mode",
    ),
    "a completed step in an event": (
        "event",
        lambda o: o.call("fmi2CompletedIntegratorStep", 1, byref(c_int()), byref(c_int())),
        "in event mode",
    ),
    "time during initialization": (
        "init",
        lambda o: o.call("fmi2SetTime", 1.0),
        "not allowed during initialization",
    ),
    "a slope, which nothing would follow": (
        "init",
        lambda o: o.call(
            "fmi2SetRealInputDerivatives", o.references(["u"]), 1, integers(1), doubles(1.0)
        ),
        "made for model exchange",
    ),
    "time that is none": (
        "event",
        lambda o: o.call("fmi2SetTime", math.nan),
        "fmi2SetTime: -?nan is not a finite",
    ),
    "too many states": (
        "continuous",
        lambda o: o.call("fmi2SetContinuousStates", doubles(1, 2), 2),
        "2 elements, but there are 1",
    ),
    "no room for states": (
        "continuous",
        lambda o: o.call("fmi2GetContinuousStates", None, 1),
        "array is NULL though it should have 1",
    ),
    "too few rates": (
        "continuous",
        lambda o: o.call("fmi2GetDerivatives", None, 0),
        "0 elements, but there are 1",
    ),
    "too many indicators": (
        "continuous",
        lambda o: o.call("fmi2GetEventIndicators", doubles(1, 2, 3), 3),
        "3 elements, but there are 0",
    ),
    "no event": (
        "event",
        lambda o: o.call("fmi2NewDiscreteStates", None),
        "the pointer to the event is NULL",
    ),
    "no flags": (
        "continuous",
        lambda o: o.call("fmi2CompletedIntegratorStep", 1, None, None),
        "a pointer is NULL",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_host_should_not_do_is_refused_in_a_sentence(exchanged, case):
    mode, act, words = REFUSED[case]
    one = exchanged(Sampler)
    if mode == "init":
        one.do("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        one.do("fmi2EnterInitializationMode")
    else:
        one.initialize()
        one.event()
    if mode == "continuous":
        one.do("fmi2EnterContinuousTimeMode")
    values = one.everything()
    assert act(one) == ERROR
    (message,) = one.messages
    assert re.search(words, message), message
    assert one.everything() == values


def test_discrete_inputs_are_set_in_event_mode(exchanged):
    one = exchanged(Sampler).initialize()
    one.set({"enabled": 0})
    one.event()
    assert one.get("enabled") == [0]


def test_a_discrete_input_may_be_set_between_events_to_what_it_is(exchanged):
    """Some hosts set all inputs at every step."""
    one = exchanged(Sampler).initialize({"enabled": 0})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    one.set({"enabled": 0, "u": 0.5})
    assert one.get("enabled", "u") == [0, 0.5]


def test_a_trial_that_goes_too_far_is_discarded_and_the_next_is_heard(exchanged):
    one = exchanged(stack(component("ppy_actuator"), BrokenRate)).initialize({"current": 0.1})
    one.event()
    one.do("fmi2EnterContinuousTimeMode")
    one.do("fmi2SetContinuousStates", doubles(0.5, 0.0, 0.0), 3)
    before = one.array("GetDerivatives", 3)
    assert one.call("fmi2SetContinuousStates", doubles(math.nan, 0.0, 0.0), 3) == DISCARD
    one.set({"current": 6.0})  # where this law is broken
    assert one.call("fmi2GetDerivatives", doubles(0, 0, 0), 3) == DISCARD
    assert (
        one.call("fmi2GetReal", one.references(["der(kelvin_elongation)"]), 1, doubles(0.0))
        == DISCARD
    )
    assert [message.partition(" at t = ")[0] for message in one.messages] == [
        "fmi2SetContinuousStates: 'charge' = nan is not a finite number",
        *["'der(kelvin_elongation)' is not a finite number"] * 2,
    ]
    one.set({"current": 0.1})
    assert one.array("GetDerivatives", 3) == before


@pytest.mark.parametrize(
    "function", ["GetDerivatives", "GetContinuousStates", "GetEventIndicators"]
)
def test_what_belongs_to_model_exchange_is_none_of_co_simulation(built, function):
    with instance(built(Sampler, "native")) as one:
        one.initialize()
        assert one.call(f"fmi2{function}", doubles(0.0), 1) == ERROR
        assert one.messages == [
            f"fmi2{function}: this instance of sampler was made for co-simulation"
        ]


def test_the_build_with_python_is_for_co_simulation_only(built):
    with unzipped(built(Sampler, "python")) as folder:
        one = Instance(Library(folder), kind=EXCHANGE)
        assert one.component is None
        assert one.messages == [
            "fmi2Instantiate: sampler is made for co-simulation, not for type 0"
        ]
