"""Claims: members as one component run like the matrix exponential of both, and keep their laws."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.kit import Component, Effect, Input, Output, Parameter, Size, State, Term, stack
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError
from fmus.kit.record import CompiledModel
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.systems.fused_component import Fused, full_name, fused
from orchestration.system import connect, library
from tests.support.closed_loop import TIME as BENCH_TIME
from tests.support.closed_loop import closed_loop, references

STEP = 0.1
TIME = STEP * np.arange(50)


class Lag(Component):
    """A lag that follows its input but for a load."""

    name = "lag"
    tau = Parameter(0.5, "s", min=1e-3)
    drive = Input("1")
    load = Input("1")
    x = State("1", rate="rate", output=True)

    def gap(self):
        """Driving gap."""
        return self.drive - self.load - self.x

    def rate(self):
        """Of a lag."""
        return self.gap() / self.tau


class Spring(Component):
    """A spring with a state of its own."""

    name = "spring"
    k = Parameter(2.0, "1", min=0)
    bias = Input("1")
    length = Input("1")
    creep = State("1", rate="creep_rate", start=0.1)

    def force(self):
        """Of the spring."""
        return self.k * (self.length - self.creep) + self.bias

    def creep_rate(self):
        """Creep."""
        return self.force()

    @Output("1")
    def push(self):
        """Its force."""
        return self.force()


class Give(Effect):
    """A spring that gives by a share; share = 0 is without."""

    id = "give"
    title = "A spring that gives"
    neutral = "share"
    term = Term("force", "length", "-c k x", "force over length")
    sizes = (Size("by {}", ("share",)),)
    share = Parameter(0.0, "1", min=-1.0, max=1.0, nominal=0.1, doc="share")

    def force(self):
        """Force less the share."""
        return super().force() * (1.0 - self.share)


WIRES = ("lag.x -> spring.length", "spring.push -> lag.load")


def whole(*wires: str, **values: dict[str, float]) -> Fused:
    return fused("both", {"lag": Lag, "spring": Spring}, values, connect(*(wires or WIRES)))


def flows(tau: float, k: float, drive: Array, bias: float, give: float = 0.0) -> Array:
    """Return x and the push (n, 2) by the exponential; inputs are held from sample to sample."""
    own = np.array([k * (1.0 - give), -k * (1.0 - give), 0.0, 1.0 - give])  # by x, creep, inputs
    rate = np.array([-1.0, 0.0, 1.0, 0.0]) - own
    flow = expm(STEP * np.vstack([rate / tau, own, np.zeros((2, 4))]))[:2]
    state = np.array([0.0, 0.1])
    rows = []
    for now in drive:
        point = np.array([*state, now, bias])
        rows.append([state[0], own @ point])
        state = flow @ point
    return np.array(rows)


def test_a_closed_loop_runs_like_both_together() -> None:
    cls = whole(spring={"k": 1.5, "creep_start": 0.1}).cls
    assert [v.name for v in cls.layout.inputs] == ["lag_drive", "spring_bias"]
    drive = 2.0 + TIME + 0.1 * np.sin(TIME)
    inputs = {"lag_drive": drive, "spring_bias": np.full(50, 0.4)}
    run = CompiledModel(cls).run(TIME, inputs, {"lag_tau": 0.3})
    found = np.column_stack([run.signals["lag_x"], run.signals["spring_push"]])
    assert found == pytest.approx(flows(0.3, 1.5, drive, 0.4), abs=1e-6)


def test_an_effect_of_a_member_acts_in_the_whole() -> None:
    both = whole()
    effects = both.lifted({"spring": {"give": Give}})
    give = effects["spring_give"]
    assert (give.term.law, give.neutral, give.title) == (
        "spring_force",
        "spring_share",
        "A spring that gives",
    )
    assert [size.parameters for size in give.sizes] == [("spring_share",)]
    drive = 1.0 + np.sin(TIME)
    inputs = {"lag_drive": drive, "spring_bias": np.full(50, 0.2)}
    cls = stack(both.cls, give)
    for own in (cls, pickle.loads(pickle.dumps(cls))):
        run = CompiledModel(own).run(TIME, inputs, {"spring_share": 0.3})
        found = np.column_stack([run.signals["lag_x"], run.signals["spring_push"]])
        assert found == pytest.approx(flows(0.5, 2.0, drive, 0.2, 0.3), abs=1e-6)


def test_laws_of_members_are_those_of_the_whole_and_a_connection_is_one() -> None:
    both = whole()
    model = LawModel(both.cls)
    assert {"lag_gap", "lag_load", "spring_force", "spring_length"} <= set(model.laws)
    assert model.perturbed.calls("lag_rate", "spring_force")
    assert [output.name for output in model.outputs] == ["spring_push", "lag_x"]
    assert both.origin("spring_force") == ("spring", "force")
    assert both.origin("time") == ("", "")


def test_a_connection_converts() -> None:
    (wire,) = connect("lag.x -> spring.length")
    scaled = type(wire)(wire.source, wire.target, factor=10.0, offset=0.5)
    cls = fused("both", {"lag": Lag, "spring": Spring}, {}, [scaled]).cls
    one = cls(spring_k=2.0)
    one.lag_x, one.spring_creep, one.spring_bias = 0.3, 0.0, 0.0
    assert one.spring_push() == pytest.approx(2.0 * (10.0 * 0.3 + 0.5))


class Rigid(Spring):
    """A spring whose length is the force on it."""

    name = "rigid"


class Odd(Lag):
    """A lag with a parameter called like one of a spring."""

    b_k = Parameter(1.0, "1")


def test_outputs_that_wait_for_each_other_are_refused() -> None:
    wires = connect("a.push -> b.length", "b.push -> a.length")
    with pytest.raises(UserError, match="wait for each other"):
        fused("ring", {"a": Spring, "b": Rigid}, {}, wires)


def test_names_that_would_mean_two_things_are_refused() -> None:
    with pytest.raises(UserError, match="two members have something named 'a_b_k'"):
        fused(
            "two", {"a_b": Spring, "a": type("Odd", (Lag,), {"b_k": Parameter(1.0, "1")})}, {}, ()
        )


def test_the_bench_holds_its_actuator_like_the_exponential_of_its_matrix() -> None:
    system = library.system("dma_bench")
    members = {m.name: m.cls for m in system.members if m.cls is not None}
    values = {m.name: m.parameters for m in system.members}
    cls = fused("bench", members, values, system.connections).cls
    reference = references()
    inputs = {"bench_force_reference": reference, "actuator_current": 0.0 * reference}
    run = CompiledModel(cls).run(BENCH_TIME, inputs)
    position, tension = closed_loop(reference)
    assert run.signals["bench_position"] == pytest.approx(position, abs=1e-9)
    assert run.signals[full_name("actuator", "tension")] == pytest.approx(tension, abs=1e-4)
