"""Claims: coupling error is measured as it is, its orders are those of theory, and the energy it
makes is counted.

Oracles: co-simulation of linear systems worked out with exponentials, and the energy of an
oscillator.
"""

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.kit import Component, Input, Output, Parameter, State
from orchestration.master import run
from orchestration.master.reference import imbalance, mechanical
from orchestration.system import library
from orchestration.system.model import Connection, Member, Port, System, connect
from tests.support.coupling_error import CouplingError, coupling_error
from tests.support.pace import slow_but

PERIOD = 1.0 / 30.0  # s, of the bench's controller
# Steps, duration, inputs and a signal: taut and away from limits throughout, and the controller
# samples at communication points, so that nothing kinks between them.
SMOOTH = {
    "dma_bench": (
        [PERIOD / 128, PERIOD / 256],
        2 * PERIOD,
        {"force_reference": lambda t: np.full(t.size, 1.0)},
        "bench.position",
    ),
    "foot_gait": (
        [4e-4, 2e-4],
        0.1,
        {"an_current": lambda t: np.sin(20.0 * t), "pl_current": lambda t: -0.5 * np.sin(30.0 * t)},
        "foot.ankle_angle",
    ),
}


def measured(name: str, **options) -> CouplingError:
    """Coupling error of a system that ships."""
    steps, stop, inputs, _ = SMOOTH[name]
    return coupling_error(library.system(name), steps, stop, inputs, **options)


class Follower(Component):
    """Follows its input in a second."""

    name = "follower"
    tolerance = 1e-12
    u = Input("1")
    x = State("1", rate="x_rate", start=1.0, output=True)

    def x_rate(self):
        return self.u - self.x


class Mass(Component):
    """A mass that something pulls back."""

    name = "mass"
    tolerance = 1e-12
    m = Parameter(0.5, "kg", min=1e-3)
    tension = Input("N")
    position = State("m", rate="position_rate", start=0.1, output=True)
    velocity = State("m/s", rate="velocity_rate", output=True)

    def position_rate(self):
        return self.velocity

    def velocity_rate(self):
        return -self.tension / self.m


class Spring(Component):
    """A spring that pulls and pushes."""

    name = "spring"
    k = Parameter(20.0, "N/m")
    length_change = Input("m")

    @Output("N")
    def tension(self):
        """Force of the spring."""
        return self.k * self.length_change


def system_of(classes, connections):
    members = (Member.of(name, cls) for name, cls in classes.items())
    return System("small", tuple(members), connections)


def loop(factor):
    return (Connection(Port("p", "x"), Port("q", "u"), factor=factor), *connect("q.x -> p.u"))


PAIR = {"p": Follower, "q": Follower}


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_error_is_that_of_held_inputs_worked_out_on_paper(method):
    steps = np.array([0.1, 0.05, 0.025])
    found = coupling_error(system_of(PAIR, loop(-2.0)), steps, 2.0, {}, method=method)
    for k, step in enumerate(steps):
        decay = np.exp(-step)
        p = q = 1.0
        rows = [(p, q)]
        for _ in range(round(2.0 / step)):
            before, p = p, decay * p + (1 - decay) * q
            q = decay * q - 2.0 * (1 - decay) * (p if method == "gauss-seidel" else before)
            rows.append((p, q))
        exact = np.array(
            [
                expm(t * np.array([[-1, 1], [-2, -1]])) @ [1.0, 1.0]
                for t in step * np.arange(len(rows))
            ]
        )
        errors = np.abs(rows - exact).max(axis=0) / np.abs(exact).max(axis=0)
        assert [found.errors["p.x"][k], found.errors["q.x"][k]] == pytest.approx(errors, rel=1e-6)
    assert found.order("p.x") == pytest.approx(1.0, abs=0.1)


def test_gauss_seidel_has_the_smaller_error_of_two_moving_members_and_extrapolation_an_order():
    system, steps = system_of(PAIR, loop(0.5)), [0.05, 0.025, 0.0125]
    jacobi, seidel, linear = (
        coupling_error(system, steps, 2.0, {}, method=method, extrapolation=extrapolation)
        for method, extrapolation in (("jacobi", 0), ("gauss-seidel", 0), ("gauss-seidel", 1))
    )
    for name in ("p.x", "q.x"):
        assert (seidel.errors[name] < 0.75 * jacobi.errors[name]).all(), name
        assert linear.order(name) > 1.9, name
        assert (linear.errors[name] < 0.1 * jacobi.errors[name]).all(), name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method"),
    slow_but(
        [(name, method) for name in SMOOTH for method in ("jacobi", "gauss-seidel")],
        ("dma_bench", "jacobi"),
        ("dma_bench", "gauss-seidel"),
        ("foot_gait", "jacobi"),
    ),
)
def test_systems_that_ship_converge_with_first_order_and_extrapolated_with_second(name, method):
    signal = SMOOTH[name][-1]
    held, linear = (measured(name, method=method, extrapolation=e) for e in (0, 1))
    assert held.order(signal) == pytest.approx(1.0, abs=0.1)
    assert linear.order(signal) == pytest.approx(2.0, abs=0.1)
    assert linear.errors[signal][-1] < 0.1 * held.errors[signal][-1] < 0.01


@pytest.mark.parametrize("name", slow_but(SMOOTH, "dma_bench"))
def test_gauss_seidel_has_the_better_constant_where_outputs_are_taken_as_they_stand_after_a_step(
    name,
):
    signal = SMOOTH[name][-1]
    jacobi, seidel = (
        measured(name, method=m, feedthrough=False) for m in ("jacobi", "gauss-seidel")
    )
    assert (seidel.errors[signal] < 0.5 * jacobi.errors[signal]).all()


def test_tension_that_follows_the_length_at_once_leaves_jacobi_nothing_to_lose_on_the_bench():
    """Only the creep of the actuator is a step old in one and not in the other."""
    jacobi, seidel = (measured("dma_bench", method=m) for m in ("jacobi", "gauss-seidel"))
    for signal in ("bench.position", "actuator.tension"):
        assert seidel.errors[signal] == pytest.approx(jacobi.errors[signal], rel=1e-3)


# --- energy
# --------------------------------------------------------------------------------------------------

OSCILLATOR = connect("mass.position -> spring.length_change", "spring.tension -> mass.tension")


@pytest.mark.parametrize(
    ("method", "extrapolation"), [("jacobi", 0), ("gauss-seidel", 0), ("jacobi", 1)]
)
def test_what_the_coupling_makes_is_what_an_oscillator_gains(method, extrapolation):
    system = system_of({"mass": Mass, "spring": Spring}, OSCILLATOR)
    time = 0.01 * np.arange(401)
    signals = run(system, time, method=method, extrapolation=extrapolation).signals
    energy = 0.5 * 0.5 * signals["mass.velocity"] ** 2 + 0.5 * 20.0 * signals["mass.position"] ** 2
    (found,) = imbalance(mechanical(system), signals, extrapolation).values()
    gain = energy - energy[0]
    assert found.energy == pytest.approx(gain, abs=(1e-8, 0.02)[extrapolation] * np.abs(gain).max())
    assert (gain[-1] > 0.1 * energy[0]) == (extrapolation == 0)
    travelled = np.abs(np.diff(0.5 * 20.0 * signals["mass.position"] ** 2)).sum()
    assert found.exchanged == pytest.approx(travelled, rel=1e-9)
    assert found.relative == pytest.approx(
        abs(gain[-1]) / travelled, rel=(1e-8, 0.02)[extrapolation]
    )


def test_imbalance_is_counted_in_the_units_of_either_side():
    """Length and force through a lever of 2: the spring sees twice the way, the mass twice the
    force.
    """
    lever = (
        Connection(Port("mass", "position"), Port("spring", "length_change"), factor=2.0),
        Connection(Port("spring", "tension"), Port("mass", "tension"), factor=2.0),
    )
    (coupling,) = mechanical(system_of({"mass": Mass, "spring": Spring}, lever))
    assert str(coupling) == "mass.position <-> spring.tension"
    x = np.cumsum([0.0, 0.1, -0.3, 0.05, 0.2])
    found = imbalance([coupling], {"mass.position": x, "spring.tension": 20.0 * 2.0 * x})[
        str(coupling)
    ]
    assert found.energy == pytest.approx(np.append(0.0, np.cumsum(0.5 * 80.0 * np.diff(x) ** 2)))


@pytest.mark.slow
def test_couplings_of_the_systems_that_ship_are_found_and_their_imbalance_is_of_first_order():
    found = measured("foot_gait")
    assert set(found.imbalances) == {
        f"foot.{a}_length_change <-> {a}.tension" for a in ("an", "po", "do", "pl")
    }
    for name in found.imbalances:
        assert found.order(name) == pytest.approx(1.0, abs=0.02)
    assert mechanical(library.system("degradation_watch")) == []
