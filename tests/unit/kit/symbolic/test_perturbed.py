"""Laws with additions: the response of rates and outputs, and the signals that laws depend on.

Oracles: subclasses that add a number to one law by hand, evaluated as plain floats, in differences;
and small models, read by eye.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.foot.model import FootDynamic
from fmus.galvanostat.model import Galvanostat
from fmus.kit import Component, Discrete, Input, Output, Parameter, State, cos, exp, sin, stack
from fmus.kit.curves import curve
from fmus.kit.inputs import input_saturation
from fmus.kit.symbolic.perturbed import PerturbedLaws
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from studies.plants.models.pendulum import Pendulum

POINTS = 3
STEP = 1e-5  # of differences, relative to a typical magnitude


class Chain(Component):
    """Two states, laws of every kind: with an argument, called twice, several numbers."""

    name = "chain"

    gain = Parameter(0.7, "1")
    stiffness = Parameter(2.0, "1")
    drive = Input("1", start=0.3)
    fed = Input("1", start=-0.2)
    first = State("1", rate="first_rate", start=0.4)
    second = State("1", rate="second_rate", start=-0.3)
    kept = Discrete("1", update="keep", period=0.5, start=0.2)

    def first_rate(self):
        return self.held() - self.spring(self.first) - self.spring(self.second)

    def second_rate(self):
        return self.handed_on() + self.both()[1] * self.swing()

    def spring(self, x):
        return self.stiffness * x + x * x * x

    def held(self):
        return self.drive

    def handed_on(self):
        return self.first

    def constant(self):
        return self.gain

    def both(self):
        return self.spring(x=self.second), self.damper() * self.constant()

    def damper(self):
        return exp(-self.second) + self.kept

    def swing(self):
        return cos(self.time)

    def keep(self):
        return self.sampled() + 0.5 * self.kept

    def sampled(self):
        return self.fed + self.first

    def never_called(self):
        return self.first

    @Output("1")
    def twice(self):
        """Compute a law from another, called twice."""
        return self.damper() * self.damper() + self.second

    @Output("1")
    def sum_of_laws(self):
        """Two laws and nothing else."""
        return self.damper() - self.gain * self.held()

    @Output("1")
    def of_the_time(self):
        """Compute a law from another and the time."""
        return self.held() * self.time

    @Output("1")
    def of_both(self):
        """One of several numbers."""
        return self.both()[0]


CHAIN = [
    "sampled",
    "keep",
    "first_rate",
    "held",
    "spring",
    "second_rate",
    "handed_on",
    "damper",
    "constant",
    "swing",
    "twice",
    "sum_of_laws",
    "of_the_time",
    "of_both",
]


class Divider(Component):
    """No state."""

    name = "ratio"

    supply = Input("V", start=8.0)

    def share(self):
        return 0.25

    @Output("V")
    def tap(self):
        return self.supply * self.share()


def plus(cls, law, number):
    """Return the component with a number added to one law."""

    def more(self, *arguments, **named):
        return getattr(super(made, self), law)(*arguments, **named) + number

    made = type(cls.__name__, (cls,), {law: more, "name": cls.name})
    return made


def evaluated(cls, values):
    model = cls()
    for name, value in values.items():
        setattr(model, name, float(value))
    return np.array([*model.rates(), *model.outputs()], dtype=float)


def points(cls, seed):
    """Random points of a trajectory: time, parameters, inputs, states."""
    rng, layout = np.random.default_rng(seed), cls.layout
    parameters = {
        p.name: p.start * rng.uniform(0.9, 1.1) for p in layout.parameters if p.type == "real"
    }

    def drawn(group):
        return {v.name: v.start + 0.1 * v.nominal * rng.normal(size=POINTS) for v in group}

    return (
        np.sort(rng.uniform(0.0, 3.0, POINTS)),
        parameters,
        drawn(layout.inputs),
        drawn((*layout.states, *layout.discretes)),
    )


def by_differences(cls, laws, at, values):
    """Return the slopes of rates and outputs by states and by additions to laws, in columns."""
    columns = []
    for s in cls.layout.states:
        step = STEP * s.nominal
        up, down = (evaluated(cls, at | {s.name: at[s.name] + way * step}) for way in (1.0, -1.0))
        columns.append((up - down) / (2.0 * step))
    for law, value in zip(laws, values, strict=True):
        step = STEP * max(abs(value), 1e-3)
        up, down = (evaluated(plus(cls, law, way * step), at) for way in (1.0, -1.0))
        columns.append((up - down) / (2.0 * step))
    return np.array(columns).T


class Linearised:
    """Jacobians by states (a, c) and additions (b, d), and values of laws, at points."""

    def __init__(self, laws, time, parameters, inputs, signals):
        functions = {f.name(): f for f in laws.functions()}
        layout = laws.graph.layout
        rates, outputs, values = [], [], []
        for k, now in enumerate(time):
            at = {n: v[k] for n, v in (inputs | signals).items()}
            arguments = [
                [at[v.name] for v in (*layout.states, *layout.discretes)],
                [at[v.name] for v in layout.inputs],
                now,
                [parameters.get(p.name, p.start) for p in layout.parameters],
                np.zeros(len(laws.names)),
            ]
            rates.append([m.full() for m in functions["rate_slopes_of"](*arguments)])
            outputs.append([m.full() for m in functions["output_slopes_of"](*arguments)])
            values.append(functions["laws_of"](*arguments)[0].full().ravel())
        nx = len(layout.states)
        self.a, self.b = (np.array([r[i][:nx] for r in rates]) for i in (1, 3))
        self.a = self.a[:, :, :nx]
        self.c, self.d = (np.array([o[i] for o in outputs]) for i in (1, 3))
        self.c = self.c[:, :, :nx]
        self.values = np.array(values)


def check_against_differences(cls, seed=3, skipped=()):
    laws, (time, parameters, inputs, signals) = PerturbedLaws(cls), points(cls, seed)
    found, layout = Linearised(laws, time, parameters, inputs, signals), cls.layout
    states = [s.name for s in layout.states]
    assert found.a.shape == (POINTS, len(states), len(states))
    assert found.d.shape == (POINTS, len(layout.outputs), len(laws.names))
    seen = 0.0
    for k in range(POINTS):
        at = parameters | {n: v[k] for n, v in (inputs | signals).items()} | {"time": time[k]}
        exact = np.vstack(
            [np.hstack([found.a[k], found.b[k]]), np.hstack([found.c[k], found.d[k]])]
        )
        expected = by_differences(cls, laws.names, at, found.values[k])
        for j, (one, other) in enumerate(zip(exact.T, expected.T, strict=True)):
            name = (states + laws.names)[j]
            if name not in skipped:
                assert one == pytest.approx(
                    other, rel=1e-4, abs=1e-5 * np.abs(other).max() + 1e-12
                ), name
        seen += np.abs(expected[:, len(states) :]).sum()
    assert seen > 0.0
    return laws


@pytest.mark.parametrize(
    "cls", [PpyActuator, Pendulum, FootDynamic, Chain], ids=lambda cls: cls.name
)
def test_jacobians_are_those_of_differences(cls):
    check_against_differences(cls)


def test_jacobians_of_a_component_that_is_sampled_and_saturates():
    """A law that tells yes from no is no number that a difference could be taken of."""
    check_against_differences(
        Galvanostat, skipped=("in_recovery", "is_saturated", "recovery_count")
    )


def test_jacobians_of_effects_laid_over():
    """A term of a law is added to the law with its effects, and laws of effects have terms too."""
    cubic = curve(PpyActuator, "film_voltage", "charge", "cubic", "V")
    cls = stack(PpyActuator, cubic, EFFECTS["double_layer"], defaults={cubic.neutral: 0.3})
    laws = check_against_differences(cls)
    added = {law for law in laws.names if law not in PerturbedLaws(PpyActuator).names}
    assert added, "the rate of the layer's state at least"


def test_jacobians_of_an_input_that_arrives_as_another():
    """The laws have the input as an effect changes it; the input itself is no law."""
    level = input_saturation(Chain, "drive")
    laws = check_against_differences(stack(Chain, level, defaults={level.neutral: 0.8}))
    assert laws.names == PerturbedLaws(Chain).names


def test_values_are_those_of_the_laws():
    laws, (time, parameters, inputs, signals) = PerturbedLaws(Chain), points(Chain, 5)
    values = dict(
        zip(laws.names, Linearised(laws, time, parameters, inputs, signals).values.T, strict=True)
    )
    first, second = signals["first"], signals["second"]
    assert values["held"] == pytest.approx(inputs["drive"])
    assert values["swing"] == pytest.approx(np.cos(time))
    assert values["damper"] == pytest.approx(np.exp(-second) + signals["kept"])
    assert values["spring"] == pytest.approx(parameters["stiffness"] * first + first**3), (
        "as it is called first"
    )
    assert values["sampled"] == pytest.approx(inputs["fed"] + first)


def test_laws_are_those_that_are_called_and_give_one_number():
    assert sorted(PerturbedLaws(Chain).names) == sorted(CHAIN)
    names = PerturbedLaws(Pendulum).names
    assert names == ["angle_rate", "acceleration", "gravity", "friction", "position"]


def test_a_component_without_states():
    laws = PerturbedLaws(Divider)
    found = Linearised(laws, np.arange(3.0), {}, {"supply": np.array([1.0, 2.0, 3.0])}, {})
    assert found.a.shape == (3, 0, 0)
    assert found.b.shape == (3, 0, 2)
    assert found.d[:, 0] == pytest.approx(np.array([[1.0, 1.0], [1.0, 2.0], [1.0, 3.0]])), (
        "of tap and of share"
    )
    assert found.values == pytest.approx(np.array([[0.25, 0.25], [0.5, 0.25], [0.75, 0.25]]))


def test_the_graph_is_the_component_as_it_is():
    layout = PerturbedLaws(Pendulum).graph.layout
    assert [v.name for v in layout.variables] == [v.name for v in Pendulum.layout.variables]


@pytest.mark.parametrize("law", CHAIN)
def test_nothing_can_be_wrong_with_what_only_adds_up_laws(law):
    """An input or a parameter that is passed on may be wrong: less arrives, or it varies."""
    assert PerturbedLaws(Chain).is_definition(law) == (law == "sum_of_laws")


def test_nothing_can_be_wrong_with_definitions_of_a_pendulum():
    laws = PerturbedLaws(Pendulum)
    assert {law for law in laws.names if laws.is_definition(law)} == {"angle_rate", "position"}


class Coasting(Component):
    """A train in km and h, with a battery whose charge is counted in parts of its capacity."""

    name = "coasting"
    current = Input("A", nominal=1.0)
    drag = Parameter(0.1, "1/s")
    capacity = Parameter(5.0, "A*s")
    speed = State("km/h", rate="braking", nominal=100.0)
    way = State("km", rate="way_rate", nominal=1.0)
    charge = State("A*h", rate="counting", nominal=1.0)
    share = State("1", rate="share_rate", nominal=1.0)

    def braking(self):
        """Newton."""
        return -self.drag * self.speed

    def way_rate(self):
        """Definition."""
        return self.speed / 3600.0

    def counting(self):
        """Definition."""
        return self.current / 3600.0

    def share_rate(self):
        """Not: the capacity may be another."""
        return self.current / self.capacity

    @Output("km", nominal=1.0)
    def position(self):
        """As seen."""
        return self.way


def test_a_definition_may_be_in_another_unit():
    laws = PerturbedLaws(Coasting)
    assert {law for law in laws.names if laws.is_definition(law)} == {"way_rate", "position"}
    assert {law for law in laws.names if laws.is_count(law)} == {"counting"}


@pytest.mark.parametrize(
    ("law", "stands"),
    [
        ("first_rate", {"held", "spring", "first", "second"}),
        (
            "second_rate",
            {"handed_on", "swing", "spring", "second", "damper", "constant"},
        ),  # both() is a part of it
        ("spring", {"first", "second"}),  # which are handed to it
        ("held", {"drive"}),
        ("swing", {"time"}),
        ("damper", {"second", "kept"}),
        ("keep", {"sampled", "kept"}),
        ("sum_of_laws", {"damper", "held"}),
        ("of_the_time", {"held", "time"}),
    ],
)
def test_what_stands_in_a_law_itself(law, stands):
    signals = {"drive", "fed", "first", "second", "kept", "time", *CHAIN}
    laws = PerturbedLaws(Chain)
    assert {s for s in signals if laws.reads_itself(law, s)} == stands


@pytest.mark.parametrize(
    ("law", "from_these"),
    [
        ("first_rate", {"held", "spring"}),
        ("second_rate", {"handed_on", "damper", "constant", "swing"}),
        ("twice", {"damper"}),
        ("keep", {"sampled"}),
        ("spring", set()),
        ("of_both", {"spring"}),
    ],
)
def test_what_a_law_is_computed_from(law, from_these):
    laws = PerturbedLaws(Chain)
    assert {other for other in CHAIN if laws.calls(law, other)} == from_these


@pytest.mark.parametrize(
    ("signal", "of"),
    [
        ("first", {"first"}),
        ("time", {"time"}),
        ("damper", {"second", "kept"}),
        ("constant", set()),
        ("held", {"drive"}),
    ],
)
def test_what_a_signal_is_computed_from(signal, of):
    assert PerturbedLaws(Chain).computed_from(signal) == of


def test_a_law_that_is_handed_what_another_gives():
    class Handed(Pendulum):
        """Gravity of what a law gives."""

        name = "handed"

        def turned(self):
            return 2.0 * self.angle

        def weighs(self, angle):
            return self.weight * angle

        def gravity(self):
            return self.weighs(self.turned())

    laws = PerturbedLaws(Handed)
    assert laws.reads_itself("weighs", "turned")
    assert not laws.reads_itself("weighs", "angle")


def test_a_law_that_is_none_is_computed_from_nothing():
    laws = PerturbedLaws(Pendulum)
    assert laws.calls("acceleration", "friction")
    assert not laws.calls("friction", "acceleration")
    assert not laws.calls("angle", "friction")
    assert not laws.calls("acceleration", "angle")


def test_a_law_through_another_that_an_effect_overrides():
    """The amount of the effect is 0; what it is computed from is told all the same."""
    cubic = curve(Pendulum, "gravity", "angle", "cubic", "N*m")
    laws = PerturbedLaws(stack(Pendulum, cubic))
    assert laws.calls("acceleration", "gravity")
    assert laws.reads_itself("gravity", "angle")
    assert not laws.reads_itself("acceleration", "angle")


def test_sine_of_a_pendulum_by_hand():
    laws = PerturbedLaws(Pendulum)
    angle = np.array([0.3, -1.0])
    signals = {"angle": angle, "velocity": np.zeros(2)}
    found = Linearised(laws, np.zeros(2), {}, {"torque": np.zeros(2)}, signals)
    assert found.a[:, 1, 0] == pytest.approx(-5.0 * np.cos(angle) / 0.5)
    assert found.b[:, 1, laws.names.index("friction")] == pytest.approx([-2.0, -2.0])
    assert found.values[:, laws.names.index("gravity")] == pytest.approx(
        5.0 * np.array(list(map(sin, angle.tolist())))
    )
