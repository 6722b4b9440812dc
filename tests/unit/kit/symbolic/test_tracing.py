from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fmus
from fmus.kit import UserError, stack
from fmus.kit.symbolic.tracing import dependencies, trace
from tests.contract.subjects import ACTUATORS
from tests.support.kit_samples import Curved, Divider, Doubled, Thermostat, Warmer
from tests.support.pace import FREE_FEET, slow_but

CLASSES = [
    Curved,
    Divider,
    Thermostat,
    stack(Thermostat, Warmer, Doubled),
    *map(fmus.component, fmus.COMPONENTS),
]
graph_of = cache(trace)
classes = pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.name)


@cache
def functions_of(cls):
    return graph_of(cls).functions()


@cache
def jacobians_of(cls):
    """Of rates and outputs, by all arguments."""
    graph = graph_of(cls)
    known = ca.vertcat(*graph.arguments)
    dense = (
        ca.densify(ca.jacobian(expression, known)) for expression in (graph.rates, graph.outputs)
    )
    return [ca.Function("j", graph.arguments, [jacobian]) for jacobian in dense]


seeds = st.integers(0, 2**32 - 1)
ENOUGH, POINTS = 40, 200  # the more where something listed has not been seen yet


def point(cls, seed):
    """Draw values of everything, by name; parameters near their defaults, in their ranges."""
    rng = np.random.default_rng(seed)
    values = {}
    for v in cls.layout.parameters:
        near = v.start * rng.uniform(0.5, 2.0) + (
            rng.normal() * rng.choice([1.0, 10.0]) * v.nominal
            if v.start == 0 or v.starts is not None
            else 0.0
        )
        values[v.name] = float(np.clip(near, v.min, v.max))
    for group in (cls.layout.inputs, cls.layout.states, cls.layout.discretes):
        for v in group:
            values[v.name] = float(
                v.start + rng.normal() * v.nominal * (10.0 if v.unit == "K" else 1.0)
            )
    for v in cls.layout.variables:
        if v.type == "boolean" and v.name in values:
            values[v.name] = float(rng.integers(2))
        if v.type == "integer" and v.name in values:
            values[v.name] = float(rng.integers(1, 4))
    return values, float(rng.uniform(0, 10))


def evaluated(cls, values, time):
    """Rates, outputs and, for each group, all discrete states after its update; by floats."""
    component = cls()
    component.time = time
    for name, value in values.items():
        setattr(component, name, value)
    updates = []
    for _, members in cls.layout.sampled:
        after = {d.name: getattr(component, d.update)() for d in members}
        updates.append([float(after.get(d.name, values[d.name])) for d in cls.layout.discretes])
    return [list(map(float, component.rates())), list(map(float, component.outputs())), *updates]


def vectors(cls, values):
    layout = cls.layout
    groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)
    return [np.array([values[v.name] for v in group]) for group in groups]


@classes
@settings(max_examples=50)
@given(seed=seeds)
def test_the_graph_has_the_values_of_the_class(cls, seed):
    values, time = point(cls, seed)
    *laws, tangent = functions_of(cls)
    expected = evaluated(cls, values, time)
    assert [f.name() for f in laws] == [
        "rates",
        "outputs",
        *(f"update_{i}" for i in range(len(cls.layout.sampled))),
    ]
    assert tangent.name() == "tangent"
    bare = graph_of(cls).functions(tangent=False)
    assert [f.name() for f in bare] == [f.name() for f in laws]
    for function, numbers in zip(laws, expected, strict=True):
        result = function(time, *vectors(cls, values)).full().ravel()
        assert result == pytest.approx(numbers, rel=1e-12, abs=1e-13)


def differences(cls, values, time, name, step):
    """Central difference of [rates, outputs] over one variable."""
    results = []
    for sign in (1, -1):
        rates, outputs, *_ = evaluated(cls, values | {name: values[name] + sign * step}, time)
        results.append(np.array([*rates, *outputs]))
    return (results[0] - results[1]) / (2 * step)


@pytest.mark.parametrize("cls", [Curved, *map(fmus.component, ACTUATORS)], ids=lambda cls: cls.name)
@settings(max_examples=25)
@given(seed=seeds)
def test_linearisation_against_differences(cls, seed):
    values, _ = point(cls, seed)
    layout, graph = cls.layout, graph_of(cls)
    if (
        cls is Curved
        and min(abs(values["x"]), abs(values["z"]), abs(values["y"] - values["v"])) < 1e-3
    ):
        return  # a kink or a jump has no derivative
    component = cls(**{v.name: values[v.name] for v in layout.parameters})
    for name, value in values.items():
        setattr(component, name, value)
    if hasattr(component, "tension") and abs(component.tension()) < 1e-2:
        return  # about to go slack
    a, b, c, d = graph.linearise(**values)
    n = len(layout.states)
    for matrices, group in (((a, c), layout.states), ((b, d), layout.inputs)):
        for k, v in enumerate(group):
            numeric = differences(cls, values, 0.0, v.name, 1e-5 * v.nominal)
            scale = 1e-6 * max(1.0, np.abs(numeric).max())
            assert matrices[0][:, k] == pytest.approx(numeric[:n], rel=1e-5, abs=scale)
            assert matrices[1][:, k] == pytest.approx(numeric[n:], rel=1e-5, abs=scale)


def test_linearisation_has_the_dimensions_of_the_layout():
    shapes = [m.shape for m in graph_of(Curved).linearise()]
    assert shapes == [(3, 3), (3, 2), (3, 3), (3, 2)]
    a, b, c, d = graph_of(Divider).linearise(upper=3.0)
    assert (a.shape, b.shape, c.shape) == ((0, 0), (0, 1), (1, 0))
    assert d[0, 0] == pytest.approx(0.5)


def test_points_take_defaults_and_refuse_what_does_not_exist():
    parameters, inputs, states, discretes = graph_of(Thermostat).point(
        loss=2.0, temperature=300.0, on=1.0
    )
    assert parameters[0] == 2.0
    assert parameters[1] == 20.0
    assert inputs.tolist() == [280.0, 0.0]
    assert states.tolist() == [300.0, 0.0]
    assert discretes.tolist() == [1.0, 0.0, 290.0]
    _, _, states, discretes = graph_of(Thermostat).point(
        temperature_start=301.0, energy_start=5.0, energy=7.0, on_start=1.0
    )
    assert states.tolist() == [301.0, 7.0]
    assert discretes.tolist() == [1.0, 0.0, 290.0]
    with pytest.raises(UserError, match="thermostat: no parameter, input or state named 'los'"):
        graph_of(Thermostat).linearise(los=1.0)


@classes
@settings(max_examples=20)
@given(seed=seeds)
def test_tangent_is_the_directional_derivative(cls, seed):
    values, time = point(cls, seed)
    rng = np.random.default_rng(seed)
    given_ = vectors(cls, values)
    direction = [rng.normal(size=np.size(v)) for v in (time, *given_)]
    tangents = functions_of(cls)[-1](time, *given_, *direction)
    for result, jacobian in zip(tangents, jacobians_of(cls), strict=True):
        expected = jacobian(time, *given_).full() @ np.concatenate(direction)
        assert result.full().ravel() == pytest.approx(expected, rel=1e-10, abs=1e-10)


@classes
def test_dependencies_against_differences(cls):
    """A listed known changes the unknown somewhere; one that is not listed never does."""
    layout = cls.layout
    found = dependencies(graph_of(cls))
    position = {name: i for i, name in enumerate(layout.names)}
    unknowns = [*(f"der({s.name})" for s in layout.states), *(o.name for o in layout.outputs)]
    knowns = [v.name for v in (*layout.inputs, *layout.states)]
    seen = np.zeros((len(unknowns), len(knowns)), dtype=bool)
    listed = found["Derivatives"] | found["Outputs"]
    expected = np.array(
        [[position[known] in listed[position[unknown]] for known in knowns] for unknown in unknowns]
    )
    for seed in range(POINTS):
        if seed >= ENOUGH and (seen == expected).all():
            break
        values, time = point(cls, seed)
        others, _ = point(cls, seed + POINTS)
        base = evaluated(cls, values, time)
        for k, name in enumerate(knowns):
            changed = evaluated(cls, values | {name: others[name]}, time)
            seen[:, k] |= np.concatenate(base[:2]) != np.concatenate(changed[:2])
    for row, unknown in zip(seen, unknowns, strict=True):
        assert listed[position[unknown]] == [
            position[k] for k, depends in zip(knowns, row, strict=True) if depends
        ]


def start_name(state):
    """Name of the start value, of an element of an array too."""
    stem, bracket, place = state.partition("[")
    return f"{stem}_start{bracket}{place}"


@pytest.mark.parametrize(
    "cls",
    slow_but(
        CLASSES,
        *(
            cls
            for cls in CLASSES
            if cls.name
            not in ("degradation_estimator", "foot_dynamic", *FREE_FEET, "learning_controller")
        ),
    ),
    ids=lambda cls: cls.name,
)
def test_initial_dependencies_against_differences(cls):
    layout = cls.layout
    initial = dependencies(graph_of(cls))["InitialUnknowns"]
    names, knowns = layout.names, [v.name for v in (*layout.parameters, *layout.inputs)]
    unknowns = [names[i] for i in initial]

    def at_start(values):
        values = values | {
            s.name: values[start_name(s.name)] for s in (*layout.states, *layout.discretes)
        }
        rates, outputs, *_ = evaluated(cls, values, 0.0)
        by_name = values | dict(zip((o.name for o in layout.outputs), outputs, strict=True))
        by_name |= dict(zip((f"der({s.name})" for s in layout.states), rates, strict=True))
        return np.array([by_name[name] for name in unknowns])

    seen = np.zeros((len(unknowns), len(knowns)), dtype=bool)
    expected = np.array(
        [
            [names.index(known) in initial[names.index(unknown)] for known in knowns]
            for unknown in unknowns
        ]
    )
    for seed in range(POINTS):
        if seed >= ENOUGH and (seen == expected).all():
            break
        values, _ = point(cls, seed)
        others, _ = point(cls, seed + POINTS)
        base = at_start(values)
        for k, name in enumerate(knowns):
            seen[:, k] |= base != at_start(values | {name: others[name]})
    for row, unknown in zip(seen, unknowns, strict=True):
        assert initial[names.index(unknown)] == [
            names.index(k) for k, d in zip(knowns, row, strict=True) if d
        ]


def test_output_states_depend_on_themselves_and_discrete_outputs_on_nothing():
    names = Thermostat.layout.names
    outputs = dependencies(graph_of(Thermostat))["Outputs"]
    assert outputs[names.index("temperature")] == [names.index("temperature")]
    assert outputs[names.index("on")] == []
    assert sorted(outputs) == sorted(
        names.index(n) for n in ("temperature", "on", "reading", "power", "warm")
    )


def test_tracing_leaves_the_class_alone():
    before = dict(vars(Thermostat))
    trace(Thermostat)
    assert dict(vars(Thermostat)) == before
    assert Thermostat().temperature == 290.0
