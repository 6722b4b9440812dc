"""Claims: models of Modelica, compiled by others, move as their FMUs do.

Inputs go straight from value to value of the component's own reference; they are compared away from
knots and from samples, where both sides of an instant are there.
"""

import csv
import re
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import rumoca
from pymoca.backends.casadi.api import transfer_model

import fmus
from fmus import COMPONENTS
from fmus.kit import stack
from fmus.kit.build import build_cached
from fmus.kit.modelica import class_name, package_files
from orchestration.fmu.model import find_class, known_effects
from tests.support.effect_samples import ACTIVE, active
from tests.support.modelica import (
    Courses,
    causalised,
    driven,
    flatten_by_pymoca,
    parse_by_pymoca,
    simulate_by_pymoca,
    simulate_by_rumoca,
    simulate_fmu,
    sources,
    write,
)
from tests.support.modelica_units import misfits
from tests.support.pace import FREE_FEET, slow_but

# pymoca 0.12 knows no sample; all others are rumoca's alone
CONTINUOUS = [name for name in COMPONENTS if not fmus.component(name).layout.sampled]
ELEMENT = str.maketrans("[,", "__", "]")  # in a name
_LEVELS = 12  # values of the reference that inputs go through
_STEPS = dict.fromkeys(FREE_FEET, 0.0025)  # touches of the ground are short


@pytest.fixture(scope="module")
def files():
    return package_files([fmus.component(name) for name in COMPONENTS], "0")


@pytest.fixture(scope="module")
def flat(files):
    """A component's model as pymoca flattens it, once."""
    tree = parse_by_pymoca(files)
    return cache(lambda name: flatten_by_pymoca(tree, f"PpyRig.{class_name(name)}"))


@pytest.fixture(scope="module")
def folder(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("modelica")
    write(files, folder)
    return folder / "PpyRig"


def courses_of(name):
    """Return a component's inputs, and the communication step."""
    cls = fmus.component(name)
    path = Path(sys.modules[cls.__module__].__file__).parent / "reference" / f"{name}_in.csv"
    with path.open(encoding="utf-8") as file:
        (_, *names), *rows = csv.reader(file)
    table = np.array(rows, dtype=float)
    levels = table[:-1][np.diff(table[:, 0]) > 0.0, 1:]
    count = min(_LEVELS, len(levels))
    levels = levels[np.linspace(0, len(levels) - 1, count).round().astype(int)]
    step = _STEPS.get(name, cls.experiment[1] / 2.0)
    steps_of_a_level = 6
    if cls.layout.sampled:
        starts = {p.name: p.start for p in cls.layout.parameters}
        step = min(starts.get(c.period, c.period) for c, _ in cls.layout.sampled) / 2.0
    knots = step * np.array([0, *(2 * steps_of_a_level * k + 1 for k in range(1, count))])
    values = {each: levels[:, k] for k, each in enumerate(names)}
    held = {v.name for v in cls.layout.inputs if v.type == "boolean"}
    for port in cls.ports:
        if port.rate:
            slopes = np.diff(values[port.potential]) / np.diff(knots)
            values[port.rate] = np.append(slopes, slopes[-1])
            held.add(port.rate)
    return Courses(knots, values, frozenset(held)), step


@dataclass(frozen=True)
class Reference:
    """The trajectories of an FMU.

    Attributes
    ----------
    times : ndarray
    outputs : dict of str to ndarray
    places : ndarray
        Of the times that are compared.
    """

    times: np.ndarray
    outputs: dict[str, np.ndarray]
    places: np.ndarray


@cache
def by_fmpy(cls, name):
    """Return what an FMU does under the inputs of a component."""
    courses, step = courses_of(name)
    times = step * np.arange(round(courses.times[-1] / step) + 1)
    outputs = simulate_fmu(build_cached(cls, "native"), courses, times)
    off_knots = np.abs(times[:, None] - courses.times).min(axis=1) > step / 2.0
    places = np.flatnonzero(off_knots & (np.arange(len(times)) % 2 == 1))
    return Reference(times, outputs, places)


def by_rumoca(cls, name, folder, modifiers=""):
    """Return what the model does."""
    courses, step = courses_of(name)
    texts = {each: courses.text(each) for each in moved(cls, courses)}
    model = driven(cls, f"PpyRig.{class_name(cls.name)}", texts).replace(" m;", f" m{modifiers};")
    stop = float(courses.times[-1])
    return simulate_by_rumoca(folder, [sources(), model], "Driven", stop, step)


def moved(cls, courses):
    """Return inputs that are given; a rate follows from its potential."""
    rates = {port.rate for port in cls.ports}
    return [name for name in courses.values if name not in rates]


def assert_agree(reference, simulated, tolerance=1e-6):
    times = reference.times[reference.places]
    nearest = [int(np.abs(simulated["time"] - t).argmin()) for t in times]
    assert np.abs(simulated["time"][nearest] - times).max() < 1e-9
    moving = 0
    for output, values in reference.outputs.items():
        wanted = values[reference.places]
        value = np.asarray(simulated[f"m.{output}"], dtype=float)[nearest]
        assert np.abs(value - wanted).max() <= tolerance * np.abs(wanted).max(), output
        moving += np.ptp(wanted) > 0.0
    assert moving, "nothing moved"


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPONENTS)
def test_pymoca_flattens_it_into_as_many_equations_as_variables(name, flat):
    model = flat(name)
    unknown = [s for s in model.symbols.values() if "parameter" not in s.prefixes]
    cls = fmus.component(name)
    at_ports = {n for port in cls.ports for n in port.variables}
    given = [v for v in cls.layout.inputs if v.name not in at_ports]
    equations = sum(len(e.blocks[0]) if hasattr(e, "blocks") else 1 for e in model.equations)
    assert equations == len(unknown) - len(given)


@dataclass(frozen=True)
class Point:
    """Values of a component, drawn at random.

    Attributes
    ----------
    given, states : dict of str to float
        Of inputs and discrete states, and of continuous states.
    """

    given: dict[str, float]
    states: dict[str, float]


def drawn(cls, random):
    """Return inputs and states of both signs, about as large as they are in use."""
    layout = cls.layout
    given = {
        v.name: float(random.random() < 0.5)
        if v.type == "boolean"
        else float(np.clip(v.start + v.nominal * random.standard_normal(), v.min, v.max))
        for v in (*layout.inputs, *layout.discretes)
    }
    states = {s.name: s.nominal * float(random.standard_normal()) for s in layout.states}
    return Point(given, states)


def by_floats(cls, point):
    """Return what the class itself computes at a point: outputs, rates and new discrete states."""
    one = cls()
    types = {v.name: v.type for v in (*cls.layout.inputs, *cls.layout.discretes)}
    for name, value in (point.given | point.states).items():
        setattr(one, name, bool(value) if types.get(name) == "boolean" else value)
    layout = cls.layout
    values = {v.name: x for v, x in zip(layout.outputs, one.outputs(), strict=True)}
    values |= {f"der({s.name})": x for s, x in zip(layout.states, one.rates(), strict=True)}
    updates = one.laws([d.update for d in layout.discretes])
    values |= {f"next_{d.name}": law() for d, law in zip(layout.discretes, updates, strict=True)}
    return {name.translate(ELEMENT): float(x) for name, x in values.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPONENTS)
def test_pymoca_transfers_it_as_it_stands(name, folder, monkeypatch):
    """A plain call, with CasADi as it is, and what is sampled as inputs and outputs."""
    monkeypatch.delattr(ca.MX, "__div__", raising=False)
    made = transfer_model(str(folder / "Resources/Pymoca"), f"PpyRig.{class_name(name)}", {})
    cls = fmus.component(name)
    solved, unknown = causalised(made, {})
    random = np.random.default_rng(len(name))
    for _ in range(20):
        point = drawn(cls, random)
        given = {k.translate(ELEMENT): x for k, x in point.given.items()}
        inputs = [given[v.symbol.name().rstrip("_")] for v in made.inputs]
        states = [point.states[v.symbol.name()] for v in made.states]
        found = dict(zip(unknown, solved(0.0, inputs, 0.0, states).full().ravel(), strict=True))
        for output, value in by_floats(cls, point).items():
            assert found[output] == pytest.approx(value, rel=1e-9, abs=1e-12), output


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPONENTS)
def test_units_of_its_equations_fit(name, flat):
    """All but those of laws that are declared to compute with bare numbers."""
    found, compared = misfits(flat(name))
    assert len(found) <= len(fmus.component(name).unchecked), found
    assert compared > 5


@pytest.mark.slow
def test_a_unit_that_does_not_fit_is_seen(files):
    path = "PpyRig/PpyActuator.mo"
    wrong = files[path].replace(b'k1(unit="N/m"', b'k1(unit="N"')
    assert wrong != files[path]
    tree = parse_by_pymoca(files | {path: wrong})
    found, _ = misfits(flatten_by_pymoca(tree, "PpyRig.PpyActuator"))
    assert len(found) == 1, found
    assert found[0].startswith("creep: ")  # creep + force / k1


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPONENTS)
def test_rumoca_simulates_it_as_its_fmu_moves(name, folder):
    cls = fmus.component(name)
    assert_agree(by_fmpy(cls, name), by_rumoca(cls, name, folder))


@pytest.mark.slow
@pytest.mark.parametrize("name", slow_but(CONTINUOUS, "ppy_actuator"))
def test_what_pymoca_gives_casadi_moves_as_its_fmu(name, files):
    cls = fmus.component(name)
    courses, _ = courses_of(name)
    names = {each: f"u_{each}" for each in moved(cls, courses)}
    text = driven(cls, f"PpyRig.{class_name(name)}", names)
    declared = "".join(f"input Real {u};\n" for u in names.values())
    tree = parse_by_pymoca(files, [sources(), text.replace("equation", f"{declared}equation", 1)])
    forced = {f"m.{port.potential}": names[port.potential] for port in cls.ports if port.rate}
    inputs = Courses(courses.times, {u: courses.values[each] for each, u in names.items()})
    reference = by_fmpy(cls, name)
    simulated = simulate_by_pymoca(tree, "Driven", inputs, reference.times, forced)
    assert_agree(reference, simulated)


@pytest.mark.parametrize("name", slow_but(ACTIVE, "self_heating", "slack", "strain_hysteresis"))
def test_an_effect_carries_over(name, tmp_path):
    """With values of its parameters at which it acts, as defaults of both; the film recovers."""
    base = stack(fmus.component("ppy_actuator"), defaults={"kelvin_elongation_start": 3e-4})
    effect = fmus.effects("ppy_actuator")[name]
    cls = stack(base, effect, name="touched", defaults=active([name]))
    write(package_files([cls], "0"), tmp_path)
    simulated = by_rumoca(cls, "ppy_actuator", tmp_path / "PpyRig")
    assert_agree(by_fmpy(cls, "ppy_actuator"), simulated)
    with pytest.raises(AssertionError, match=r"^(charge|voltage|\w+displacement)"):
        assert_agree(by_fmpy(base, "ppy_actuator"), simulated, tolerance=1e-8)


def clocks(cls):
    return [clock for clock, _ in cls.layout.sampled]


def compiles_balanced(cls, folder):
    """True if a class compiles; not where a clock reads a sample of another period, which rumoca
    refuses.
    """
    write(package_files([cls], "0"), folder)
    session = rumoca.Session(roots=[str(folder / "PpyRig")])
    model = driven(cls, f"PpyRig.{class_name(cls.name)}", {})
    try:
        compiled = session.loads(f"{sources()}\n{model}", model="Driven")
    except rumoca.CompileError as error:
        periods = {clock.period for clock in clocks(cls)}
        if "is not owned by clock" not in str(error) or len(periods) == 1:
            raise
        return True
    return compiled.structure().is_balanced


# the same effects as those of `foot_free` and `foot_design`
OTHER_FEET = {"foot", "foot_dynamic", "foot_displacement_driven"}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(COMPONENTS.keys() - OTHER_FEET))
def test_every_effect_compiles(name, tmp_path):
    """Those without a clock of their own all in one model, the others one by one.

    A fault of a sensor is the same text for each output: that of one.
    """
    base = fmus.component(name)
    effects = list(
        {re.sub(r"^(sensor_\w+)\(.*", r"\1", e): e for e in known_effects(base)}.values()
    )
    sampled = [e for e in effects if clocks(find_class(name, [e])) != clocks(base)]
    continuous = [e for e in effects if e not in sampled]
    for chosen in (continuous, *([e] for e in sampled)):
        cls = find_class(name, chosen)
        assert compiles_balanced(cls, tmp_path / cls.name[:60]), chosen


@pytest.mark.slow
def test_a_compiler_refuses_an_equation_too_few(files, tmp_path):
    """rumoca balances whatever it compiles, which is every component and every example."""
    path = "PpyRig/PpyActuator.mo"
    fewer = files[path].replace(b"  maxwell_rate = force / b1;\n", b"")
    assert fewer != files[path]
    write(files | {path: fewer}, tmp_path)
    with pytest.raises(rumoca.CompileError, match="unbalanced model"):
        by_rumoca(fmus.component("ppy_actuator"), "ppy_actuator", tmp_path / "PpyRig")


@pytest.mark.slow
def test_a_difference_is_seen(folder):
    """Of a parameter by a ten-thousandth."""
    cls = fmus.component("ppy_actuator")
    simulated = by_rumoca(cls, "ppy_actuator", folder, "(R1=0.430043)")
    with pytest.raises(AssertionError, match=r"^(charge|voltage)"):
        assert_agree(by_fmpy(cls, "ppy_actuator"), simulated)
