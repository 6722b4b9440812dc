"""Each effect is exactly the base model at its neutral value, moves what it should elsewhere, and
can be fitted.
"""

import ast
import inspect
import itertools
import math
import re
import textwrap
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fmus
from fmus.kit import stack
from fmus.kit.effects import made_by
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven
from tests.support.builds import check_that_builds_agree
from tests.support.completeness import check_complete, check_described
from tests.support.effect_samples import (
    ACTIVE,
    BASES,
    NEUTRAL,
    active,
    bases,
    changed_with_law,
    effects,
    random_values,
)
from tests.support.laws import check_neutral, in_graph, named
from tests.support.pace import slow_but
from tests.support.source import ROOT

CREEP, FLOW = "der(kelvin_elongation)", "der(maxwell_elongation)"
STRAINS = (
    "quadratic_strain",
    "quadratic_strain(modulus)",
    "strain_saturation",
    "strain_saturation(slow)",
    "strain_lag",
    "strain_lag(two_stages)",
    "strain_hysteresis",
)
KINDS = dict(
    zip(STRAINS, ("added", "added", "factor", "factor", "behind", "behind", "behind"), strict=True)
)
SPRINGS = "nonlinear_stiffness", "slack", "slack(smooth)"
TENSION = {
    "tension",
    "force_margin",
    "compression_margin",
    CREEP,
    FLOW,
}
# What an active effect changes at an instant, where that is more than its law does: the charge
# softens the spring of creep too, and length-driven the spring is solved for the tension.
CHANGED = {
    (PpyActuator, "charge_dependent_stiffness"): {
        "mechanical_displacement",
        "displacement",
        "displacement_margin",
        CREEP,
    },
    **dict.fromkeys(
        [(PpyActuatorLengthDriven, n) for n in (*SPRINGS, "charge_dependent_stiffness")], TENSION
    ),
}
# Taut, the mechanical displacement is what the length leaves, however the spring: it changes by
# rounding only.
ROUNDED = {(PpyActuatorLengthDriven, n) for n in (*SPRINGS, "charge_dependent_stiffness")}
# Effects that are laid one over the other, so that their order matters.
LAYERED = [
    *(pair for pair in itertools.combinations(STRAINS, 2) if KINDS[pair[0]] != KINDS[pair[1]]),
    *itertools.combinations(SPRINGS, 2),
]
seeds = st.integers(0, 2**32 - 1)
README = "fmus/ppy_actuator/README.md"
HERE = Path(__file__).relative_to(ROOT).as_posix()


def test_catalogue():
    check_described("ppy_actuator", EFFECTS)
    for name, effect in EFFECTS.items():
        said = effect.term.law and effect.term.signal and effect.term.shape
        assert said, f"{name}: say term = Term(law, signal, shape) in its class"
        own = [
            v
            for v in effect.declared.values()
            if v.name in {p.name for p in effect.layout.parameters}
        ]
        assert NEUTRAL[name] in [v.name for v in own]
        for p in own:
            limited = p.type == "boolean" or (math.isfinite(p.min) and math.isfinite(p.max))
            assert limited, f"{name}: give {p.name} a finite min= and max="
        for state in effect.layout.states:
            assert state.start == 0.0, f"{name}: {state.name} starts at rest, at 0"
    names = [v for effect in EFFECTS.values() for v in effect.declared]
    assert len(names) == len(set(names)), "effects must not share variables"


def test_table_of_the_readme():
    readme = (ROOT / README).read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w()]+)` \| (\d+) \| `(\w+)`", readme, re.M)
    expected = [(name, str(e.assumption), e.neutral) for name, e in EFFECTS.items()]
    check_complete(rows, expected, f"the table of effects in {README}, in the order of EFFECTS")
    assert rows == expected, "the rows stand in the order of EFFECTS"


def test_shapes_of_one_family_are_of_one_law_and_signal():
    families = {}
    for name, effect in EFFECTS.items():
        families.setdefault(effect.term.family, []).append(name)
        assert {e.term.family for e in EFFECTS.values() if e.id == effect.id} == {
            effect.term.family
        }
    for names in families.values():
        terms = {(EFFECTS[name].term.law, EFFECTS[name].term.signal) for name in names}
        assert len(terms) == 1, names
        assert len({EFFECTS[name].term.shape for name in names}) == len(names)
    assert families["film_voltage over charge"] == [
        n for n in EFFECTS if n.startswith("charge_dependent_capacitance")
    ]
    assert families["spring_elongation over force"] == list(SPRINGS)
    assert families["even part of charge_elongation over charge"] == list(STRAINS[:2])
    assert families["odd part of charge_elongation over charge"] == list(STRAINS[2:4])
    assert families["charge_elongation remembering charge"] == list(STRAINS[4:6])


# --- neutral
# --------------------------------------------------------------------------------------------------


@bases
@pytest.mark.parametrize(
    "chosen", [*((n,) for n in EFFECTS), tuple(EFFECTS), tuple(reversed(EFFECTS))], ids="+".join
)
@settings(max_examples=25)
@given(seed=seeds)
def test_neutral_is_bit_identical_on_floats(base, chosen, seed):
    cls = stack(base, *(EFFECTS[n] for n in chosen))
    values = random_values(cls, seed) | {NEUTRAL[n]: 0.0 for n in chosen}
    check_neutral(base, cls, values)


@bases
@effects
def test_neutral_is_bit_identical_on_arrays(base, name):
    cls = stack(base, EFFECTS[name])
    check_neutral(base, cls, random_values(cls, 1, size=1000) | {NEUTRAL[name]: 0.0})


@bases
@effects
def test_neutral_is_bit_identical_in_the_graph(base, name):
    cls = stack(base, EFFECTS[name])
    for seed in range(50):
        values = random_values(cls, seed) | {NEUTRAL[name]: 0.0}
        check_neutral(base, cls, values, in_graph)


@bases
@effects
def test_neutral_runs_are_the_base_run(base, name):
    """Through the integrator only the internal step can differ, which the effect's own state takes
    part in choosing.

    The slack actuator is the hard case: going taut is a kink, and what a step across it costs
    depends on the step.
    """
    runs = []
    for cls in (base, stack(base, EFFECTS[name])):
        model = cls()
        integrator = Integrator(model)
        rows = []
        for k in range(50):
            model.current = 0.9 if k % 20 < 10 else -0.9
            integrator.advance(k * 0.1, 0.1)
            rows.append(model.outputs())
        runs.append(np.array(rows))
    tolerated = 1e-5 if base is PpyActuatorLengthDriven else 1e-8
    assert (np.abs(runs[1] - runs[0]).max(axis=0) <= tolerated * np.abs(runs[0]).max(axis=0)).all()


@bases
@effects
def test_the_model_moves_smoothly_away_from_neutral(base, name):
    cls = stack(base, EFFECTS[name])
    values = random_values(cls, 3)
    at_zero = named(cls, values | {NEUTRAL[name]: 0.0})
    near = named(cls, values | {NEUTRAL[name]: 1e-12})
    assert {n: near[n] for n in near} == pytest.approx(at_zero, rel=1e-5, abs=1e-9)


# --- active: what changes, and what does not
# --------------------------------------------------------------------------


@bases
@effects
def test_an_active_effect_changes_what_it_should_and_nothing_else(base, name):
    """Everything else keeps its bits."""
    cls = stack(base, EFFECTS[name])
    changed, rounded = set(), set()
    for seed in range(50):
        values = random_values(cls, seed) | ACTIVE[name]
        plain = named(cls, values | {NEUTRAL[name]: 0.0})
        found = named(cls, values)
        moved = {n for n in named(base, {}) if plain[n] != found[n]}
        changed |= {n for n in moved if plain[n] != pytest.approx(found[n], rel=1e-9, abs=1e-15)}
        rounded |= moved
    law = EFFECTS[name].term.law
    expected = CHANGED.get((base, name)) or changed_with_law(base, law)
    where = f"what {name} changes in {base.name}, where {law} does: else CHANGED of {HERE} says so"
    check_complete(expected, changed, where)
    assert rounded - changed <= ({"mechanical_displacement"} if (base, name) in ROUNDED else set())


# --- stacks
# --------------------------------------------------------------------------------------------------


@bases
def test_order_does_not_matter_where_laws_differ(base):
    """Pairs of `LAYERED` are laid one over the other; every other pair commutes but for
    rounding.
    """
    for pair in itertools.combinations(EFFECTS, 2):
        forth, back = (stack(base, *(EFFECTS[n] for n in order)) for order in (pair, pair[::-1]))
        values = random_values(forth, 5) | active(pair) | {"length_change": 5e-3, "charge": 3.0}
        values = {n: v for n, v in values.items() if n in forth.layout.names}
        one, other = named(forth, values), named(back, values)
        same = one == pytest.approx(other, rel=1e-12, abs=1e-18)
        where = f"LAYERED of {HERE}, which lists effects that are laid one over the other"
        assert same == (pair not in LAYERED), (
            f"the order of {' and '.join(pair)} {'does not matter' if same else 'matters'}: {where}"
        )


@bases
def test_all_effects_agree_on_floats_arrays_and_symbols(base):
    cls = stack(base, *EFFECTS.values())
    arrays = random_values(cls, 7, size=40) | active(EFFECTS)
    batch = named(cls, arrays)
    graph = trace(cls)
    rates, outputs, *_ = graph.functions(tangent=False)
    layout = cls.layout
    for i in range(40):
        values = {n: float(np.broadcast_to(v, 40)[i]) for n, v in arrays.items()}
        single = named(cls, values)
        point = [
            [values[v.name] for v in g] for g in (layout.parameters, layout.inputs, layout.states)
        ]
        symbolic = ca.vertcat(rates(0.0, *point, []), outputs(0.0, *point, [])).full().ravel()
        assert symbolic == pytest.approx(list(single.values()), rel=1e-11, abs=1e-15)
        assert [float(v[i]) for v in batch.values()] == pytest.approx(
            list(single.values()), rel=1e-12, abs=1e-15
        )


# --- fitting starts at the neutral value
# ------------------------------------------------------------------------------


@bases
def test_parameter_sensitivities_are_finite_at_neutral(base):
    """Identification starts there: no law may divide zero by zero in its derivative."""
    cls = stack(base, *EFFECTS.values())
    graph = trace(cls)
    expressions = ca.vertcat(graph.rates, graph.outputs)
    known = ca.vertcat(graph.parameters, graph.states)
    f = ca.Function("j", graph.arguments, [ca.jacobian(expressions, known)])
    for charge in (0.0, 1.0):
        assert np.isfinite(f(0.0, *graph.point(charge=charge, current=0.5)).full()).all()


STEP, STEPS = 0.1, 600
TIME = STEP * np.arange(STEPS)
CURRENT = 0.9 * np.where(np.arange(STEPS) % 50 < 25, 1.0, -1.0) + 0.2
LOAD = np.where(np.arange(STEPS) % 200 < 120, 2.0, 0.0)
INPUTS = {
    PpyActuator: {"current": CURRENT, "force": LOAD},
    PpyActuatorLengthDriven: {"current": CURRENT, "length_change": 3e-4 * LOAD},
}


@pytest.fixture(scope="module")
def models():
    """All effects at once, neutral: with the sensitivities to what switches them, and plain."""
    made = {}

    def get(base):
        if base not in made:
            cls = stack(base, *EFFECTS.values())
            found = CompiledModel(cls, list(NEUTRAL.values())).run(TIME, INPUTS[base]).sensitivities
            made[base] = found, CompiledModel(cls)
        return made[base]

    return get


@pytest.mark.slow
@pytest.mark.parametrize(
    ("base", "name"),
    slow_but(
        [(base, name) for base in BASES for name in EFFECTS],
        *((PpyActuator, name) for name in EFFECTS),
    ),
    ids=lambda value: getattr(value, "name", value),
)
def test_sensitivity_at_neutral_is_that_of_differences_and_not_zero(base, name, models):
    """Identification begins at neutral, and a slope of zero would hide the effect from it."""
    (found, model), declared = models(base), EFFECTS[name].declared[NEUTRAL[name]]
    step, seen = 1e-3 * declared.nominal, []
    # to both sides, or into the range where neutral is the end of it; both of second order
    weights = {0.0: -1.5, 1.0: 2.0, 2.0: -0.5} if declared.min == 0.0 else {1.0: 0.5, -1.0: -0.5}
    runs = {k: model.run(TIME, INPUTS[base], {NEUTRAL[name]: k * step}).signals for k in weights}
    # a margin has a corner where its signal changes sign, and no slope of its own elsewhere
    for output in (o.name for o in base.layout.outputs if not o.name.endswith("_margin")):
        slope = sum(weight / step * runs[k][output] for k, weight in weights.items())
        floor = (
            1e-8 * np.abs(runs[1.0][output]).max() / step
        )  # what the accuracy of the runs leaves of nothing
        exact = found[output][:, list(EFFECTS).index(name)]
        assert exact == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max() + floor)
        seen.append(np.abs(slope * declared.nominal).max() / runs[1.0][output].std())
    assert max(seen) > 1e-3, (
        f"a change of {NEUTRAL[name]} by its nominal value is not seen: its effect begins linearly,"
        " and nominal= is a size that matters"
    )


# --- both builds, as FMUs
# --------------------------------------------------------------------------------------------------


def ranges(base):
    return {"current": (-1.0, 1.3)} | (
        {"force": (0.0, 2.5)} if base is PpyActuator else {"length_change": (0.0, 8e-4)}
    )


@pytest.mark.slow
@bases
def test_builds_agree_on_all_effects(base, tmp_path):
    cls = stack(base, *EFFECTS.values(), name="everything")
    check_that_builds_agree(cls, active(EFFECTS), ranges(base), tmp_path, steps=20)


@pytest.mark.slow
@bases
@effects
def test_builds_agree_on_each_effect(base, name, tmp_path):
    check_that_builds_agree(stack(base, EFFECTS[name]), active([name]), ranges(base), tmp_path)


# --- the rule that keeps laws and measurements apart
# ------------------------------------------------------------------


@pytest.mark.parametrize("name", fmus.COMPONENTS)
def test_no_law_uses_an_output(name):
    """Then an effect of the measurement, laid over an output, cannot change the physics."""
    component = fmus.component(name)
    outputs = {o.name for o in component.layout.outputs}
    assert not outputs & {s.rate for s in component.layout.states}
    assert not outputs & {d.update for d in component.layout.discretes}
    # what is made by a function has no source of its own, and the law that it is made for
    effects = [effect for effect in fmus.effects(name).values() if not made_by(effect)]
    classes = {part for cls in (component, *effects) for part in cls.__mro__}
    for cls in (
        c for c in classes if c.__module__.startswith(component.__module__.rpartition(".")[0])
    ):
        tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
        for law in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            used = {node.attr for node in ast.walk(law) if isinstance(node, ast.Attribute)}
            assert not used & (outputs - {law.name}), f"{cls.__name__}.{law.name}"
